// SPDX-License-Identifier: BSD-3-Clause
// The smoothing penalty R of a lattice, applied plane by plane along its first axis.
#ifndef GONIO_FIT_SMOOTH_PENALTY_H
#define GONIO_FIT_SMOOTH_PENALTY_H

#include "base/thread_pool.h"
#include "fit/smooth/form.h"

// Planes of a level's lattice: size of them, `points` in each.
typedef struct gonio_smooth_planes {
    int dims, level;
    size_t size, points;
} gonio_smooth_planes;

gonio_smooth_planes gonio_smooth_planes_of(int dims, int level);

// Plane `plane` of out += lambda R in.
void gonio_smooth_penalise(const gonio_smooth_planes *planes, const gonio_smooth_form *form, double lambda,
                           const double *in, double *out, size_t plane);
// Plane `plane` of out = (out + its mirror image) / 2; axes: those that the mirror flips, never the first; 0: nothing.
void gonio_smooth_fold(const gonio_smooth_planes *planes, unsigned axes, double *out, size_t plane);

#endif
