// SPDX-License-Identifier: BSD-3-Clause
// A control lattice of three or four dimensions of which only some bricks of 4 points a side are there.
#ifndef GONIO_BRDF_SPLINE_OVERLAY_H
#define GONIO_BRDF_SPLINE_OVERLAY_H

#include <stdbool.h>

#include "brdf/spline/bspline.h"

// Arrays are owned or borrowed by whoever fills it.
typedef struct gonio_overlay {
    int dims, level;
    size_t channels, side; // bricks a dimension
    size_t bricks;
    const uint32_t *table; // [side^dims]: 0 where there is no brick, else 1 + its number
    const float *data;     // [bricks][4^dims][channels]
} gonio_overlay;

static inline size_t gonio_overlay_side(int level) { return (gonio_bspline_size(level) + 3) / 4; }

static inline size_t gonio_overlay_places(int dims, int level) {
    const size_t side = gonio_overlay_side(level);
    return side * side * side * (dims == 4 ? side : 1);
}

static inline size_t gonio_overlay_brick_points(int dims) { return dims == 4 ? 256 : 64; }

// The cell that x (in [0, 1], else at the border) lies in, and the weights of its 4 control points along an axis.
static inline size_t gonio_overlay_cell(double x, int level, double weights[4]) {
    const double at = gonio_bspline_inside(x) * (double)((size_t)1 << level);
    const size_t cell = (size_t)at;
    gonio_bspline_weights(at - (double)cell, weights);
    return cell;
}

// The overlay at x[dims], added to sums[channels].
void gonio_overlay_add(const gonio_overlay *overlay, const double *x, double *sums);

#endif
