// The standard uncertainty that a fitted model carries (docs/fitting.md).
#ifndef GONIO_FIT_UNCERTAINTY_H
#define GONIO_FIT_UNCERTAINTY_H

#include "fit/lobe_model.h"
#include "fit/lsq_large.h"

// Add sigma to a model of the direct solver, from what it makes of left-out samples and the fit's covariance.
gonio_status gonio_uncertainty_dense(const gonio_lsq_dense *dense, const gonio_lsq_data *data,
                                     const gonio_lsq_base *base, const double *lambdas, gonio_lobe_model_parts *parts,
                                     gonio_error *error);
// Add sigma to a model of the iterative solver: the choice is fitted once more, without scattered geometries, without
// neighbourhoods and without the largest angles.
gonio_status gonio_uncertainty_large(const gonio_lsq_large_choice *choice, const gonio_lsq_data *data,
                                     gonio_lsq_watch *watch, gonio_lobe_model_parts *parts, gonio_error *error);

#endif
