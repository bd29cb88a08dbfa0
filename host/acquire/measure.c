// SPDX-License-Identifier: BSD-3-Clause
// A plan on a rig, into a session: begin it, and drive it to its end with a fit running along.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "fit/options.h"
#include "gonio/io.h"
#include "gonio/library.h"
#include "gonio/needs.h"
#include "gonio/version.h"
#include "host/acquire/adaptive.h"
#include "host/acquire/rig_file.h"
#include "host/acquire/steer.h"

void gonio_measure_options_default(gonio_measure_options *options) {
    *options = (gonio_measure_options){.plan = "nusselt:1400", .seed = 1};
    gonio_fit_options_default(&options->fit);
}

// ---- begin ----

static gonio_status check_hands(const gonio_rig_file *rig, const gonio_measure_options *options, gonio_error *error) {
    return options->hooks.mount != NULL || !gonio_rig_file_needs_hands(rig)
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE,
                            "the reference and the sample are put on the table by hand and there is nobody to ask");
}

static gonio_status fixed_steps(const gonio_rig_file *rig, const gonio_measure_options *options,
                                const gonio_setup *setup, gonio_step **steps, size_t *n, gonio_error *error) {
    gonio_plan *plan;
    gonio_pose_time time = gonio_pose_time_of(&rig->rig, setup);
    gonio_status status =
        gonio_plan_resolve(options->plan, options->seed, gonio_pose_time_s, &time, &plan, NULL, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = plan->n > 0 ? gonio_scan_steps(&rig->rig, &setup->scan, plan, steps, n, error)
                         : gonio_fail(error, GONIO_E_INPUT, "plan '%s' has no poses", options->plan);
    gonio_plan_free(plan);
    return status;
}

// *batch: what the journal is to know of an adaptive plan's first batch, which the caller frees; NULL of other plans.
static gonio_status prepare(const gonio_rig_file *rig, const gonio_measure_options *options, gonio_setup *setup,
                            gonio_step **steps, size_t *n, char **batch, gonio_error *error) {
    *setup = (gonio_setup){.fit = options->fit};
    setup->fit.progress = NULL;
    gonio_status status = check_hands(rig, options, error);
    const gonio_method *method = gonio_fit_method_of(&options->fit);
    if (status == GONIO_OK) {
        status = method != NULL ? gonio_fit_options_check(&options->fit, method, error)
                                : gonio_fail(error, GONIO_E_USAGE, "unknown fit method '%s'", options->fit.method);
    }
    status = status == GONIO_OK ? gonio_setup_of_rig(&rig->rig, &rig->scan, setup, error) : status;
    if (status == GONIO_OK && setup->fit.prior[0] != 0) {
        gonio_library *library = NULL;
        status = gonio_library_open(setup->fit.prior, &library, error);
        gonio_library_free(library);
    }
    if (status != GONIO_OK || !gonio_adaptive_is(options->plan)) {
        return status == GONIO_OK ? fixed_steps(rig, options, setup, steps, n, error) : status;
    }
    gonio_adaptive_plan plan;
    gonio_needs *needs = NULL;
    status = gonio_adaptive_parse(options->plan, &plan, error);
    if (status == GONIO_OK && plan.scene[0] != 0) { // what is wrong with it is told before hours of measuring
        status = gonio_needs_open(plan.scene, &needs, error);
        gonio_needs_free(needs);
        memcpy(setup->scan.needs, plan.scene, sizeof plan.scene);
    }
    return status != GONIO_OK
               ? status
               : gonio_adaptive_begin(&rig->rig, setup, options->plan, options->seed, steps, n, batch, error);
}

// A resume may run in another folder: the model's place is kept as an absolute path.
static gonio_status put_model_place(gonio_session *session, const char *model, gonio_error *error) {
    char folder[4096] = "", *place;
    if (model[0] != '/' && getcwd(folder, sizeof folder) == NULL) {
        return gonio_fail(error, GONIO_E_IO, "cannot tell the working folder, in which the model is to go");
    }
    if (asprintf(&place, "%s%s%s", folder, folder[0] != 0 ? "/" : "", model) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    const gonio_status status = gonio_session_put(session, "model", place, error);
    free(place);
    return status;
}

// The file that a plan "scene:NEEDS,..." or "prior:PRIOR,..." goes by.
static gonio_status add_named(gonio_sources *files, const char *plan, gonio_error *error) {
    char path[4096];
    const bool prior = gonio_library_plan_is(plan);
    if (!prior && strncmp(plan, "scene:", 6) != 0) {
        return GONIO_OK;
    }
    snprintf(path, sizeof path, "%.*s", (int)strcspn(plan + 6, ","), plan + 6);
    return gonio_sources_add_file(files, prior ? "prior" : "needs", path, error);
}

// The plan as it was given; where it is or names a file, that too. What the plan comes to are the steps.
static gonio_status put_plan(gonio_session *session, const gonio_measure_options *options, gonio_error *error) {
    char seed[24];
    gonio_sources files = {0};
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)options->seed);
    gonio_status status = gonio_session_put(session, "plan", options->plan, error);
    status = status == GONIO_OK ? gonio_session_put(session, "plan.seed", seed, error) : status;
    status = status == GONIO_OK ? gonio_sources_add_file(&files, "plan", options->plan, error) : status;
    status = status == GONIO_OK ? add_named(&files, options->plan, error) : status;
    status = status == GONIO_OK ? gonio_sources_put(session, &files, error) : status;
    gonio_sources_free(&files);
    return status;
}

