// SPDX-License-Identifier: BSD-3-Clause
// The simulated axes: durations against the trapezoid's closed forms and the machine's own time, limits, homing,
// pointing, backlash, faults.
//
// Statistics: 2000 fixed seeds; bounds are 5 standard errors, 6e-7 each for fresh seeds, a dozen of them.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "sim/internal.h"
#include "tests/unit/near.h"
#include "tests/unit/sim_rig.h"

static const char *const small[] = {"camera.width=8", "camera.height=8", NULL};

static double duration(const sim_rig *r, int axis, double from_deg, double to_deg) {
    double from[GONIO_AXES] = {0}, to[GONIO_AXES] = {0};
    from[axis] = gonio_radians(from_deg);
    to[axis] = gonio_radians(to_deg);
    return r->rig.stage->duration_s(r->rig.stage_device, from, to);
}

// 20 deg/s and 40 deg/s^2 reach full speed in 0.5 s and 5 deg.
static void durations(void **state) {
    (void)state;
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, small, NULL);
    assert_near(duration(&r, 0, 0, 40), 0.5 + 0.5 + 30.0 / 20, 1e-12);
    assert_near(duration(&r, 2, 10, 12.5), 2 * sqrt(2.5 / 40), 1e-12); // a triangle
    assert_near(duration(&r, 2, 10, 10), 0, 0);
    // Downward it passes the target by 0.1 deg and comes back.
    assert_near(duration(&r, 1, 40, 0), 1 + (40.1 - 10) / 20 + 2 * sqrt(0.1 / 40), 1e-12);
    // Axes move together: the slowest counts.
    const double from[GONIO_AXES] = {0, 0, 0, 0}, to[GONIO_AXES] = {0.1, 1.5, 0.2, 0.3};
    assert_near(r.rig.stage->duration_s(r.sim, from, to), duration(&r, 1, 0, gonio_degrees(1.5)), 0);
    sim_rig_close(&r);
}

// The nominal clock leaves out what rounding to segments, the approach to rest and the energising add: milliseconds.
static void moves_take_what_the_clock_says(void **state) {
    (void)state;
    for (int jerk = 0; jerk < 2; jerk++) {
        const char *const extra[] = {"axis light_phi.speed_deg_per_s=50", "axis camera_phi.acceleration_deg_per_s2=300",
                                     jerk ? "axis light_theta.jerk_deg_per_s3=100" : "camera.width=8", NULL};
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", 1, 1, small, extra);
        const double poses[][GONIO_AXES] = {
            {10, 20, 30, 40}, {70, -300, 2, 41}, {69.98, -300, 2, 41}, {70, -300, 2, 41}, {0, 0, 0, 0}};
        double from[GONIO_AXES] = {0};
        for (size_t i = 0; i < sizeof poses / sizeof *poses; i++) {
            double to[GONIO_AXES];
            for (int k = 0; k < GONIO_AXES; k++) {
                to[k] = gonio_radians(poses[i][k]);
            }
            const double nominal = r.rig.stage->duration_s(r.sim, from, to);
            const uint64_t start_us = r.sim->machine.now_us;
            sim_rig_move(&r, 1, poses[i][0], poses[i][1], poses[i][2], poses[i][3]);
            const double took = 1e-6 * (double)(r.sim->machine.now_us - start_us);
            if (took < nominal || took > nominal + 0.02) {
                fail_msg("move %zu: %g s, the clock says %g s", i, took, nominal);
            }
            memcpy(from, to, sizeof from);
        }
        sim_rig_close(&r);
    }
}

// From anywhere, without a step of difference.
static void homing_finds_the_same_place(void **state) {
    (void)state;
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, small, NULL);
    const double poses[][GONIO_AXES] = {{90, 360, -90, -360}, {-0.1, -0.11, -0.05, -0.16}, {1, 0, 2, 0}};
    for (size_t i = 0; i < sizeof poses / sizeof *poses; i++) {
        sim_rig_move(&r, 1, poses[i][0], poses[i][1], poses[i][2], poses[i][3]);
        assert_int_equal(r.rig.stage->home(r.sim, 100, NULL), GONIO_OK);
        for (int k = 0; k < GONIO_AXES; k++) {
            assert_true(r.sim->machine.core.registers.home_difference[k] == 0);
            assert_true(r.sim->machine.axis[k].steps == 0 && r.sim->machine.axis[k].arm == 0);
            assert_near(r.sim->actual_rad[k], r.sim->truth.zero_error_rad[k], 0);
        }
    }
    gonio_error error = {0};
    sim_rig_move(&r, 1, 90, 360, 90, 360);
    assert_int_equal(r.rig.stage->home(r.sim, 2, &error), GONIO_E_TIMEOUT);
    gonio_machine_hold(&r.sim->machine, FW_CONTACT_home_2, true);
    assert_int_equal(r.rig.stage->home(r.sim, 1000, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "camera_theta"));
    gonio_machine_release(&r.sim->machine, FW_CONTACT_home_2);
    assert_int_equal(r.rig.stage->home(r.sim, 1000, NULL), GONIO_OK);
    sim_rig_close(&r);
}

