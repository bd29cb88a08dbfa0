// SPDX-License-Identifier: BSD-3-Clause
#include "scene/needs/search.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FILL_WEIGHT 1e-3  // of the mean over the cells
#define WEIGHT_RANGE 1e-3 // the least weight of a cell, over the mean
#define SIGMA_UNIT 1e-4   // relative sigma that stands for the mean weight: far below what a log's eps follows

gonio_status gonio_search_checkpoint(const search_work *w, const char *what, gonio_error *error) {
    return w->how->progress == NULL || w->how->progress(w->how->progress_context, what)
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; nothing was written");
}

// ---- what smaller models are made of ----

static gonio_status add_told(search_work *w, const gonio_pair *pair, double weight, gonio_error *error) {
    const int channels = w->best->channels;
    double values[channels], sigma[channels], own[channels];
    gonio_model_eval_pair(w->best, pair, values);
    if (!gonio_model_sigma(w->best, gonio_direction(pair->theta_i, pair->phi_i),
                           gonio_direction(pair->theta_o, pair->phi_o), own)) {
        memset(own, 0, sizeof own);
    }
    for (int c = 0; c < channels; c++) {
        values[c] = isfinite(values[c]) ? values[c] : 0;
        own[c] = isfinite(own[c]) ? own[c] : 0;
        sigma[c] = fmax(fabs(values[c]), 1e-12) * SIGMA_UNIT / sqrt(weight);
    }
    return gonio_samples_add(w->told, pair, values, sigma, own, error);
}

static gonio_status fill_told(search_work *w, gonio_error *error) {
    gonio_plan *plan = NULL;
    gonio_needs_facts facts;
    char text[64];
    gonio_needs_describe(w->needs, w->material, &facts);
    const double mean = facts.squares / (double)facts.cells;
    gonio_status status = gonio_samples_new(w->best->channels, true, &w->told, error);
    if (status == GONIO_OK) {
        w->told->isotropic = w->best->isotropic;
        memcpy(w->told->channel_names, w->best->channel_names, (size_t)w->best->channels * GONIO_CHANNEL_NAME_MAX);
        status = gonio_samples_reserve(w->told, w->n_cells + GONIO_SEARCH_FILL, error);
    }
    for (size_t i = 0; i < w->n_cells && status == GONIO_OK; i++) {
        const gonio_pair pair = gonio_pair_from_vectors(w->cells[i].wi, w->cells[i].wo);
        status = add_told(w, &pair, fmax(w->cells[i].squares / mean, WEIGHT_RANGE), error);
    }
    snprintf(text, sizeof text, "nusselt:%d,theta_max=90%s", GONIO_SEARCH_FILL,
             w->best->isotropic ? "" : ",anisotropic=1");
    status = status == GONIO_OK ? gonio_plan_make(text, 1, &plan, error) : status;
    for (size_t i = 0; status == GONIO_OK && i < plan->n; i++) {
        status = add_told(w, &plan->poses[i], FILL_WEIGHT, error);
    }
    gonio_plan_free(plan);
    return status;
}

static gonio_status fill_reference(search_work *w, gonio_error *error) {
    const size_t channels = (size_t)w->best->channels;
    double expected = 0;
    bool told = true;
    gonio_status status = gonio_colour_new(w->best->channels, w->best->channel_names, &w->colour, error);
    w->reference = malloc((3 * w->n_cells + 1) * sizeof *w->reference);
    if (status == GONIO_OK && w->reference == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu cells", w->n_cells);
    }
    for (size_t i = 0; i < w->n_cells && status == GONIO_OK; i++) {
        double sigma[channels], f = 0, s = 0;
        gonio_colour_rgb(&w->colour, w->told->values + i * channels, w->reference + 3 * i);
        told = told && gonio_model_sigma(w->best, w->cells[i].wi, w->cells[i].wo, sigma);
        for (size_t c = 0; c < channels && told; c++) {
            f += fabs(w->told->values[i * channels + c]);
            s += sigma[c];
        }
        // The mean of a normal's absolute value is 0.8 of its standard deviation; beyond 100 % sigma tells no size.
        expected += f > 0 ? w->cells[i].codes * 0.8 * fmin(s / f, 1) : 0;
    }
    w->report->expected = told ? expected : NAN;
    return status;
}

// ---- promises ----

// What the values at the cells promise of the measure.
double gonio_search_promise(const search_work *w, const gonio_model *model) {
    double values[model->channels], sum = 0;
    for (size_t i = 0; i < w->n_cells; i++) {
        double rgb[3], off = 0, size = 0;
        gonio_model_eval(model, w->cells[i].wi, w->cells[i].wo, values);
        gonio_colour_rgb(&w->colour, values, rgb);
        for (int k = 0; k < 3; k++) {
            const double truth = fmax(w->reference[3 * i + (size_t)k], 0), d = fmax(rgb[k], 0) - truth;
            off += d * d;
            size += truth * truth;
        }
        const double relative2 = size > 0 ? off / size : off > 0 ? 1 : 0;
        sum += w->how->image_error > 0 ? w->cells[i].codes * sqrt(relative2) : w->cells[i].squares * relative2;
    }
    return w->how->image_error > 0 ? sum : sqrt(sum);
}

gonio_status gonio_search_tell(search_work *w, gonio_error *error) {
    const gonio_status status = fill_told(w, error);
    return status == GONIO_OK ? fill_reference(w, error) : status;
}
