// SPDX-License-Identifier: BSD-3-Clause
// Thresholded wavelets in three and four dimensions, Lalonde (1997), DeYoung (1996), section 3.2.7;
// brdf/kind/wavelet.c.
//
// Of the coefficients those are kept that matter most for the squared error of the whole table: a detail of step s
// stands for about 2^(s dims) nodes, so its weight is |c| 2^(s dims / 2), |c| over the channels, which share the nodes'
// numbers.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/order_statistic.h"
#include "brdf/kind/wavelet.h"
#include "fit/tables/fill.h"

static const int level_usual[2] = {5, 3};
#define DROP_USUAL 95

static double *weights_of(const gonio_grid *grid, size_t channels, const double *values) {
    double *weights = malloc(grid->count * sizeof *weights);
    for (size_t k = 0; weights != NULL && k < grid->count; k++) {
        double sum = 0;
        for (size_t c = 0; c < channels; c++) {
            sum += values[k * channels + c] * values[k * channels + c];
        }
        weights[k] = sum * exp2(gonio_lifting_step(grid, k) * grid->dims);
    }
    return weights;
}

// The least weight that is kept. Ties are all kept.
static double threshold(const gonio_grid *grid, const double *weights, size_t wanted, gonio_error *error) {
    double *copy = malloc(grid->count * sizeof *copy);
    if (copy == NULL) {
        gonio_fail(error, GONIO_E_MEMORY, "no memory to rank %zu coefficients", grid->count);
        return NAN;
    }
    for (size_t k = 0; k < grid->count; k++) {
        copy[k] = weights[k];
    }
    const double least = gonio_order_statistic(copy, grid->count, grid->count - wanted);
    free(copy);
    return least;
}

static gonio_status keep_largest(gonio_wavelet_parts *parts, const double *values, size_t wanted, gonio_model **out,
                                 gonio_error *error) {
    const size_t channels = (size_t)parts->channels, count = parts->grid.count;
    double *weights = weights_of(&parts->grid, channels, values);
    uint32_t *key = malloc(count * sizeof *key);
    const double least = weights != NULL && key != NULL ? threshold(&parts->grid, weights, wanted, error) : (double)NAN;
    gonio_status status =
        !isnan(least) ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu nodes", count);
    for (size_t k = 0; k < count && status == GONIO_OK; k++) {
        // Those that never were a detail carry the means.
        if ((weights[k] >= least && weights[k] > 0) || gonio_lifting_step(&parts->grid, k) > parts->grid.level) {
            key[parts->keys++] = (uint32_t)k;
        }
    }
    float *kept = status == GONIO_OK ? malloc(parts->keys * channels * sizeof *kept) : NULL;
    for (size_t k = 0; kept != NULL && k < parts->keys * channels; k++) {
        kept[k] = (float)values[key[k / channels] * channels + k % channels];
    }
    if (status == GONIO_OK && kept == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu coefficients", parts->keys);
    }
    parts->key = key;
    parts->values = kept;
    status = status == GONIO_OK ? gonio_wavelet_new(parts, out, error) : status;
    free(weights);
    free(key);
    free(kept);
    return status;
}

static gonio_status fit_filled(const gonio_fill *fill, const gonio_grid *grid, const gonio_samples *samples,
                               const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                               gonio_error *error) {
    const double drop = options->drop_percent >= 0 ? options->drop_percent : DROP_USUAL;
    const size_t wanted = (size_t)fmax(ceil((double)grid->count * (1 - drop / 100)), 1);
    gonio_wavelet_parts parts = {.grid = *grid,
                                 .wavelet = options->wavelet != GONIO_WAVELET_AUTO ? (gonio_wavelet)options->wavelet
                                                                                   : GONIO_WAVELET_CDF53,
                                 .channels = samples->channels,
                                 .kind = fill->data.kind,
                                 .transforms = fill->data.transforms,
                                 .names = (const char(*)[32])samples->channel_names};
    double *values;
    gonio_status status = gonio_fill_grid(fill, grid, &values, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_lifting_forward(parts.wavelet, grid, (size_t)samples->channels, values);
    status = keep_largest(&parts, values, wanted, out, error);
    free(values);
    gonio_fill_describe(fill, grid, report);
    gonio_fill_add(report, " %s kept=%zu", gonio_wavelet_names()[parts.wavelet], parts.keys);
    return status;
}

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    *out = NULL;
    const gonio_grid grid = gonio_fill_grid_of(options, samples->isotropic, level_usual);
    if (grid.count > UINT32_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "level %d; a table of wavelets has at most 2^32 nodes", grid.level);
    }
    if (options->drop_percent > 99.9) {
        return gonio_fail(error, GONIO_E_USAGE, "--drop %g; at most 99.9 per cent of the coefficients may go",
                          options->drop_percent);
    }
    gonio_fill fill;
    gonio_status status = gonio_fill_init(&fill, samples, options, error);
    if (status == GONIO_OK) {
        status = fit_filled(&fill, &grid, samples, options, out, report, error);
        gonio_fill_release(&fill);
    }
    return status;
}

static double memory(const gonio_fit_size *size, double n) { return 2 * gonio_fill_grid_memory(size, n); }

static const gonio_method_option options_of_wavelet[] = {GONIO_METHOD_OPTION(level, "of the grid (5; 3 in 4-D)"),
                                                         GONIO_METHOD_OPTION(domain, "log"),
                                                         GONIO_METHOD_OPTION(grid, NULL),
                                                         GONIO_METHOD_OPTION(fill, NULL),
                                                         GONIO_METHOD_OPTION(wavelet, NULL),
                                                         GONIO_METHOD_OPTION(drop_percent, "of the coefficients (95)"),
                                                         {0}};

static const gonio_method_form forms[] = {
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_DOMAIN_AUTO, "wavelet=haar"},
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_DOMAIN_AUTO, NULL},
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_DOMAIN_AUTO, "drop_percent=99"},
};

const gonio_method gonio_method_wavelet = {
    .name = "wavelet",
    .summary = "the largest wavelet coefficients of a table",
    .kind = "wavelet",
    .options = options_of_wavelet,
    .fit = fit,
    .memory = memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
