// SPDX-License-Identifier: BSD-3-Clause
// The acquisition: steps in short and repeatable order, windows around the sample, a setup that comes back exactly, and
// a scan that a stop anywhere does not change.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "fit/options.h"
#include "gonio/sim.h"
#include "host/acquire/acquire.h"
#include "host/drivers/null.h"
#include "tests/unit/key_values.h"
#include "tests/unit/session_folder.h"

typedef struct bench {
    gonio_sim *sim;
    gonio_rig rig;
} bench;

// A small and quick rig: few pixels a frame.
static bench open_rig(void) {
    bench b;
    gonio_error error = {0};
    assert_int_equal(gonio_sim_new("ward:rho_d=0.3,rho_s=0.2,alpha=0.3", 5, &b.sim, &error), GONIO_OK);
    assert_int_equal(gonio_sim_set(b.sim, "rig", "camera_distance_mm", "1000", &error), GONIO_OK);
    assert_int_equal(gonio_sim_set(b.sim, "camera", "fx_px", "3000", &error), GONIO_OK);
    assert_int_equal(gonio_sim_open(b.sim, 1, &b.rig, &error), GONIO_OK);
    return b;
}

static void close_rig(bench *b) {
    gonio_rig_close(&b->rig);
    gonio_sim_free(b->sim);
}

static gonio_plan *make_plan(const char *text) {
    gonio_plan *plan;
    assert_int_equal(gonio_plan_make(text, 1, &plan, NULL), GONIO_OK);
    return plan;
}

// ---- steps ----

static int by_angles(const void *a, const void *b) { return memcmp(a, b, sizeof(gonio_pair)); }

static void test_steps_hold_every_pose_once(void **state) {
    (void)state;
    bench b = open_rig();
    gonio_plan *plan = make_plan("nusselt:300,anisotropic=1");
    gonio_step *steps;
    size_t n;
    gonio_scan_options options;
    gonio_scan_options_default(&options);
    assert_int_equal(gonio_scan_steps(&b.rig, &options, plan, &steps, &n, NULL), GONIO_OK);
    assert_int_equal(n, 306);
    assert_int_equal(steps[0].kind, GONIO_STEP_DARK);
    assert_int_equal(steps[1].kind, GONIO_STEP_TRAP);
    assert_int_equal(steps[2].kind, GONIO_STEP_REFERENCE);
    assert_int_equal(steps[n - 1].kind, GONIO_STEP_REFERENCE);
    gonio_pair poses[300];
    for (size_t i = 0; i < 300; i++) {
        assert_int_equal(steps[i + 4].kind, GONIO_STEP_SAMPLE);
        assert_int_equal(steps[i + 4].index, i + 4);
        poses[i] = steps[i + 4].pose;
        // Canonical: the journal's degrees bring it back exactly.
        assert_true(gonio_radians(gonio_degrees(poses[i].theta_o)) == poses[i].theta_o);
        gonio_pair *p = &plan->poses[i];
        *p = (gonio_pair){gonio_angle_canonical(p->theta_i), gonio_angle_canonical(p->phi_i),
                          gonio_angle_canonical(p->theta_o), gonio_angle_canonical(p->phi_o)};
    }
    qsort(poses, 300, sizeof *poses, by_angles);
    qsort(plan->poses, 300, sizeof *poses, by_angles);
    assert_memory_equal(poses, plan->poses, sizeof poses);
    free(steps);
    gonio_plan_free(plan);
    close_rig(&b);
}

