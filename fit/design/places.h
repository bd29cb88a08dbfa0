// SPDX-License-Identifier: BSD-3-Clause
// The candidates of a choice: places, what is unknown there, and what they stand for.
#ifndef GONIO_FIT_DESIGN_PLACES_H
#define GONIO_FIT_DESIGN_PLACES_H

#include "fit/design/design.h"

typedef struct gonio_design_place {
    gonio_pair pair;
    double x[4];   // half-vector coordinates in the kernel's lengths
    double spread; // relative sigma
    double value;  // f_r, mean over channels
    double weight; // the share of all directions, times their need, that lies nearest to it
    bool open;     // may be chosen
} gonio_design_place;

typedef struct gonio_design_places {
    gonio_design_place *items;
    size_t n, taken; // the first `taken` are to be measured in any case
    int dims;
} gonio_design_places;

gonio_status gonio_design_places_init(gonio_design_places *places, const gonio_design *design, const gonio_model *model,
                                      const gonio_pair *taken, size_t taken_n, gonio_error *error);
void gonio_design_places_release(gonio_design_places *places);
// covariance[places n x n] of a deviation of variance 1 that the samples leave.
gonio_status gonio_design_posterior(const gonio_design_places *places, const gonio_samples *samples, int threads,
                                    double *covariance, gonio_error *error);

#endif
