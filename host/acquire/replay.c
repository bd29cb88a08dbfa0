// SPDX-License-Identifier: BSD-3-Clause
// Stored frames -> calibration -> samples -> model again, held against what the measure journalled.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/acquire/adaptive.h"

typedef struct replay {
    gonio_session *session;
    const gonio_measure_options *options;
    gonio_process process;
    size_t poses;
} replay;

static bool go_on(const replay *r, gonio_measure_phase phase, double fraction, const char *what, double error_now) {
    const gonio_measure_hooks *hooks = &r->options->hooks;
    const size_t done = phase == GONIO_MEASURE_POSES ? (size_t)(fraction * (double)r->poses) : r->poses;
    const gonio_measure_progress now = {phase, done, r->poses, 0, fraction, what, error_now};
    return hooks->progress == NULL || hooks->progress(hooks->context, &now);
}

static bool on_poses(void *context, double fraction, const char *what, double error_now) {
    (void)what, (void)error_now;
    return go_on(context, GONIO_MEASURE_POSES, fraction, "", NAN);
}

static bool on_fit(void *context, double fraction, const char *what, double error_now) {
    return go_on(context, GONIO_MEASURE_FIT, fraction, what, error_now);
}

// A folder for the model whose checksum is wanted where nobody wants its file.
static gonio_status temporary_folder(char path[64], gonio_error *error) {
    const char *folder = getenv("TMPDIR");
    if (snprintf(path, 64, "%s/gonio-replay-XXXXXX", folder != NULL && strlen(folder) < 32 ? folder : "/tmp") >= 64) {
        return gonio_fail(error, GONIO_E_IO, "the path of the temporary folder is too long");
    }
    return mkdtemp(path) != NULL
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot make a temporary folder: %s", strerror(errno));
}

static gonio_status finish(replay *r, gonio_samples **sets, gonio_outcome *outcome, gonio_error *error) {
    const char *path = r->options->model_path;
    gonio_finish_options options = {
        .sets = sets, .threads = r->options->threads, .model_path = path, .progress = on_fit, .context = r};
    if (path != NULL) {
        const gonio_status status = gonio_finish(r->session, &r->process, &options, outcome, error);
        outcome->model_path = status == GONIO_OK ? strdup(path) : NULL;
        return status;
    }
    char folder[64], file[80];
    gonio_status status = temporary_folder(folder, error);
    if (status != GONIO_OK) {
        return status;
    }
    snprintf(file, sizeof file, "%s/model", folder);
    options.model_path = file;
    status = gonio_finish(r->session, &r->process, &options, outcome, error);
    unlink(file);
    rmdir(folder);
    return status;
}

static gonio_status prepare(replay *r, gonio_error *error) {
    bool ready;
    gonio_status status = gonio_process_begin(r->session, &r->process, error);
    if (status == GONIO_OK) {
        status = gonio_process_prepare(r->session, &r->process, NULL, NULL, 0, &ready, error);
    }
    if (status == GONIO_OK && !ready) {
        status = gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(r->session), -1,
                                 "its dark and reference frames are not complete; `gonio resume` takes them");
    }
    for (size_t i = 0; status == GONIO_OK && i < r->process.n; i++) {
        r->poses += r->process.steps[i].kind == GONIO_STEP_SAMPLE;
    }
    return status;
}

// Were the poses of an adaptive plan chosen on the samples that the frames give now? They are not chosen again.
static gonio_status verify_batches(const replay *r, gonio_samples *const *sets, gonio_replay_report *report,
                                   gonio_error *error) {
    char *plan;
    gonio_status status = gonio_session_find(r->session, "plan", &plan, error);
    if (status == GONIO_OK && plan != NULL && gonio_adaptive_is(plan)) {
        status = gonio_adaptive_verify(r->session, r->process.steps, r->process.n, sets, &report->batches,
                                       &report->batches_differing, error);
    }
    free(plan);
    return status;
}

gonio_status gonio_replay(gonio_session *session, const gonio_measure_options *options, gonio_outcome *outcome,
                          gonio_replay_report *report, gonio_error *error) {
    *outcome = (gonio_outcome){0};
    replay r = {.session = session, .options = options};
    gonio_samples **sets = NULL;
    gonio_step_radiance *radiance = NULL;
    gonio_status status = prepare(&r, error);
    if (status == GONIO_OK) {
        status =
            gonio_process_samples(session, &r.process, false, options->threads, on_poses, &r, &sets, &radiance, error);
    }
    status = status == GONIO_OK ? gonio_stages_steps(session, &r.process, sets, radiance, report, error) : status;
    free(radiance);
    status = status == GONIO_OK ? verify_batches(&r, sets, report, error) : status;
    status = status == GONIO_OK ? finish(&r, sets, outcome, error) : status;
    status = status == GONIO_OK ? gonio_stages_results(session, outcome, report, error) : status;
    if (status != GONIO_OK) {
        gonio_outcome_free(outcome);
    }
    gonio_sets_free(sets, r.process.n);
    gonio_process_end(&r.process);
    return status;
}