// What the controller's contacts do to a stage: a limit switch, the emergency stop, the door.
static void contacts_stop_the_stage(void **state) {
    (void)state;
    const char *const extra[] = {"faults.stage_estop=3x1", NULL};
    sim_rig r;
    gonio_error error = {0};
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, small, extra);
    struct machine *m = &r.sim->machine;
    const double up[GONIO_AXES] = {1, 1, 1, 1};
    gonio_stamp stamp = {.pose = 3};
    assert_int_equal(r.rig.stage->move(r.sim, up, 1, &stamp, 100, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "emergency stop"));
    double position[GONIO_AXES];
    assert_int_equal(r.rig.stage->position(r.sim, position, NULL), GONIO_OK);
    assert_true(position[0] > 0.4 && position[0] < 0.6);
    assert_near(r.sim->actual_rad[0] - r.sim->truth.zero_error_rad[0], position[0], 1e-3);
    assert_int_equal(r.rig.stage->move(r.sim, up, 1, &stamp, 100, &error), GONIO_E_DEVICE);
    gonio_machine_hold(m, FW_CONTACT_estop, true);
    assert_int_equal(r.rig.stage->home(r.sim, 100, &error), GONIO_E_DEVICE);
    gonio_machine_release(m, FW_CONTACT_estop);
    assert_int_equal(r.rig.stage->home(r.sim, 100, NULL), GONIO_OK);
    m->axis[2].limit_max_at = 300;
    assert_int_equal(r.rig.stage->move(r.sim, up, 1, &stamp, 100, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "upper limit switch: camera_theta"));
    assert_true(m->axis[2].steps == 300);
    m->axis[2].limit_max_at = 100000;
    assert_int_equal(r.rig.stage->home(r.sim, 100, NULL), GONIO_OK);
    gonio_machine_hold(m, FW_CONTACT_door, true);
    assert_int_equal(r.rig.stage->move(r.sim, up, 1, &stamp, 100, &error), GONIO_E_DEVICE);
    gonio_machine_release(m, FW_CONTACT_door);
    assert_int_equal(r.rig.stage->move(r.sim, up, 1, &stamp, 100, &error), GONIO_OK);
    sim_rig_close(&r);
}

// Whatever the axes can do, the controller's registers hold it, and an arm arrives where it is sent.
static void odd_axes_arrive(void **state) {
    (void)state;
    const char *const speeds[][3] = {
        {"axis light_phi.speed_deg_per_s=10000", "axis light_phi.acceleration_deg_per_s2=1e6",
         "axis light_phi.jerk_deg_per_s3=1e9"},
        {"axis light_phi.speed_deg_per_s=0.01", "axis light_phi.acceleration_deg_per_s2=1e6",
         "axis light_phi.min_deg=-0.1"},
        {"axis light_phi.speed_deg_per_s=300", "axis light_phi.acceleration_deg_per_s2=2000",
         "axis light_phi.jerk_deg_per_s3=40000"},
        {"axis light_phi.backlash_deg=10", "axis light_phi.max_deg=720", "axis light_phi.min_deg=-720"}};
    for (size_t i = 0; i < sizeof speeds / sizeof *speeds; i++) {
        const char *const extra[] = {speeds[i][0], speeds[i][1], speeds[i][2], NULL};
        const double far = i == 1 ? 0.3 : 300, near = i == 1 ? -0.1 : -300;
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", 1, 1, sim_perfect, extra);
        sim_rig_move(&r, 1, 0, far, 0, 0);
        assert_near(r.sim->actual_rad[1], gonio_radians(far), 1e-15);
        sim_rig_move(&r, 2, 0, near, 0, 0);
        assert_near(r.sim->actual_rad[1], gonio_radians(near), 1e-15);
        sim_rig_close(&r);
    }
}

