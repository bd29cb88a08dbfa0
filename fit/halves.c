// SPDX-License-Identifier: BSD-3-Clause
#include "fit/halves.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "fit/library/method.h"

static bool has_halves(const gonio_samples *samples) {
    return samples->transmission && gonio_samples_halves(samples) != 1u << GONIO_REFLECTION;
}

// What a half may take of the limits that hold for the whole.
static gonio_fit_options share_of(const gonio_fit_options *options, double share) {
    gonio_fit_options o = *options;
    o.max_seconds *= share;
    o.max_bytes = (size_t)((double)o.max_bytes * share);
    return o;
}

static void tell(gonio_half half, const gonio_fit_report *own, gonio_fit_report *report) {
    if (report->coordinates == GONIO_COORDINATES_AUTO) { // the first
        report->level = own->level;
        report->coordinates = own->coordinates;
        report->domain = own->domain;
        memcpy(report->options, own->options, sizeof report->options);
    }
    report->fill_seconds += own->fill_seconds;
    memcpy(report->half[half].options, own->options, sizeof own->options);
    if (own->note[0] != 0) {
        gonio_text_append(report->note, sizeof report->note, "%s%s: %s", report->note[0] != 0 ? "; " : "",
                          gonio_half_name(half), own->note);
    }
}

static gonio_status fit_half(const gonio_method *method, const gonio_samples *samples, gonio_half half,
                             const gonio_fit_options *options, gonio_model **model, gonio_fit_report *report,
                             gonio_error *error) {
    gonio_samples *raised;
    gonio_status status = gonio_samples_half(samples, half, NULL, &raised, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_fit_options o = share_of(options, (double)raised->n / (double)samples->n);
    gonio_fit_report own = {0};
    gonio_error why = {.line = -1, .byte = -1};
    status = method->fit(raised, &o, model, &own, &why);
    gonio_samples_free(raised);
    if (status == GONIO_OK) {
        tell(half, &own, report);
        return status;
    }
    *model = NULL;
    return gonio_fail(error, status, "%s: %s", gonio_half_name(half), why.message);
}

gonio_status gonio_fit_halves(const gonio_method *method, const gonio_samples *samples,
                              const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                              gonio_error *error) {
    if (!has_halves(samples)) {
        return options->prior[0] != 0 ? gonio_library_method(method, samples, options, out, report, error)
                                      : method->fit(samples, options, out, report, error);
    }
    *out = NULL;
    if (options->prior[0] != 0) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "a prior is of reflection; these samples are of transmission too");
    }
    const unsigned halves = gonio_samples_halves(samples);
    gonio_model *models[GONIO_HALVES] = {NULL};
    gonio_status status = gonio_samples_check(samples, error);
    report->coordinates = GONIO_COORDINATES_AUTO;
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        if (halves >> h & 1) {
            status = fit_half(method, samples, (gonio_half)h, options, &models[h], report, error);
        }
    }
    status = status == GONIO_OK ? gonio_model_of_halves(models, out, error) : status;
    for (int h = 0; h < GONIO_HALVES && status != GONIO_OK; h++) {
        gonio_model_free(models[h]);
    }
    return status;
}

static gonio_status errors_of(const gonio_samples *samples, const gonio_model *model, const double *predicted,
                              const bool *which, int threads, gonio_half_report *half, bool *mask, size_t n,
                              gonio_error *error) {
    if (model != NULL) {
        half->samples = n;
        return gonio_errors_model(model, samples, mask, threads, &half->train, error);
    }
    half->held_out = (gonio_errors){NAN, NAN, NAN, NAN, NAN, NAN, 0};
    for (size_t i = 0; i < samples->n && which != NULL; i++) {
        mask[i] = mask[i] && which[i];
    }
    return which != NULL ? gonio_errors_of(samples, predicted, mask, &half->held_out, error) : GONIO_OK;
}

gonio_status gonio_halves_errors(const gonio_samples *samples, const gonio_model *model, const double *predicted,
                                 const bool *which, int threads, gonio_fit_report *report, gonio_error *error) {
    if (!has_halves(samples)) {
        return GONIO_OK;
    }
    bool *mask = malloc(samples->n * sizeof *mask);
    gonio_status status =
        mask != NULL ? GONIO_OK
                     : gonio_fail(error, GONIO_E_MEMORY, "no memory for the errors of %zu samples", samples->n);
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        gonio_samples *raised;
        status = gonio_samples_half(samples, (gonio_half)h, mask, &raised, error);
        if (status == GONIO_OK && raised->n > 0) {
            status = errors_of(samples, model, predicted, which, threads, &report->half[h], mask, raised->n, error);
        }
        gonio_samples_free(raised);
    }
    free(mask);
    return status;
}
