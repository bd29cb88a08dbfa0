// SPDX-License-Identifier: BSD-3-Clause
// Stage, lamp and monitor against the firmware's simulated machine over pty and TCP, on good and on bad lines.
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

static void note(void *context, const char *kind, const char *text) {
    (void)context;
    const size_t n = strlen(events);
    snprintf(events + n, sizeof events - n, "%s: %s\n", kind, text);
}

// Quick axes with limits of a real rig.
static void quick_axes(void) {
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
static void start(bool tcp, double speed, uint32_t seed) {
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

static void open_controller(void) {
    gonio_error error = {0};
    if (gonio_controller_open(&config, &controller, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
}

// And the controller. Nothing has been written so far.
static void look_at_stage(void) {
    gonio_error error = {0};
    open_controller();
    if (gonio_stage_modbus_open(&axes, controller, &stage, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
}

// The same, and the controller has its parameters.
static void open_stage(void) {
    gonio_error error = {0};
    look_at_stage();
    if (gonio_stage_modbus_apply(stage, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
}

static void close_drivers(void) {
    if (stage != NULL) {
        gonio_stage_modbus.close(stage);
    }
    gonio_controller_release(controller);
    stage = NULL;
    controller = NULL;
}

static void stop(void) {
    close_drivers();
    bench_stop(&b);
}

static void must(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK) {
        fail_msg("%s: %s", gonio_status_name(status), error->message);
    }
}

static void pose(double deg0, double deg1, double deg2, double deg3, double rad[GONIO_AXES]) {
    rad[0] = gonio_radians(deg0);
    rad[1] = gonio_radians(deg1);
    rad[2] = gonio_radians(deg2);
    rad[3] = gonio_radians(deg3);
}

static void check_handshake_and_motion(bool tcp) {
    start(tcp, 30, 1);
    open_stage();
    assert_int_equal(gonio_controller_identify(controller)->axes, 4);
    assert_int_equal(b.shared->motions, 0); // nothing moved so far
    gonio_error error = {0};
    double target[GONIO_AXES], at[GONIO_AXES];
    pose(30, 120, -45.125, 0, target);
    assert_int_equal(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "not homed"));
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    // After homing every axis stands at its switch, outside the limits: one moves while the others stay there.
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    at[2] = gonio_radians(10);
    must(gonio_stage_modbus.move(stage, at, 1, &stamp, 10, &error), &error);
    must(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), &error);
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    assert_true(fabs(gonio_degrees(at[0]) - 30) < 1e-9 && fabs(gonio_degrees(at[1]) - 120) < 1e-9);
    assert_true(fabs(gonio_degrees(at[2]) + 45.13) < 0.0051); // to the next step
    pose(0, 400, 0, 0, target);
    assert_int_equal(gonio_stage_modbus.move(stage, target, 2, &stamp, 10, &error), GONIO_E_RANGE);
    assert_non_null(strstr(error.message, "light_phi"));
    double low, high;
    gonio_stage_modbus_limits(stage, 0, &low, &high);
    assert_true(fabs(low + 95) < 1e-9 && fabs(high - 95) < 1e-9);
    double drift[GONIO_AXES];
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    must(gonio_stage_modbus_audit(stage, drift, &error), &error);
    assert_int_equal(gonio_stage_modbus_lost_steps(stage), 0);
    stop();
}

static void test_rtu(void **state) {
    (void)state;
    check_handshake_and_motion(false);
}

static void test_tcp(void **state) {
    (void)state;
    check_handshake_and_motion(true);
}

static void test_zero_and_sign(void **state) {
    (void)state;
    start(true, 30, 1);
    axes.axes[0].zero_deg = 2;
    axes.axes[0].invert = true;
    open_stage();
    gonio_error error = {0};
    double target[GONIO_AXES], at[GONIO_AXES], low, high;
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    pose(30, 0, 0, 0, target);
    must(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), &error);
    assert_int_equal(b.shared->machine.core.registers.position[0], -2800); // dial = 2 - 30
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    assert_true(fabs(gonio_degrees(at[0]) - 30) < 1e-9);
    gonio_stage_modbus_limits(stage, 0, &low, &high);
    assert_true(fabs(low + 93) < 1e-9 && fabs(high - 97) < 1e-9);
    stop();
}

// How far homing looks for a switch, and what it does with an axis that stands on its switch, go to the controller
// where they are given and stay what they are where not.
static void test_homing_parameters(void **state) {
    (void)state;
    start(true, 30, 1);
    const struct fw_registers *r = &b.shared->machine.core.registers;
    const uint32_t travel = r->home_travel[1];
    const uint16_t pressed = r->home_pressed[0];
    open_stage();
    assert_true(r->home_travel[1] == travel && r->home_pressed[0] == pressed);
    close_drivers();
    axes.home_pressed = 1;
    axes.axes[1].home_travel_deg = 0.05; // 5 steps, and the axis stands further from its switch
    open_stage();
    assert_true(r->home_travel[0] == travel && r->home_travel[1] == 5 && r->home_pressed[0] == 1);
    gonio_error error = {0};
    assert_int_equal(gonio_stage_modbus.home(stage, 30, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "HOME_MISSING"));
    close_drivers();
    axes.home_pressed = 0;
    axes.axes[1].home_travel_deg = 800;
    open_stage();
    assert_true(r->home_travel[1] == 80000 && r->home_pressed[0] == 0);
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    stop();
}

// The nominal duration against the firmware's own: the simulated machine in its own time.
static void test_duration(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    static const double ways_deg[] = {0.02, 0.3, 1, 3, 10, 60, 180};
    for (size_t i = 0; i < sizeof ways_deg / sizeof *ways_deg; i++) {
        static struct machine m;
        gonio_machine_new(&m);
        gonio_machine_start(&m, FW_CAUSE_POWER);
        memcpy(&m.core.registers, &b.shared->machine.core.registers, sizeof m.core.registers);
        m.core.known = 15;
        m.core.registers.settle[0] = 0;
        m.core.registers.energise[0] = 0;
        double from[GONIO_AXES] = {0}, to[GONIO_AXES];
        pose(0, ways_deg[i], 0, 0, to);
        const int64_t target[FW_AXES] = {0, llround(ways_deg[i] * 100), 0, 0};
        const uint64_t start = m.now_us;
        assert_int_equal(gonio_machine_move(&m, 15, target), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(&m, 60000000));
        const double real = (double)(m.now_us - start) * 1e-6;
        const double nominal = gonio_stage_modbus.duration_s(stage, from, to);
        if (!(fabs(nominal - real) < 0.05 * real + 0.01)) {
            fail_msg("%g deg: nominal %g s, the controller takes %g s", ways_deg[i], nominal, real);
        }
    }
    stop();
}

static struct fw_registers registers_now(void) {
    gonio_fw_core_refresh(&b.shared->machine.core);
    return b.shared->machine.core.registers;
}

// Whoever only looks, in whatever way, with another rig file, writes nothing and holds nothing.
static void test_looking_changes_nothing(void **state) {
    (void)state;
    start(true, 1, 1);
    axes.axes[2].steps_per_deg = 150;
    usleep(50000); // it reads its sensor
    struct fw_registers before = registers_now();
    look_at_stage();
    gonio_error error = {0};
    double at[GONIO_AXES], to[GONIO_AXES], low, high;
    void *lamp = NULL, *meter = NULL;
    must(gonio_lamp_modbus_open(controller, 0, &lamp, &error), &error);
    must(gonio_meter_modbus_open(controller, 2, 0.01, &meter, &error), &error);
    double value, sigma;
    must(gonio_meter_modbus.read(meter, &stamp, 0, &value, &sigma, &error), &error);
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    pose(1, 2, 3, 4, to);
    must(gonio_stage_modbus.check(stage, at, to, &error), &error);
    gonio_stage_modbus.duration_s(stage, at, to);
    gonio_stage_modbus_limits(stage, 2, &low, &high);
    assert_true(fabs(low + 95) < 1e-9 && fabs(high - 95) < 1e-9); // what the rig file wants
    must(gonio_stage_modbus.stop(stage, &error), &error);         // free to all
    gonio_lamp_modbus.close(lamp);
    gonio_meter_modbus.close(meter);
    close_drivers();
    struct fw_registers after = registers_now();
    before.token[0] = after.token[0];
    before.time[0] = after.time[0];
    before.monitor[0] = after.monitor[0];
    before.monitor_time[0] = after.monitor_time[0];
    assert_memory_equal(&before, &after, sizeof before);
    assert_int_equal(b.shared->machine.core.owner.number, 0);
    bench_stop(&b);
}

// What changes the meaning of a step: the difference is told, and nothing moves before the axis is homed again.
static void test_edited_rig_file(void **state) {
    (void)state;
    static const char *const told[] = {"light_phi steps_per_deg: the controller had 100, the rig file has 150",
                                       "light_phi home_deg: the controller had -370, the rig file has -369",
                                       "light_phi home_up: the controller had 0, the rig file has 1",
                                       "light_phi speed_deg_per_s: the controller had 400, the rig file has 300"};
    start(true, 30, 1);
    for (int i = 0; i < 4; i++) {
        quick_axes();
        axes.axes[1].home_up = 0;
        open_stage();
        b.shared->machine.core.known = 15;
        close_drivers();
        const int64_t motions = b.shared->motions;
        events[0] = 0;
        axes.axes[1].steps_per_deg = i == 0 ? 150 : 100;
        axes.axes[1].home_deg = i == 1 ? -369 : -370;
        axes.axes[1].home_up = i == 2;
        axes.axes[1].speed_deg_per_s = i == 3 ? 300 : 400;
        look_at_stage();
        gonio_error error = {0};
        double target[GONIO_AXES];
        pose(0, 90, 0, 0, target);
        const gonio_status status = gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error);
        if (strstr(events, told[i]) == NULL) {
            fail_msg("told: %s", events);
        }
        assert_int_equal(status, i < 3 ? GONIO_E_DEVICE : GONIO_OK);
        assert_true(i == 3 ||
                    (strstr(error.message, "light_phi is not homed") != NULL && b.shared->motions == motions));
        assert_int_equal(b.shared->machine.core.known, i < 3 ? 13 : 15);
        close_drivers();
    }
    bench_stop(&b);
}

// Parameters that somebody else changes behind an open stage are noticed before the next move.
static void test_parameters_of_somebody_else(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    b.shared->machine.core.known = 15;
    gonio_error error = {0};
    double target[GONIO_AXES];
    pose(0, 10, 0, 0, target);
    must(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), &error);
    const uint16_t scale[2] = {0, 50000};
    must(gonio_controller_write(controller, CONTROLLER_steps_per_deg, 2, scale, &error), &error);
    pose(0, 20, 0, 0, target);
    assert_int_equal(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(events, "somebody else has changed"));
    assert_non_null(strstr(events, "light_theta steps_per_deg: the controller had 50, the rig file has 100"));
    assert_non_null(strstr(error.message, "light_theta is not homed"));
    stop();
}

// Limits hold for the take-up of backlash as well, on either side, and for what is asked for, not the step next to it.
static void test_limits_hold_everywhere(void **state) {
    (void)state;
    static const struct {
        double backlash, from, to;
        bool allowed;
    } moves[] = {{5, 10, -5, false}, {5, 10, -0.01, false}, {5, 10, 0, true},      {5, -30, -5, true},
                 {5, 0, 95, true},   {-5, 0, 95, false},    {-5, 0, 90.01, false}, {-5, 0, 90, true},
                 {-5, 99, 95, true}, {-5, 10, -5, true},    {0, 10, -5, true},     {0, 10, -5.001, false},
                 {0, 0, 95, true},   {0, 0, 95.001, false}};
    start(true, 30, 1);
    for (size_t i = 0; i < sizeof moves / sizeof *moves; i++) {
        axes.axes[0].backlash_deg = moves[i].backlash;
        axes.axes[0].min_deg = -5;
        open_stage();
        struct fw_core *core = &b.shared->machine.core;
        for (int k = 0; k < GONIO_AXES; k++) {
            core->step.position[k] = b.shared->machine.axis[k].steps = k == 0 ? llround(100 * moves[i].from) : 0;
        }
        core->known = 15;
        gonio_error error = {0};
        double from[GONIO_AXES], to[GONIO_AXES], turn[GONIO_AXES];
        pose(moves[i].from, 0, 0, 0, from);
        pose(moves[i].to, 0, 0, 0, to);
        const bool inside = moves[i].from >= -5 && moves[i].from <= 95;
        b.shared->moves_past_limit = 0;
        const gonio_status checked = gonio_stage_modbus.check(stage, from, to, &error);
        const gonio_status status = gonio_stage_modbus.move(stage, to, 1, &stamp, 10, &error);
        if (status != (moves[i].allowed ? GONIO_OK : GONIO_E_RANGE) || checked != status ||
            (inside && b.shared->moves_past_limit > 0)) {
            fail_msg("move %zu: %s, %s: %s", i, gonio_status_name(checked), gonio_status_name(status), error.message);
        }
        assert_true(core->registers.soft_min[0] == -500 && core->registers.soft_max[0] == 9500);
        const bool down = moves[i].to<moves[i].from, turns = moves[i].backlash * (down ? 1 : -1)> 0;
        assert_int_equal(gonio_stage_modbus.turns(stage, from, to, turn), turns);
        assert_true(fabs(gonio_degrees(turn[0]) - moves[i].to + (turns ? moves[i].backlash : 0)) < 0.006);
        close_drivers();
    }
    bench_stop(&b);
}

// A value that the controller cannot have: the key, the value and the bound, before anything is written.
static void test_values_beyond_the_controller(void **state) {
    (void)state;
    static const struct {
        size_t offset;
        double value, scale;
        const char *said;
    } cases[] = {
        {offsetof(gonio_axis_config, speed_deg_per_s), 400, 888.889,
         "speed_deg_per_s = 400: the controller's largest is 70.3"},
        {offsetof(gonio_axis_config, acceleration_deg_per_s2), 1e5, 100, "= 100000: the controller's largest is 40000"},
        {offsetof(gonio_axis_config, jerk_deg_per_s3), 1e9, 100, "the controller's largest is 40000000,"},
        {offsetof(gonio_axis_config, home_fast_deg_per_s), 1e4, 100,
         "home_fast_deg_per_s = 10000: the controller's largest is 625"},
        {offsetof(gonio_axis_config, home_slow_deg_per_s), 1e-4, 100,
         "home_slow_deg_per_s = 0.0001: the controller's smallest is 0.01"},
        {offsetof(gonio_axis_config, home_travel_deg), 1440, 4e6,
         "home_travel_deg = 1440: the controller's largest is 250"},
        {offsetof(gonio_axis_config, backlash_deg), -10, 4e5, "backlash_deg = -10: the controller's smallest is -2.5"},
        {offsetof(gonio_axis_config, steps_per_deg), 5e6, 0,
         "steps_per_deg = 5000000: the controller's largest is 4294967.29"},
        {offsetof(gonio_axis_config, min_deg), 96, 100, "min_deg = 96 is above max_deg = 95"},
        {offsetof(gonio_axis_config, max_deg), -96, 100, "min_deg = -95 is above max_deg = -96"}};
    start(true, 30, 1);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        gonio_stage_modbus_defaults(&axes);
        axes.axes[2] =
            (gonio_axis_config){cases[i].scale, 0.01, 0.01, 0.01, -95, 95, 0, 0, 0.01, NAN, NAN, -1, -1, 0, false};
        memcpy((char *)&axes.axes[2] + cases[i].offset, &cases[i].value, sizeof(double));
        open_controller();
        gonio_error error = {0};
        assert_int_equal(gonio_stage_modbus_open(&axes, controller, &stage, &error), GONIO_E_INPUT);
        if (strstr(error.message, cases[i].said) == NULL || strstr(error.message, "[axis camera_theta]") == NULL) {
            fail_msg("said: %s", error.message);
        }
        stage = NULL;
        close_drivers();
    }
    // The largest scale comes back as it is.
    gonio_stage_modbus_defaults(&axes);
    axes.axes[3].steps_per_deg = 4e6;
    axes.axes[3].speed_deg_per_s = 0.01;
    axes.axes[3].acceleration_deg_per_s2 = axes.axes[3].jerk_deg_per_s3 = 0.1;
    open_stage();
    close_drivers();
    gonio_stage_modbus_defaults(&axes);
    look_at_stage();
    gonio_error error = {0};
    double at[GONIO_AXES];
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    assert_true(fabs(gonio_degrees(at[3]) - (double)b.shared->machine.core.step.position[3] / 4e6) < 1e-9);
    stop();
}

static void test_lamp_and_monitor(void **state) {
    (void)state;
    start(false, 30, 1);
    open_controller();
    void *lamp = NULL, *meter = NULL;
    gonio_error error = {0};
    must(gonio_lamp_modbus_open(controller, 0, &lamp, &error), &error);
    must(gonio_meter_modbus_open(controller, 2, 0.01, &meter, &error), &error);
    double waited = -1, dark = -1, bright = -1, sigma = -1;
    assert_int_equal(gonio_lamp_modbus.wait_ready(lamp, &stamp, 1, &waited, &error), GONIO_E_DEVICE);
    must(gonio_meter_modbus.read(meter, &stamp, 0, &dark, &sigma, &error), &error);
    must(gonio_lamp_modbus.set_level(lamp, 0.8, &error), &error);
    must(gonio_lamp_modbus.set_shutter(lamp, true, &error), &error);
    assert_int_equal(gonio_lamp_modbus.set_level(lamp, 1.5, &error), GONIO_E_RANGE);
    must(gonio_lamp_modbus.wait_ready(lamp, &stamp, 10, &waited, &error), &error);
    must(gonio_meter_modbus.read(meter, &stamp, 0.05, &bright, &sigma, &error), &error);
    assert_true(b.shared->machine.shutter);
    assert_int_equal(b.shared->machine.lamp, 8000);
    assert_true(bright > dark + 0.05);
    assert_true(sigma >= 0.01 * bright - 1e-12);
    // The lamp stays as it is when the program goes, and for longer than the dead-man would wait.
    gonio_lamp_modbus.close(lamp);
    gonio_meter_modbus.close(meter);
    close_drivers();
    usleep(500000); // 10 s of the controller's time
    assert_int_equal(b.shared->machine.lamp, 8000);
    assert_true(b.shared->machine.shutter);
    bench_stop(&b);
}

// A killed host: the controller stops by itself. Here the host is a process that moves and is killed in mid-move.
static void test_killed_host(void **state) {
    (void)state;
    start(true, 1, 1);
    config.deadman_s = 0.5;
    const pid_t host = bench_fork();
    if (host == 0) {
        axes.axes[1].speed_deg_per_s = 20;
        open_stage();
        double target[GONIO_AXES];
        b.shared->machine.core.known = 15; // homing would take longer than the test
        pose(0, 340, 0, 0, target);
        gonio_stage_modbus.move(stage, target, 1, &stamp, 60, NULL);
        _exit(0);
    }
    for (int i = 0; i < 2000 && b.shared->machine.core.state != FW_STATE_MOVING; i++) {
        usleep(2000);
    }
    assert_int_equal(b.shared->machine.core.state, FW_STATE_MOVING);
    kill(host, SIGKILL);
    waitpid(host, NULL, 0);
    for (int i = 0; i < 2000 && b.shared->machine.core.state != FW_STATE_ALARM; i++) {
        usleep(2000);
    }
    assert_int_equal(b.shared->machine.core.state, FW_STATE_ALARM);
    assert_int_equal(b.shared->machine.core.registers.alarm[0], FW_ALARM_DEADMAN);
    // Who looks at it changes nothing; the next host that holds the rig clears it, and nothing goes on by itself.
    open_controller();
    gonio_controller_status now;
    gonio_error error = {0};
    must(gonio_controller_read_status(controller, &now, &error), &error);
    assert_int_equal(now.state, CONTROLLER_STATE_ALARM);
    must(gonio_controller_claim(controller, &error), &error);
    must(gonio_controller_read_status(controller, &now, &error), &error);
    assert_int_equal(now.state, CONTROLLER_STATE_IDLE);
    const int64_t position = now.position[1];
    usleep(200000);
    must(gonio_controller_read_status(controller, &now, &error), &error);
    assert_int_equal(now.position[1], position);
    assert_non_null(strstr(events, "DEADMAN"));
    stop();
}

// The host is busy elsewhere for longer than the dead-man waits: it is fed. Hung for longer than feed_s: it is not.
static void test_feeding(void **state) {
    (void)state;
    start(true, 1, 1);
    config.deadman_s = 0.3;
    config.feed_s = 1;
    open_controller();
    gonio_error error = {0};
    must(gonio_controller_claim(controller, &error), &error);
    usleep(900000);
    assert_int_equal(b.shared->machine.core.state, FW_STATE_IDLE);
    usleep(1500000);
    assert_int_equal(b.shared->machine.core.state, FW_STATE_ALARM);
    gonio_controller_counts counts;
    gonio_controller_count(controller, &counts);
    assert_true(counts.feeds >= 4);
    stop();
}

static bool stop_now;
static bool cancelled(void *context) {
    (void)context;
    return stop_now;
}

static gonio_status pressed(void *device, gonio_error *error) {
    return *(bool *)device ? gonio_fail(error, GONIO_E_DEVICE, "interlock: door is active") : GONIO_OK;
}

static void test_stops_in_mid_move(void **state) {
    (void)state;
    start(true, 1, 1);
    config.cancelled = cancelled;
    const gonio_interlock_ops interlock = {.check = pressed};
    bool door = false;
    axes.interlock = &interlock;
    axes.interlock_device = &door;
    axes.axes[1].speed_deg_per_s = 20;
    open_stage();
    b.shared->machine.core.known = 15;
    gonio_error error = {0};
    double target[GONIO_AXES], at[GONIO_AXES];
    pose(0, 340, 0, 0, target);
    stop_now = true;
    assert_int_equal(gonio_stage_modbus.move(stage, target, 1, &stamp, 60, &error), GONIO_E_INTERRUPTED);
    stop_now = false;
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    assert_true(gonio_degrees(at[1]) < 20);
    assert_int_equal(b.shared->machine.core.state, FW_STATE_IDLE); // stopped, position known
    assert_int_equal(b.shared->machine.core.known, 15);
    assert_int_equal(gonio_stage_modbus.move(stage, target, 2, &stamp, 0.2, &error), GONIO_E_TIMEOUT);
    assert_int_equal(b.shared->machine.core.state, FW_STATE_IDLE);
    door = true;
    const int64_t motions = b.shared->motions;
    assert_int_equal(gonio_stage_modbus.move(stage, target, 3, &stamp, 60, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "door"));
    assert_int_equal(b.shared->motions, motions); // not even begun
    // The controller's own emergency stop, pressed in mid-move.
    door = false;
    const pid_t presser = bench_fork();
    if (presser == 0) {
        while (b.shared->machine.core.state != FW_STATE_MOVING) {
            usleep(1000);
        }
        usleep(200000);
        b.shared->machine.forced_on |= 1 << FW_CONTACT_estop;
        _exit(0);
    }
    const gonio_status status = gonio_stage_modbus.move(stage, target, 4, &stamp, 60, &error);
    waitpid(presser, NULL, 0);
    assert_int_equal(status, GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "alarm 1 EMERGENCY"));
    stop();
}

