// The standard uncertainty that a fitted model carries (docs/fitting.md).
#ifndef GONIO_FIT_UNCERTAINTY_H
#define GONIO_FIT_UNCERTAINTY_H

#include "fit/lobe_model.h"
#include "fit/lsq_large.h"

// Add sigma to a model of the direct solver, from its leave-one-out residuals and the fit's covariance.
gonio_status gonio_uncertainty_dense(const gonio_lsq_dense *dense, const gonio_lsq_data *data,
                                     const gonio_lsq_base *base, const double *lambdas, gonio_lobe_model_parts *parts,
                                     gonio_error *error);
// Add sigma to a model of the iterative solver, from its residuals on the inner held-out geometries.
gonio_status gonio_uncertainty_held(const gonio_lsq_large_choice *choice, const gonio_lsq_data *data,
                                    gonio_lobe_model_parts *parts, gonio_error *error);

#endif
