// SPDX-License-Identifier: BSD-3-Clause
// All samples -> final samples and model.
//
// The pointing term of a sample's uncertainty needs the BRDF's slope there, and the slope needs a fit: so a first fit
// gives the slopes, and the model that is saved is fitted to the samples with their full uncertainty.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "host/acquire/adaptive.h"

// A step's samples to the end of all; *clock_s: the nominal clock of every one, when its step was done.
static gonio_status append(gonio_samples *all, const gonio_samples *set, double step_clock_s, double **clock_s,
                           gonio_error *error) {
    double *larger = realloc(*clock_s, (all->n + set->n + 1) * sizeof *larger);
    if (larger == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", all->n + set->n);
    }
    *clock_s = larger;
    gonio_status status = GONIO_OK;
    for (size_t k = 0; status == GONIO_OK && k < set->n; k++) {
        const size_t c = k * (size_t)set->channels;
        larger[all->n] = step_clock_s;
        status = gonio_samples_add(all, &set->pairs[k], set->values + c, set->sigma_random + c,
                                   set->sigma_systematic + c, error);
    }
    return status;
}

// Every step's samples in order: from sets, which are released as they are joined (there may be millions), or, without
// sets, from the journal.
static gonio_status join(gonio_session *session, const gonio_process *process, gonio_samples **sets, gonio_samples *all,
                         double **clock_s, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < process->n; i++) {
        const gonio_step *step = &process->steps[i];
        gonio_samples *set = NULL;
        if (sets != NULL) {
            set = sets[i];
            sets[i] = NULL;
        } else if (step->kind == GONIO_STEP_SAMPLE && step->done) {
            status = gonio_session_step_samples(session, step->index, &set, error);
        }
        status = status == GONIO_OK && set != NULL ? append(all, set, step->clock_end_s, clock_s, error) : status;
        gonio_samples_free(set);
    }
    return status;
}

// Correct what the second reference tells. *changed: the values are others than those that were streamed.
static gonio_status correct_drift(gonio_session *session, gonio_process *process, const double *clock_s,
                                  gonio_outcome *out, bool *changed, gonio_error *error) {
    *changed = false;
    out->drift_ratio = NAN;
    bool any;
    gonio_status status = gonio_process_late_references(session, process, &any, error);
    if (status != GONIO_OK || !any) {
        return status;
    }
    const size_t bytes = out->samples->n * (size_t)out->samples->channels * sizeof(double);
    double *before = malloc(bytes + 1);
    if (before == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", out->samples->n);
    }
    memcpy(before, out->samples->values, bytes);
    status = gonio_calib_drift(process->calib, clock_s, out->samples, &out->drift_ratio, error);
    *changed = memcmp(before, out->samples->values, bytes) != 0;
    free(before);
    return status;
}

// A sample that turns out not to be like the library of its prior is fitted without.
static gonio_status fit_final(const gonio_samples *samples, const gonio_fit_options *options, gonio_outcome *out,
                              gonio_error *error) {
    gonio_error why = {.line = -1, .byte = -1};
    gonio_status status = gonio_fit(samples, options, &out->model, &out->fit, &why);
    if (status == GONIO_E_MISMATCH && options->prior[0] != 0) {
        gonio_fit_options without = *options;
        without.prior[0] = 0;
        status = gonio_fit(samples, &without, &out->model, &out->fit, error);
        gonio_text_append(out->fit.note, sizeof out->fit.note, "%sthe prior was not used: %s",
                          out->fit.note[0] != 0 ? "; " : "", why.message);
    } else if (status != GONIO_OK && error != NULL) {
        *error = why;
    }
    return status;
}

