// SPDX-License-Identifier: BSD-3-Clause
// Refinement of a lattice of cubic B-splines, an axis at a time (Kameya 2002, 2.3.4): the points of the finer axis are
// by turns the mean of two neighbours a, b of the coarser one and (a + 6 b + c)/8 of three.
#ifndef GONIO_BRDF_SPLINE_REFINE_H
#define GONIO_BRDF_SPLINE_REFINE_H

#include <stddef.h>

// Defines, for one type of points and one way to round (a + 6 b + c)/8 of them:
//   name_point(from, s, inner, to)               point s of the finer axis, `inner` points wide, from all of the
//   coarser name_axis(from, to, outer, n, inner)         outer x n x inner -> outer x (2n - 3) x inner
#define GONIO_REFINE(name, type, OF_THREE)                                                                             \
    static void name##_point(const type *restrict from, size_t s, size_t inner, type *restrict to) {                   \
        const type *a = from + s / 2 * inner, *b = a + inner, *c = b + inner;                                          \
        if (s % 2 == 1) {                                                                                              \
            for (size_t k = 0; k < inner; k++) {                                                                       \
                to[k] = OF_THREE(a[k], b[k], c[k]);                                                                    \
            }                                                                                                          \
        } else {                                                                                                       \
            for (size_t k = 0; k < inner; k++) {                                                                       \
                to[k] = (type)0.5 * (a[k] + b[k]);                                                                     \
            }                                                                                                          \
        }                                                                                                              \
    }                                                                                                                  \
    static void name##_axis(const type *from, type *to, size_t outer, size_t n, size_t inner) {                        \
        for (size_t o = 0; o < outer; o++, from += n * inner, to += (2 * n - 3) * inner) {                             \
            for (size_t s = 0; s < 2 * n - 3; s++) {                                                                   \
                name##_point(from, s, inner, to + s * inner);                                                          \
            }                                                                                                          \
        }                                                                                                              \
    }

#endif
