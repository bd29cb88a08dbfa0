// SPDX-License-Identifier: BSD-3-Clause
// One axis of a lattice, in the eigenvectors of its second-difference penalty ("modes").
#ifndef GONIO_FIT_SMOOTH_AXIS_H
#define GONIO_FIT_SMOOTH_AXIS_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/status.h"

typedef struct gonio_smooth_axis {
    int level;
    size_t m;          // modes, as many as control points
    double *modes;     // m x m: mode j in column j
    double *stiffness; // [m] 2^level times the penalty of a mode
    bool *odd;         // [m] under the flip of the axis
} gonio_smooth_axis;

gonio_status gonio_smooth_axis_init(gonio_smooth_axis *axis, int level, gonio_error *error);
void gonio_smooth_axis_release(gonio_smooth_axis *axis);
// feature[mode count + i] = mode's spline at coordinate x[i * stride].
void gonio_smooth_axis_features(const gonio_smooth_axis *axis, size_t count, const double *x, size_t stride,
                                double *feature);
// Modes -> control points of the middle index: from[outer][m][inner] -> to.
void gonio_smooth_axis_transform(const gonio_smooth_axis *axis, size_t outer, size_t inner, const double *from,
                                 double *to);

#endif
