// SPDX-License-Identifier: BSD-3-Clause
// k-separable sums by singular values, DeYoung (1996), section 4.2.4; Kautz and McCool (1999) on half and difference
// vectors; brdf/kind/separable.c. Every channel has its own decomposition.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "brdf/kind/separable.h"
#include "fit/tables/fill.h"
#include "fit/tables/low_rank.h"

static const int level_usual[2] = {5, 3};
#define TERMS_USUAL 5 // DeYoung's velvet

typedef struct work {
    const gonio_grid *grid;
    const double *values;
    size_t channels, terms, rows, columns;
    float *left, *right;
    double *rests; // [channels]
} work;

static gonio_status decompose(void *context, size_t channel, gonio_error *error) {
    const work *w = context;
    double *a = malloc(w->rows * w->columns * sizeof *a);
    double *left = malloc(w->terms * w->rows * sizeof *left), *right = malloc(w->terms * w->columns * sizeof *right);
    gonio_status status =
        a != NULL && left != NULL && right != NULL
            ? GONIO_OK
            : gonio_fail(error, GONIO_E_MEMORY, "no memory for a matrix of %zu x %zu", w->rows, w->columns);
    for (size_t k = 0; status == GONIO_OK && k < w->rows * w->columns; k++) {
        a[k] = w->values[k * w->channels + channel];
    }
    status = status == GONIO_OK
                 ? gonio_low_rank(w->rows, w->columns, a, w->terms, left, right, &w->rests[channel], error)
                 : status;
    for (size_t k = 0; status == GONIO_OK && k < w->terms; k++) {
        for (size_t i = 0; i < w->rows; i++) {
            w->left[(i * w->terms + k) * w->channels + channel] = (float)left[k * w->rows + i];
        }
        for (size_t j = 0; j < w->columns; j++) {
            w->right[(j * w->terms + k) * w->channels + channel] = (float)right[k * w->columns + j];
        }
    }
    free(a);
    free(left);
    free(right);
    return status;
}

static gonio_status make(const gonio_fill *fill, const work *w, const gonio_samples *samples, gonio_model **out,
                         gonio_fit_report *report, gonio_error *error) {
    double rest = 0;
    for (size_t c = 0; c < w->channels; c++) {
        rest += w->rests[c] * w->rests[c] / (double)w->channels;
    }
    const gonio_separable_parts parts = {.grid = *w->grid,
                                         .terms = (int)w->terms,
                                         .channels = (int)w->channels,
                                         .kind = fill->data.kind,
                                         .transforms = fill->data.transforms,
                                         .names = (const char(*)[32])samples->channel_names,
                                         .left = w->left,
                                         .right = w->right};
    gonio_fill_describe(fill, w->grid, report);
    gonio_fill_add(report, " k=%zu rest=%.2g", w->terms, sqrt(rest));
    return gonio_separable_new(&parts, out, error);
}

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    *out = NULL;
    const gonio_grid grid = gonio_fill_grid_of(options, samples->isotropic, level_usual);
    if (options->order == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "--order 0; a sum has at least one product");
    }
    work w = {.grid = &grid,
              .channels = (size_t)samples->channels,
              .terms = options->order != GONIO_ORDER_AUTO ? (size_t)options->order : TERMS_USUAL,
              .columns = gonio_grid_columns_n(&grid)};
    w.rows = grid.count / w.columns;
    w.terms = w.terms > w.rows ? w.rows : w.terms;
    gonio_fill fill;
    gonio_status status = gonio_fill_init(&fill, samples, options, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *values = NULL;
    status = gonio_fill_grid(&fill, &grid, &values, error);
    w.values = values;
    w.left = malloc(w.rows * w.terms * w.channels * sizeof *w.left);
    w.right = malloc(w.columns * w.terms * w.channels * sizeof *w.right);
    w.rests = calloc(w.channels, sizeof *w.rests);
    if (status == GONIO_OK && (w.left == NULL || w.right == NULL || w.rests == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu products", w.terms);
    }
    status = status == GONIO_OK ? gonio_pool_try(options->threads, w.channels, decompose, &w, error) : status;
    status = status == GONIO_OK ? make(&fill, &w, samples, out, report, error) : status;
    free(values);
    free(w.left);
    free(w.right);
    free(w.rests);
    gonio_fill_release(&fill);
    return status;
}

static double memory(const gonio_fit_size *size, double n) {
    const gonio_grid grid = gonio_grid_of(GONIO_GRID_ANGLES, size->dims, size->level);
    const double threads = size->threads > 0 ? size->threads : 64, columns = (double)gonio_grid_columns_n(&grid);
    return gonio_fill_grid_memory(size, n) +
           fmin(threads, size->channels) * ((double)grid.count * 8 + 1e6 + columns * 1000) +
           columns * GONIO_ORDER_MAX * size->channels * 16;
}

static const gonio_method_option options_of_separable[] = {GONIO_METHOD_OPTION(level, "of the grid (5; 3 in 4-D)"),
                                                           GONIO_METHOD_OPTION(domain, "log"),
                                                           GONIO_METHOD_OPTION(grid, NULL),
                                                           GONIO_METHOD_OPTION(fill, NULL),
                                                           GONIO_METHOD_OPTION(order, "number of products (5)"),
                                                           {0}};

static const gonio_method_form forms[] = {
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_LINEAR, "grid=angles"},
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_METHOD_EVERY, NULL},
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_LOG, "order=2"},
};

const gonio_method gonio_method_separable = {
    .name = "separable",
    .summary = "sums of products of two tables, by singular values",
    .kind = "separable",
    .options = options_of_separable,
    .fit = fit,
    .memory = memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
