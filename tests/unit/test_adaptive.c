// SPDX-License-Identifier: BSD-3-Clause
// Plans that are made while they are measured: the text, the choice, and the measure that is stopped anywhere.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/gonio.h"
#include "tests/adaptive_run.h"
#include "tests/unit/session_folder.h"

static void plan_texts(void **state) {
    (void)state;
    static const struct {
        const char *text;
        int character; // at fault; 0: none
    } plans[] = {{"adaptive:350", 0},
                 {"adaptive:350,until=0.02,batch=20,share=0.4,first=30,theta_max=80,anisotropic=1", 0},
                 {"adaptive:", 10},
                 {"adaptive:7", 10},
                 {"adaptive:12.5", 10},
                 {"adaptive:35O", 10},
                 {"adaptive:350,shar=0.2", 14},
                 {"adaptive:350,", 14},
                 {"adaptive:350,share=2", 20},
                 {"adaptive:350,share=", 20},
                 {"adaptive:350,until=0", 20},
                 {"adaptive:350,share=0.5,batch=3.5", 30},
                 {"adaptive:350,anisotropic=2", 26},
                 {"adaptive:350,until=nan", 20}};
    for (size_t k = 0; k < sizeof plans / sizeof *plans; k++) {
        gonio_adaptive_plan plan;
        gonio_error error = {0};
        char place[32];
        snprintf(place, sizeof place, "character %d:", plans[k].character);
        const gonio_status status = gonio_adaptive_parse(plans[k].text, &plan, &error);
        assert_int_equal(status, plans[k].character > 0 ? GONIO_E_USAGE : GONIO_OK);
        assert_true(plans[k].character == 0 || strstr(error.message, place) != NULL);
    }
    gonio_adaptive_plan plan;
    assert_int_equal(gonio_adaptive_parse(plans[1].text, &plan, NULL), GONIO_OK);
    assert_true(plan.poses == 350 && plan.until == 0.02 && plan.batch == 20 && plan.share == 0.4 && plan.first == 30 &&
                plan.theta_max_deg == 80 && plan.anisotropic);
    gonio_plan *made;
    gonio_error error = {0};
    assert_int_equal(gonio_plan_make("adaptive:350", 1, &made, &error), GONIO_E_USAGE);
    assert_non_null(strstr(error.message, "while it is measured"));
}

// Threads change no pose, the stated share fills the space, nothing is asked for twice, all is within theta_max; a
// narrow mirror peak over a matt base is met by the first batch, and the holes that it leaves are asked for.
static void choices(void **state) {
    (void)state;
    gonio_model *truth = simulate_truth("ward:rho_d=0.3,rho_s=0.05,alpha=0.02");
    adaptive_run runs[2];
    double largest = 0, sigma = 0;
    for (int t = 0; t < 2; t++) {
        run_begin(&runs[t], truth, "adaptive:60,first=24,batch=18,theta_max=75,share=0.4", 5);
        runs[t].threads = 1 + 2 * t;
        assert_int_equal(run_batch(&runs[t]), 24);
        assert_int_equal(run_batch(&runs[t]), 18);
    }
    const gonio_adaptive *a = &runs[0].a;
    size_t filling[2] = {0}, all[2] = {0};
    for (size_t i = 0; i < a->n; i++) {
        const gonio_adaptive_pose *p = &a->poses[i];
        assert_memory_equal(&p->pose, &runs[1].a.poses[i].pose, sizeof p->pose);
        assert_true(fmax(p->pose.theta_i, p->pose.theta_o) <= gonio_radians(75) && p->pose.phi_i == 0);
        filling[p->batch] += p->why == GONIO_ADAPTIVE_FILL || p->why == GONIO_ADAPTIVE_MIRROR;
        all[p->batch]++;
        largest = fmax(largest, a->samples->values[p->sample]);
        sigma = p->why == GONIO_ADAPTIVE_SIGMA ? fmax(sigma, p->sigma) : sigma;
        assert_true(p->why != GONIO_ADAPTIVE_SIGMA || (p->gain > 0 && p->gain < 1 && p->seconds > 0));
        for (size_t j = 0; j < i; j++) {
            assert_memory_not_equal(&p->pose, &a->poses[j].pose, sizeof p->pose);
        }
    }
    assert_true(filling[0] == all[0] && filling[1] >= 0.4 * (double)all[1] && filling[1] < all[1]);
    assert_true(largest > 10 * 0.3 / GONIO_PI && sigma > 0.01);
    run_end(&runs[0]);
    run_end(&runs[1]);
    gonio_model_free(truth);
}

