// SPDX-License-Identifier: BSD-3-Clause
// Leave-one-out scores, and the lambda that they choose.
#include "fit/smooth/loo.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "fit/lobes/fit.h"
#include "fit/smooth/tuning.h"

void gonio_smooth_base_release(gonio_smooth_base *base) {
    free(base->lobes.strength);
    free(base->rest);
    free(base->mean);
    free(base->low);
    free(base->high);
    *base = (gonio_smooth_base){0};
}

static double weighted_mean(const gonio_dataset *data, const double *values, size_t channel) {
    const size_t c = (size_t)data->channels;
    double sum = 0, total = 0;
    for (size_t i = 0; i < data->n; i++) {
        sum += data->weights[i] * values[i * c + channel];
        total += data->weights[i];
    }
    return sum / total;
}

// The range of what is fitted, and a quarter of it more on both sides: between samples a peak may pass them all. In
// logarithms never more than a factor of four, above what was measured and not above what physics added to it. Samples
// themselves lie inside, so holding costs them nothing.
static void set_range(const gonio_dataset *data, gonio_smooth_base *base, size_t channel) {
    const size_t c = (size_t)data->channels;
    double low = INFINITY, high = -INFINITY, measured = -INFINITY;
    for (size_t i = 0; i < data->n; i++) {
        // With a grazing factor what is held is the sum.
        const double t =
            base->lobes.lobes > 0 ? base->rest[i * c + channel] : data->targets[i * c + channel] - base->mean[channel];
        low = fmin(low, t);
        high = fmax(high, t);
        measured = i < data->measured ? high : measured;
    }
    const double quarter = 0.25 * (high - low);
    const bool linear = data->kind == GONIO_TRANSFORM_LINEAR;
    const double margin = linear ? quarter : fmin(quarter, log(4));
    base->low[channel] = low - margin;
    base->high[channel] = linear ? high + margin : fmin(high + margin, measured + log(4));
}

gonio_status gonio_smooth_base_init(gonio_smooth_base *base, const gonio_dataset *data, gonio_lobe_base *lobes,
                                    gonio_error *error) {
    const size_t c = (size_t)data->channels;
    *base = (gonio_smooth_base){.rest = malloc(data->n * c * sizeof(double)),
                                .mean = malloc(c * sizeof(double)),
                                .low = malloc(c * sizeof(double)),
                                .high = malloc(c * sizeof(double))};
    if (base->rest == NULL || base->mean == NULL || base->low == NULL || base->high == NULL) {
        gonio_smooth_base_release(base);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the base at %zu samples", data->n);
    }
    if (lobes != NULL) {
        base->lobes = *lobes;
        *lobes = (gonio_lobe_base){0};
        gonio_lobe_targets(&base->lobes, data, base->rest);
    } else {
        memset(base->rest, 0, data->n * c * sizeof(double));
    }
    for (size_t i = 0; i < data->n * c; i++) {
        base->rest[i] = data->targets[i] - base->rest[i];
    }
    for (size_t k = 0; k < c; k++) {
        base->mean[k] = weighted_mean(data, base->rest, k);
        for (size_t i = 0; i < data->n; i++) {
            base->rest[i * c + k] -= base->mean[k];
        }
        set_range(data, base, k);
    }
    return GONIO_OK;
}

// Residuals below a millionth of the transform's unit are as good as none; without a floor exact data would score -inf.
#define RESIDUAL_FLOOR 1e-6

// Only what was measured judges.
static double channel_score(const gonio_dataset *data, const double *residuals, size_t channel, double *work) {
    const size_t c = (size_t)data->channels, n = data->measured;
    double squares = 0;
    for (size_t i = 0; i < n; i++) {
        work[i] = fabs(residuals[i * c + channel]);
        squares += work[i] * work[i];
    }
    const double rms = log(sqrt(squares / (double)n) + RESIDUAL_FLOOR);
    if (data->kind == GONIO_TRANSFORM_LINEAR) {
        return (1 + gonio_smooth_tuned.median) * rms;
    }
    return rms + gonio_smooth_tuned.median * log(gonio_upper_median(work, n) + gonio_smooth_tuned.median_floor);
}

static double channel_square_error(const gonio_dataset *data, const double *residuals, size_t channel) {
    const size_t c = (size_t)data->channels;
    double sum = 0;
    for (size_t i = 0; i < data->measured; i++) {
        const double t = data->targets[i * c + channel] - residuals[i * c + channel];
        const double d =
            gonio_transform_invert(data->kind, &data->transforms[channel], t) - data->values[i * c + channel];
        sum += d * d;
    }
    return sum / (double)data->measured;
}

gonio_smooth_score gonio_smooth_score_of(const gonio_dataset *data, const double *residuals, double *work) {
    gonio_smooth_score s = {0, 0};
    for (size_t k = 0; k < (size_t)data->channels; k++) {
        s.score += channel_score(data, residuals, k, work) / data->channels;
        s.rmse += channel_square_error(data, residuals, k) / data->channels;
    }
    s.rmse = sqrt(s.rmse);
    return s;
}

// Half decades around 1e-2.5: below 1e-7 a fit interpolates its samples' rounding, above 1e2 only the base is left.
#define LAMBDAS 19
static double grid_lambda(int l) { return pow(10, 0.5 * l - 7); }

static double **residual_rows(int count, size_t length) {
    double **rows = calloc((size_t)count, sizeof *rows);
    double *all = rows != NULL ? malloc((size_t)count * length * sizeof *all) : NULL;
    if (all == NULL) {
        free(rows);
        return NULL;
    }
    for (int l = 0; l < count; l++) {
        rows[l] = all + (size_t)l * length;
    }
    return rows;
}