static void test_restart_is_noticed(void **state) {
    (void)state;
    start(true, 30, 1);
    open_controller();
    gonio_controller_status now;
    gonio_error error = {0};
    must(gonio_controller_read_status(controller, &now, &error), &error);
    usleep(50000);
    must(gonio_controller_read_status(controller, &now, &error), &error);
    b.shared->restart = 1;
    usleep(20000);
    assert_int_equal(gonio_controller_read_status(controller, &now, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "restarted"));
    // Nothing goes on with the parameters of its start; it is told once.
    assert_int_equal(gonio_controller_read_status(controller, &now, &error), GONIO_E_DEVICE);
    assert_null(strstr(strstr(events, "controller-restart") + 1, "controller-restart"));
    close_drivers();
    open_controller();
    must(gonio_controller_read_status(controller, &now, &error), &error);
    stop();
}

// A controller that had just been switched on is reset between its set-up and the first move: its clock does not go
// back, and it would have moved with the parameters, and the limits, of its start.
static void test_early_restart_is_noticed(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    gonio_error error = {0};
    b.shared->restart = 1;
    usleep(300000); // of thirty-fold time: more than it had been up before
    const int64_t motions = b.shared->motions;
    assert_int_equal(gonio_stage_modbus.home(stage, 30, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "restarted"));
    assert_int_equal(b.shared->motions, motions);
    stop();
}

