// SPDX-License-Identifier: BSD-3-Clause
// Predictions of left-out samples, in closed form: each sample alone, whole neighbourhoods, and all beyond an angle.
#ifndef GONIO_FIT_SIGMA_BLOCKS_H
#define GONIO_FIT_SIGMA_BLOCKS_H

#include "fit/prior/prior.h"
#include "fit/sigma/law.h"
#include "fit/smooth/loo.h"

// The fit as a linear map of its targets, and how the base depends on its parameters.
typedef struct gonio_influence {
    const gonio_smooth_dense *dense;
    const gonio_dataset *data;
    const gonio_smooth_base *base;
    double lambda;
    size_t n, p;      // geometries, the base's parameters
    double *map;      // n x n: Q, targets times root weights -> residuals times root weights
    double *square;   // n x n: Q Q
    double *residual; // n x channels, geometry fastest: Q times the targets
    double *slopes;   // n x p: of the base's transformed value by each parameter's logarithm, times root weight
    double *pulled;   // n x p: the map times the slopes
    double *inverse;  // p x p: (slopes^T map slopes + prior)^-1
    double *errors;   // added places x materials: gonio_prior_errors times root weights; NULL: no place was added
} gonio_influence;

// doubt: the residuals' spread; a parameter of the base is known a priori within a factor of e, in these units.
gonio_status gonio_influence_init(gonio_influence *f, const gonio_smooth_dense *dense, const gonio_dataset *data,
                                  const gonio_smooth_base *base, double lambda, double doubt, gonio_prior *prior,
                                  gonio_error *error);
void gonio_influence_release(gonio_influence *f);
// Residuals divided by factor[channel], and what each is expected to be made of.
gonio_status gonio_influence_records(const gonio_influence *f, const double *factor, gonio_sigma_records *records,
                                     gonio_error *error);
// At m points: N and the signs of the model's error as in the records (own noise left out). N counts what the samples'
// noise does to the base's parameters too. signs: m x GONIO_SIGMA_SIGNS. passed[m]: the variance that the materials
// leave at the added places, passed on by the fit, in the factor of the middle channel.
gonio_status gonio_influence_at(const gonio_influence *f, const double *factor, size_t m, const gonio_pair *pairs,
                                const double *x, double *noise, double *signs, double *passed, gonio_error *error);

#endif
