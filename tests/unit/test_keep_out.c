// SPDX-License-Identifier: BSD-3-Clause
// Keep-out zones against dense sampling of the path, and the guard in front of a stage.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "host/drivers/keep_out.h"
#include "host/drivers/null.h"

static uint32_t seed = 17;

static double random_deg(double low, double high) {
    seed = seed * 1664525u + 1013904223u;
    return low + (high - low) * (double)(seed >> 8) / 16777216;
}

static bool inside(const gonio_zone *z, const double rad[GONIO_AXES], double slack_deg) {
    for (int k = 0; k < GONIO_AXES; k++) {
        const double deg = gonio_degrees(rad[k]);
        if (deg < z->minimum_deg[k] - slack_deg || deg > z->maximum_deg[k] + slack_deg) {
            return false;
        }
    }
    return true;
}

// A path that sampling finds deep inside a zone is refused; one that keeps clear by a little is allowed.
static void test_paths_against_sampling(void **state) {
    (void)state;
    int met = 0, clear = 0;
    for (int trial = 0; trial < 3000; trial++) {
        gonio_keep_out keep_out = {0};
        gonio_zone *z = &keep_out.zones[gonio_keep_out_zone(&keep_out, "arms")];
        for (int k = 0; k < GONIO_AXES; k++) {
            if (random_deg(0, 1) < 0.6) {
                z->minimum_deg[k] = random_deg(-90, 60);
                z->maximum_deg[k] = z->minimum_deg[k] + random_deg(1, 60);
            }
        }
        double from[GONIO_AXES], to[GONIO_AXES];
        for (int k = 0; k < GONIO_AXES; k++) {
            from[k] = gonio_radians(random_deg(-95, 95));
            to[k] = random_deg(0, 1) < 0.3 ? from[k] : gonio_radians(random_deg(-95, 95));
        }
        bool deep = false, near = false;
        for (int i = 0; i <= 2000; i++) {
            double at[GONIO_AXES];
            for (int k = 0; k < GONIO_AXES; k++) {
                at[k] = from[k] + (to[k] - from[k]) * i / 2000;
            }
            deep = deep || inside(z, at, 0);
            near = near || inside(z, at, 0.2); // a step of the sampling is at most 0.095 deg
        }
        gonio_error error = {0};
        const gonio_status status = gonio_keep_out_check(&keep_out, from, NULL, to, &error);
        if (deep) {
            assert_int_equal(status, GONIO_E_RANGE);
            assert_non_null(strstr(error.message, "arms"));
            met++;
        } else if (!near) {
            assert_int_equal(status, GONIO_OK);
            clear++;
        }
    }
    assert_true(met > 300 && clear > 300);
}

static void test_shadowing(void **state) {
    (void)state;
    const gonio_keep_out keep_out = {.retro_deg = 6};
    for (int trial = 0; trial < 3000; trial++) {
        double pose[GONIO_AXES];
        for (int k = 0; k < GONIO_AXES; k++) {
            pose[k] = gonio_radians(random_deg(k % 2 == 0 ? 0 : -180, k % 2 == 0 ? 90 : 180));
        }
        if (trial % 2 == 0) { // near each other, or such cases are rare
            pose[2] = pose[0] + gonio_radians(random_deg(-8, 8));
            pose[3] = pose[1] + gonio_radians(random_deg(-8, 8));
        }
        const gonio_vec3 l = gonio_direction(pose[0], pose[1]), c = gonio_direction(pose[2], pose[3]);
        const double dot = l.x * c.x + l.y * c.y + l.z * c.z;
        const double apart = gonio_degrees(acos(fmax(-1, fmin(1, dot))));
        if (fabs(apart - 6) > 1e-3) {
            assert_int_equal(gonio_keep_out_check(&keep_out, pose, NULL, pose, NULL),
                             apart < 6 ? GONIO_E_RANGE : GONIO_OK);
        }
    }
    // Passing by is allowed, ending there is not.
    const double from[GONIO_AXES] = {0.5, 0, 0, 0}, far[GONIO_AXES] = {0.5, 0, 1, 0}, on[GONIO_AXES] = {0.5, 0, 0.5, 0};
    assert_int_equal(gonio_keep_out_check(&keep_out, from, NULL, far, NULL), GONIO_OK);
    assert_int_equal(gonio_keep_out_check(&keep_out, from, NULL, on, NULL), GONIO_E_RANGE);
}

