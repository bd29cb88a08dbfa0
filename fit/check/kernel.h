// SPDX-License-Identifier: BSD-3-Clause
// DeYoung 3.2.1: scattered samples between which a Gaussian kernel interpolates.
//
// The value at a direction pair is the mean of the j nearest samples by a Gaussian of their distances, whose standard
// deviation is their mean distance. The thesis leaves j and the distance open. Here the samples themselves choose, each
// predicted from the others: j of 4, 8, 16; the distance of the unit vectors, as the thesis has it first, or of
// half-vector coordinates, in which lobes of neighbouring incidences lie on each other; means of the values, or of
// their logarithms.
#ifndef GONIO_FIT_CHECK_KERNEL_H
#define GONIO_FIT_CHECK_KERNEL_H

#include "fit/check/neighbours.h"
#include "gonio/check.h"

typedef struct gonio_kernel {
    gonio_model head;              // the interpolant as a model
    const gonio_samples *samples;  // borrowed
    bool half_vector, log, turned; // turned: azimuths of the sample count for nothing
    int wanted, dims;
    double *at;   // [n][dims]
    double *eps;  // [channels] where the logarithm begins
    double reach; // distance within which the place counts as sampled
    gonio_neighbours tree;
    double *units;          // [n][5 or 6] the places as unit vectors, and their tree
    gonio_neighbours exact; // what stands at a place itself: half-vector coordinates have none at some
    // Of each sample predicted from the others: median of |error| / (|f| + eps), and the mean square of a channel.
    double left_out, *left_out_squares;
} gonio_kernel;

// turned: as an isotropic set, whatever the samples say. The caller frees with gonio_kernel_free.
gonio_status gonio_kernel_new(const gonio_samples *samples, bool turned, gonio_kernel *out, gonio_error *error);
void gonio_kernel_free(gonio_kernel *kernel);

// The samples at the place itself, without that one; up to GONIO_NEAREST_MAX of them.
size_t gonio_kernel_at(const gonio_kernel *kernel, gonio_vec3 wi, gonio_vec3 wo, size_t without, size_t *rows);
// The nearest sample of a pair.
size_t gonio_kernel_nearest(const gonio_kernel *kernel, const gonio_pair *pair);
// values[channels] at a pair, without the sample of that number (SIZE_MAX: all take part); false: the nearest are too
// far away for the place to count as sampled (the values are set all the same). sigma: NULL, or [channels] the random
// uncertainty that they inherit.
bool gonio_kernel_value(const gonio_kernel *kernel, gonio_vec3 wi, gonio_vec3 wo, size_t without, double *values,
                        double *sigma);

#endif
