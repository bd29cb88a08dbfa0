// One axis of a lattice, in the eigenvectors of its second-difference penalty ("modes").
#ifndef GONIO_FIT_LSQ_AXIS_H
#define GONIO_FIT_LSQ_AXIS_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/status.h"

typedef struct gonio_lsq_axis {
    int level;
    size_t m;          // modes, as many as control points
    double *modes;     // m x m: mode j in column j
    double *stiffness; // [m] 2^level times the penalty of a mode
    bool *odd;         // [m] under the flip of the axis
} gonio_lsq_axis;

gonio_status gonio_lsq_axis_init(gonio_lsq_axis *axis, int level, gonio_error *error);
void gonio_lsq_axis_release(gonio_lsq_axis *axis);
// feature[mode count + i] = mode's spline at coordinate x[i * stride].
void gonio_lsq_axis_features(const gonio_lsq_axis *axis, size_t count, const double *x, size_t stride, double *feature);
// Modes -> control points of the middle index: from[outer][m][inner] -> to.
void gonio_lsq_axis_transform(const gonio_lsq_axis *axis, size_t outer, size_t inner, const double *from, double *to);

#endif
