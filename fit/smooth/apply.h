// SPDX-License-Identifier: BSD-3-Clause
// Passes over the samples on a lattice of doubles: the spline at each sample, and what it adds to its control points.
#ifndef GONIO_FIT_SMOOTH_APPLY_H
#define GONIO_FIT_SMOOTH_APPLY_H

#include "base/thread_pool.h"
#include "fit/smooth/form.h"

// Positions of a set, sorted along the first axis.
typedef struct gonio_smooth_places {
    size_t n;
    int dims;
    unsigned mirror_axes;
    uint32_t *positions; // n x 4, fixed-point
    double *weights;     // [n]
    size_t *sample;      // [n]: which geometry of the data
} gonio_smooth_places;

gonio_status gonio_smooth_places_init(gonio_smooth_places *places, const gonio_dataset *data,
                                      const gonio_smooth_form *form, gonio_error *error);
void gonio_smooth_places_release(gonio_smooth_places *places);

// What a sample with basis w (4^d values), weight q and spline value s adds to its control points.
typedef enum gonio_smooth_pass {
    GONIO_SMOOTH_NORMAL,   // q s w
    GONIO_SMOOTH_RESIDUAL, // q (t - s) w
    GONIO_SMOOTH_DIAGONAL, // q w^2
    GONIO_SMOOTH_MBA,      // q (t - s) w^3 / sum w^2
} gonio_smooth_pass;

// Add the pass to out; t = targets[sample * stride]. pool may be NULL.
void gonio_smooth_apply(const gonio_smooth_places *places, gonio_pool *pool, int level, gonio_smooth_pass pass,
                        const double *targets, size_t stride, const double *in, double *out);
// out += its mirror image; without mirror symmetry out is left alone.
void gonio_smooth_symmetrise(const gonio_smooth_places *places, int level, double *out);
// values[sample * stride] = the spline at each position.
void gonio_smooth_places_eval(const gonio_smooth_places *places, int level, const double *in, double *values,
                              size_t stride);

#endif
