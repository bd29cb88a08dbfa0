// SPDX-License-Identifier: BSD-3-Clause
// Show a scan and its result on a terminal, and ask for the operator's hands.
#include "host/cli/measuring.h"

#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"

bool cli_measuring_hands(const cli_measuring *measuring, const cli_rig *rig) {
    if (!gonio_rig_file_needs_hands(rig) || measuring->yes || isatty(STDIN_FILENO) == 1) {
        return true;
    }
    cli_usage(measuring->common,
              "the reference and the sample are put on the table by hand and there is no terminal to ask at; "
              "--yes goes on without asking");
    return false;
}

static gonio_status ask_for_hands(void *context, gonio_target target, gonio_error *error) {
    cli_measuring *m = context;
    const char *what = target == GONIO_TARGET_REFERENCE ? "white reference"
                       : target == GONIO_TARGET_TRAP    ? "light trap"
                                                        : "sample";
    cli_progress_end(&m->progress);
    if (m->yes) {
        fprintf(stderr, "assuming that the %s lies on the table (--yes)\n", what);
        return GONIO_OK;
    }
    fprintf(stderr, "put the %s on the table, close the door, then press Enter ", what);
    fflush(stderr);
    char line[64];
    do {
        struct pollfd key = {.fd = STDIN_FILENO, .events = POLLIN};
        while (poll(&key, 1, 200) == 0 && !cli_interrupted()) { // it may be stopped from elsewhere
        }
        if (cli_interrupted() || fgets(line, sizeof line, stdin) == NULL) {
            return gonio_fail(error, cli_interrupted() ? GONIO_E_INTERRUPTED : GONIO_E_DEVICE,
                              "waiting for the %s on the table: no answer", what);
        }
    } while (strchr(line, '\n') == NULL);
    return GONIO_OK;
}

static void show_note(void *context, const char *text) {
    cli_progress_end(&((cli_measuring *)context)->progress);
    fprintf(stderr, "%s\n", cli_text(text));
}

static bool show_progress(void *context, const gonio_measure_progress *now) {
    cli_measuring *m = context;
    const bool poses = now->phase == GONIO_MEASURE_POSES;
    if (now->phase == GONIO_MEASURE_PAUSED) {
        return !cli_interrupted(); // the note said it
    }
    if (m->phase != (int)now->phase) {
        cli_progress_end(&m->progress);
        cli_progress_start(&m->progress, poses ? "poses" : "fit", poses ? (double)(now->total - now->done_before) : 1);
        m->phase = (int)now->phase;
    }
    char detail[48];
    snprintf(detail, sizeof detail, "%zu of %zu", now->done, now->total);
    cli_progress_update(&m->progress, poses ? (double)(now->done - now->done_before) : now->fraction,
                        poses ? detail : now->what, now->error);
    return !cli_interrupted();
}

void cli_measuring_options(cli_measuring *measuring, gonio_measure_options *options) {
    measuring->phase = -1;
    options->model_path = measuring->model;
    options->threads = measuring->common->threads;
    options->wait_for_room = true;
    options->hooks = (gonio_measure_hooks){measuring, show_progress, ask_for_hands, show_note};
}

// The error that the power law gives for so many poses.
static double error_at(const gonio_adaptive_report *a, double poses) {
    return a->median_rel_scale * pow(poses, -a->median_rel_power);
}

