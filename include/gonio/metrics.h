// SPDX-License-Identifier: BSD-3-Clause
// Every error figure that Gonio prints, computed in one place.
#ifndef GONIO_METRICS_H
#define GONIO_METRICS_H

#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/sample.h"

GONIO_BEGIN

// Figures per channel, then the mean over channels (rmse and rms_log: root of the mean square). NaN: no samples (JSON
// null).
typedef struct gonio_errors {
    double rmse;
    double max_abs;    // Kameya's MAE
    double max_rel;    // Kameya's MRE: max_abs / max |value|
    double median_rel; // median of |p - f| / (f + 1e-3), p and f raised to at least 0
    double rms_log;    // rms of ln((p + 1e-3)/(f + 1e-3)), p and f raised to at least 0
    double rmse_70;    // over theta_i <= 70 deg
    size_t samples;
} gonio_errors;

// predicted: n x channels, as gonio_model_eval_many gives. which (may be NULL): only samples with which[i].
gonio_status gonio_errors_of(const gonio_samples *samples, const double *predicted, const bool *which,
                             gonio_errors *out, gonio_error *error);
// The model's errors on the samples; the model must have as many channels as they have. threads 0: all.
gonio_status gonio_errors_model(const gonio_model *model, const gonio_samples *samples, const bool *which, int threads,
                                gonio_errors *out, gonio_error *error);

GONIO_END
#endif
