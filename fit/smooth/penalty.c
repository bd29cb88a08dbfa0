// SPDX-License-Identifier: BSD-3-Clause
// R = 2^h sum_d stretch_d D_d^T D_d + ridge (fit/smooth/form.h), D_d the second differences along axis d. A plane of R
// phi needs its own plane of phi and two on either side: planes are independent, so that any number of threads make
// them.
#include "fit/smooth/penalty.h"

#include <math.h>
#include <string.h>

#include "brdf/spline/bspline.h"
#include "brdf/spline/clones.h"

gonio_smooth_planes gonio_smooth_planes_of(int dims, int level) {
    const size_t size = gonio_bspline_size(level);
    return (gonio_smooth_planes){dims, level, size, dims == 3 ? size * size : size * size * size};
}

// Row i of D^T D on an axis of m points: coefficients of points i - 2 to i + 2.
static void gram_row(size_t m, size_t i, double coefficient[5]) {
    memset(coefficient, 0, 5 * sizeof *coefficient);
    static const double stencil[3] = {1, -2, 1};
    for (size_t shift = 0; shift < 3; shift++) {
        // The difference that begins at i - shift uses point i with stencil[shift].
        if (i < shift || i - shift + 2 >= m) {
            continue;
        }
        for (size_t k = 0; k < 3; k++) {
            coefficient[2 + k - shift] += stencil[shift] * stencil[k];
        }
    }
}

GONIO_INLINE void add_scaled(double *to, const double *from, double factor, size_t n) {
    size_t j = 0;
    for (; j + 8 <= n; j += 8) {
        *(gonio_d8 *)(to + j) += factor * *(const gonio_d8 *)(from + j);
    }
    for (; j < n; j++) {
        to[j] += factor * from[j];
    }
}

// Point i of an axis whose points are `inner` apart and m in number; `inner` values.
GONIO_INLINE void add_row(const double *line, double *out, size_t m, size_t inner, size_t i, double factor) {
    double row[5];
    gram_row(m, i, row);
    for (size_t k = 0; k < 5; k++) {
        if (row[k] != 0) {
            add_scaled(out, line + (i + k - 2) * inner, factor * row[k], inner);
        }
    }
}

// The last axis, where neighbours are adjacent.
GONIO_INLINE void add_last_axis(const double *in, double *out, size_t m, size_t lines, double factor) {
    for (size_t l = 0; l < lines; l++) {
        const double *p = in + l * m;
        double *q = out + l * m;
        for (size_t i = 0; i + 2 < m; i++) {
            const double d = factor * (p[i] - 2 * p[i + 1] + p[i + 2]);
            q[i] += d;
            q[i + 1] -= 2 * d;
            q[i + 2] += d;
        }
    }
}

GONIO_CLONES static void penalise_plane(const gonio_smooth_planes *p, const gonio_smooth_form *form, double lambda,
                                        const double *in, double *out, size_t plane) {
    const double scale = ldexp(lambda, p->level);
    const double *here = in + plane * p->points;
    double *to = out + plane * p->points;
    add_row(in, to, p->size, p->points, plane, scale * form->stretch[0]);
    size_t outer = 1, inner = p->points / p->size;
    for (int d = 1; d < p->dims; d++, outer *= p->size, inner /= p->size) {
        const double factor = scale * form->stretch[d];
        for (size_t o = 0; o < outer && inner > 1; o++) {
            const double *line = here + o * p->size * inner;
            for (size_t i = 0; i < p->size; i++) {
                add_row(line, to + (o * p->size + i) * inner, p->size, inner, i, factor);
            }
        }
        if (inner == 1) {
            add_last_axis(here, to, p->size, outer, factor);
        }
    }
    add_scaled(to, here, lambda * GONIO_SMOOTH_RIDGE, p->points);
}

void gonio_smooth_penalise(const gonio_smooth_planes *planes, const gonio_smooth_form *form, double lambda,
                           const double *in, double *out, size_t plane) {
    penalise_plane(planes, form, lambda, in, out, plane);
}

void gonio_smooth_fold(const gonio_smooth_planes *planes, unsigned axes, double *out, size_t plane) {
    if (axes == 0) {
        return;
    }
    const size_t m = planes->size;
    double *p = out + plane * planes->points;
    size_t at[4] = {0};
    for (size_t line = 0; line < planes->points / m; line++) {
        size_t image = 0;
        for (int d = 1; d < planes->dims - 1; d++) {
            image = image * m + ((axes >> d & 1u) != 0 ? m - 1 - at[d] : at[d]);
        }
        const bool flipped = (axes >> (planes->dims - 1) & 1u) != 0;
        for (size_t i = 0; i < m && image >= line; i++) {
            double *a = p + line * m + i, *b = p + image * m + (flipped ? m - 1 - i : i);
            if (b >= a) {
                *a = *b = 0.5 * (*a + *b);
            }
        }
        for (int d = planes->dims - 2; d >= 1 && ++at[d] == m; d--) {
            at[d] = 0;
        }
    }
}