static gonio_status fit_twice(const gonio_process *process, gonio_fit_stream *stream, const gonio_fit_options *options,
                              gonio_outcome *out, gonio_error *error) {
    gonio_model *first;
    gonio_fit_options slope = gonio_setup_slope_fit(&process->setup);
    slope.threads = options->threads;
    slope.progress = options->progress;
    slope.progress_context = options->progress_context;
    gonio_status status = stream != NULL ? gonio_fit_stream_finish(stream, &first, &out->fit, error)
                                         : gonio_fit(out->samples, &slope, &first, &out->fit, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_calib_pointing(&process->setup.facts, first, out->samples, error);
    gonio_model_free(first);
    return status == GONIO_OK ? fit_final(out->samples, options, out, error) : status;
}

// The model's own words go into its file, and so into its checksum.
static gonio_status describe(gonio_outcome *out, gonio_error *error) {
    gonio_coverage coverage;
    const gonio_status status = gonio_coverage_of(out->samples, &coverage, error);
    return status == GONIO_OK ? gonio_model_describe(out->model, &coverage, &out->fit, error) : status;
}

static void count(const gonio_process *process, gonio_outcome *out) {
    for (size_t i = 0; i < process->n; i++) {
        out->poses += process->steps[i].kind == GONIO_STEP_SAMPLE && process->steps[i].done;
        out->frames += (size_t)process->steps[i].frames;
    }
    gonio_edges_report edges;
    gonio_scan_edges(&process->setup, process->steps, process->n, &edges);
    out->edges_excluded = edges.excluded;
    out->edges_spilled = edges.spilled;
}

// What an adaptive plan came to; nothing of others.
static gonio_status report_plan(gonio_session *session, const gonio_process *process, gonio_outcome *out,
                                gonio_error *error) {
    char *plan;
    gonio_adaptive a = {0};
    gonio_status status = gonio_session_find(session, "plan", &plan, error);
    if (status == GONIO_OK && plan != NULL && gonio_adaptive_is(plan)) {
        status = gonio_adaptive_get(session, process->steps, process->n, &a, error);
        status = status == GONIO_OK ? gonio_adaptive_figures(&a, &out->adaptive, error) : status;
    }
    gonio_adaptive_release(&a);
    free(plan);
    return status;
}

static gonio_status save(gonio_session *session, const gonio_finish_options *options, gonio_outcome *out,
                         gonio_error *error) {
    gonio_status status = GONIO_OK;
    if (options->replaces != NULL) {
        status = gonio_session_make_way(session, options->replaces, "a model was fitted anew", error);
    } else if (options->keep_old) {
        status = gonio_session_keep_file(options->model_path, error);
    }
    status = status == GONIO_OK ? gonio_model_save(out->model, options->model_path, error) : status;
    status = status == GONIO_OK ? gonio_sha256_file(options->model_path, out->model_sha256, error) : status;
    return status == GONIO_OK ? gonio_sha256_samples(out->samples, out->samples_sha256, error) : status;
}

gonio_status gonio_finish(gonio_session *session, gonio_process *process, const gonio_finish_options *options,
                          gonio_outcome *out, gonio_error *error) {
    *out = (gonio_outcome){.drift_ratio = NAN};
    double *clock_s = NULL;
    bool changed = false;
    count(process, out);
    gonio_status status = gonio_process_new_samples(process, &out->samples, error);
    status = status == GONIO_OK ? gonio_session_head(session, &out->samples->head, error) : status;
    status = status == GONIO_OK ? report_plan(session, process, out, error) : status;
    status = status == GONIO_OK ? join(session, process, options->sets, out->samples, &clock_s, error) : status;
    status = status == GONIO_OK ? correct_drift(session, process, clock_s, out, &changed, error) : status;
    free(clock_s);
    if (status == GONIO_OK) {
        gonio_fit_options fit = process->setup.fit;
        fit.threads = options->threads;
        fit.progress = options->progress;
        fit.progress_context = options->context;
        status = fit_twice(process, changed ? NULL : options->stream, &fit, out, error);
    }
    if (status == GONIO_OK) {
        status = gonio_process_motion(session, process, &out->motion, out->motion_text, error);
    }
    if (status == GONIO_OK) {
        gonio_calib_blur(&process->setup.facts, out->model, out->samples, &out->blur);
        status = describe(out, error);
        status = status == GONIO_OK ? save(session, options, out, error) : status;
    }
    if (status != GONIO_OK) {
        gonio_outcome_free(out);
    }
    return status;
}

void gonio_outcome_free(gonio_outcome *outcome) {
    gonio_samples_free(outcome->samples);
    gonio_model_free(outcome->model);
    free(outcome->model_path);
    *outcome = (gonio_outcome){0};
}

static gonio_status put_results(gonio_session *session, const gonio_outcome *outcome, gonio_error *error) {
    gonio_status status = gonio_session_put_final(session, outcome->samples, error);
    if (status == GONIO_OK) {
        status = gonio_session_put(session, "result.samples_sha256", outcome->samples_sha256, error);
    }
    if (status == GONIO_OK) {
        status = gonio_session_put(session, "result.model_sha256", outcome->model_sha256, error);
    }
    if (status == GONIO_OK && isfinite(outcome->fit.held_out.rmse)) {
        char text[32];
        gonio_text_shortest(outcome->fit.held_out.rmse, text);
        status = gonio_session_put(session, "result.held_out_rmse", text, error);
    }
    for (int stage = GONIO_STAGE_FRAMES; status == GONIO_OK && stage <= GONIO_STAGE_SAMPLES; stage++) {
        char key[64], hex[GONIO_SHA256_HEX];
        snprintf(key, sizeof key, "result.stage.%s", gonio_stage_name(stage));
        status = gonio_session_stage_hash(session, (gonio_stage)stage, hex, error);
        status = status == GONIO_OK ? gonio_session_put(session, key, hex, error) : status;
    }
    if (status == GONIO_OK && outcome->motion.moved) {
        status = gonio_session_event(session, "moved", outcome->motion_text, error);
    }
    return status == GONIO_OK ? gonio_session_event(session, "finished", outcome->samples_sha256, error) : status;
}

gonio_status gonio_outcome_put(gonio_session *session, const gonio_outcome *outcome, gonio_error *error) {
    const gonio_status status = gonio_session_begin(session, error);
    return status == GONIO_OK ? gonio_session_end(session, put_results(session, outcome, error), error) : status;
}