// The tour is far shorter than the plan's own order (for 1,000 spread poses in 3-D by about n^(1/3) / 2), also where it
// slides over more candidates than it looks at, and two runs give the same one.
static void test_steps_make_short_moves(void **state) {
    (void)state;
    bench b = open_rig();
    gonio_scan_options options;
    gonio_scan_options_default(&options);
    static const char *const plans[] = {"nusselt:1000", "nusselt:5000"};
    for (int p = 0; p < 2; p++) {
        gonio_plan *plan = make_plan(plans[p]);
        gonio_step *steps, *again, *plain;
        size_t n;
        assert_int_equal(gonio_scan_steps(&b.rig, &options, plan, &steps, &n, NULL), GONIO_OK);
        assert_int_equal(gonio_scan_steps(&b.rig, &options, plan, &again, &n, NULL), GONIO_OK);
        assert_memory_equal(steps, again, n * sizeof *steps);
        plain = calloc(n, sizeof *plain);
        for (size_t i = 0; i < plan->n; i++) {
            plain[i].pose = plan->poses[i];
        }
        const double ours = gonio_scan_travel_s(&b.rig, steps, n, 0);
        const double theirs = gonio_scan_travel_s(&b.rig, plain, plan->n, 0);
        assert_true(ours < 0.4 * theirs);
        free(steps);
        free(again);
        free(plain);
        gonio_plan_free(plan);
    }
    close_rig(&b);
}

// ---- window ----

static void test_windows(void **state) {
    (void)state;
    const gonio_camera_info camera = {
        .width = 641, .height = 513, .bits = 12, .fx = 1e4, .fy = 1e4, .cx = 319.5, .cy = 255.5, .k1 = -2};
    gonio_rig_facts facts = {.camera_distance_mm = 1000, .region_radius_mm = 5, .sphere_radius_mm = 20};
    gonio_scan_options options = {0};
    gonio_window w;
    // A disc of 5 mm radius at 0.1 mm a pixel: 100 pixels and a margin, even, centred.
    assert_int_equal(gonio_scan_window(&camera, &facts, &options, &w, NULL), GONIO_OK);
    assert_true(w.width >= 110 && w.width <= 140 && w.width == w.height);
    assert_true(w.x % 2 == 0 && w.y % 2 == 0 && w.width % 2 == 0);
    assert_true(fabs(w.x + (w.width - 1) / 2.0 - camera.cx) <= 1 && fabs(w.y + (w.height - 1) / 2.0 - camera.cy) <= 1);
    facts.sphere = true;
    assert_int_equal(gonio_scan_window(&camera, &facts, &options, &w, NULL), GONIO_OK);
    assert_true(w.width >= 400 && w.width <= 480);
    options = (gonio_scan_options){.window_width = -1, .window_height = -1};
    assert_int_equal(gonio_scan_window(&camera, &facts, &options, &w, NULL), GONIO_OK);
    assert_true(w.x == 0 && w.y == 0 && w.width == 641 && w.height == 513);
    options = (gonio_scan_options){.window_width = 160, .window_height = 128};
    assert_int_equal(gonio_scan_window(&camera, &facts, &options, &w, NULL), GONIO_OK);
    assert_true(w.width == 160 && w.height == 128);
    options.window_width = 700;
    assert_int_equal(gonio_scan_window(&camera, &facts, &options, &w, NULL), GONIO_E_INPUT);
    // A sample that fills more than the sensor: the sensor, its odd rim apart.
    options = (gonio_scan_options){0};
    facts.sphere_radius_mm = 200;
    assert_int_equal(gonio_scan_window(&camera, &facts, &options, &w, NULL), GONIO_OK);
    assert_true(w.x == 0 && w.y == 0 && w.width == 640 && w.height == 512);
    facts.sphere_radius_mm = 2000;
    assert_int_equal(gonio_scan_window(&camera, &facts, &options, &w, NULL), GONIO_E_INPUT);
}

// ---- setup ----

