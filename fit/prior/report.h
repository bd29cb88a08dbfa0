// SPDX-License-Identifier: BSD-3-Clause
// What a user must know of where a model is supported.
#ifndef GONIO_FIT_PRIOR_REPORT_H
#define GONIO_FIT_PRIOR_REPORT_H

#include "fit/prior/prior.h"

// Append to the report's note how much of all directions the samples leave to physics, and an albedo above 1.
void gonio_prior_report(gonio_prior *prior, const gonio_model *model, gonio_fit_report *report);

#endif
