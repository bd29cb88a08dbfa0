// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/spline/overlay.h"

// One brick's part: the control points of the cell that lie in it.
static void add_brick(const gonio_overlay *o, const float *brick, const size_t *first, const size_t *at,
                      double weights[4][4], double *sums) {
    const size_t points = gonio_overlay_brick_points(o->dims);
    for (size_t k = 0; k < points; k++) {
        double weight = 1;
        size_t rest = k;
        for (int d = o->dims - 1; d >= 0 && weight != 0; d--, rest /= 4) {
            const size_t place = 4 * at[d] + rest % 4 - first[d]; // wraps to a large number before the cell
            weight *= place < 4 ? weights[d][place] : 0;
        }
        for (size_t c = 0; weight != 0 && c < o->channels; c++) {
            sums[c] += weight * (double)brick[k * o->channels + c];
        }
    }
}

void gonio_overlay_add(const gonio_overlay *o, const double *x, double *sums) {
    double weights[4][4];
    size_t first[4];
    for (int d = 0; d < o->dims; d++) {
        first[d] = gonio_overlay_cell(x[d], o->level, weights[d]);
    }
    for (size_t corner = 0; corner < (size_t)1 << o->dims; corner++) {
        size_t at[4], place = 0;
        bool there = true;
        for (int d = 0; d < o->dims; d++) {
            at[d] = first[d] / 4 + (corner >> d & 1);
            there = there && at[d] * 4 <= first[d] + 3;
            place = place * o->side + at[d];
        }
        if (there && o->table[place] != 0) {
            const size_t brick = o->table[place] - 1;
            add_brick(o, o->data + brick * gonio_overlay_brick_points(o->dims) * o->channels, first, at, weights, sums);
        }
    }
}
