// SPDX-License-Identifier: BSD-3-Clause
// Fits of samples with transmission: each half by itself, raised in front of the surface, by the same method.
#ifndef GONIO_FIT_HALVES_H
#define GONIO_FIT_HALVES_H

#include "fit/method.h"

// As the method's fit, which it is for samples without transmission.
gonio_status gonio_fit_halves(const gonio_method *method, const gonio_samples *samples,
                              const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                              gonio_error *error);
// The errors of each half, into the report; nothing for samples without transmission. Training errors of a model, or,
// where that is NULL, held-out ones of the predictions of those samples that `which` has (NULL: none).
gonio_status gonio_halves_errors(const gonio_samples *samples, const gonio_model *model, const double *predicted,
                                 const bool *which, int threads, gonio_fit_report *report, gonio_error *error);

#endif
