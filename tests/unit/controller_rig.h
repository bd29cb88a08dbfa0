// SPDX-License-Identifier: BSD-3-Clause
// The controller's and the stage's drivers against the bench of controller_bench.h, with what a test of them shares.
#ifndef GONIO_TESTS_CONTROLLER_RIG_H
#define GONIO_TESTS_CONTROLLER_RIG_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "host/drivers/controller.h"
#include "host/drivers/controller_map.h"
#include "host/drivers/lamp_modbus.h"
#include "host/drivers/meter_modbus.h"
#include "host/drivers/stage_modbus.h"
#include "host/transport/clock.h"
#include "tests/unit/controller_bench.h"

static const gonio_stamp stamp = {0};
static bench b;
static char events[4096];
static gonio_controller_config config;
static gonio_stage_modbus_config axes;
static gonio_controller *controller;
static void *stage;

static inline void note(void *context, const char *kind, const char *text) {
    (void)context;
    const size_t n = strlen(events);
    snprintf(events + n, sizeof events - n, "%s: %s\n", kind, text);
}

// Quick axes with limits of a real rig.
static inline void quick_axes(void) {
    gonio_stage_modbus_defaults(&axes);
    for (int k = 0; k < GONIO_AXES; k++) {
        axes.axes[k].steps_per_deg = 100;
        axes.axes[k].speed_deg_per_s = 400;
        axes.axes[k].acceleration_deg_per_s2 = 4000;
        axes.axes[k].jerk_deg_per_s3 = 80000;
        axes.axes[k].min_deg = k % 2 == 0 ? -95 : -350;
        axes.axes[k].max_deg = k % 2 == 0 ? 95 : 350;
        axes.axes[k].home_deg = -370; // where the machine's switches are
        axes.axes[k].home_fast_deg_per_s = 200;
        axes.axes[k].home_slow_deg_per_s = 10;
    }
}

// A machine, a line to it, and configurations that the test may change before it opens a driver; `stop` ends all.
static inline void start(bool tcp, double speed, uint32_t seed) {
    bench_start(&b, tcp, speed, seed);
    gonio_controller_defaults(&config);
    snprintf(config.modbus.port, sizeof config.modbus.port, "%s", b.port);
    config.modbus.timeout_ms = 200; // a busy machine may take a while
    config.replug_s = 3;
    config.deadman_s = 300; // most of these controllers live thirty times as fast as this machine may be busy
    config.event = note;
    events[0] = 0;
    quick_axes();
    stage = NULL; // of a test that failed
    controller = NULL;
}

static inline void open_controller(void) {
    gonio_error error = {0};
    if (gonio_controller_open(&config, &controller, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
}

// And the controller. Nothing has been written so far.
static inline void look_at_stage(void) {
    gonio_error error = {0};
    open_controller();
    if (gonio_stage_modbus_open(&axes, controller, &stage, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
}

// The same, and the controller has its parameters.
static inline void open_stage(void) {
    gonio_error error = {0};
    look_at_stage();
    if (gonio_stage_modbus_apply(stage, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
}

static inline void close_drivers(void) {
    if (stage != NULL) {
        gonio_stage_modbus.close(stage);
    }
    gonio_controller_release(controller);
    stage = NULL;
    controller = NULL;
}

static inline void stop(void) {
    close_drivers();
    bench_stop(&b);
}

static inline void must(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK) {
        fail_msg("%s: %s", gonio_status_name(status), error->message);
    }
}

static inline void pose(double deg0, double deg1, double deg2, double deg3, double rad[GONIO_AXES]) {
    rad[0] = gonio_radians(deg0);
    rad[1] = gonio_radians(deg1);
    rad[2] = gonio_radians(deg2);
    rad[3] = gonio_radians(deg3);
}

#endif
