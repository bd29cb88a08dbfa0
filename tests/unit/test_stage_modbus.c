// SPDX-License-Identifier: BSD-3-Clause
// The stage behind the controller and its parameters: who looks writes nothing, who moves tells what differs; limits
// hold for all of a way, values for the controller's bounds.
#include "tests/unit/controller_rig.h"

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
            (gonio_axis_config){cases[i].scale, 0.01, 0.01, 0.01, -95, 95, 0, 0, 0.01, NAN, NAN, NAN, -1, -1, 0, false};
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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_looking_changes_nothing),      cmocka_unit_test(test_edited_rig_file),
        cmocka_unit_test(test_parameters_of_somebody_else),  cmocka_unit_test(test_limits_hold_everywhere),
        cmocka_unit_test(test_values_beyond_the_controller),
    };
    return cmocka_run_group_tests_name("stage_modbus", tests, NULL, NULL);
}