static void limits_and_homing(void **state) {
    (void)state;
    gonio_error error = {0};
    sim_rig r;
    const char *const extra[] = {"axis camera_theta.max_deg=80", NULL};
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, small, extra);
    const gonio_stamp stamp = {.pose = 1};
    const double beyond[GONIO_AXES] = {0, 0, gonio_radians(80.01), 0}, at[GONIO_AXES] = {0, 0, gonio_radians(80), 0},
                 nan[GONIO_AXES] = {NAN, 0, 0, 0};
    assert_int_equal(r.rig.stage->move(r.sim, beyond, 1, &stamp, 100, &error), GONIO_E_RANGE);
    assert_non_null(strstr(error.message, "camera_theta cannot go to 80.01 deg"));
    assert_int_equal(r.rig.stage->move(r.sim, nan, 1, &stamp, 100, &error), GONIO_E_RANGE);
    assert_int_equal(r.rig.stage->check(r.sim, at, beyond, &error), GONIO_E_RANGE);
    assert_int_equal(r.rig.stage->check(r.sim, beyond, at, &error), GONIO_OK);
    assert_int_equal(r.rig.stage->move(r.sim, at, 1, &stamp, 100, &error), GONIO_OK);
    double position[GONIO_AXES];
    assert_int_equal(r.rig.stage->position(r.sim, position, NULL), GONIO_OK);
    assert_memory_equal(position, at, sizeof at);
    const double zero[GONIO_AXES] = {0};
    assert_int_equal(r.rig.stage->move(r.sim, zero, 1, &stamp, 1, &error), GONIO_E_TIMEOUT);
    assert_int_equal(gonio_sim_open(r.sim, 1, &r.rig, &error), GONIO_OK);
    assert_int_equal(r.rig.stage->move(r.sim, at, 1, &stamp, 100, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "not homed"));
    sim_rig_close(&r);
}

// Zero errors and repeatability are what the facts state, and independent of each other; the way to a pose does not
// matter.
static void pointing_is_as_stated(void **state) {
    (void)state;
    enum { SEEDS = 2000 };
    // Quick axes: pointing does not depend on how long a move takes.
    const char *const quick[] = {"axis light_theta.speed_deg_per_s=1000",
                                 "axis light_theta.acceleration_deg_per_s2=100000",
                                 "axis light_phi.speed_deg_per_s=1000",
                                 "axis light_phi.acceleration_deg_per_s2=100000",
                                 "axis camera_theta.speed_deg_per_s=1000",
                                 "axis camera_theta.acceleration_deg_per_s2=100000",
                                 "axis camera_phi.speed_deg_per_s=1000",
                                 "axis camera_phi.acceleration_deg_per_s2=100000",
                                 NULL};
    double systematic = 0, random = 0, product = 0, stated[2] = {0};
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", seed, 1, small, quick);
        sim_rig_move(&r, 1, 10, 20, 30, 40);
        double first[GONIO_AXES];
        memcpy(first, r.sim->actual_rad, sizeof first);
        sim_rig_move(&r, 2, 60, -20, 5, 40);
        sim_rig_move(&r, 1, 10, 20, 30, 40);
        assert_memory_equal(first, r.sim->actual_rad, sizeof first);
        const double zero = gonio_degrees(r.sim->truth.zero_error_rad[GONIO_CAMERA_THETA]);
        const double repeat = gonio_degrees(r.sim->actual_rad[GONIO_CAMERA_THETA]) - 30 - zero;
        systematic += zero * zero / SEEDS;
        random += repeat * repeat / SEEDS;
        product += zero * repeat / SEEDS;
        stated[0] = r.rig.facts.pointing_systematic_deg;
        stated[1] = r.rig.facts.pointing_random_deg;
        sim_rig_close(&r);
    }
    const double variance = 0.01 * 0.01 / 2, bound = 5 * sqrt(2.0 / SEEDS);
    assert_near(stated[0], sqrt(variance), 1e-12);
    assert_near(stated[1], sqrt(variance), 1e-12);
    assert_near(systematic / variance, 1, bound);
    assert_near(random / variance, 1, bound);
    assert_near(product / variance, 0, 5 / sqrt(SEEDS));
}

