// SPDX-License-Identifier: BSD-3-Clause
// Linear least squares with a ridge, for models that are linear in their coefficients (brdf/kind/linear.h).
#ifndef GONIO_FIT_LINEAR_RIDGE_H
#define GONIO_FIT_LINEAR_RIDGE_H

#include "brdf/kind/linear.h"
#include "fit/method.h"

gonio_status gonio_ridge_fit(const gonio_linear_basis *basis, const gonio_samples *samples,
                             const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                             gonio_error *error);
gonio_method_memory gonio_ridge_memory;
extern const gonio_method_option gonio_ridge_options[];

#endif
