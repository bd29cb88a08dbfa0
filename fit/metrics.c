// SPDX-License-Identifier: BSD-3-Clause
// Every error figure that Gonio prints: per channel first, then the mean over the channels.
//
//   rmse        sqrt(mean (p - f)^2)                      channels: root of the mean square
//   max_abs     max |p - f|                               Kameya's MAE
//   max_rel     max_abs / max |f|                         Kameya's MRE; channels that are zero throughout have none
//   median_rel  median |p - f| / (f + 1e-3)               p and f raised to at least 0
//   rms_log     sqrt(mean ln^2((p + 1e-3)/(f + 1e-3)))    p and f raised to at least 0; root of the mean square
//   rmse_70     rmse over theta_i <= 70 deg
//
// Sums run in sample order in one thread, so a figure does not depend on the thread count.
#include "gonio/metrics.h"
#include "base/statistics.h"

#include <math.h>
#include <stdlib.h>

#include "base/thread_pool.h"

#define RELATIVE_FLOOR 1e-3 // 1/sr
// 70 deg and the rounding of angles that a file gives in radians with six decimals.
#define THETA_70 (70 * GONIO_PI / 180 + 1e-6)

typedef struct channel_errors {
    double mean_square, max_abs, max_rel, median_rel, mean_square_log, mean_square_70;
    size_t n, n_70;
} channel_errors;

// relative: room for samples->n numbers.
static channel_errors errors_of_channel(const gonio_samples *samples, const double *predicted, const bool *which,
                                        size_t channel, double *relative) {
    channel_errors e = {0};
    double largest = 0;
    for (size_t i = 0; i < samples->n; i++) {
        if (which != NULL && !which[i]) {
            continue;
        }
        const size_t at = i * (size_t)samples->channels + channel;
        const double f = samples->values[at], p = predicted[at], difference = fabs(p - f);
        const double f_up = fmax(f, 0), p_up = fmax(p, 0);
        const double log_ratio = log((p_up + RELATIVE_FLOOR) / (f_up + RELATIVE_FLOOR));
        e.mean_square += difference * difference;
        e.mean_square_log += log_ratio * log_ratio;
        e.max_abs = fmax(e.max_abs, difference);
        largest = fmax(largest, fabs(f));
        relative[e.n++] = fabs(p_up - f_up) / (f_up + RELATIVE_FLOOR);
        if (gonio_pair_raised(samples->pairs[i]).theta_i <= THETA_70) {
            e.mean_square_70 += difference * difference;
            e.n_70++;
        }
    }
    e.max_rel = largest > 0 ? e.max_abs / largest : NAN;
    if (e.n > 0) {
        e.mean_square /= (double)e.n;
        e.mean_square_log /= (double)e.n;
        e.median_rel = gonio_median(relative, e.n);
    }
    e.mean_square_70 = e.n_70 > 0 ? e.mean_square_70 / (double)e.n_70 : NAN;
    return e;
}

static gonio_status check_finite(const gonio_samples *samples, const double *predicted, const bool *which,
                                 gonio_error *error) {
    const size_t c = (size_t)samples->channels;
    for (size_t i = 0; i < samples->n; i++) {
        for (size_t k = 0; k < c && (which == NULL || which[i]); k++) {
            if (!isfinite(predicted[i * c + k])) {
                const gonio_pair *p = &samples->pairs[i];
                return gonio_fail(error, GONIO_E_FAILED,
                                  "predicted %g at theta_i=%g phi_i=%g theta_o=%g phi_o=%g deg, channel %zu",
                                  predicted[i * c + k], gonio_degrees(p->theta_i), gonio_degrees(p->phi_i),
                                  gonio_degrees(p->theta_o), gonio_degrees(p->phi_o), k + 1);
            }
        }
    }
    return GONIO_OK;
}

gonio_status gonio_errors_of(const gonio_samples *samples, const double *predicted, const bool *which,
                             gonio_errors *out, gonio_error *error) {
    const gonio_errors none = {NAN, NAN, NAN, NAN, NAN, NAN, 0};
    *out = none;
    const gonio_status status = check_finite(samples, predicted, which, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *relative = malloc((samples->n + 1) * sizeof *relative);
    if (relative == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the errors of %zu samples", samples->n);
    }
    gonio_errors sum = {0};
    int channels_rel = 0;
    for (int c = 0; c < samples->channels; c++) {
        const channel_errors e = errors_of_channel(samples, predicted, which, (size_t)c, relative);
        sum.samples = e.n;
        sum.rmse += e.mean_square;
        sum.max_abs += e.max_abs;
        sum.median_rel += e.median_rel;
        sum.rms_log += e.mean_square_log;
        sum.rmse_70 += e.mean_square_70;
        if (isfinite(e.max_rel)) {
            sum.max_rel += e.max_rel;
            channels_rel++;
        }
    }
    free(relative);
    if (sum.samples > 0) {
        const double n = samples->channels;
        *out = (gonio_errors){.rmse = sqrt(sum.rmse / n),
                              .max_abs = sum.max_abs / n,
                              .max_rel = channels_rel > 0 ? sum.max_rel / channels_rel : NAN,
                              .median_rel = sum.median_rel / n,
                              .rms_log = sqrt(sum.rms_log / n),
                              .rmse_70 = sqrt(sum.rmse_70 / n),
                              .samples = sum.samples};
    }
    return GONIO_OK;
}

// Evaluate in blocks: each is one call of eval_many, and they run in any thread.
#define BLOCK 4096

typedef struct prediction {
    const gonio_model *model;
    const gonio_samples *samples;
    double *values;
} prediction;

static void predict(void *context, size_t block) {
    const prediction *all = context;
    const size_t first = block * BLOCK, left = all->samples->n - first, count = left < BLOCK ? left : BLOCK;
    gonio_vec3 wi[BLOCK], wo[BLOCK];
    for (size_t i = 0; i < count; i++) {
        const gonio_pair *p = &all->samples->pairs[first + i];
        wi[i] = gonio_direction(p->theta_i, p->phi_i);
        wo[i] = gonio_direction(p->theta_o, p->phi_o);
    }
    gonio_model_eval_many(all->model, count, wi, wo, all->values + first * (size_t)all->samples->channels);
}

gonio_status gonio_errors_model(const gonio_model *model, const gonio_samples *samples, const bool *which, int threads,
                                gonio_errors *out, gonio_error *error) {
    if (model->channels != samples->channels) {
        return gonio_fail(error, GONIO_E_INPUT, "the model has %d channels, the samples have %d", model->channels,
                          samples->channels);
    }
    double *predicted = calloc(samples->n + 1, (size_t)samples->channels * sizeof *predicted);
    if (predicted == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to evaluate %zu samples of %d channels (%.3g GB)",
                          samples->n, samples->channels, 8e-9 * (double)samples->n * samples->channels);
    }
    gonio_pool_for(threads, (samples->n + BLOCK - 1) / BLOCK, predict, &(prediction){model, samples, predicted});
    const gonio_status status = gonio_errors_of(samples, predicted, which, out, error);
    free(predicted);
    return status;
}
