// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/spline/overlay.h"

// One brick's part: the control points of the cell that lie in it, from first to last of each axis.
static void add_brick(const gonio_overlay *o, const float *brick, const size_t *first, const size_t *at,
                      double weights[4][4], double *sums) {
    size_t low[4], n[4], count = 1;
    for (int d = 0; d < o->dims; d++) {
        low[d] = first[d] > 4 * at[d] ? first[d] - 4 * at[d] : 0;
        const size_t high = first[d] + 3 - 4 * at[d];
        n[d] = (high < 3 ? high : 3) - low[d] + 1;
        count *= n[d];
    }
    for (size_t k = 0; k < count; k++) {
        double weight = 1;
        size_t rest = k, point = 0, stride = 1;
        for (int d = o->dims - 1; d >= 0; d--, stride *= 4) {
            const size_t place = low[d] + rest % n[d];
            rest /= n[d];
            point += place * stride;
            weight *= weights[d][4 * at[d] + place - first[d]];
        }
        const float *values = brick + point * o->channels;
        for (size_t c = 0; c < o->channels; c++) {
            sums[c] += weight * (double)values[c];
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