// An axis slips: an audit finds by how much, once. Where the position was lost in between, nobody can know.
static void test_audit(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    gonio_error error = {0};
    double difference[GONIO_AXES];
    must(gonio_stage_modbus.audit(stage, 60, difference, &error), &error);
    assert_true(isnan(difference[0])); // never homed before
    must(gonio_stage_modbus.audit(stage, 60, difference, &error), &error);
    for (int k = 0; k < GONIO_AXES; k++) {
        assert_true(fabs(gonio_degrees(difference[k])) < 0.0101);
    }
    b.shared->machine.axis[2].steps += 70;
    assert_int_equal(gonio_stage_modbus.audit(stage, 60, difference, &error), GONIO_E_MISMATCH);
    assert_non_null(strstr(error.message, "camera_theta"));
    assert_true(fabs(gonio_degrees(difference[2]) + 0.7) < 0.0101 && fabs(gonio_degrees(difference[1])) < 0.0101);
    must(gonio_stage_modbus.audit(stage, 60, difference, &error), &error);
    assert_true(fabs(gonio_degrees(difference[2])) < 0.0101);
    assert_int_equal(gonio_stage_modbus_lost_steps(stage), 1);
    b.shared->machine.core.known = 7;
    must(gonio_stage_modbus.audit(stage, 60, difference, &error), &error);
    assert_true(isnan(difference[0]));
    stop();
}