static void print_adaptive(const gonio_adaptive_report *a) {
    if (a->batches == 0) {
        return;
    }
    printf("adaptive   %zu poses in %zu batches, %.0f %% of the last one to fill the space", a->poses, a->batches,
           100 * a->share);
    if (isfinite(a->median_rel)) {
        printf("; median_rel %.3g, rms_log %.3g on %zu poses before the model saw them", a->median_rel, a->rms_log,
               a->held_out);
    }
    putchar('\n');
    if (a->until > 0) {
        printf("until      median_rel %.3g was %s\n", a->until, a->met ? "met" : "not met");
    }
    if (isfinite(a->median_rel_power)) {
        const double n = (double)a->poses;
        printf("more poses median_rel falls with poses^-%.2f: about %.3g now, %.3g with %.0f, %.3g with %.0f",
               a->median_rel_power, error_at(a, n), error_at(a, 1.5 * n), 1.5 * n, error_at(a, 2 * n), 2 * n);
        if (a->until > 0 && !a->met && a->median_rel_power > 0) {
            printf("; %.3g needs about %.3g", a->until, pow(a->median_rel_scale / a->until, 1 / a->median_rel_power));
        }
        putchar('\n');
    }
}

#define ADAPTIVE(member) CLI_FIGURE(gonio_adaptive_report, member)
static const cli_figure adaptive_figures[] = {ADAPTIVE(median_rel),
                                              ADAPTIVE(rms_log),
                                              ADAPTIVE(until),
                                              ADAPTIVE(share),
                                              ADAPTIVE(median_rel_scale),
                                              ADAPTIVE(median_rel_power),
                                              ADAPTIVE(rms_log_scale),
                                              ADAPTIVE(rms_log_power),
                                              ADAPTIVE(choosing_s),
                                              {0}};

static json_t *adaptive_json(const gonio_adaptive_report *a) {
    if (a->batches == 0) {
        return json_null();
    }
    json_t *object = cli_json_figures(adaptive_figures, a);
    json_t *more = json_array();
    for (double by = 1; by <= 2 && isfinite(a->median_rel_power); by += 0.5) {
        json_array_append_new(more, json_pack("{s:f,s:f}", "poses", by * (double)a->poses, "median_rel",
                                              error_at(a, by * (double)a->poses)));
    }
    json_object_set_new(object, "batches", json_integer((json_int_t)a->batches));
    json_object_set_new(object, "poses", json_integer((json_int_t)a->poses));
    json_object_set_new(object, "held_out", json_integer((json_int_t)a->held_out));
    json_object_set_new(object, "met", json_boolean(a->met));
    json_object_set_new(object, "more", more);
    return object;
}

void cli_outcome_print(const gonio_outcome *outcome) {
    printf("poses      %zu, %zu frames, %zu samples\n", outcome->poses, outcome->frames, outcome->samples->n);
    if (outcome->edges_excluded + outcome->edges_spilled > 0) {
        printf("edges      %zu poses gave no sample (over the sample's edge), %zu are flagged (the lit spot is)\n",
               outcome->edges_excluded, outcome->edges_spilled);
    }
    if (outcome->motion.moved) {
        printf("MOVED      %s\n", cli_text(outcome->motion_text));
    } else if (outcome->motion.known) {
        printf("motion     (%.3f, %.3f) px between start and end\n", outcome->motion.shift_px[0],
               outcome->motion.shift_px[1]);
    } else if (outcome->motion.correlation != 0) {
        printf("motion     not known: the frames before and after have too little in common\n");
    }
    if (isfinite(outcome->drift_ratio)) {
        printf("drift      %+.3f %% between the references\n", 100 * (outcome->drift_ratio - 1));
    }
    const gonio_blur *blur = &outcome->blur;
    printf(
        "blur       light +-%.3g deg, aperture +-%.3g deg, averaged disc +-%.3g deg; took %.2g %% of bias out of the "
        "samples (at most %.2g %%)",
        blur->light_deg, blur->aperture_deg, blur->region_deg, 100 * blur->taken_median, 100 * blur->taken_max);
    if (blur->untouched > 0) {
        printf(", nothing out of %.0f %% of them, where it is not known: their sigma holds it", 100 * blur->untouched);
    }
    putchar('\n');
    printf("fit        %s, level %d, %zu bytes, %.3g s\n", outcome->fit.method, outcome->fit.level, outcome->fit.bytes,
           outcome->fit.fit_seconds);
    cli_print_errors("training", &outcome->fit.train);
    cli_print_errors("held-out", &outcome->fit.held_out);
    print_adaptive(&outcome->adaptive);
    printf("samples    sha256 %s\nmodel      sha256 %s\n", outcome->samples_sha256, outcome->model_sha256);
}