static void test_setup_comes_back(void **state) {
    (void)state;
    gonio_session *session;
    assert_int_equal(gonio_session_create(path, &session, NULL), GONIO_OK);
    gonio_setup setup = {
        .camera = {.name = "cam \"1\"", .width = 640, .height = 480, .bits = 12, .fx = 1.0 / 3, .k1 = -2e-17},
        .facts = {.light_distance_mm = 1e3 / 7,
                  .reference_reflectance = {0.99, 1.0 / 3, 0.1},
                  .sphere = true,
                  .operator_name = "Z\xc3\xbcrich\n2"},
        .scan = {.dark_frames = 4, .settle_s = 0.1, .hands = true},
        .window = {1, 2, 3, 4}};
    gonio_fit_options_default(&setup.fit);
    setup.fit.method = "lsq";
    setup.fit.seed = UINT64_MAX;
    setup.fit.level = 4;
    gonio_error error = {0};
    assert_int_equal(gonio_setup_put(session, &setup, &error), GONIO_OK);
    gonio_setup back;
    assert_int_equal(gonio_setup_get(session, &back, &error), GONIO_OK);
    assert_memory_equal(&back.camera, &setup.camera, sizeof back.camera);
    assert_memory_equal(&back.facts, &setup.facts, sizeof back.facts);
    assert_memory_equal(&back.window, &setup.window, sizeof back.window);
    assert_true(back.scan.dark_frames == 4 && back.scan.settle_s == 0.1 && back.scan.hands);
    assert_string_equal(back.fit.method, "lsq");
    assert_true(back.fit.seed == UINT64_MAX && back.fit.level == 4);
    // A text that is no UTF-8 cannot stand in JSON: said so, not stored in pieces.
    strcpy(setup.facts.notes, "\xff\xfe");
    assert_int_equal(gonio_setup_put(session, &setup, &error), GONIO_E_INPUT);
    assert_int_equal(gonio_session_put(session, "window", "{\"x\":1}", NULL), GONIO_OK);
    assert_int_equal(gonio_setup_get(session, &back, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "window"));
    gonio_session_close(session);
}

// Every option of the fit, whatever it is, and what sessions of earlier releases hold of them.
static void test_fit_options_come_back(void **state) {
    (void)state;
    gonio_session *session;
    gonio_error error = {0};
    assert_int_equal(gonio_session_create(path, &session, NULL), GONIO_OK);
    gonio_setup setup = {.camera = {.width = 2, .height = 2, .bits = 8}, .window = {0, 0, 2, 2}}, back;
    gonio_fit_options_default(&setup.fit);
    assert_int_equal(gonio_setup_put(session, &setup, &error), GONIO_OK);
    assert_int_equal(gonio_setup_get(session, &back, &error), GONIO_OK);
    for (const gonio_key *key = gonio_fit_keys; key->name != NULL; key++) {
        assert_true(gonio_key_equal(key, &setup.fit, &back.fit));
        set_other(key, &setup.fit);
    }
    assert_int_equal(gonio_setup_put(session, &setup, &error), GONIO_OK);
    assert_int_equal(gonio_setup_get(session, &back, &error), GONIO_OK);
    for (const gonio_key *key = gonio_fit_keys; key->name != NULL; key++) {
        if (!gonio_key_equal(key, &setup.fit, &back.fit)) {
            fail_msg("%s does not come back", key->name);
        }
    }
    static const char first[] = "{\"fit_method\":\"lsq\",\"fit.level\":4,\"fit.tolerance\":0.0,"
                                "\"fit.hold_out\":0.25,\"fit.seed\":\"7\"}";
    gonio_fit_options usual;
    gonio_fit_options_default(&usual);
    usual.method = "lsq";
    usual.level = 4;
    usual.hold_out = 0.25;
    usual.seed = 7;
    assert_int_equal(gonio_session_put(session, "fit", first, &error), GONIO_OK);
    assert_int_equal(gonio_setup_get(session, &back, &error), GONIO_OK);
    for (const gonio_key *key = gonio_fit_keys; key->name != NULL; key++) {
        assert_true(gonio_key_equal(key, &usual, &back.fit));
    }
    assert_int_equal(gonio_session_put(session, "fit", "{\"fit_method\":\"nonsense\"}", &error), GONIO_OK);
    assert_int_equal(gonio_setup_get(session, &back, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "method"));
    gonio_session_close(session);
}

// ---- the scan ----