// The controller counts another position though nothing was asked to move: any exchange that reads it back tells.
static void test_position_is_read_back(void **state) {
    (void)state;
    start(true, 30, 1);
    open_stage();
    gonio_error error = {0};
    double target[GONIO_AXES], at[GONIO_AXES];
    pose(10, 20, 30, 40, target);
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    must(gonio_stage_modbus.move(stage, target, 1, &stamp, 10, &error), &error);
    must(gonio_stage_modbus.position(stage, at, &error), &error);
    b.shared->machine.core.step.position[1] += 3;
    assert_int_equal(gonio_stage_modbus.position(stage, at, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "nothing was asked to move"));
    assert_non_null(strstr(events, "lost-steps: axis 1"));
    must(gonio_stage_modbus.move(stage, target, 2, &stamp, 10, &error), &error); // absolute: it goes there again
    stop();
}

static void test_wrong_partners(void **state) {
    (void)state;
    start(true, 1, 1);
    gonio_error error = {0};
    b.shared->machine.core.registers.protocol[0] = 9;
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "protocol 9"));
    b.shared->machine.core.registers.magic[0] = 0x1234;
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "0x1234"));
    b.shared->frozen = 1;
    config.modbus.timeout_ms = 20;
    const int64_t began = gonio_clock_ms();
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_TIMEOUT);
    assert_true(gonio_clock_ms() - began < 20000); // bounded; no figure of speed
    bench_stop(&b);
    strcpy(config.modbus.port, "/dev/no-such-port");
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_DEVICE);
    strcpy(config.modbus.port, "tcp:127.0.0.1:1");
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_DEVICE);
    config.modbus.port[0] = 0;
    assert_int_equal(gonio_controller_open(&config, &controller, &error), GONIO_E_INPUT);
    assert_null(controller);
}

