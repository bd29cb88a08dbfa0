// SPDX-License-Identifier: BSD-3-Clause
// Samples made ready for least squares: equal geometries merged, values as transformed values in double, weights.
#ifndef GONIO_FIT_PREPARE_DATASET_H
#define GONIO_FIT_PREPARE_DATASET_H

#include "brdf/transform.h"
#include "gonio/fit.h"

typedef struct gonio_dataset {
    size_t n;        // unique geometries
    size_t measured; // of them; the others, which stand last, are what physics says (fit/prior/extend.h)
    int dims, channels;
    bool mirror; // geometries are folded onto one side of the plane of incidence: f(phi) = f(-phi)
    gonio_pair *pairs;
    double *values;  // n x channels, f_r; equal geometries averaged
    double *targets; // n x channels, transformed values
    double *weights; // n; their mean is 1
    gonio_transform_kind kind;
    gonio_transform *transforms; // [channels]
    double *noise; // [channels]: median standard uncertainty of the transformed values; 0 where the samples carry none
} gonio_dataset;

typedef struct gonio_dataset_options {
    bool mirror;
    gonio_domain domain; // GONIO_LOG: the positive transform, or asinh for a signed quantity
    bool reciprocal;     // add every geometry with its directions swapped
} gonio_dataset_options;

// Release with gonio_dataset_release. GONIO_E_INPUT for no samples, and for NaN, infinities or angles outside the
// hemisphere, with the sample's number.
gonio_status gonio_dataset_init(gonio_dataset *data, const gonio_samples *samples, const gonio_dataset_options *options,
                                gonio_error *error);
void gonio_dataset_release(gonio_dataset *data);
// About `count` measured geometries spread evenly over the set, and all others, as a set of its own.
gonio_status gonio_dataset_thin(const gonio_dataset *data, size_t count, uint64_t seed, gonio_dataset *out,
                                gonio_error *error);
// The geometries with keep[i], as a set of its own.
gonio_status gonio_dataset_select(const gonio_dataset *data, const bool *keep, gonio_dataset *out, gonio_error *error);
// Only the channels which[0..count-1], as a set of its own.
gonio_status gonio_dataset_channels(const gonio_dataset *data, const int *which, int count, gonio_dataset *out,
                                    gonio_error *error);
// Add what was not measured: pairs[count], f_r values[count x channels], weights[count] beside a mean of 1.
gonio_status gonio_dataset_append(gonio_dataset *data, size_t count, const gonio_pair *pairs, const double *values,
                                  const double *weights, gonio_error *error);
// x[n x dims] in [0, 1].
void gonio_dataset_locate(const gonio_dataset *data, gonio_coordinates coordinates, double *x);

#endif
