// SPDX-License-Identifier: BSD-3-Clause
// Squares and cubes of a sample's basis functions: what every kernel of the fit multiplies.
#ifndef GONIO_FIT_MBA_POWERS_H
#define GONIO_FIT_MBA_POWERS_H

#include "brdf/spline/rows.h"

// Squares and cubes of the basis functions: pairs[d][k] = (b^2, b^3) of axis d's k-th function; squares: the product
// over the axes of sum b^2, which is the sum of w^2.
typedef struct gonio_powers {
    gonio_d2 pairs[GONIO_DIMS_MAX][4];
    double squares;
} gonio_powers;

GONIO_INLINE void gonio_powers_raise(const gonio_place *place, const int dims, gonio_powers *p) {
    gonio_d4 sum = {0};
    GONIO_UNROLL
    for (int k = 0; k < 4; k++) {
        const gonio_d4 b2 = place->basis[k] * place->basis[k], b3 = b2 * place->basis[k];
        sum += b2;
        p->pairs[0][k] = __builtin_shufflevector(b2, b3, 0, 4);
        p->pairs[1][k] = __builtin_shufflevector(b2, b3, 1, 5);
        p->pairs[2][k] = __builtin_shufflevector(b2, b3, 2, 6);
        if (dims == 4) {
            p->pairs[3][k] = __builtin_shufflevector(b2, b3, 3, 7);
        }
    }
    p->squares = sum[0] * sum[1] * sum[2] * (dims == 4 ? sum[3] : 1);
}

#endif