// A whole run of moves over a line that mangles 8 % of all frames: every move ends where it was sent, each moved once,
// and the controller's count agrees with the driver's.
static void check_bad_line(bool tcp, uint32_t kinds, uint32_t seed) {
    start(tcp, 30, seed);
    config.modbus.timeout_ms = 60;
    config.deadman_s = 120; // of the controller's time, which runs 30 times as fast
    open_stage();
    gonio_error error = {0};
    must(gonio_stage_modbus.home(stage, 30, &error), &error);
    double middle[GONIO_AXES] = {0};
    must(gonio_stage_modbus.move(stage, middle, 0, &stamp, 20, &error), &error); // the switch is outside the limits
    b.shared->moves_past_limit = 0;
    b.shared->kinds = kinds;
    b.shared->permille = 80;
    const int64_t motions = b.shared->motions;
    uint32_t random = seed;
    enum { MOVES = 15 };
    for (int i = 0; i < MOVES; i++) {
        double target[GONIO_AXES], at[GONIO_AXES];
        for (int k = 0; k < GONIO_AXES; k++) {
            random = random * 1664525u + 1013904223u;
            target[k] = gonio_radians((double)((random >> 16) % 18000) / 100 - 90);
        }
        must(gonio_stage_modbus.move(stage, target, (uint32_t)i, &stamp, 20, &error), &error);
        for (int k = 0; k < GONIO_AXES; k++) {
            assert_int_equal(b.shared->machine.core.registers.position[k], llround(gonio_degrees(target[k]) * 100));
            assert_int_equal(b.shared->machine.axis[k].steps, b.shared->machine.core.registers.position[k]);
        }
        must(gonio_stage_modbus.position(stage, at, &error), &error);
    }
    b.shared->permille = 0;
    assert_int_equal(b.shared->motions - motions, MOVES);
    assert_int_equal(b.shared->moves_past_limit, 0);
    gonio_controller_counts counts;
    gonio_controller_count(controller, &counts);
    assert_true(counts.retries > 0);
    stop();
}