static bool gives_below_70(const gonio_pair *pose) { return pose->theta_o < gonio_radians(70); }

// A pose without a sample is asked for once more; then its neighbourhood is left alone.
static void poses_without_a_sample(void **state) {
    (void)state;
    gonio_model *truth = simulate_truth("ward:rho_d=0.3,rho_s=0.2,alpha=0.3");
    adaptive_run run;
    run_begin(&run, truth, "adaptive:56,first=24,batch=16", 2);
    run.gives = gives_below_70;
    while (run.a.n < 56) {
        run_batch(&run);
    }
    size_t again = 0, without = 0;
    for (size_t i = 0; i < run.a.n; i++) {
        const gonio_adaptive_pose *p = &run.a.poses[i];
        again += p->why == GONIO_ADAPTIVE_AGAIN;
        without += p->sample < 0;
        assert_true((p->sample < 0) == !gives_below_70(&p->pose));
    }
    assert_true(again > 0 && without > again && run.a.samples->n > 30);
    run_end(&run);
    gonio_model_free(truth);
}

// ---- a session ----

#define QUICK                                                                                                          \
    "camera.width=44,camera.height=44,camera.white_e_per_s=4e6,camera.exposure_max_s=0.06,camera.exposure_min_s=1e-6," \
    "sample.region_radius_mm=1,scan.settle_s=0.05"

typedef struct watcher {
    size_t stop_at;   // poses done
    bool stop_choice; // while the batch behind them is chosen
} watcher;

static bool watch(void *context, const gonio_measure_progress *now) {
    const watcher *w = context;
    const bool choosing = now->phase == GONIO_MEASURE_POSES && now->what[0] != 0;
    return now->phase != GONIO_MEASURE_POSES || now->done < w->stop_at || (w->stop_choice && !choosing);
}

static gonio_rig_file *open_rig(void) {
    static const char *const settings[] = {QUICK};
    const gonio_rig_file_options options = {
        .sample = "ward:rho_d=0.3,rho_s=0.2,alpha=0.3", .settings = settings, .n_settings = 1, .seed = 3, .threads = 1};
    gonio_rig_file *rig;
    assert_int_equal(gonio_rig_file_open(&options, &rig, NULL), GONIO_OK);
    return rig;
}

static gonio_measure_options options_of(watcher *w, const char *plan) {
    gonio_measure_options options;
    gonio_measure_options_default(&options);
    options.plan = plan;
    options.fit.method = "mba";
    options.threads = 1;
    options.hooks = (gonio_measure_hooks){.context = w, .progress = watch};
    return options;
}

static gonio_status measure(const char *where, const char *plan, watcher *w, gonio_outcome *outcome) {
    const gonio_measure_options options = options_of(w, plan);
    gonio_error error = {0};
    gonio_rig_file *rig = open_rig();
    gonio_session *session;
    assert_int_equal(gonio_measure_begin(where, rig, &options, &session, &error), GONIO_OK);
    const gonio_status status = gonio_measure_run(session, rig, &options, outcome, &error);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
    return status;
}

