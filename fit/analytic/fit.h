// SPDX-License-Identifier: BSD-3-Clause
// The fit of a plan with what tests and benches want to know beside the model.
#ifndef GONIO_FIT_ANALYTIC_FIT_H
#define GONIO_FIT_ANALYTIC_FIT_H

#include "fit/analytic/plan.h"

typedef struct gonio_analytic_detail {
    bool converged;
    int iterations;
    int starts; // that went down; the rms residuals where the best and the worst of them ended
    double best, worst;
    double condition; // of the Jacobian with columns of unit length; INFINITY: the data do not decide
} gonio_analytic_detail;

// *detail (may be NULL): of the search, or of the first channel's.
gonio_status gonio_analytic_fit_detail(const gonio_analytic_plan *plan, const gonio_samples *samples,
                                       const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                                       gonio_analytic_detail *detail, gonio_error *error);

extern const gonio_analytic_plan gonio_analytic_plan_lafortune; // for the bench of its starts

#endif