static void test_guard_refuses_before_anything_moves(void **state) {
    (void)state;
    gonio_rig rig = {0};
    gonio_keep_out keep_out = {0};
    gonio_zone *z = &keep_out.zones[gonio_keep_out_zone(&keep_out, "post")];
    z->minimum_deg[GONIO_CAMERA_THETA] = 30;
    z->maximum_deg[GONIO_CAMERA_THETA] = 40;
    const gonio_stamp stamp = {0};
    const double beyond[GONIO_AXES] = {0, 0, gonio_radians(60), 0}, before[GONIO_AXES] = {0, 0, gonio_radians(20), 0};
    double at[GONIO_AXES];
    assert_int_equal(gonio_null_rig_open(&rig, NULL), GONIO_OK);
    assert_int_equal(gonio_keep_out_guard(&keep_out, &rig, NULL), GONIO_OK);
    assert_int_equal(rig.stage->move(rig.stage_device, before, 1, &stamp, 1, NULL), GONIO_OK);
    assert_int_equal(rig.stage->move(rig.stage_device, beyond, 2, &stamp, 1, NULL), GONIO_E_RANGE);
    assert_int_equal(rig.stage->check(rig.stage_device, before, beyond, NULL), GONIO_E_RANGE);
    assert_int_equal(rig.stage->position(rig.stage_device, at, NULL), GONIO_OK);
    assert_true(fabs(gonio_degrees(at[GONIO_CAMERA_THETA]) - 20) < 1e-9);
    gonio_rig_close(&rig);
}

// Takes up 5 degrees of backlash from below, whatever the axis.
static bool turns(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                  double turn_rad[GONIO_AXES]) {
    (void)device;
    bool any = false;
    for (int k = 0; k < GONIO_AXES; k++) {
        const bool down = to_rad[k] < from_rad[k];
        turn_rad[k] = to_rad[k] - (down ? gonio_radians(5) : 0);
        any = any || down;
    }
    return any;
}

// A zone on the way there, behind the target, and where the take-up leads back.
static void test_the_take_up_keeps_out_too(void **state) {
    (void)state;
    static const struct {
        double low, high, from, to;
        gonio_status status;
    } ways[] = {{30, 40, 60, 42, GONIO_E_RANGE}, {30, 40, 60, 44.9, GONIO_E_RANGE}, {30, 40, 60, 45.1, GONIO_OK},
                {30, 40, 0, 29, GONIO_OK},       {41, 41.5, 60, 42, GONIO_E_RANGE}, {50, 51, 60, 42, GONIO_E_RANGE}};
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
        gonio_rig rig = {0};
        gonio_keep_out keep_out = {0};
        gonio_zone *z = &keep_out.zones[gonio_keep_out_zone(&keep_out, "post")];
        z->minimum_deg[GONIO_CAMERA_THETA] = ways[i].low;
        z->maximum_deg[GONIO_CAMERA_THETA] = ways[i].high;
        const gonio_stamp stamp = {0};
        const double from[GONIO_AXES] = {0, 0, gonio_radians(ways[i].from), 0},
                     to[GONIO_AXES] = {0, 0, gonio_radians(ways[i].to), 0};
        assert_int_equal(gonio_null_rig_open(&rig, NULL), GONIO_OK);
        gonio_stage_ops ops = *rig.stage;
        ops.turns = turns;
        rig.stage = &ops;
        assert_int_equal(rig.stage->move(rig.stage_device, from, 1, &stamp, 1, NULL), GONIO_OK);
        assert_int_equal(gonio_keep_out_guard(&keep_out, &rig, NULL), GONIO_OK);
        gonio_error error = {0};
        assert_int_equal(rig.stage->check(rig.stage_device, from, to, &error), ways[i].status);
        assert_int_equal(rig.stage->move(rig.stage_device, to, 2, &stamp, 1, &error), ways[i].status);
        assert_true(ways[i].status == GONIO_OK || strstr(error.message, "take-up") != NULL);
        gonio_rig_close(&rig);
    }
}

static void test_zones_by_name(void **state) {
    (void)state;
    gonio_keep_out keep_out = {0};
    char name[16];
    for (int i = 0; i < GONIO_ZONES_MAX; i++) {
        snprintf(name, sizeof name, "z%d", i);
        assert_int_equal(gonio_keep_out_zone(&keep_out, name), i);
    }
    assert_int_equal(gonio_keep_out_zone(&keep_out, "z3"), 3);
    assert_int_equal(gonio_keep_out_zone(&keep_out, "one more"), -1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_paths_against_sampling),
        cmocka_unit_test(test_shadowing),
        cmocka_unit_test(test_guard_refuses_before_anything_moves),
        cmocka_unit_test(test_the_take_up_keeps_out_too),
        cmocka_unit_test(test_zones_by_name),
    };
    return cmocka_run_group_tests_name("keep_out", tests, NULL, NULL);
}