static void test_bad_serial_line(void **state) {
    (void)state;
    check_bad_line(false, (1u << BENCH_CLOSE) - 2, 3);
}

static void test_bad_tcp_line(void **state) {
    (void)state;
    // TCP carries no checksum of its own in Modbus: bits do not flip there.
    check_bad_line(true, (1u << BENCH_DELAY) | (1u << BENCH_DROP) | (1u << BENCH_SPLIT) | (1u << BENCH_CLOSE), 5);
}

static void test_replugged_adapter(void **state) {
    (void)state;
    check_bad_line(false, 1u << BENCH_CLOSE, 11);
}

static void test_record_and_replay(void **state) {
    (void)state;
    start(false, 30, 3);
    char path[] = "/tmp/gonio-tape-XXXXXX";
    close(mkstemp(path));
    unlink(path);
    double at[2][GONIO_AXES];
    gonio_status ends[2];
    char told[2][512];
    for (int replay = 0; replay < 2; replay++) {
        gonio_tape *tape = NULL;
        assert_int_equal((replay ? gonio_tape_open : gonio_tape_create)(path, &tape, NULL), GONIO_OK);
        config.tape = tape;
        config.mode = replay ? GONIO_TAPE_REPLAY : GONIO_TAPE_RECORD;
        open_stage();
        gonio_error error = {0};
        must(gonio_stage_modbus.home(stage, 30, &error), &error);
        b.shared->kinds = 1u << BENCH_FLIP | 1u << BENCH_CUT;
        b.shared->permille = 100;
        double target[GONIO_AXES];
        pose(10, 20, 30, 40, target);
        must(gonio_stage_modbus.move(stage, target, 1, &stamp, 20, &error), &error);
        must(gonio_stage_modbus.position(stage, at[replay], &error), &error);
        b.shared->permille = 0;
        if (!replay) {
            b.shared->machine.forced_on |= 1 << FW_CONTACT_estop;
            usleep(100000);
        }
        ends[replay] = gonio_stage_modbus.move(stage, target, 2, &stamp, 20, &error);
        strcpy(told[replay], error.message);
        close_drivers();
        gonio_tape_close(tape);
        if (!replay) {
            bench_stop(&b); // the replay has nothing to talk to
            b.shared = calloc(1, sizeof *b.shared);
        }
    }
    free(b.shared);
    unlink(path);
    assert_memory_equal(at[0], at[1], sizeof at[0]);
    assert_int_equal(ends[0], GONIO_E_DEVICE);
    assert_int_equal(ends[0], ends[1]);
    assert_string_equal(told[0], told[1]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rtu),
        cmocka_unit_test(test_tcp),
        cmocka_unit_test(test_zero_and_sign),
        cmocka_unit_test(test_homing_parameters),
        cmocka_unit_test(test_duration),
        cmocka_unit_test(test_looking_changes_nothing),
        cmocka_unit_test(test_edited_rig_file),
        cmocka_unit_test(test_parameters_of_somebody_else),
        cmocka_unit_test(test_limits_hold_everywhere),
        cmocka_unit_test(test_values_beyond_the_controller),
        cmocka_unit_test(test_lamp_and_monitor),
        cmocka_unit_test(test_killed_host),
        cmocka_unit_test(test_feeding),
        cmocka_unit_test(test_stops_in_mid_move),
        cmocka_unit_test(test_restart_is_noticed),
        cmocka_unit_test(test_early_restart_is_noticed),
        cmocka_unit_test(test_audit),
        cmocka_unit_test(test_position_is_read_back),
        cmocka_unit_test(test_wrong_partners),
        cmocka_unit_test(test_bad_serial_line),
        cmocka_unit_test(test_bad_tcp_line),
        cmocka_unit_test(test_replugged_adapter),
        cmocka_unit_test(test_record_and_replay),
    };
    return cmocka_run_group_tests_name("controller", tests, NULL, NULL);
}