enum { POSES = 12 };

static gonio_session *begin(bench *b, const gonio_scan_options *scan) {
    gonio_session *session;
    gonio_setup setup = {0};
    gonio_error error = {0};
    gonio_step *steps;
    size_t n;
    gonio_fit_options_default(&setup.fit);
    gonio_plan *plan = make_plan("nusselt:12");
    assert_int_equal(gonio_session_create(path, &session, &error), GONIO_OK);
    assert_int_equal(gonio_setup_of_rig(&b->rig, scan, &setup, &error), GONIO_OK);
    assert_int_equal(gonio_scan_steps(&b->rig, scan, plan, &steps, &n, &error), GONIO_OK);
    assert_int_equal(gonio_setup_put(session, &setup, &error), GONIO_OK);
    assert_int_equal(gonio_session_put_steps(session, steps, n, &error), GONIO_OK);
    free(steps);
    gonio_plan_free(plan);
    return session;
}

static gonio_scan_options quick(void) {
    gonio_scan_options options;
    gonio_scan_options_default(&options);
    options.dark_frames = options.reference_frames = 4;
    return options;
}

// Drive at most `limit` steps; the number done.
static int drive(gonio_session *session, const gonio_rig *rig, const gonio_scan_hooks *hooks, int limit,
                 gonio_status expected) {
    gonio_scan *scan;
    gonio_error error = {0};
    assert_int_equal(gonio_scan_new(session, rig, hooks, &scan, &error), GONIO_OK);
    int done = 0;
    gonio_status status = GONIO_OK;
    const gonio_samples *samples;
    while (status == GONIO_OK && done < limit && !gonio_scan_done(scan)) {
        status = gonio_scan_step(scan, &samples, &error);
        done += status == GONIO_OK;
    }
    assert_int_equal(status, expected);
    gonio_scan_free(scan);
    return done;
}

static gonio_samples *samples_of(gonio_session *session) {
    gonio_samples *samples;
    gonio_error error = {0};
    assert_int_equal(gonio_session_samples(session, &samples, &error), GONIO_OK);
    return samples;
}

static void assert_same(const gonio_samples *a, const gonio_samples *b) {
    const size_t bytes = a->n * (size_t)a->channels * sizeof(double);
    assert_true(a->n == b->n && a->channels == b->channels);
    assert_memory_equal(a->pairs, b->pairs, a->n * sizeof *a->pairs);
    assert_memory_equal(a->values, b->values, bytes);
    assert_memory_equal(a->sigma_random, b->sigma_random, bytes);
    assert_memory_equal(a->sigma_systematic, b->sigma_systematic, bytes);
}

// Whole in one go, against one that is broken off after every single step and goes on with a fresh rig each time.
static void test_a_scan_in_pieces(void **state) {
    (void)state;
    const gonio_scan_options options = quick();
    const gonio_scan_hooks hooks = {0};
    bench b = open_rig();
    gonio_session *whole = begin(&b, &options);
    assert_int_equal(drive(whole, &b.rig, &hooks, 1000, GONIO_OK), POSES + 6);
    gonio_samples *expected = samples_of(whole);
    assert_int_equal(expected->n, POSES);
    close_rig(&b);

    snprintf(path, sizeof path, "%s/pieces", root);
    b = open_rig();
    gonio_session *pieces = begin(&b, &options);
    for (int done = 0; done < POSES + 6; done++) {
        close_rig(&b);
        b = open_rig();
        assert_int_equal(drive(pieces, &b.rig, &hooks, 1, GONIO_OK), 1);
    }
    gonio_samples *samples = samples_of(pieces);
    assert_same(samples, expected);
    gonio_samples_free(samples);

    // Steps that are lost in the middle, the calibration among them, come back the same.
    assert_int_equal(gonio_session_undo_step(pieces, 0, "test", NULL), GONIO_OK);
    assert_int_equal(gonio_session_undo_step(pieces, 5, "test", NULL), GONIO_OK);
    assert_int_equal(gonio_session_put_step_samples(pieces, 7, NULL, NULL), GONIO_OK);
    assert_int_equal(drive(pieces, &b.rig, &hooks, 1000, GONIO_OK), 2);
    samples = samples_of(pieces);
    assert_same(samples, expected);
    gonio_samples_free(samples);

    gonio_samples_free(expected);
    gonio_session_close(whole);
    gonio_session_close(pieces);
    close_rig(&b);
}

