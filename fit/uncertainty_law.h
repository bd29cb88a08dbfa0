// A law of the prediction error's variance, learnt from predictions of left-out samples.
//
// variance = noise N + scale e^(2 u(x)) U^power: N is the variance that a unit of the samples' noise leaves in the
// prediction, U a measure of what gaps and smoothing leave unknown, u how much rougher than elsewhere the data are
// about x.
#ifndef GONIO_FIT_UNCERTAINTY_LAW_H
#define GONIO_FIT_UNCERTAINTY_LAW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/direction.h"
#include "gonio/status.h"

// One left-out sample's prediction.
typedef struct gonio_sigma_record {
    double x[2];           // where: gonio_sigma_place
    double noise, unknown; // N, the sample's own noise included, and U
    double square;         // of the residual
    double weight;
    size_t centre; // the sample
} gonio_sigma_record;

typedef struct gonio_sigma_records {
    gonio_sigma_record *rows;
    size_t n, capacity;
    size_t near; // the first so many leave out least: the distances between them tell how densely samples lie
} gonio_sigma_records;

typedef struct gonio_sigma_law {
    const gonio_sigma_records *records; // borrowed
    double noise, scale, power, unit;   // unit: U is taken in it
    double growth; // of the part of U, by which the left-out residuals' quantiles ask for more than u gives
} gonio_sigma_law;

// Where roughness is the same: BRDFs are as rough as the half vector is tilted and the difference angle is large, more
// than anything else.
void gonio_sigma_place(const gonio_pair *pair, double x[2]);
void gonio_sigma_records_release(gonio_sigma_records *records);
gonio_status gonio_sigma_records_add(gonio_sigma_records *records, const gonio_sigma_record *row, gonio_error *error);

// Fit to the records, which must outlive the law. noise: variance of a sample's noise in the residuals' units; < 0
// where the samples do not tell it, and it is fitted too.
gonio_status gonio_sigma_law_fit(const gonio_sigma_records *records, double noise, gonio_sigma_law *law,
                                 gonio_error *error);
// The variance of the model's error at x, in the residuals' units. work: 4 doubles a record.
double gonio_sigma_law_variance(const gonio_sigma_law *law, const double x[2], double noise, double unknown,
                                double *work);

#endif
