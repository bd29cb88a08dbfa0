// SPDX-License-Identifier: BSD-3-Clause
// Measuring through the public calls alone: what is stopped and gone on with ends as if it had not been, wrong requests
// leave nothing behind, a replay finds the same, and the process is afterwards what it was.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <fcntl.h>
#include <locale.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "gonio/gonio.h"
#include "tests/unit/session_folder.h"

#define QUICK                                                                                                          \
    "camera.width=44,camera.height=44,camera.white_e_per_s=4e6,camera.exposure_max_s=0.06,camera.exposure_min_s=1e-6," \
    "sample.region_radius_mm=1,scan.settle_s=0.05,scan.audit_poses=0"

static gonio_rig_file *open_rig(const char *more) {
    const char *const settings[] = {QUICK, more};
    const gonio_rig_file_options options = {.sample = "ward:rho_d=0.3,rho_s=0.2,alpha=0.3",
                                            .settings = settings,
                                            .n_settings = more != NULL ? 2 : 1,
                                            .seed = 3,
                                            .threads = 1};
    gonio_rig_file *rig;
    gonio_error error = {0};
    if (gonio_rig_file_open(&options, &rig, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return rig;
}

// What the hooks were told, and when they stop.
typedef struct watcher {
    size_t stop_at; // poses done
    bool stop_fit;
    size_t calls, last_done, done_before, total, mounts, notes;
    double fraction;
    gonio_measure_phase phase;
} watcher;

static bool watch(void *context, const gonio_measure_progress *now) {
    watcher *w = context;
    if (w->calls > 0 && now->phase == w->phase) {
        assert_true(now->done >= w->last_done && now->fraction >= w->fraction);
    }
    assert_true(now->done <= now->total && now->fraction >= 0 && now->fraction <= 1 && now->what != NULL);
    w->calls++;
    w->phase = now->phase;
    w->fraction = now->fraction;
    w->last_done = now->done;
    w->done_before = now->done_before;
    w->total = now->total;
    return now->phase == GONIO_MEASURE_POSES ? now->done < w->stop_at : !w->stop_fit;
}

static gonio_status put_target(void *context, gonio_target target, gonio_error *error) {
    (void)target, (void)error;
    ((watcher *)context)->mounts++;
    return GONIO_OK;
}

static void take_note(void *context, const char *text) {
    assert_true(text[0] != 0);
    ((watcher *)context)->notes++;
}

static gonio_measure_options options_of(watcher *w) {
    gonio_measure_options options;
    gonio_measure_options_default(&options);
    options.plan = "nusselt:12";
    options.fit.method = "mba";
    options.threads = 1;
    options.hooks = (gonio_measure_hooks){w, watch, put_target, take_note};
    return options;
}

static void measure_whole(const char *where, gonio_outcome *outcome) {
    watcher w = {.stop_at = 1000};
    const gonio_measure_options options = options_of(&w);
    gonio_error error = {0};
    gonio_rig_file *rig = open_rig(NULL);
    gonio_session *session;
    if (gonio_measure_begin(where, rig, &options, &session, &error) != GONIO_OK ||
        gonio_measure_run(session, rig, &options, outcome, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    assert_true(w.phase == GONIO_MEASURE_FIT && w.total == 12 && w.last_done == 12 && w.mounts == 0);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
}

static void whole_and_replayed(void **state) {
    (void)state;
    gonio_outcome outcome, again;
    measure_whole(path, &outcome);
    assert_int_equal(outcome.poses, 12);
    assert_int_equal(outcome.samples->n, 12);
    assert_string_equal(outcome.fit.method, "mba");
    gonio_model *saved;
    assert_int_equal(gonio_model_open(outcome.model_path, &saved, NULL), GONIO_OK);
    gonio_model_free(saved);

    gonio_session *session;
    gonio_replay_report report;
    watcher w = {.stop_at = 1000};
    gonio_measure_options options = options_of(&w);
    gonio_error error = {0};
    assert_int_equal(gonio_session_open(path, false, &session, NULL), GONIO_OK);
    if (gonio_replay(session, &options, &again, &report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    assert_true(report.equal && report.finished && report.samples_equal && report.model_equal);
    assert_true(report.steps_differing == 0 && report.first_differing == -1 && report.first_stage == -1);
    for (int k = 0; k < GONIO_STAGES; k++) {
        assert_true(report.stages[k].known && report.stages[k].equal && report.stages[k].steps_differing == 0);
    }
    assert_string_equal(again.samples_sha256, outcome.samples_sha256);
    assert_string_equal(again.model_sha256, outcome.model_sha256);
    assert_null(again.model_path);
    gonio_outcome_free(&again);
    // Stopped, it gives nothing.
    w = (watcher){.stop_at = 1};
    assert_int_equal(gonio_replay(session, &options, &again, &report, &error), GONIO_E_INTERRUPTED);
    assert_true(again.samples == NULL && again.model == NULL);
    gonio_session_close(session);

    // Samples that were changed behind the journal's back are found.
    assert_int_equal(gonio_session_open(path, true, &session, NULL), GONIO_OK);
    gonio_samples *set;
    assert_int_equal(gonio_session_step_samples(session, 6, &set, NULL), GONIO_OK);
    set->values[0] = nextafter(set->values[0], 1);
    assert_int_equal(gonio_session_put_step_samples(session, 6, set, NULL), GONIO_OK);
    gonio_samples_free(set);
    w = (watcher){.stop_at = 1000};
    options.model_path = NULL;
    assert_int_equal(gonio_replay(session, &options, &again, &report, &error), GONIO_OK);
    assert_true(!report.equal && report.steps_differing == 1 && report.first_differing == 6);
    const gonio_stage_report *stages = report.stages;
    assert_int_equal(report.first_stage, GONIO_STAGE_SAMPLES);
    assert_true(stages[GONIO_STAGE_SAMPLES].first_step == 6 && stages[GONIO_STAGE_SAMPLES].largest > 0 &&
                stages[GONIO_STAGE_SAMPLES].largest < 1e-15);
    assert_true(stages[GONIO_STAGE_FRAMES].equal && stages[GONIO_STAGE_RADIANCE].equal);
    gonio_outcome_free(&again);

    // As if the version that measured had calibrated otherwise: that stage is named, and by how much.
    gonio_step_radiance radiance;
    assert_int_equal(gonio_session_radiance(session, 7, &radiance, NULL), GONIO_OK);
    assert_int_equal(radiance.channels, 1);
    radiance.mean[0] *= 1.25;
    radiance.sha256[3] = radiance.sha256[3] == '0' ? '1' : '0';
    assert_int_equal(gonio_session_put_radiance(session, 7, &radiance, NULL), GONIO_OK);
    w = (watcher){.stop_at = 1000};
    assert_int_equal(gonio_replay(session, &options, &again, &report, &error), GONIO_OK);
    assert_int_equal(report.first_stage, GONIO_STAGE_RADIANCE);
    assert_true(stages[GONIO_STAGE_RADIANCE].steps_differing == 1 && stages[GONIO_STAGE_RADIANCE].first_step == 7);
    assert_true(fabs(stages[GONIO_STAGE_RADIANCE].largest - 0.2) < 1e-12);
    gonio_outcome_free(&again);
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
}

// Stopped between poses, in the fit, and with the rig closed in between; gone on with twice in the same process.
static void stopped_and_gone_on_with(void **state) {
    (void)state;
    gonio_outcome plain, outcome;
    measure_whole(path, &plain);
    char other[128];
    snprintf(other, sizeof other, "%s-stopped", path);
    watcher w = {.stop_at = 4};
    const gonio_measure_options options = options_of(&w);
    gonio_error error = {0};
    gonio_rig_file *rig = open_rig(NULL);
    gonio_session *session;
    assert_int_equal(gonio_measure_begin(other, rig, &options, &session, &error), GONIO_OK);
    assert_int_equal(gonio_measure_run(session, rig, &options, &outcome, &error), GONIO_E_INTERRUPTED);
    assert_true(outcome.samples == NULL && outcome.model_path == NULL);
    assert_non_null(strstr(error.message, "4 of 12"));
    w = (watcher){.stop_at = 7};
    assert_int_equal(gonio_measure_run(session, rig, &options, &outcome, &error), GONIO_E_INTERRUPTED);
    assert_true(w.done_before == 4 && w.last_done == 7);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
    for (int last = 0; last < 2; last++) { // first stopped in the fit, then not
        w = (watcher){.stop_at = 1000, .stop_fit = last == 0};
        assert_int_equal(gonio_session_open(other, true, &session, &error), GONIO_OK);
        if (gonio_rig_file_reopen(session, NULL, &rig, &error) != GONIO_OK) {
            fail_msg("%s", error.message);
        }
        const gonio_status status = gonio_measure_run(session, rig, &options, &outcome, &error);
        assert_int_equal(status, last == 0 ? GONIO_E_INTERRUPTED : GONIO_OK);
        gonio_session_close(session);
        gonio_rig_file_close(rig);
    }
    assert_string_equal(outcome.samples_sha256, plain.samples_sha256);
    assert_string_equal(outcome.model_sha256, plain.model_sha256);
    gonio_outcome_free(&outcome);
    gonio_outcome_free(&plain);
}

static void hands_are_asked(void **state) {
    (void)state;
    watcher w = {.stop_at = 1000};
    gonio_measure_options options = options_of(&w);
    options.hooks.mount = NULL;
    gonio_rig_file *rig = open_rig("mount.by=operator");
    gonio_session *session;
    gonio_error error = {0};
    assert_true(gonio_rig_file_needs_hands(rig));
    assert_int_equal(gonio_measure_begin(path, rig, &options, &session, &error), GONIO_E_USAGE);
    assert_null(session);
    assert_int_equal(access(path, F_OK), -1);
    options.hooks.mount = put_target;
    gonio_outcome outcome;
    assert_int_equal(gonio_measure_begin(path, rig, &options, &session, &error), GONIO_OK);
    gonio_rig_file_close(rig);
    assert_int_equal(gonio_rig_file_reopen(session, NULL, &rig, &error), GONIO_OK);
    assert_true(gonio_rig_file_needs_hands(rig)); // the journal knows
    assert_int_equal(gonio_measure_run(session, rig, &options, &outcome, &error), GONIO_OK);
    assert_int_equal(w.mounts, 4); // trap, reference, sample, reference
    gonio_outcome_free(&outcome);
    // Again: nothing is measured, so nobody is asked, and the operator is told.
    assert_int_equal(gonio_measure_run(session, rig, &options, &outcome, &error), GONIO_OK);
    assert_true(w.mounts == 4 && w.notes == 1);
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
}

static void wrong_requests_leave_nothing(void **state) {
    (void)state;
    watcher w = {.stop_at = 1000};
    gonio_rig_file *rig = open_rig(NULL);
    gonio_session *session;
    for (int k = 0; k < 3; k++) {
        gonio_measure_options options = options_of(&w);
        gonio_error error = {0};
        options.plan = k == 0 ? "nusselt:none" : k == 1 ? "/nowhere/plan.csv" : options.plan;
        options.fit.method = k == 2 ? "guess" : options.fit.method;
        assert_int_not_equal(gonio_measure_begin(path, rig, &options, &session, &error), GONIO_OK);
        assert_true(session == NULL && error.message[0] != 0);
        assert_int_equal(access(path, F_OK), -1);
    }
    gonio_rig_file_close(rig);
    const struct {
        gonio_rig_file_options options;
        gonio_status status;
    } bad[] = {{{.path = "/nowhere/rig.ini"}, GONIO_E_INPUT},
               {{.sample = NULL}, GONIO_E_USAGE},
               {{.sample = "felt:rho=1"}, GONIO_E_USAGE},
               {{.sample = "lambert:rho=0.5", .settings = (const char *const[]){"camera.colour=1"}, .n_settings = 1},
                GONIO_E_USAGE},
               {{.sample = "lambert:rho=0.5", .fragments = (const char *const[]){"/nowhere.ini"}, .n_fragments = 1},
                GONIO_E_INPUT}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_error error = {0};
        assert_int_equal(gonio_rig_file_open(&bad[k].options, &rig, &error), bad[k].status);
        assert_true(rig == NULL && error.message[0] != 0);
    }
    gonio_rig_file_close(NULL);
}

// ---- the process ----

// In place of libc's: a library that asks for the umask changes it for a moment, and for every thread.
static int umasks;
mode_t umask(mode_t mask) {
    umasks++;
    return (mode_t)syscall(SYS_umask, mask);
}

typedef struct process_state {
    mode_t mask;
    char folder[256], locale[256];
    uint64_t environment;
    struct sigaction action[32];
    sigset_t blocked;
} process_state;

static process_state state_of_process(void) {
    extern char **environ;
    process_state s;
    memset(&s, 0, sizeof s);
    s.mask = umask(0);
    umask(s.mask);
    assert_non_null(getcwd(s.folder, sizeof s.folder));
    snprintf(s.locale, sizeof s.locale, "%s", setlocale(LC_ALL, NULL));
    for (char **e = environ; *e != NULL; e++) {
        for (const char *c = *e; *c != 0; c++) {
            s.environment = s.environment * 31 + (unsigned char)*c;
        }
    }
    for (int k = 1; k < 32; k++) {
        sigaction(k, NULL, &s.action[k]);
    }
    sigprocmask(SIG_SETMASK, NULL, &s.blocked);
    return s;
}

static void many_calls(void) {
    gonio_outcome outcome;
    measure_whole(path, &outcome);
    gonio_fit_options fit;
    gonio_fit_options_default(&fit);
    fit.level = 2;
    fit.method = "cbmba";
    fit.diffuse_level = 1;
    fit.storage = "hash"; // libcmph draws from rand()
    fit.threads = 2;
    gonio_model *model;
    gonio_check_report report;
    gonio_error error = {0};
    if (gonio_fit(outcome.samples, &fit, &model, NULL, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    gonio_render_options render;
    gonio_render_options_default(&render);
    render.width = render.height = 32;
    char file[160];
    snprintf(file, sizeof file, "%s/ball.png", path);
    const gonio_model *const models[] = {model};
    assert_int_equal(gonio_render(models, 1, &render, file, NULL, &error), GONIO_OK);
    gonio_image image;
    assert_int_equal(gonio_image_read(file, true, &image, &error), GONIO_OK);
    gonio_image_free(&image);
    snprintf(file, sizeof file, "%s/model.gonio", path); // not an image, and OpenCV would say so
    assert_int_equal(gonio_image_read(file, true, &image, &error), GONIO_E_INPUT);
    assert_int_equal(gonio_check_model(model, 0, &report, &error), GONIO_OK);
    gonio_check_report_free(&report);
    gonio_model_free(model);
    gonio_outcome_free(&outcome);
}

static void the_process_stays_as_it_was(void **state) {
    (void)state;
    // What rand() gives after seeding is the same with the calls in between.
    srand(7);
    const int expected[2] = {rand(), rand()};
    srand(7);
    assert_int_equal(rand(), expected[0]);
    const process_state before = state_of_process();
    fflush(NULL);
    char said[128];
    snprintf(said, sizeof said, "%s/said", root);
    const int file = open(said, O_RDWR | O_CREAT, 0600), out = dup(1), err = dup(2);
    dup2(file, 1);
    dup2(file, 2);
    umasks = 0;
    many_calls();
    const int asked = umasks;
    fflush(NULL);
    dup2(out, 1);
    dup2(err, 2);
    char text[512] = "";
    assert_true(pread(file, text, sizeof text - 1, 0) >= 0);
    close(file), close(out), close(err);
    assert_string_equal(text, "");
    assert_int_equal(asked, 0);
    assert_int_equal(rand(), expected[1]);
    const process_state after = state_of_process();
    assert_int_equal(before.mask, after.mask);
    assert_string_equal(before.folder, after.folder);
    assert_string_equal(before.locale, after.locale);
    assert_true(before.environment == after.environment);
    for (int k = 1; k < 32; k++) {
        if (before.action[k].sa_handler != after.action[k].sa_handler) {
            fail_msg("signal %d", k);
        }
    }
    assert_memory_equal(&before.blocked, &after.blocked, sizeof after.blocked);
}

int main(void) {
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        T(whole_and_replayed),           T(stopped_and_gone_on_with),    T(hands_are_asked),
        T(wrong_requests_leave_nothing), T(the_process_stays_as_it_was),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