// From the stored frames, on one thread and on several: the journalled samples, bit for bit.
static void test_frames_give_the_samples_again(void **state) {
    (void)state;
    const gonio_scan_options options = quick();
    const gonio_scan_hooks hooks = {0};
    bench b = open_rig();
    gonio_session *session = begin(&b, &options);
    drive(session, &b.rig, &hooks, 1000, GONIO_OK);
    gonio_samples *expected = samples_of(session);
    for (int threads = 1; threads <= 3; threads++) {
        gonio_process process;
        gonio_samples **sets;
        gonio_step_radiance *radiance;
        bool ready;
        gonio_error error = {0};
        assert_int_equal(gonio_process_begin(session, &process, &error), GONIO_OK);
        assert_true(process.isotropic);
        assert_int_equal(gonio_process_prepare(session, &process, NULL, NULL, 0, &ready, &error), GONIO_OK);
        assert_true(ready);
        assert_int_equal(gonio_process_samples(session, &process, false, threads, NULL, NULL, &sets, &radiance, &error),
                         GONIO_OK);
        gonio_samples *all;
        assert_int_equal(gonio_process_new_samples(&process, &all, NULL), GONIO_OK);
        for (size_t i = 0; i < process.n; i++) {
            for (size_t k = 0; sets[i] != NULL && k < sets[i]->n; k++) {
                gonio_samples_add(all, &sets[i]->pairs[k], &sets[i]->values[k], &sets[i]->sigma_random[k],
                                  &sets[i]->sigma_systematic[k], NULL);
            }
        }
        assert_same(all, expected);
        gonio_samples_free(all);
        for (size_t i = 0; i < process.n; i++) { // and so is what the frames say before geometry
            gonio_step_radiance journalled;
            assert_int_equal(gonio_session_radiance(session, (int64_t)i, &journalled, &error), GONIO_OK);
            assert_int_equal(journalled.channels, sets[i] != NULL ? 1 : 0);
            assert_memory_equal(&journalled, &radiance[i], sizeof journalled);
        }
        free(radiance);
        gonio_sets_free(sets, process.n);
        gonio_process_end(&process);
    }
    gonio_samples_free(expected);
    gonio_session_close(session);
    close_rig(&b);
}

// A dark step with the shutter stuck open calibrates nothing: the calibration says so, and counts as not done.
static gonio_status stuck_shutter(void *device, bool open, gonio_error *error) {
    bench *b = device;
    (void)open;
    return b->rig.lamp->set_shutter(b->rig.lamp_device, true, error);
}
static gonio_status pass_level(void *device, double level, gonio_error *error) {
    bench *b = device;
    return b->rig.lamp->set_level(b->rig.lamp_device, level, error);
}
static gonio_status pass_ready(void *device, const gonio_stamp *stamp, double timeout_s, double *waited_s,
                               gonio_error *error) {
    bench *b = device;
    return b->rig.lamp->wait_ready(b->rig.lamp_device, stamp, timeout_s, waited_s, error);
}

