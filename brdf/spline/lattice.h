// SPDX-License-Identifier: BSD-3-Clause
// A control lattice: float32 control points of a tensor-product cubic B-spline over [0, 1]^dims.
#ifndef GONIO_BRDF_SPLINE_LATTICE_H
#define GONIO_BRDF_SPLINE_LATTICE_H

#include <stdbool.h>

#include "brdf/spline/bspline.h"
#include "gonio/status.h"

// size = 2^level + 3 points a dimension; points[((i0 size + i1) size + i2 ...) channels + c].
typedef struct gonio_lattice {
    int dims, level, channels;
    size_t size;
    size_t count; // control points a channel: size^dims
    float *points;
} gonio_lattice;

// Control points a channel of a lattice; 0 where they cannot be counted in a size_t.
size_t gonio_lattice_count(int dims, int level);
// A lattice of zeros; release its points with gonio_lattice_release. GONIO_E_RANGE for dims other than 3 and 4 or
// levels other than 0..9, GONIO_E_MEMORY with the figure where it does not fit.
gonio_status gonio_lattice_init(gonio_lattice *lattice, int dims, int level, int channels, gonio_error *error);
void gonio_lattice_release(gonio_lattice *lattice);
// Every control point of channel c set to values[c]: the spline is that constant.
void gonio_lattice_fill(gonio_lattice *lattice, const double *values);
// The same function on a lattice one level finer (Kameya 2002, 2.3.4; Lee et al. 1997, section 4.2), in place.
gonio_status gonio_lattice_refine(gonio_lattice *lattice, gonio_error *error);
// The spline of every channel at x (clamped to [0, 1]): plain and in double; the reference for the fast kernels.
void gonio_lattice_eval(const gonio_lattice *lattice, const double *x, double *values);
double gonio_lattice_eval_channel(const gonio_lattice *lattice, const double *x, int channel);
// One channel and its derivatives with respect to x.
double gonio_lattice_gradient(const gonio_lattice *lattice, const double *x, int channel, double *gradient);

#endif
