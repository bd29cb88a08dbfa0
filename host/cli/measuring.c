// Drive a scan to its end: progress, Ctrl-C, the operator's hands, the live fit, the result.
#include "host/cli/measuring.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"

typedef struct run {
    const cli_measuring *m;
    gonio_session *session;
    gonio_scan *scan;
    gonio_fit_stream *stream;
    bool in_order; // the stream was given every sample in the steps' order
    bool undone;   // an audit took samples back that the stream was given
    cli_progress progress;
    size_t done, total; // sample steps
} run;

bool cli_measuring_hands(const cli_measuring *measuring, const gonio_rig *rig, bool hands) {
    if ((!hands && rig->mount != NULL) || measuring->yes || isatty(STDIN_FILENO) == 1) {
        return true;
    }
    cli_usage(measuring->common,
              "the reference and the sample are put on the table by hand and there is no terminal to ask at; "
              "--yes goes on without asking");
    return false;
}

static gonio_status ask_for_hands(void *context, gonio_target target, gonio_error *error) {
    run *r = context;
    const char *what = target == GONIO_TARGET_REFERENCE ? "white reference"
                       : target == GONIO_TARGET_TRAP    ? "light trap"
                                                        : "sample";
    cli_progress_end(&r->progress);
    if (r->m->yes) {
        fprintf(stderr, "assuming that the %s lies on the table (--yes)\n", what);
        return GONIO_OK;
    }
    fprintf(stderr, "put the %s on the table, close the door, then press Enter ", what);
    fflush(stderr);
    char line[64];
    do {
        if (fgets(line, sizeof line, stdin) == NULL) {
            return gonio_fail(error, cli_interrupted() ? GONIO_E_INTERRUPTED : GONIO_E_DEVICE,
                              "waiting for the %s on the table: no answer", what);
        }
    } while (strchr(line, '\n') == NULL);
    return GONIO_OK;
}

static void show_note(void *context, const char *text) {
    run *r = context;
    cli_progress_end(&r->progress);
    fprintf(stderr, "%s\n", text);
}

static void note_undone(void *context, size_t steps) {
    (void)steps;
    ((run *)context)->undone = true;
}

static gonio_status open_stream(run *r, gonio_error *error) {
    gonio_process *process = gonio_scan_process(r->scan);
    gonio_fit_options options = gonio_setup_slope_fit(&process->setup);
    options.threads = r->m->common->threads;
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
    return status;
}

static gonio_status scan_all(run *r, gonio_error *error) {
    gonio_status status = GONIO_OK;
    const double before = (double)r->done;
    cli_progress_start(&r->progress, "poses", (double)r->total - before);
    while (status == GONIO_OK && !gonio_scan_done(r->scan)) {
        if (cli_interrupted()) {
            status = gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %zu of %zu poses", r->done, r->total);
            break;
        }
        const gonio_samples *samples;
        status = gonio_scan_step(r->scan, &samples, error);
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
        char detail[48];
        snprintf(detail, sizeof detail, "%zu of %zu", r->done, r->total);
        cli_progress_update(&r->progress, (double)r->done - before, detail, gonio_fit_stream_error(r->stream));
    }
    cli_progress_end(&r->progress);
    return status;
}

static bool on_fit(void *context, double fraction, const char *what, double error_now) {
    run *r = context;
    cli_progress_update(&r->progress, fraction, what, error_now);
    return !cli_interrupted();
}