static void backlash_shows_without_takeup(void **state) {
    (void)state;
    for (int takeup = 0; takeup < 2; takeup++) {
        const char *const extra[] = {"axis light_theta.backlash_deg=0.2",
                                     takeup ? "rig.backlash_takeup=1" : "rig.backlash_takeup=0", "camera.width=8",
                                     "camera.height=8", NULL};
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", 1, 1, sim_perfect, extra);
        sim_rig_move(&r, 1, 40, 0, 0, 0);
        assert_near(gonio_degrees(r.sim->actual_rad[0]), 40, 1e-12);
        sim_rig_move(&r, 2, 30, 0, 0, 0);
        assert_near(gonio_degrees(r.sim->actual_rad[0]), takeup ? 30 : 30.2, 1e-12);
        sim_rig_close(&r);
    }
}

static void faults_are_named_and_counted(void **state) {
    (void)state;
    const char *const extra[] = {
        "faults.stage_stall=5x1", "faults.stage_timeout=6", "faults.interlock_open=7x2", "faults.camera_timeout=8:2",
        "faults.camera_error=9",  "faults.lamp_off=10",     "faults.meter_error=11x1",   NULL};
    sim_rig r;
    gonio_error error = {0};
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, small, extra);
    const double target[GONIO_AXES] = {0.1, 0.2, 0.9, 0.4};
    gonio_stamp stamp = {.pose = 5, .clock_s = 5000};
    assert_int_equal(r.rig.stage->move(r.sim, target, 1, &stamp, 100, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "camera_theta stalled"));
    assert_int_equal(r.rig.stage->move(r.sim, target, 1, &stamp, 100, &error), GONIO_E_DEVICE); // not homed
    assert_int_equal(r.rig.stage->home(r.sim, 100, NULL), GONIO_OK);
    assert_int_equal(r.rig.stage->move(r.sim, target, 1, &stamp, 100, &error), GONIO_OK);
    stamp.pose = 6;
    assert_int_equal(r.rig.stage->move(r.sim, target, 1, &stamp, 100, &error), GONIO_E_TIMEOUT);
    assert_int_equal(r.rig.interlock->check(r.sim, NULL), GONIO_OK);
    stamp.pose = 7;
    assert_int_equal(r.rig.stage->move(r.sim, target, 1, &stamp, 100, &error), GONIO_OK);
    assert_int_equal(r.rig.interlock->check(r.sim, NULL), GONIO_E_DEVICE);
    assert_int_equal(r.rig.interlock->check(r.sim, NULL), GONIO_E_DEVICE);
    assert_int_equal(r.rig.interlock->check(r.sim, NULL), GONIO_OK);
    uint16_t pixels[64];
    gonio_frame frame = {.pixels = pixels};
    const gonio_window all = {0, 0, 8, 8};
    const struct {
        gonio_stamp stamp;
        gonio_status status;
    } captures[] = {
        {{8, 1, 0}, GONIO_OK}, {{8, 2, 0}, GONIO_E_TIMEOUT}, {{8, 2, 0}, GONIO_E_TIMEOUT}, {{9, 0, 0}, GONIO_E_DEVICE}};
    for (int k = 0; k < 4; k++) {
        assert_int_equal(r.rig.camera->capture(r.sim, &all, 0.01, 0, &captures[k].stamp, 1, &frame, &error),
                         captures[k].status);
    }
    double value, sigma;
    stamp.pose = 10;
    assert_int_equal(r.rig.meter->read(r.sim, &stamp, 0.1, &value, &sigma, NULL), GONIO_OK);
    assert_near(value, 0, 1e-5);
    stamp.pose = 11;
    assert_int_equal(r.rig.meter->read(r.sim, &stamp, 0.1, &value, &sigma, NULL), GONIO_E_DEVICE);
    assert_int_equal(r.rig.meter->read(r.sim, &stamp, 0.1, &value, &sigma, NULL), GONIO_OK);
    assert_near(value, 1, 0.03);
    sim_rig_close(&r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(durations),
        cmocka_unit_test(moves_take_what_the_clock_says),
        cmocka_unit_test(limits_and_homing),
        cmocka_unit_test(homing_finds_the_same_place),
        cmocka_unit_test(contacts_stop_the_stage),
        cmocka_unit_test(odd_axes_arrive),
        cmocka_unit_test(pointing_is_as_stated),
        cmocka_unit_test(backlash_shows_without_takeup),
        cmocka_unit_test(faults_are_named_and_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
