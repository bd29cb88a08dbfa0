// SPDX-License-Identifier: BSD-3-Clause
// A law of the prediction error's variance, learnt from predictions of left-out samples.
//
// variance = noise N + scale e^(2 u(x)) U^p S^q G^r: N is the variance that a unit of the samples' noise leaves in the
// prediction and u how much rougher than elsewhere the data are about x. The others tell where the model can be wrong:
// U what gaps and smoothing leave unknown; S the square of what the spline adds to the base, since a spline that adds
// nothing has nothing to be wrong about; G how far the samples fail to hold the base's parameters down there. Over
// simulated sets ln U alone explains a sixth of ln error^2, all three more than half, with exponents that are alike at
// new directions and among left-out samples.
#ifndef GONIO_FIT_SIGMA_LAW_H
#define GONIO_FIT_SIGMA_LAW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/direction.h"
#include "gonio/status.h"

enum { GONIO_SIGMA_UNKNOWN, GONIO_SIGMA_CORRECTION, GONIO_SIGMA_SLOPES, GONIO_SIGMA_SIGNS };

// One left-out sample's prediction.
typedef struct gonio_sigma_record {
    double x[2];                     // where: gonio_sigma_place
    double noise;                    // N, the sample's own noise included
    double signs[GONIO_SIGMA_SIGNS]; // U, S, G
    double square;                   // of the residual
    double weight;
    size_t centre;      // the sample
    double expected[2]; // the law's: noise's part of the variance, and the unknown's where u is 0
} gonio_sigma_record;

typedef struct gonio_sigma_records {
    gonio_sigma_record *rows;
    size_t n, capacity;
    // What is expected of the exponents of U, S, G, and the standard deviation about that.
    double power[GONIO_SIGMA_SIGNS], spread[GONIO_SIGMA_SIGNS];
    size_t near; // the first so many leave out least: the distances between them tell how densely samples lie
} gonio_sigma_records;

typedef struct gonio_sigma_law {
    const gonio_sigma_records *records; // borrowed
    double noise, scale;
    // Of U, S, G: the exponents; what each is taken in; what is added to it first, so that a zero of S is no certainty.
    double power[GONIO_SIGMA_SIGNS], unit[GONIO_SIGMA_SIGNS], floor[GONIO_SIGMA_SIGNS];
    double growth; // of the unknown part, by which the left-out residuals' quantiles ask for more than u gives
} gonio_sigma_law;

// Where roughness is the same: BRDFs are as rough as the half vector is tilted and the difference angle is large, more
// than anything else.
void gonio_sigma_place(const gonio_pair *pair, double x[2]);
void gonio_sigma_records_release(gonio_sigma_records *records);
gonio_status gonio_sigma_records_add(gonio_sigma_records *records, const gonio_sigma_record *row, gonio_error *error);

// Fit to the records, which must outlive the law unchanged. noise: variance of a sample's noise in the residuals'
// units; < 0 where the samples do not tell it, and it is fitted too.
gonio_status gonio_sigma_law_fit(gonio_sigma_records *records, double noise, gonio_sigma_law *law, gonio_error *error);
// The variance of the model's error at x, in the residuals' units. work: 4 doubles a record.
double gonio_sigma_law_variance(const gonio_sigma_law *law, const double x[2], double noise,
                                const double signs[GONIO_SIGMA_SIGNS], double *work);

#endif
