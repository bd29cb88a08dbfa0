// SPDX-License-Identifier: BSD-3-Clause
// The simulated lamp and its monitor.
//
// Statistics: 2000 fixed seeds; bounds are 5 standard errors, 6e-7 each for fresh seeds, fewer than ten of them.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "tests/unit/near.h"
#include "tests/unit/sim_rig.h"

enum { SEEDS = 2000 };

static const char *const small[] = {"camera.width=8", "camera.height=8", NULL};

static double meter(const sim_rig *r, double clock_s, int64_t pose, double *sigma) {
    const gonio_stamp stamp = {.pose = pose, .clock_s = clock_s};
    double value;
    assert_int_equal(r->rig.meter->read(r->rig.meter_device, &stamp, 0, &value, sigma, NULL), GONIO_OK);
    return value;
}

static void warms_up(void **state) {
    (void)state;
    const char *const extra[] = {"lamp.warm_up_percent=10", "lamp.warm_up_s=60", "camera.width=8", "camera.height=8",
                                 NULL};
    sim_rig r;
    double sigma, waited;
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, sim_perfect, extra);
    assert_near(meter(&r, 0, 0, &sigma), 0.9, 1e-5);
    assert_near(meter(&r, 60, 0, &sigma), 1 - 0.1 * exp(-1), 1e-5);
    gonio_stamp stamp = {.clock_s = 10};
    assert_int_equal(r.rig.lamp->wait_ready(r.sim, &stamp, 1e4, &waited, NULL), GONIO_OK);
    assert_near(waited, 60 * log(0.1 / 1e-4) - 10, 1e-9);
    assert_int_equal(r.rig.lamp->wait_ready(r.sim, &stamp, 100, &waited, NULL), GONIO_E_TIMEOUT);
    assert_near(waited, 0, 0);
    stamp.clock_s = 5000;
    assert_int_equal(r.rig.lamp->wait_ready(r.sim, &stamp, 1, &waited, NULL), GONIO_OK);
    assert_near(waited, 0, 0);
    assert_int_equal(r.rig.lamp->set_level(r.sim, 0.25, NULL), GONIO_OK);
    assert_near(meter(&r, 1e5, 0, &sigma), 0.25, 1e-5);
    assert_int_equal(r.rig.lamp->set_level(r.sim, 1.1, NULL), GONIO_E_RANGE);
    assert_int_equal(r.rig.lamp->set_level(r.sim, 0, NULL), GONIO_OK);
    assert_int_equal(r.rig.lamp->wait_ready(r.sim, &stamp, 1e4, &waited, NULL), GONIO_E_DEVICE);
    sim_rig_close(&r);
}

// Between two hours the lamp drifts by 0.5 % rms over the seeds; the wander adds its own 0.05 % at either end.
static void drift_is_as_stated(void **state) {
    (void)state;
    double square = 0, noise = 0;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        const char *const extra[] = {"meter.noise_percent=0", "camera.width=8", "camera.height=8", NULL};
        sim_rig r;
        double sigma;
        sim_rig_open(&r, "lambert:rho=0.5", seed, 1, extra, NULL);
        const double change = meter(&r, 7200, 0, &sigma) - meter(&r, 3600, 0, &sigma);
        square += change * change / SEEDS;
        assert_near(r.rig.facts.lamp_drift_per_h, 0.005, 1e-15);
        sim_rig_close(&r);
        sim_rig_open(&r, "lambert:rho=0.5", seed, 1, small, NULL);
        const double d = (meter(&r, 7200, 1, &sigma) - meter(&r, 7200, 2, &sigma)) / sigma;
        noise += d * d / 2 / SEEDS;
        sim_rig_close(&r);
    }
    const double variance = 0.005 * 0.005 + 2 * 0.0005 * 0.0005;
    assert_near(square / variance, 1, 5 * sqrt(2.0 / SEEDS));
    assert_near(noise, 1, 5 * sqrt(2.0 / SEEDS));
}

// The frames follow the lamp that the monitor sees.
static void frames_follow_the_monitor(void **state) {
    (void)state;
    const char *const extra[] = {"lamp.drift_percent_per_hour=20",
                                 "lamp.warm_up_percent=30",
                                 "camera.width=64",
                                 "camera.height=64",
                                 "camera.bits=16",
                                 NULL};
    sim_rig r;
    double sigma;
    sim_rig_open(&r, "lambert:rho=0.5", 6, 1, sim_perfect, extra);
    gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
    const double clocks[] = {0, 100, 7200};
    for (int k = 0; k < 3; k++) {
        stamp.clock_s = clocks[k];
        stamp.frame = k;
        uint16_t *pixels = sim_rig_capture(&r, sim_rig_full(&r), 0.01, stamp);
        double mean = 0;
        for (int i = 0; i < 4096; i++) {
            mean += (pixels[i] - 1024.0) / (65535 - 1024) * 10000 / 4096;
        }
        const double expected = 2500 * meter(&r, clocks[k] + 0.005, 0, &sigma);
        // The plate's own fall-off over 6.4 mm is below 2e-5.
        assert_near(mean, expected, 5 * sqrt(expected / 4096) + 2e-5 * expected);
        free(pixels);
    }
    sim_rig_close(&r);
}

static void meter_can_be_absent(void **state) {
    (void)state;
    const char *const extra[] = {"meter.present=0", NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 6, 1, small, extra);
    assert_null(r.rig.meter);
    assert_null(r.rig.meter_device);
    sim_rig_close(&r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(warms_up),
        cmocka_unit_test(drift_is_as_stated),
        cmocka_unit_test(frames_follow_the_monitor),
        cmocka_unit_test(meter_can_be_absent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