static gonio_status put_all(gonio_session *session, const gonio_rig_file *rig, const gonio_measure_options *options,
                            const gonio_setup *setup, const gonio_step *steps, size_t n, const char *batch,
                            gonio_error *error) {
    gonio_status status = gonio_session_put(session, "gonio.version", gonio_version(), error);
    status = status == GONIO_OK ? put_plan(session, options, error) : status;
    status = status == GONIO_OK ? gonio_rig_file_put(session, rig, error) : status;
    status = status == GONIO_OK ? gonio_setup_put(session, setup, error) : status;
    status = status == GONIO_OK ? gonio_session_put_steps(session, steps, n, error) : status;
    status = status == GONIO_OK && batch != NULL ? gonio_adaptive_put(session, 0, batch, error) : status;
    if (status == GONIO_OK && options->model_path != NULL) {
        status = put_model_place(session, options->model_path, error);
    }
    return status == GONIO_OK ? gonio_session_event(session, "begun", options->plan, error) : status;
}

static gonio_status journal(gonio_session *session, const gonio_rig_file *rig, const gonio_measure_options *options,
                            const gonio_setup *setup, const gonio_step *steps, size_t n, const char *batch,
                            gonio_error *error) {
    const gonio_status status = gonio_session_begin(session, error);
    return status == GONIO_OK
               ? gonio_session_end(session, put_all(session, rig, options, setup, steps, n, batch, error), error)
               : status;
}

gonio_status gonio_measure_begin(const char *path, const gonio_rig_file *rig, const gonio_measure_options *options,
                                 gonio_session **out, gonio_error *error) {
    *out = NULL;
    gonio_setup setup;
    gonio_step *steps = NULL;
    char *batch = NULL;
    size_t n = 0;
    gonio_status status = prepare(rig, options, &setup, &steps, &n, &batch, error);
    status = status == GONIO_OK ? gonio_session_create(path, out, error) : status;
    status = status == GONIO_OK && rig->scan.unsynced ? gonio_session_set_sync(*out, false, error) : status;
    status = status == GONIO_OK ? journal(*out, rig, options, &setup, steps, n, batch, error) : status;
    free(steps);
    free(batch);
    if (status != GONIO_OK) {
        gonio_session_close(*out);
        *out = NULL;
    }
    return status;
}

// ---- run ----

