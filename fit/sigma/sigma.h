// SPDX-License-Identifier: BSD-3-Clause
// The standard uncertainty that a fitted model carries (docs/fitting.md).
#ifndef GONIO_FIT_SIGMA_SIGMA_H
#define GONIO_FIT_SIGMA_SIGMA_H

#include "brdf/kind/lobe_spline.h"
#include "fit/auto/iterative.h"
#include "fit/prior/prior.h"

// Add sigma to a model of the direct solver, from what it makes of left-out samples and the fit's covariance.
gonio_status gonio_sigma_dense(const gonio_smooth_dense *dense, const gonio_dataset *data,
                               const gonio_smooth_base *base, const double *lambdas, gonio_prior *prior,
                               gonio_lobe_spline_parts *parts, gonio_error *error);
// Add sigma to a model of the iterative solver: the choice is fitted once more, without scattered geometries, without
// neighbourhoods and without the largest angles.
gonio_status gonio_sigma_large(const gonio_iterative_choice *choice, const gonio_dataset *data, gonio_deadline *watch,
                               gonio_prior *prior, gonio_lobe_spline_parts *parts, gonio_error *error);

#endif