// residuals[0] becomes those with each channel's own lambda.
static void choose_channels(const gonio_dataset *data, int count, const double *grid, double **residuals,
                            double *lambdas, double *work) {
    const size_t c = (size_t)data->channels;
    for (size_t k = 0; k < c; k++) {
        int best = 0;
        double least = INFINITY;
        for (int l = 0; l < count; l++) {
            const double score = channel_score(data, residuals[l], k, work);
            if (score < least) {
                least = score;
                best = l;
            }
        }
        lambdas[k] = grid[best];
        for (size_t i = 0; i < data->n && best > 0; i++) {
            residuals[0][i * c + k] = residuals[best][i * c + k];
        }
    }
}

// As the model's spline is held, so are the predictions that it is judged by.
static void hold_predictions(const gonio_dataset *data, const gonio_smooth_base *base, int count, double **residuals) {
    const size_t c = (size_t)data->channels;
    for (int l = 0; l < count; l++) {
        for (size_t i = 0; i < data->n * c; i++) {
            const double predicted = fmin(fmax(base->rest[i] - residuals[l][i], base->low[i % c]), base->high[i % c]);
            residuals[l][i] = base->rest[i] - predicted;
        }
    }
}

gonio_status gonio_smooth_choose_lambda(const gonio_smooth_dense *dense, const gonio_dataset *data,
                                        const gonio_smooth_base *base, double fixed, double *lambdas,
                                        gonio_smooth_score *score, gonio_error *error) {
    double grid[LAMBDAS];
    const int count = fixed >= 0 ? 1 : LAMBDAS;
    for (int l = 0; l < count; l++) {
        // Exact interpolation (lambda 0) divides by the rounding of the eigenvalues.
        grid[l] = fixed >= 0 ? fmax(fixed, 1e-12) : grid_lambda(l);
    }
    double **residuals = residual_rows(count, data->n * (size_t)data->channels);
    double *work = malloc(data->n * sizeof *work);
    gonio_status status = residuals != NULL && work != NULL
                              ? gonio_smooth_dense_loo(dense, base->rest, data->channels, count, grid, residuals, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for leave-one-out errors");
    if (status == GONIO_OK) {
        hold_predictions(data, base, count, residuals);
        choose_channels(data, count, grid, residuals, lambdas, work);
        *score = gonio_smooth_score_of(data, residuals[0], work);
    }
    if (residuals != NULL) {
        free(residuals[0]);
    }
    free(residuals);
    free(work);
    return status;
}

gonio_status gonio_smooth_parts_init(gonio_lobe_spline_parts *parts, const gonio_dataset *data,
                                     const gonio_lobe_base *lobes, gonio_coordinates coordinates, gonio_error *error) {
    const size_t c = (size_t)data->channels, strengths = c * (1 + GONIO_LOBES_MAX);
    *parts = (gonio_lobe_spline_parts){.channels = data->channels,
                                       .dims = data->dims,
                                       .coordinates = coordinates,
                                       .kind = data->kind,
                                       .transforms = malloc(c * sizeof *data->transforms)};
    if (lobes != NULL && lobes->lobes > 0) {
        parts->base = *lobes;
        parts->base.strength = malloc(strengths * sizeof(double));
    } else if (lobes != NULL) {
        parts->base = (gonio_lobe_base){.cosine_min = lobes->cosine_min, .grazing = lobes->grazing};
    }
    if (parts->transforms == NULL || (parts->base.lobes > 0 && parts->base.strength == NULL)) {
        gonio_lobe_spline_parts_release(parts);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", c);
    }
    memcpy(parts->transforms, data->transforms, c * sizeof *data->transforms);
    if (parts->base.lobes > 0) {
        memcpy(parts->base.strength, lobes->strength, strengths * sizeof(double));
    }
    return GONIO_OK;
}

gonio_status gonio_smooth_parts_hold(gonio_lobe_spline_parts *parts, const gonio_smooth_base *base,
                                     gonio_error *error) {
    const size_t c = (size_t)parts->channels;
    parts->range = malloc(2 * c * sizeof *parts->range);
    if (parts->range == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", c);
    }
    for (size_t k = 0; k < c; k++) {
        parts->range[2 * k] = base->low[k] + base->mean[k];
        parts->range[2 * k + 1] = base->high[k] + base->mean[k];
    }
    return GONIO_OK;
}

gonio_status gonio_smooth_dense_parts(const gonio_smooth_dense *dense, const gonio_dataset *data,
                                      const gonio_smooth_base *base, const double *lambdas,
                                      gonio_lobe_spline_parts *parts, gonio_error *error) {
    const gonio_coordinates coordinates = gonio_smooth_dense_form(dense)->coordinates;
    gonio_status status = gonio_smooth_parts_init(parts, data, &base->lobes, coordinates, error);
    status = status == GONIO_OK ? gonio_smooth_parts_hold(parts, base, error) : status;
    if (status == GONIO_OK) {
        status = gonio_smooth_dense_solve(dense, base->rest, data->channels, lambdas, &parts->lattice, error);
    }
    if (status == GONIO_OK) {
        status = gonio_smooth_dense_profile_solve(dense, base->rest, data->channels, lambdas, &parts->profile, error);
    }
    if (status == GONIO_OK) {
        status = gonio_smooth_dense_shares_solve(dense, base->rest, data->channels, lambdas, &parts->shares, error);
    }
    if (status != GONIO_OK) {
        gonio_lobe_spline_parts_release(parts);
        return status;
    }
    const size_t c = (size_t)data->channels;
    for (size_t i = 0; i < parts->lattice.count * c; i++) {
        parts->lattice.points[i] = (float)((double)parts->lattice.points[i] + base->mean[i % c]);
    }
    return GONIO_OK;
}
