// SPDX-License-Identifier: BSD-3-Clause
// The driver around every method: options, the saved model's fit, held-out figures from fits that did not see them.
#include "gonio/fit.h"
#include "base/clock.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/halves.h"
#include "fit/memory.h"
#include "fit/options.h"

static gonio_status unknown_method(const char *name, gonio_error *error) {
    char list[1024] = "";
    for (const char *const *m = gonio_fit_methods(); *m != NULL; m++) {
        snprintf(list + strlen(list), sizeof list - strlen(list), " %s", *m);
    }
    return gonio_fail(error, GONIO_E_USAGE, "unknown method '%s'; there are:%s", name, list);
}

// Which part each sample falls in: part[i] in 0 .. *parts - 1 is held out in its turn, -1 never. *parts 0: no hold-out.
static gonio_status split(const gonio_samples *samples, const gonio_fit_options *o, int *part, int *parts,
                          gonio_error *error) {
    *parts = 0;
    if (o->folds >= 2) {
        *parts = o->folds;
        return gonio_samples_folds(samples, o->folds, o->seed, part, error);
    }
    if (o->hold_out == 0) {
        return GONIO_OK;
    }
    bool *held = malloc(samples->n * sizeof *held);
    if (held == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to hold samples out");
    }
    const gonio_status status = gonio_samples_hold_out(samples, o->hold_out, o->seed, held, error);
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        part[i] = held[i] ? 0 : -1;
        *parts = 1;
    }
    free(held);
    return status;
}

typedef struct parts_fit {
    const gonio_samples *samples;
    const gonio_method *method;
    const int *part;
    bool *which;       // scratch, then: which samples were predicted
    double *predicted; // n x channels
} parts_fit;

// Tell how far the work is and ask whether to go on.
static gonio_status checkpoint(const gonio_fit_options *options, double fraction, const char *what,
                               gonio_error *error) {
    if (options->progress != NULL && !options->progress(options->progress_context, fraction, what, NAN)) {
        return gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; nothing was written");
    }
    return GONIO_OK;
}

