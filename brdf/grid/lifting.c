// SPDX-License-Identifier: BSD-3-Clause
// Lifting, Sweldens, "The lifting scheme: a construction of second generation wavelets" (1998). Along one axis a step
// takes every second node, o_k between e_k and e_{k+1}, for a detail and the others for the smooth:
//   haar   d_k = o_k - e_k                    s_k = e_k + d_k / 2
//   cdf53  d_k = o_k - (e_k + e_{k+1}) / 2    s_k = e_k + (d_{k-1} + d_k) / 4
// and what was added is taken off again on the way back. A step goes along every axis, the next one on the smooth nodes
// of all of them ("nonstandard": a coefficient's support is about as long in every direction, as a lobe's is). An
// azimuth closes on itself; elsewhere the line is mirrored in its ends, which are smooth nodes: lines have 2^level + 1
// nodes. Haar's last one has no partner and stays.
#include "brdf/grid/lifting.h"

typedef struct line {
    double *at; // of the first node
    size_t step, n, channels;
    bool closed;
} line;

// y[k] += f x[i] (+ f x[j]) over the channels.
static void add(const line *l, size_t to, double factor, size_t from) {
    for (size_t c = 0; c < l->channels; c++) {
        l->at[to * l->step + c] += factor * l->at[from * l->step + c];
    }
}

static size_t right_of(const line *l, size_t k) { return k + 1 < l->n ? k + 1 : l->closed ? 0 : k - 1; }
static size_t left_of(const line *l, size_t k) { return k > 0 ? k - 1 : l->closed ? l->n - 1 : 1; }

// sign 1: forward; -1: back.
static void predict(gonio_wavelet wavelet, const line *l, double sign) {
    for (size_t k = 1; k < l->n; k += 2) {
        if (wavelet == GONIO_WAVELET_HAAR) {
            add(l, k, -sign, k - 1);
        } else {
            add(l, k, -sign / 2, k - 1);
            add(l, k, -sign / 2, right_of(l, k));
        }
    }
}

static void update(gonio_wavelet wavelet, const line *l, double sign) {
    for (size_t k = 0; k < l->n; k += 2) {
        if (wavelet == GONIO_WAVELET_HAAR) {
            if (k + 1 < l->n) {
                add(l, k, sign / 2, k + 1);
            }
        } else {
            add(l, k, sign / 4, left_of(l, k));
            add(l, k, sign / 4, right_of(l, k));
        }
    }
}

// One step along one axis, of the nodes whose indices are multiples of `stride`.
static void along(gonio_wavelet wavelet, const gonio_grid *grid, size_t channels, double *values, int axis,
                  size_t stride, bool back) {
    size_t steps[4], n[4], lines = 1, inner = channels;
    for (int d = grid->dims - 1; d >= 0; d--) {
        steps[d] = inner * stride;
        inner *= grid->size[d];
        n[d] = (grid->size[d] + stride - 1) / stride;
        lines *= d != axis ? n[d] : 1;
    }
    const bool closed = gonio_grid_is_azimuth(grid, axis) && grid->dims == 4;
    for (size_t i = 0; i < lines; i++) {
        line l = {values, steps[axis], n[axis], channels, closed};
        size_t rest = i;
        for (int d = grid->dims - 1; d >= 0; d--) {
            if (d != axis) {
                l.at += rest % n[d] * steps[d];
                rest /= n[d];
            }
        }
        if (back) {
            update(wavelet, &l, -1);
            predict(wavelet, &l, -1);
        } else {
            predict(wavelet, &l, 1);
            update(wavelet, &l, 1);
        }
    }
}

void gonio_lifting_forward(gonio_wavelet wavelet, const gonio_grid *grid, size_t channels, double *values) {
    for (int step = 0; step < grid->level; step++) {
        for (int axis = 0; axis < grid->dims; axis++) {
            along(wavelet, grid, channels, values, axis, (size_t)1 << step, false);
        }
    }
}

void gonio_lifting_inverse(gonio_wavelet wavelet, const gonio_grid *grid, size_t channels, double *values) {
    for (int step = grid->level; step-- > 0;) {
        for (int axis = grid->dims; axis-- > 0;) {
            along(wavelet, grid, channels, values, axis, (size_t)1 << step, true);
        }
    }
}

int gonio_lifting_step(const gonio_grid *grid, size_t node) {
    int step = grid->level + 1;
    for (int d = grid->dims - 1; d >= 0; d--) {
        const size_t at = node % grid->size[d];
        node /= grid->size[d];
        int own = 1;
        while (own <= grid->level && (at >> (own - 1)) % 2 == 0) {
            own++;
        }
        step = own < step ? own : step;
    }
    return step;
}