// null: nothing to compare, or too little to see.
static json_t *motion_json(const gonio_motion *m) {
    return m->known ? json_pack("{s:b,s:[f,f],s:f}", "moved", m->moved, "shift_px", m->shift_px[0], m->shift_px[1],
                                "correlation", m->correlation)
                    : json_null();
}

#define BLUR(member) CLI_FIGURE(gonio_blur, member)
const cli_figure cli_blur_figures[] = {BLUR(light_deg), BLUR(aperture_deg), BLUR(region_deg),
                                       BLUR(light_sr),  BLUR(aperture_sr),  {0}};

json_t *cli_outcome_json(const char *session, const gonio_outcome *o) {
    json_t *blur = cli_json_figures(cli_blur_figures, &o->blur);
    json_object_set_new(blur, "bias_median", cli_json_real(o->blur.bias_median));
    json_object_set_new(blur, "bias_max", cli_json_real(o->blur.bias_max));
    json_object_set_new(blur, "taken_median", cli_json_real(o->blur.taken_median));
    json_object_set_new(blur, "taken_max", cli_json_real(o->blur.taken_max));
    json_object_set_new(blur, "untouched", cli_json_real(o->blur.untouched));
    return json_pack("{s:s,s:I,s:I,s:I,s:I,s:I,s:i,s:s,s:s,s:o,s:o,s:s,s:i,s:o,s:o,s:o,s:o}", "session", session,
                     "poses", (json_int_t)o->poses, "frames", (json_int_t)o->frames, "samples",
                     (json_int_t)o->samples->n, "edges_excluded", (json_int_t)o->edges_excluded, "edges_flagged",
                     (json_int_t)o->edges_spilled, "channels", o->samples->channels, "samples_sha256",
                     o->samples_sha256, "model_sha256", o->model_sha256, "drift_ratio", cli_json_real(o->drift_ratio),
                     "blur", blur, "method", o->fit.method, "level", o->fit.level, "train",
                     cli_json_errors(&o->fit.train), "held_out", cli_json_errors(&o->fit.held_out), "motion",
                     motion_json(&o->motion), "adaptive", adaptive_json(&o->adaptive));
}

static void report(const cli_measuring *m, const char *session, const gonio_outcome *outcome, double seconds) {
    if (m->common->json) {
        json_t *object = cli_outcome_json(session, outcome);
        json_object_set_new(object, "model", json_string(outcome->model_path));
        json_object_set_new(object, "resumed", json_boolean(m->resumed));
        json_object_set_new(object, "seconds", json_real(seconds));
        cli_json(object);
        return;
    }
    printf("session    %s\n", cli_text(session));
    cli_outcome_print(outcome);
    printf("wrote      %s\ntook       %.1f s\n", cli_text(outcome->model_path), seconds);
}

int cli_measuring_run(cli_measuring *measuring, const gonio_measure_options *options, gonio_session *session,
                      cli_rig *rig) {
    const double started = gonio_clock_s();
    gonio_error error = {.line = -1, .byte = -1};
    gonio_outcome outcome;
    const gonio_status status = gonio_measure_run(session, rig, options, &outcome, &error);
    cli_progress_end(&measuring->progress);
    int exit_status = 0;
    if (status == GONIO_OK) {
        report(measuring, gonio_session_path(session), &outcome, gonio_clock_s() - started);
    } else {
        exit_status = cli_fail(measuring->common, &error);
        fprintf(stderr, "nothing is lost: `gonio resume %s` goes on\n", cli_text(gonio_session_path(session)));
    }
    gonio_outcome_free(&outcome);
    return exit_status;
}