// Fit without part `index` and predict it.
static gonio_status predict_part(const parts_fit *f, const gonio_fit_options *options, int index, size_t *held,
                                 gonio_error *error) {
    const gonio_samples *all = f->samples;
    *held = 0;
    for (size_t i = 0; i < all->n; i++) {
        f->which[i] = f->part[i] != index;
        *held += !f->which[i];
    }
    if (*held == 0 || *held == all->n) {
        *held = 0;
        return GONIO_OK;
    }
    gonio_samples *rest;
    gonio_status status = gonio_samples_select(all, f->which, &rest, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_model *model = NULL;
    gonio_fit_report unused = {0};
    status = gonio_fit_halves(f->method, rest, options, &model, &unused, error);
    gonio_samples_free(rest);
    for (size_t i = 0; i < all->n && status == GONIO_OK; i++) {
        if (f->part[i] == index) {
            gonio_model_eval_pair(model, &all->pairs[i], f->predicted + i * (size_t)all->channels);
        }
    }
    gonio_model_free(model);
    return status;
}

// report: NULL, or where the errors of each half go too.
static gonio_status held_out_errors(const gonio_samples *samples, const gonio_method *method,
                                    const gonio_fit_options *options, gonio_errors *out, gonio_fit_report *report,
                                    gonio_error *error) {
    *out = (gonio_errors){NAN, NAN, NAN, NAN, NAN, NAN, 0};
    int parts = 0, *part = malloc(samples->n * sizeof *part);
    parts_fit f = {samples, method, part, malloc(samples->n * sizeof(bool)),
                   calloc(samples->n * (size_t)samples->channels, sizeof(double))};
    gonio_status status = GONIO_OK;
    if (part == NULL || f.which == NULL || f.predicted == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for held-out predictions of %zu samples", samples->n);
    } else {
        status = split(samples, options, part, &parts, error);
    }
    size_t predicted = 0;
    for (int index = 0; index < parts && status == GONIO_OK; index++) {
        size_t held;
        status = checkpoint(options, (double)index / parts, "held-out fits", error);
        if (status == GONIO_OK) {
            status = predict_part(&f, options, index, &held, error);
            predicted += held;
        }
    }
    if (status == GONIO_OK && predicted > 0) {
        for (size_t i = 0; i < samples->n; i++) {
            f.which[i] = part[i] >= 0;
        }
        status = gonio_errors_of(samples, f.predicted, f.which, out, error);
    }
    if (status == GONIO_OK && report != NULL) {
        status = gonio_halves_errors(samples, NULL, f.predicted, predicted > 0 ? f.which : NULL, options->threads,
                                     report, error);
    }
    free(part);
    free(f.which);
    free(f.predicted);
    return status;
}

static bool holds_out(const gonio_fit_options *o) { return o->hold_out > 0 || o->folds >= 2; }

// The smallest level whose held-out RMSE (training, without a hold-out) meets the tolerance.
static gonio_status meet_tolerance(const gonio_samples *samples, const gonio_method *method, gonio_fit_options *options,
                                   gonio_error *error) {
    const bool held = holds_out(options);
    double best = INFINITY;
    for (int level = 0; level <= GONIO_LEVEL_MAX; level++) {
        options->level = level;
        gonio_errors errors;
        gonio_status status = gonio_fit_check_options(samples, options, level, error);
        if (status != GONIO_OK) {
            break; // a finer level does not fit
        }
        if (held) {
            status = held_out_errors(samples, method, options, &errors, NULL, error);
        } else {
            gonio_model *model = NULL;
            gonio_fit_report unused = {0};
            status = gonio_fit_halves(method, samples, options, &model, &unused, error);
            if (status == GONIO_OK) {
                status = gonio_errors_model(model, samples, NULL, options->threads, &errors, error);
            }
            gonio_model_free(model);
        }
        if (status == GONIO_E_MEMORY || status == GONIO_E_RANGE) {
            break; // a finer level does not fit
        }
        if (status != GONIO_OK) {
            return status;
        }
        if (errors.rmse <= options->tolerance) {
            return GONIO_OK;
        }
        // Once every sample has its cells to itself, finer levels repeat the same answer in eight times the memory.
        if (level >= 5 && errors.rmse > 0.999 * best) {
            break;
        }
        best = fmin(best, errors.rmse);
    }
    return gonio_fail(error, GONIO_E_CONVERGENCE, "no level reaches a %s RMSE of %g; the best reached %g",
                      held ? "held-out" : "training", options->tolerance, best);
}

static void append_note(gonio_fit_report *report, const char *text) {
    const size_t length = strlen(report->note);
    snprintf(report->note + length, sizeof report->note - length, "%s%s", length > 0 ? "; " : "", text);
}

static gonio_status fit_all(const gonio_samples *samples, const gonio_method *method, const gonio_fit_options *options,
                            gonio_model **out, gonio_fit_report *report, gonio_error *error) {
    const double start = gonio_clock_s();
    gonio_status status = gonio_fit_halves(method, samples, options, out, report, error);
    if (status != GONIO_OK) {
        return status;
    }
    report->fit_seconds = gonio_clock_s() - start + report->fill_seconds;
    snprintf(report->method, sizeof report->method, "%s", method->name);
    report->samples = samples->n;
    report->channels = samples->channels;
    report->control_points = (*out)->control_points;
    report->bytes = (*out)->bytes;
    status = gonio_errors_model(*out, samples, NULL, options->threads, &report->train, error);
    status =
        status == GONIO_OK ? gonio_halves_errors(samples, *out, NULL, NULL, options->threads, report, error) : status;
    if (status == GONIO_OK) {
        status = held_out_errors(samples, method, options, &report->held_out, report, error);
    }
    if (status != GONIO_OK) {
        gonio_model_free(*out);
        *out = NULL;
    }
    return status;
}

// The level that is certain to be fitted; 0 where the method chooses.
static int given_level(const gonio_fit_options *o) { return o->level >= 0 ? o->level : 0; }

static void note_errors(const gonio_fit_options *o, bool searched, gonio_fit_report *report) {
    if (searched) {
        append_note(report, holds_out(o) ? "the smallest level whose held-out RMSE meets the tolerance"
                                         : "the smallest level whose training RMSE meets the tolerance");
    }
    if (report->held_out.samples == 0 && holds_out(o)) {
        append_note(report, "too few geometries to hold any out");
    }
}

static gonio_status fit_set(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                            gonio_fit_report *report, gonio_error *error) {
    gonio_fit_options o = *options;
    const gonio_method *method = gonio_fit_method_of(&o);
    if (method == NULL) {
        return unknown_method(o.method, error);
    }
    o.method = method->name;
    gonio_status status = gonio_fit_options_check(&o, method, error);
    if (status == GONIO_OK && samples->n == 0) {
        status = gonio_fail(error, GONIO_E_INPUT, "no samples: a fit needs at least one");
    }
    if (status == GONIO_OK) {
        status = gonio_fit_check_options(samples, &o, given_level(&o), error);
    }
    const bool search = o.tolerance > 0 && o.level == GONIO_LEVEL_AUTO;
    if (status == GONIO_OK && search) {
        status = meet_tolerance(samples, method, &o, error);
    }
    if (status == GONIO_OK) {
        status = fit_all(samples, method, &o, out, report, error);
    }
    if (status == GONIO_OK) {
        note_errors(&o, search, report);
    }
    return status;
}

// ---- sets of several sessions ----

static bool several_groups(const gonio_samples *samples) {
    for (size_t i = 1; samples->group != NULL && samples->sigma_random != NULL && i < samples->n; i++) {
        if (samples->group[i] != samples->group[0]) {
            return true;
        }
    }
    return false;
}

// Within one session what is common to its samples cannot tell one from another. Between sessions it can: each
// session's common error is a draw of its own, so a sample weighs by all of its uncertainty. (That the draw is shared
// by the samples of a session is left out: the weights would no longer be a number a sample.)
static gonio_status fit_groups(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                               gonio_fit_report *report, gonio_error *error) {
    bool *all = malloc((samples->n + 1) * sizeof *all);
    gonio_samples *copy = NULL;
    if (all == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", samples->n);
    }
    memset(all, true, samples->n * sizeof *all);
    gonio_status status = gonio_samples_select(samples, all, &copy, error);
    free(all);
    for (size_t k = 0; status == GONIO_OK && k < copy->n * (size_t)copy->channels; k++) {
        copy->sigma_random[k] = hypot(copy->sigma_random[k], copy->sigma_systematic[k]);
        copy->sigma_systematic[k] = 0;
    }
    status = status == GONIO_OK ? fit_set(copy, options, out, report, error) : status;
    gonio_samples_free(copy);
    return status;
}

// A sigma that every sample of a channel has tells no sample from another: most often it is a default or a placeholder,
// and its size must change no answer. The set without it borrows the samples' arrays.
static gonio_samples without_common_sigma(const gonio_samples *samples) {
    gonio_samples plain = *samples;
    const size_t c = (size_t)samples->channels;
    bool common = samples->sigma_random != NULL;
    for (size_t i = 1; i < samples->n && common; i++) {
        common = memcmp(samples->sigma_random, samples->sigma_random + i * c, c * sizeof(double)) == 0;
    }
    if (common) {
        plain.sigma_random = plain.sigma_systematic = NULL;
    }
    return plain;
}

gonio_status gonio_fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                       gonio_fit_report *report, gonio_error *error) {
    *out = NULL;
    gonio_fit_report own;
    report = report != NULL ? report : &own;
    *report = (gonio_fit_report){0};
    const gonio_samples plain = without_common_sigma(samples);
    gonio_status status = several_groups(samples) ? fit_groups(samples, options, out, report, error)
                                                  : fit_set(&plain, options, out, report, error);
    if (status == GONIO_OK && (status = gonio_model_tell(*out, samples->head, error)) != GONIO_OK) {
        gonio_model_free(*out);
        *out = NULL;
    }
    return status;
}