typedef struct run {
    const gonio_measure_options *options;
    gonio_session *session;
    gonio_scan *scan;
    gonio_fit_stream *stream;
    bool in_order;                   // the stream was given every sample in the steps' order
    bool undone;                     // an audit took samples back that the stream was given
    gonio_adaptive_plan adaptive;    // poses 0: the plan was made before
    double choosing_s;               // wall clock, of its batches
    size_t done, total, done_before; // sample steps
    gonio_steer steer;
    gonio_error stopped; // why the last checkpoint within the fit said no
} run;

static gonio_status ask_for_hands(void *context, gonio_target target, gonio_error *error) {
    const gonio_measure_hooks *hooks = &((const run *)context)->options->hooks;
    return hooks->mount(hooks->context, target, error);
}

static void note(void *context, const char *text) {
    const gonio_measure_hooks *hooks = &((const run *)context)->options->hooks;
    if (hooks->note != NULL) {
        hooks->note(hooks->context, text);
    }
}

static void note_undone(void *context, size_t steps) {
    (void)steps;
    ((run *)context)->undone = true;
}

static gonio_status checkpoint(run *r, gonio_measure_phase phase, double fraction, const char *what, double error_now,
                               gonio_error *error) {
    const gonio_measure_progress now = {phase, r->done, r->total, r->done_before, fraction, what, error_now};
    return gonio_steer_checkpoint(&r->steer, &now, error);
}

static gonio_status open_stream(run *r, gonio_error *error) {
    gonio_process *process = gonio_scan_process(r->scan);
    gonio_fit_options options = gonio_setup_slope_fit(&process->setup);
    options.threads = r->options->threads;
    gonio_status status = gonio_fit_stream_new(gonio_calib_channels(process->calib),
                                               gonio_calib_channel_names(process->calib), &options, &r->stream, error);
    r->in_order = true;
    r->undone = false;
    r->total = r->done = 0;
    for (size_t i = 0; status == GONIO_OK && i < process->n; i++) {
        const gonio_step *step = &process->steps[i];
        r->total += step->kind == GONIO_STEP_SAMPLE;
        r->done += step->kind == GONIO_STEP_SAMPLE && step->done;
        // A step that the doctor undid leaves a gap: what is measured into it comes out of order.
        r->in_order &= !step->done || i == 0 || process->steps[i - 1].done;
        gonio_samples *samples = NULL;
        if (step->kind == GONIO_STEP_SAMPLE && step->done) {
            status = gonio_session_step_samples(r->session, step->index, &samples, error);
        }
        if (samples != NULL && samples->n > 0) {
            status = gonio_fit_stream_add(r->stream, samples, error);
        }
        gonio_samples_free(samples);
    }
    r->total = r->adaptive.poses > r->total ? r->adaptive.poses : r->total;
    return status;
}

static gonio_status one_step(run *r, gonio_error *error) {
    const gonio_samples *samples;
    gonio_status status = gonio_scan_step(r->scan, &samples, error);
    if (status == GONIO_OK && samples != NULL) {
        r->done++;
        if (samples->n > 0) {
            status = gonio_fit_stream_add(r->stream, samples, error);
        }
    }
    if (status == GONIO_OK && r->undone) {
        gonio_fit_stream_free(r->stream);
        r->stream = NULL;
        status = open_stream(r, error);
    }
    return status;
}

static gonio_status pose_checkpoint(run *r, gonio_error *error) {
    const double fraction = r->total > 0 ? (double)r->done / (double)r->total : 1;
    return checkpoint(r, GONIO_MEASURE_POSES, fraction, "", gonio_fit_stream_error(r->stream), error);
}

static bool on_choice(void *context, double fraction, const char *what, double error_now) {
    run *r = context;
    (void)fraction, (void)error_now;
    r->stopped = (gonio_error){.line = -1, .byte = -1};
    const double done = r->total > 0 ? (double)r->done / (double)r->total : 1;
    return checkpoint(r, GONIO_MEASURE_POSES, done, what, NAN, &r->stopped) == GONIO_OK;
}