static gonio_status go_on(const char *where, watcher *w, gonio_outcome *outcome) {
    const gonio_measure_options options = options_of(w, "");
    gonio_rig_file *rig;
    gonio_session *session;
    assert_int_equal(gonio_session_open(where, true, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_rig_file_reopen(session, NULL, &rig, NULL), GONIO_OK);
    const gonio_status status = gonio_measure_run(session, rig, &options, outcome, NULL);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
    return status;
}

#define PLAN "adaptive:18,first=10,batch=8"

// Replayed, it is what it was; a choice that stands on other samples is told, and a record that is none is refused.
static void replay_tells(const char *where, const watcher *never) {
    gonio_session *session;
    gonio_outcome outcome;
    gonio_replay_report report;
    gonio_error error = {0};
    char *record;
    watcher w = *never;
    const gonio_measure_options options = options_of(&w, "");
    assert_int_equal(gonio_session_open(where, true, &session, NULL), GONIO_OK);
    assert_int_equal(gonio_replay(session, &options, &outcome, &report, NULL), GONIO_OK);
    assert_true(report.equal && report.batches == 2 && report.batches_differing == 0);
    gonio_outcome_free(&outcome);
    assert_int_equal(gonio_session_get(session, "adaptive.batch.1", &record, NULL), GONIO_OK);
    assert_non_null(strstr(record, "\"why\":\"sigma\""));
    char *at = strstr(record, "samples_sha256\":\"") + strlen("samples_sha256\":\"");
    *at = *at == '0' ? '1' : '0';
    assert_int_equal(gonio_session_put(session, "adaptive.batch.1", record, NULL), GONIO_OK);
    assert_int_equal(gonio_replay(session, &options, &outcome, &report, NULL), GONIO_OK);
    assert_int_equal(report.batches_differing, 1);
    gonio_outcome_free(&outcome);
    at[80] = 0;
    assert_int_equal(gonio_session_put(session, "adaptive.batch.1", record, NULL), GONIO_OK);
    assert_int_equal(gonio_replay(session, &options, &outcome, &report, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "adaptive.batch.1"));
    free(record);
    gonio_session_close(session);
}

// Stopped within a batch, while the next one is chosen, and just behind a choice: the same samples and model.
static void stopped_anywhere(void **state) {
    (void)state;
    gonio_outcome whole, outcome;
    watcher never = {.stop_at = 1000};
    assert_int_equal(measure(path, PLAN, &never, &whole), GONIO_OK);
    assert_true(whole.poses == 18 && whole.adaptive.batches == 2 && whole.adaptive.poses == 18);
    char other[128];
    snprintf(other, sizeof other, "%s-stopped", path);
    watcher stops[] = {{.stop_at = 4}, {.stop_at = 10, .stop_choice = true}, {.stop_at = 12}};
    for (size_t k = 0; k < sizeof stops / sizeof *stops; k++) {
        assert_int_equal(k == 0 ? measure(other, PLAN, &stops[k], &outcome) : go_on(other, &stops[k], &outcome),
                         GONIO_E_INTERRUPTED);
    }
    assert_int_equal(go_on(other, &never, &outcome), GONIO_OK);
    assert_string_equal(outcome.samples_sha256, whole.samples_sha256);
    assert_string_equal(outcome.model_sha256, whole.model_sha256);
    gonio_outcome_free(&outcome);
    gonio_outcome_free(&whole);
    replay_tells(other, &never);
}

static void ends_at_the_error(void **state) {
    (void)state;
    gonio_outcome outcome;
    watcher never = {.stop_at = 1000};
    assert_int_equal(measure(path, "adaptive:400,first=10,batch=20,share=1,until=0.9", &never, &outcome), GONIO_OK);
    assert_true(outcome.adaptive.met && outcome.poses < 100 && outcome.adaptive.held_out >= 12);
    assert_true(outcome.adaptive.median_rel <= 0.9 && outcome.poses == outcome.adaptive.poses);
    gonio_outcome_free(&outcome);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plan_texts),
        cmocka_unit_test(choices),
        cmocka_unit_test(poses_without_a_sample),
        cmocka_unit_test_setup_teardown(stopped_anywhere, set_up, tear_down),
        cmocka_unit_test_setup_teardown(ends_at_the_error, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
