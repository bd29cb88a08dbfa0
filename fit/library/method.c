// SPDX-License-Identifier: BSD-3-Clause
#include "fit/library/method.h"

#include <math.h>
#include <stdlib.h>

#include "base/text.h"
#include "gonio/library.h"

#define FEW 60        // samples: less of them cannot be held out to compare by
#define HELD_OUT 0.25 // of more

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
                          "%sleft out, samples lie %.3g sigmas (rms) from what prior and others tell, up to %.3g are "
                          "like the library",
                          report->note[0] != 0 ? "; " : "", sqrt(own.residual), sqrt(own.limit));
    }
    return status;
}

// The median relative error of a fit of the samples that are not held, on those that are.
static gonio_status try_fit(const gonio_method *method, const gonio_library *library, const gonio_samples *samples,
                            const gonio_samples *rest, const bool *held, const gonio_fit_options *options,
                            double *median_rel, gonio_error *error) {
    gonio_model *model = NULL;
    gonio_fit_report unused = {0};
    gonio_errors errors;
    gonio_status status = library != NULL ? fit_library(library, rest, options, &model, &unused, error)
                                          : method->fit(rest, options, &model, &unused, error);
    status = status == GONIO_OK ? gonio_errors_model(model, samples, held, options->threads, &errors, error) : status;
    *median_rel = status == GONIO_OK ? errors.median_rel : NAN;
    gonio_model_free(model);
    return status;
}

// Which of the two tells held-out samples better? error: what is wrong with the sample to the library, if that is it.
static gonio_status compare(const gonio_method *method, const gonio_library *library, const gonio_samples *samples,
                            const gonio_fit_options *options, bool *prior, gonio_fit_report *report,
                            gonio_error *error) {
    bool *held = malloc(2 * samples->n * sizeof *held);
    gonio_samples *rest = NULL;
    double with = NAN, without = NAN;
    gonio_error why = {0};
    gonio_status status =
        held != NULL ? gonio_samples_hold_out(samples, HELD_OUT, options->seed, held, error)
                     : gonio_fail(error, GONIO_E_MEMORY, "no memory to compare fits of %zu samples", samples->n);
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        held[samples->n + i] = !held[i];
    }
    status = status == GONIO_OK ? gonio_samples_select(samples, held + samples->n, &rest, error) : status;
    if (status == GONIO_OK) {
        const gonio_status fitted = try_fit(method, library, samples, rest, held, options, &with, &why);
        status = fitted == GONIO_OK || fitted == GONIO_E_MISMATCH
                     ? try_fit(method, NULL, samples, rest, held, options, &without, error)
                     : gonio_fail(error, fitted, "%s", why.message);
    }
    *prior = with < without;
    if (status == GONIO_OK && isnan(with)) {
        gonio_text_append(report->note, sizeof report->note, "the prior was not used: %s", why.message);
    } else if (status == GONIO_OK) {
        gonio_text_append(report->note, sizeof report->note,
                          "held-out median_rel with the prior %.3g, without it %.3g: %s", with, without,
                          *prior ? "it was used" : "it was not used");
    }
    gonio_samples_free(rest);
    free(held);
    return status;
}

gonio_status gonio_library_method(const gonio_method *method, const gonio_samples *samples,
                                  const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                                  gonio_error *error) {
    gonio_library *library;
    bool prior = true;
    *out = NULL;
    gonio_status status = gonio_library_open(options->prior, &library, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (samples->n > GONIO_LIBRARY_SAMPLES_MAX) {
        prior = false;
        gonio_text_append(report->note, sizeof report->note, "the prior was not used: so many samples need none");
    } else if (samples->n >= FEW) {
        status = compare(method, library, samples, options, &prior, report, error);
    }
    if (status == GONIO_OK) {
        status = prior ? fit_library(library, samples, options, out, report, error)
                       : method->fit(samples, options, out, report, error);
    }
    gonio_library_free(library);
    return status;
}
