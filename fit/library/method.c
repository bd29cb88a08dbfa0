// SPDX-License-Identifier: BSD-3-Clause
#include "fit/library/method.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "gonio/library.h"

#define FEW 12   // samples: less of them cannot be held out to compare by
#define MANY 100 // a quarter of so many is held out once; of less each quarter in its turn
#define FOLDS 4

static gonio_status fit_library(const gonio_library *library, const gonio_samples *samples,
                                const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                                gonio_error *error) {
    gonio_library_report own;
    gonio_library_facts facts;
    const gonio_status status = gonio_library_fit(library, samples, options->threads, out, &own, error);
    if (status == GONIO_OK) {
        gonio_library_tell(library, &facts);
        report->level = 5;
        report->coordinates = GONIO_HALF_VECTOR;
        report->domain = GONIO_LOG;
        gonio_text_append(report->options, sizeof report->options, "prior of %d models, %d components", facts.models,
                          facts.rank);
        gonio_text_append(report->note, sizeof report->note,
                          "left out, samples lie %.3g sigmas (rms) from what prior and others tell, up to %.3g are "
                          "like the library",
                          sqrt(own.residual), sqrt(own.limit));
    }
    return status;
}

typedef struct comparison {
    const gonio_method *method;
    const gonio_library *learnt;
    const gonio_samples *samples;
    const gonio_fit_options *options;
    int *fold;
    bool *which;
    double *predicted[2]; // n x channels: with the prior, without
    int folds;            // that are held out
} comparison;

static gonio_status predict(const comparison *c, bool prior, const gonio_samples *rest, int fold, gonio_error *error) {
    const size_t channels = (size_t)c->samples->channels;
    gonio_model *model = NULL;
    gonio_fit_report unused = {0};
    const gonio_status status = prior ? fit_library(c->learnt, rest, c->options, &model, &unused, error)
                                      : c->method->fit(rest, c->options, &model, &unused, error);
    for (size_t i = 0; i < c->samples->n && status == GONIO_OK; i++) {
        if (c->fold[i] == fold) {
            gonio_model_eval_pair(model, &c->samples->pairs[i], c->predicted[!prior] + i * channels);
        }
    }
    gonio_model_free(model);
    return status;
}

// The geometric mean of median_rel and rms_log: neither the many nor the worst have all the say.
static gonio_status score(const comparison *c, bool prior, double *out, gonio_error *error) {
    gonio_errors errors;
    gonio_status status = GONIO_OK;
    for (int fold = 0; fold < c->folds && status == GONIO_OK; fold++) {
        gonio_samples *rest;
        for (size_t i = 0; i < c->samples->n; i++) {
            c->which[i] = c->fold[i] != fold;
        }
        status = gonio_samples_select(c->samples, c->which, &rest, error);
        status = status == GONIO_OK ? predict(c, prior, rest, fold, error) : status;
        gonio_samples_free(rest);
    }
    for (size_t i = 0; i < c->samples->n; i++) {
        c->which[i] = c->fold[i] < c->folds;
    }
    status = status == GONIO_OK ? gonio_errors_of(c->samples, c->predicted[!prior], c->which, &errors, error) : status;
    *out = status == GONIO_OK ? sqrt(errors.median_rel * errors.rms_log) : NAN;
    return status;
}

static gonio_status decide(const comparison *c, bool *prior, gonio_fit_report *report, gonio_error *error) {
    double with, without;
    gonio_error why = {0};
    gonio_status status = gonio_samples_folds(c->samples, FOLDS, c->options->seed, c->fold, error);
    if (status == GONIO_OK) {
        status = score(c, true, &with, &why);
        status =
            status == GONIO_OK || status == GONIO_E_MISMATCH ? GONIO_OK : gonio_fail(error, status, "%s", why.message);
    }
    status = status == GONIO_OK ? score(c, false, &without, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    *prior = with < without;
    if (isnan(with)) {
        gonio_text_append(report->note, sizeof report->note, "the prior was not used: %s", why.message);
    } else {
        gonio_text_append(report->note, sizeof report->note,
                          "held out, samples lie %.3g from a fit with the prior, %.3g without it (geometric mean of "
                          "median_rel and rms_log): it was%s used",
                          with, without, *prior ? "" : " not");
    }
    return GONIO_OK;
}

// Which of the two tells held-out samples better?
static gonio_status compare(const gonio_method *method, const gonio_library *library, const gonio_samples *samples,
                            const gonio_fit_options *options, bool *prior, gonio_fit_report *report,
                            gonio_error *error) {
    const size_t count = samples->n * (size_t)samples->channels;
    double *predicted = calloc(2 * count + 1, sizeof *predicted);
    comparison c = {.method = method,
                    .learnt = library,
                    .samples = samples,
                    .options = options,
                    .fold = malloc((samples->n + 1) * sizeof *c.fold),
                    .which = malloc((samples->n + 1) * sizeof *c.which),
                    .predicted = {predicted, predicted != NULL ? predicted + count : NULL},
                    .folds = samples->n < MANY ? FOLDS : 1};
    const gonio_status status =
        c.fold != NULL && c.which != NULL && predicted != NULL
            ? decide(&c, prior, report, error)
            : gonio_fail(error, GONIO_E_MEMORY, "no memory to compare fits of %zu samples", samples->n);
    free(c.fold);
    free(c.which);
    free(predicted);
    return status;
}

// What was said before the fit, whose own note comes behind it.
static void prepend(const char *said, gonio_fit_report *report) {
    char own[sizeof report->note];
    memcpy(own, report->note, sizeof own);
    report->note[0] = 0;
    gonio_text_append(report->note, sizeof report->note, "%s%s%s", said, said[0] != 0 && own[0] != 0 ? "; " : "", own);
}

gonio_status gonio_library_method(const gonio_method *method, const gonio_samples *samples,
                                  const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                                  gonio_error *error) {
    gonio_library *library;
    gonio_fit_report said = {0};
    bool prior = true;
    *out = NULL;
    gonio_status status = gonio_library_open(options->prior, &library, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (samples->n > GONIO_LIBRARY_SAMPLES_MAX) {
        prior = false;
        gonio_text_append(said.note, sizeof said.note, "the prior was not used: so many samples need none");
    } else if (samples->n >= FEW) {
        status = compare(method, library, samples, options, &prior, &said, error);
    }
    if (status == GONIO_OK) {
        char why[sizeof report->note];
        snprintf(why, sizeof why, "%s", report->note);
        status = prior ? fit_library(library, samples, options, out, report, error)
                       : method->fit(samples, options, out, report, error);
        if (!prior) { // a method's note is its own
            gonio_text_append(why, sizeof why, "%s%s", report->note[0] != 0 ? "; " : "", report->note);
            snprintf(report->note, sizeof report->note, "%s", why);
        }
    }
    if (status == GONIO_OK) {
        prepend(said.note, report);
    }
    gonio_library_free(library);
    return status;
}
