// SPDX-License-Identifier: BSD-3-Clause
// One pixel's exposures -> one radiance with its variance. See merge.c.
#ifndef GONIO_CALIB_RADIANCE_MERGE_H
#define GONIO_CALIB_RADIANCE_MERGE_H

#include <stdbool.h>

#define MERGE_MAX 64 // exposures a pixel

// The camera's noise, in linear DN (DN after the response curve is undone).
typedef struct merge_noise {
    double dn_per_e;      // 1 / gain
    double read_variance; // DN^2, quantisation apart
    double ceiling;       // predicted signals above this (DN above the bias) are too near saturation to be used
} merge_noise;

// One exposure of one pixel.
typedef struct merge_term {
    double signal;           // DN above bias and dark signal
    double scale;            // DN that unit radiance gives: responsivity x exposure x lamp
    double dark;             // dark signal, DN
    double quantum_variance; // DN^2
    bool clipped;            // at or above saturation as read
} merge_term;

typedef struct merge_result {
    double value;
    double photon_variance, read_variance; // their sum is the variance of value
    double weight[MERGE_MAX];              // d value / d signal of each exposure, 0 where not used
    int used;                              // exposures used; 0: no valid exposure, value is then 0
    bool saturated;                        // with used == 0: every exposure was too bright
} merge_result;

void gonio_merge_pixel(const merge_noise *noise, int n, const merge_term *terms, merge_result *result);

#endif