static void test_dark_frames_that_are_not_dark(void **state) {
    (void)state;
    const gonio_lamp_ops stuck = {
        .name = "stuck", .set_level = pass_level, .set_shutter = stuck_shutter, .wait_ready = pass_ready};
    const gonio_scan_options options = quick();
    const gonio_scan_hooks hooks = {0};
    bench b = open_rig();
    gonio_rig faulty = b.rig;
    faulty.lamp = &stuck;
    faulty.lamp_device = &b;
    gonio_session *session = begin(&b, &options);
    gonio_scan *scan;
    gonio_error error = {0};
    const gonio_samples *samples;
    assert_int_equal(gonio_scan_new(session, &faulty, &hooks, &scan, &error), GONIO_OK);
    gonio_status status = GONIO_OK;
    for (int i = 0; i < 3 && status == GONIO_OK; i++) {
        status = gonio_scan_step(scan, &samples, &error);
    }
    assert_true(status != GONIO_OK);
    assert_non_null(strstr(error.message, "dark"));
    gonio_scan_free(scan);
    // Repaired, the same session goes the whole way.
    assert_int_equal(drive(session, &b.rig, &hooks, 1000, GONIO_OK), POSES + 6);
    gonio_session_close(session);
    close_rig(&b);
}

typedef struct operator_log {
    int calls;
    gonio_target targets[8];
} operator_log;

static gonio_status ask(void *context, gonio_target target, gonio_error *error) {
    operator_log *log = context;
    if (log->calls < 8) {
        log->targets[log->calls] = target;
    }
    return ++log->calls < 8 ? GONIO_OK : gonio_fail(error, GONIO_E_DEVICE, "asked too often");
}

static void test_hands_are_asked_for_each_change(void **state) {
    (void)state;
    gonio_scan_options options = quick();
    options.hands = true;
    operator_log log = {0};
    const gonio_scan_hooks hooks = {.context = &log, .mount = ask};
    bench b = open_rig();
    gonio_session *session = begin(&b, &options);
    assert_int_equal(drive(session, &b.rig, &hooks, 6, GONIO_OK), 6);
    assert_int_equal(log.calls, 3); // nothing for the dark frames
    assert_true(log.targets[0] == GONIO_TARGET_TRAP && log.targets[1] == GONIO_TARGET_REFERENCE &&
                log.targets[2] == GONIO_TARGET_SAMPLE);
    // After a stop nobody knows what lies there: it is asked for again.
    assert_int_equal(drive(session, &b.rig, &hooks, 1000, GONIO_OK), POSES);
    assert_int_equal(log.calls, 5);
    assert_true(log.targets[3] == GONIO_TARGET_SAMPLE && log.targets[4] == GONIO_TARGET_REFERENCE);
    gonio_session_close(session);
    close_rig(&b);
}

// The null rig does all that a scan asks for; the calibration then finds that there is nothing to see.
static void test_null_rig(void **state) {
    (void)state;
    const gonio_scan_options options = quick();
    const gonio_scan_hooks hooks = {0};
    bench b = {0};
    assert_int_equal(gonio_null_rig_open(&b.rig, NULL), GONIO_OK);
    b.rig.facts = (gonio_rig_facts){.light_distance_mm = 1000,
                                    .camera_distance_mm = 1000,
                                    .region_radius_mm = 5,
                                    .reference_reflectance = {0.99, 0.99, 0.99}};
    gonio_session *session = begin(&b, &options);
    gonio_scan *scan;
    gonio_error error = {0};
    const gonio_samples *samples;
    assert_int_equal(gonio_scan_new(session, &b.rig, &hooks, &scan, &error), GONIO_OK);
    gonio_status status = GONIO_OK;
    for (int i = 0; i < 3 && status == GONIO_OK; i++) {
        status = gonio_scan_step(scan, &samples, &error);
    }
    assert_true(status != GONIO_OK && error.message[0] != 0);
    gonio_scan_free(scan);
    gonio_session_close(session);
    gonio_rig_close(&b.rig);
}

int main(void) {
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        T(test_steps_hold_every_pose_once),
        T(test_steps_make_short_moves),
        T(test_windows),
        T(test_setup_comes_back),
        T(test_fit_options_come_back),
        T(test_a_scan_in_pieces),
        T(test_frames_give_the_samples_again),
        T(test_dark_frames_that_are_not_dark),
        T(test_hands_are_asked_for_each_change),
        T(test_null_rig),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