// Where an adaptive plan's steps so far are done: enter more in the journal. scan NULL: it will read them there.
static gonio_status choose_more(run *r, const gonio_rig *rig, const gonio_setup *setup, const gonio_step *steps,
                                size_t n, gonio_error *error) {
    const double started = gonio_clock_s();
    gonio_step *more;
    size_t count;
    gonio_status status =
        gonio_adaptive_next(r->session, rig, setup, steps, n, r->options->threads, on_choice, r, &more, &count, error);
    if (status == GONIO_OK && count > 0 && r->scan != NULL) {
        status = gonio_scan_extend(r->scan, more, count, error);
    }
    free(more);
    r->choosing_s += gonio_clock_s() - started;
    return status;
}

// A session that was stopped between two batches: the next one is chosen before the rig starts. Steps that no audit has
// vouched for may be taken back, so that they are audited first.
static gonio_status choose_before(run *r, const gonio_rig *rig, gonio_error *error) {
    gonio_process process;
    gonio_status status = gonio_process_begin(r->session, &process, error);
    bool ready = status == GONIO_OK;
    for (size_t i = 0; ready && i < process.n; i++) {
        ready = process.steps[i].done && !process.steps[i].flagged;
    }
    status = ready ? choose_more(r, rig, &process.setup, process.steps, process.n, error) : status;
    gonio_process_end(&process);
    return status;
}

static gonio_status scan_on(run *r, const gonio_rig *rig, gonio_error *error) {
    gonio_process *process = gonio_scan_process(r->scan);
    return r->adaptive.poses > 0 && gonio_scan_done(r->scan)
               ? choose_more(r, rig, &process->setup, process->steps, process->n, error)
               : GONIO_OK;
}

static gonio_status scan_all(run *r, const gonio_rig *rig, gonio_error *error) {
    gonio_status status = gonio_steer_stored(&r->steer, 0, error);
    r->done_before = r->done;
    status = status == GONIO_OK ? scan_on(r, rig, error) : status;
    while (status == GONIO_OK && !gonio_scan_done(r->scan)) {
        const int64_t step = gonio_scan_next(r->scan);
        status = pose_checkpoint(r, error);
        status = status == GONIO_OK ? one_step(r, error) : status;
        if (status == GONIO_E_IO && gonio_steer_no_room(&r->steer)) {
            status = GONIO_OK; // somebody else filled the disk: the step is undone, and its checkpoint waits for room
        } else if (status == GONIO_OK) {
            status = gonio_steer_stored(&r->steer, step, error);
        }
        status = status == GONIO_OK ? scan_on(r, rig, error) : status;
    }
    return status;
}

static bool on_fit(void *context, double fraction, const char *what, double error_now) {
    run *r = context;
    r->stopped = (gonio_error){.line = -1, .byte = -1};
    return checkpoint(r, GONIO_MEASURE_FIT, fraction, what, error_now, &r->stopped) == GONIO_OK;
}

// The journal may name any file: what is there and is no model is not replaced.
static gonio_status check_place(const run *r, const char *path, gonio_error *error) {
    struct stat info;
    if (lstat(path, &info) != 0 || (S_ISREG(info.st_mode) && gonio_model_file_is(path))) {
        return GONIO_OK;
    }
    return gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(r->session), -1,
                           "the session says that its model goes to %s, where something else is; --model names "
                           "another place",
                           path);
}

// Where the model goes: as this run was told, else as gonio_measure_begin was, else into the session. *own: there.
static gonio_status choose_place(const run *r, char **path, bool *own, gonio_error *error) {
    const char *wanted = r->options->model_path;
    *own = false;
    *path = NULL;
    gonio_status status = GONIO_OK;
    if (wanted != NULL) {
        *path = strdup(wanted);
    } else {
        status = gonio_session_find(r->session, "model", path, error);
        *own = status == GONIO_OK && *path == NULL;
        if (*own && asprintf(path, "%s/model.gonio", gonio_session_path(r->session)) < 0) {
            *path = NULL;
        }
        // What stands in the session's own place, a damaged model too, goes to lost+found/.
        status = status == GONIO_OK && *path != NULL && !*own ? check_place(r, *path, error) : status;
    }
    return status == GONIO_OK && *path == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for a path") : status;
}

