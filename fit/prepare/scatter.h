// SPDX-License-Identifier: BSD-3-Clause
// Samples made ready for a lattice fit: coordinates, transformed values, weights, sorted so that neighbours in space
// are neighbours in memory.
#ifndef GONIO_FIT_PREPARE_SCATTER_H
#define GONIO_FIT_PREPARE_SCATTER_H

#include <stdbool.h>

#include "brdf/spline/bspline.h"
#include "brdf/transform.h"
#include "gonio/fit.h"

// How to prepare. channel_scale and eps follow from the data.
typedef struct gonio_scatter_options {
    gonio_coordinates coordinates;
    gonio_domain domain; // GONIO_LOG becomes asinh for channels' sets with significantly negative values
    int symmetry;        // GONIO_SYMMETRY_* bits
    bool weighted;       // weights 1/variance where the samples carry sigma_random
    int threads;         // 0: all; the result does not depend on it
} gonio_scatter_options;

// n prepared samples. Mirror symmetry adds none: it is a flip of lattice axes, and the fit adds the flipped sums.
// Reciprocity adds the swapped ones.
typedef struct gonio_scatter {
    size_t n;
    int dims, channels;
    uint32_t *positions; // n x dims and one more that is never used, fixed-point (brdf/spline/bspline.h)
    float *values;       // n x channels: transformed
    float *weights;      // n, the largest 1; NULL: all 1
    gonio_coordinates coordinates;
    gonio_transform_kind kind;
    gonio_transform *transforms; // [channels]
    double *mean;                // [channels]: weighted mean of the transformed values
    unsigned mirror_axes;        // bit d: axis d is flipped by phi -> -phi; 0: no mirror symmetry
} gonio_scatter;

// Prepare the samples; release with gonio_scatter_release. GONIO_E_INPUT for no samples, NaN, infinities, or angles
// outside the hemisphere, with the sample's number.
gonio_status gonio_scatter_init(gonio_scatter *scatter, const gonio_samples *samples,
                                const gonio_scatter_options *options, gonio_error *error);
void gonio_scatter_release(gonio_scatter *scatter);
// The same without sorting.
gonio_status gonio_scatter_prepare(gonio_scatter *scatter, const gonio_samples *samples,
                                   const gonio_scatter_options *options, gonio_error *error);
// Sort each block of GONIO_SCATTER_BLOCK samples by cell, axis after axis, by this many bits of each;
// gonio_scatter_init has done it.
static inline int gonio_scatter_order_bits(int dims) { return dims == 3 ? 6 : 4; }
#define GONIO_SCATTER_BLOCK ((size_t)1 << 20)
gonio_status gonio_scatter_sort(gonio_scatter *scatter, int threads, gonio_error *error);
// The coordinates of one pair; x[dims].
void gonio_scatter_locate(gonio_coordinates coordinates, int dims, const gonio_pair *pair, double x[GONIO_DIMS_MAX]);
// A power of two near the largest |values[i * channels]|; 1 for zeros.
double gonio_scatter_scale(size_t n, const double *values, size_t channels);
// The squared distance of two places, or of the one from the other's mirror image where that is nearer.
double gonio_scatter_distance2(const double *x, const double *y, size_t dims, unsigned mirror_axes);

#endif