static gonio_status finish(run *r, gonio_outcome *outcome, char **model_path, gonio_error *error) {
    const bool own_path = r->m->model == NULL;
    if (asprintf(model_path, "%s%s", own_path ? gonio_session_path(r->session) : r->m->model,
                 own_path ? "/model.gonio" : "") < 0) {
        *model_path = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    gonio_process *process = gonio_scan_process(r->scan);
    const gonio_finish_options options = {.stream = r->in_order ? r->stream : NULL,
                                          .threads = r->m->common->threads,
                                          .model_path = *model_path,
                                          .progress = on_fit,
                                          .context = r};
    cli_progress_start(&r->progress, "fit", 1);
    gonio_status status = gonio_finish(r->session, process, &options, outcome, error);
    cli_progress_end(&r->progress);
    if (status == GONIO_OK) {
        char *full = own_path ? strdup("model.gonio") : realpath(*model_path, NULL);
        status = gonio_session_put(r->session, "result.model_path", full != NULL ? full : *model_path, error);
        free(full);
    }
    return status == GONIO_OK ? gonio_outcome_put(r->session, outcome, error) : status;
}

void cli_outcome_print(const gonio_outcome *outcome) {
    printf("poses      %zu, %zu frames, %zu samples\n", outcome->poses, outcome->frames, outcome->samples->n);
    if (outcome->edges_excluded + outcome->edges_spilled > 0) {
        printf("edges      %zu poses gave no sample (over the sample's edge), %zu are flagged (the lit spot is)\n",
               outcome->edges_excluded, outcome->edges_spilled);
    }
    if (outcome->motion.moved) {
        printf("MOVED      %s\n", outcome->motion_text);
    } else if (outcome->motion.known) {
        printf("motion     (%.3f, %.3f) px between start and end\n", outcome->motion.shift_px[0],
               outcome->motion.shift_px[1]);
    }
    if (isfinite(outcome->drift_ratio)) {
        printf("drift      %+.3f %% between the references\n", 100 * (outcome->drift_ratio - 1));
    }
    printf(
        "blur       light +-%.3g deg, aperture +-%.3g deg, averaged disc +-%.3g deg; bias %.2g %% (at most %.2g %%), "
        "corrected\n",
        outcome->blur.light_deg, outcome->blur.aperture_deg, outcome->blur.region_deg, 100 * outcome->blur.bias_median,
        100 * outcome->blur.bias_max);
    printf("fit        %s, level %d, %zu bytes, %.3g s\n", outcome->fit.method, outcome->fit.level, outcome->fit.bytes,
           outcome->fit.fit_seconds);
    cli_print_errors("training", &outcome->fit.train);
    cli_print_errors("held-out", &outcome->fit.held_out);
    printf("samples    sha256 %s\nmodel      sha256 %s\n", outcome->samples_sha256, outcome->model_sha256);
}

static json_t *blur_json(const gonio_blur *b) {
    return json_pack("{s:f,s:f,s:f,s:f,s:f,s:f,s:f}", "light_deg", b->light_deg, "aperture_deg", b->aperture_deg,
                     "region_deg", b->region_deg, "light_sr", b->light_sr, "aperture_sr", b->aperture_sr, "bias_median",
                     b->bias_median, "bias_max", b->bias_max);
}

// null: nothing to compare, or too little to see.
static json_t *motion_json(const gonio_motion *m) {
    return m->known ? json_pack("{s:b,s:[f,f],s:f}", "moved", m->moved, "shift_px", m->shift_px[0], m->shift_px[1],
                                "correlation", m->correlation)
                    : json_null();
}

json_t *cli_outcome_json(const char *session, const gonio_outcome *o) {
    return json_pack("{s:s,s:I,s:I,s:I,s:I,s:I,s:i,s:s,s:s,s:o,s:o,s:s,s:i,s:o,s:o,s:o}", "session", session, "poses",
                     (json_int_t)o->poses, "frames", (json_int_t)o->frames, "samples", (json_int_t)o->samples->n,
                     "edges_excluded", (json_int_t)o->edges_excluded, "edges_flagged", (json_int_t)o->edges_spilled,
                     "channels", o->samples->channels, "samples_sha256", o->samples_sha256, "model_sha256",
                     o->model_sha256, "drift_ratio", cli_json_real(o->drift_ratio), "blur", blur_json(&o->blur),
                     "method", o->fit.method, "level", o->fit.level, "train", cli_json_errors(&o->fit.train),
                     "held_out", cli_json_errors(&o->fit.held_out), "motion", motion_json(&o->motion));
}

static void report(const run *r, const gonio_outcome *outcome, const char *model_path, double seconds) {
    if (r->m->common->json) {
        json_t *object = cli_outcome_json(gonio_session_path(r->session), outcome);
        json_object_set_new(object, "model", json_string(model_path));
        json_object_set_new(object, "resumed", json_boolean(r->m->resumed));
        json_object_set_new(object, "seconds", json_real(seconds));
        cli_json(object);
        return;
    }
    printf("session    %s\n", gonio_session_path(r->session));
    cli_outcome_print(outcome);
    printf("wrote      %s\ntook       %.1f s\n", model_path, seconds);
}

int cli_measuring_run(const cli_measuring *measuring, gonio_session *session, const gonio_rig *rig) {
    const double started = gonio_clock_s();
    run r = {.m = measuring, .session = session};
    const gonio_scan_hooks hooks = {&r, ask_for_hands, show_note, note_undone};
    gonio_error error = {.line = -1, .byte = -1};
    gonio_outcome outcome = {0};
    char *model_path = NULL;
    gonio_status status = gonio_scan_new(session, rig, &hooks, &r.scan, &error);
    if (status == GONIO_OK) {
        status = open_stream(&r, &error);
    }
    if (status == GONIO_OK) {
        status = scan_all(&r, &error);
    }
    if (status == GONIO_OK) {
        status = finish(&r, &outcome, &model_path, &error);
    }
    int exit_status = 0;
    if (status == GONIO_OK) {
        report(&r, &outcome, model_path, gonio_clock_s() - started);
    } else {
        gonio_session_event(session, "stopped", error.message, NULL);
        exit_status = cli_fail(measuring->common, &error);
        fprintf(stderr, "nothing is lost: `gonio resume %s` goes on\n", gonio_session_path(session));
    }
    gonio_outcome_free(&outcome);
    free(model_path);
    gonio_fit_stream_free(r.stream);
    gonio_scan_free(r.scan);
    return exit_status;
}