static gonio_status finish(run *r, gonio_outcome *outcome, gonio_error *error) {
    char *path;
    bool own;
    gonio_status status = choose_place(r, &path, &own, error);
    const gonio_finish_options options = {.stream = r->in_order ? r->stream : NULL,
                                          .threads = r->options->threads,
                                          .model_path = path,
                                          .replaces = own ? "model.gonio" : NULL,
                                          .keep_old = r->options->model_path == NULL,
                                          .progress = on_fit,
                                          .context = r};
    if (status == GONIO_OK) {
        status = gonio_finish(r->session, gonio_scan_process(r->scan), &options, outcome, error);
    }
    outcome->model_path = path; // also on failure: released with the rest
    if (status == GONIO_OK) {
        char *full = own ? strdup("model.gonio") : realpath(path, NULL);
        status = gonio_session_put(r->session, "result.model_path", full != NULL ? full : path, error);
        free(full);
    }
    return status == GONIO_OK ? gonio_outcome_put(r->session, outcome, error) : status;
}

static gonio_status read_plan(run *r, gonio_error *error) {
    char *plan;
    gonio_status status = gonio_session_find(r->session, "plan", &plan, error);
    if (status == GONIO_OK && plan != NULL && gonio_adaptive_is(plan)) {
        status = gonio_adaptive_parse(plan, &r->adaptive, error);
    }
    free(plan);
    return status;
}

static gonio_status run_all(run *r, const gonio_rig *rig, gonio_outcome *outcome, gonio_error *error) {
    const gonio_scan_hooks hooks = {r, r->options->hooks.mount != NULL ? ask_for_hands : NULL, note, note_undone};
    char *place; // of the model: what is wrong with it is told before hours of measuring
    bool own;
    gonio_status status = choose_place(r, &place, &own, error);
    free(place);
    status = status == GONIO_OK ? read_plan(r, error) : status;
    status = status == GONIO_OK && r->adaptive.poses > 0 ? choose_before(r, rig, error) : status;
    status = status == GONIO_OK ? gonio_scan_new(r->session, rig, &hooks, &r->scan, error) : status;
    status = status == GONIO_OK ? open_stream(r, error) : status;
    status = status == GONIO_OK ? scan_all(r, rig, error) : status;
    status = status == GONIO_OK ? finish(r, outcome, error) : status;
    outcome->adaptive.choosing_s = r->choosing_s;
    return status;
}

static void tell_finished(run *r) {
    char *hash = NULL;
    if (gonio_session_get(r->session, "result.model_sha256", &hash, NULL) == GONIO_OK) {
        note(r, "the session is finished; fitting it again");
    }
    free(hash);
}

gonio_status gonio_measure_run(gonio_session *session, gonio_rig_file *rig, const gonio_measure_options *options,
                               gonio_outcome *outcome, gonio_error *error) {
    *outcome = (gonio_outcome){0};
    run r = {.options = options, .session = session};
    gonio_error own = {.line = -1, .byte = -1};
    gonio_status status = check_hands(rig, options, &own);
    if (status == GONIO_OK) {
        tell_finished(&r);
        rig->journal = session;
        gonio_steer_begin(&r.steer, session, rig, options);
        status = run_all(&r, &rig->rig, outcome, &own);
        if (status == GONIO_E_INTERRUPTED && r.stopped.status == status) {
            own = r.stopped; // it says who stopped it
        }
        if (status != GONIO_OK) {
            gonio_session_event(session, "stopped", own.message, NULL);
        }
        gonio_fit_stream_free(r.stream);
        gonio_scan_free(r.scan);
        gonio_steer_end(&r.steer);
        rig->journal = NULL;
    }
    if (status != GONIO_OK) {
        gonio_outcome_free(outcome);
        if (error != NULL) {
            *error = own;
        }
    }
    return status;
}
