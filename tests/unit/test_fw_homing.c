// SPDX-License-Identifier: BSD-3-Clause
// Homing on the simulated machine: where it ends, how well it repeats, and what it says of a bad switch.
#include "tests/unit/fw_rig.h"

static void home(struct machine *m, uint16_t axes) {
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, axes), FW_REFUSAL_NONE);
    assert_true(gonio_machine_settle(m, 5ull * MINUTE_US));
}

static void finds_the_switch(void **state) {
    (void)state;
    for (unsigned up = 0; up < 2; up++) {
        struct machine *m = rig_new();
        for (unsigned i = 0; i < FW_AXES; i++) {
            m->core.registers.home_up[i] = (uint16_t)up;
            m->axis[i].home_up = up != 0;
            m->core.registers.home_position[i] = -37000 + (int64_t)i;
            m->axis[i].home_at = (up != 0 ? 1 : -1) * (37000 - 100 * (int64_t)i);
        }
        home(m, 15);
        assert_int_equal(m->core.state, FW_STATE_IDLE);
        assert_int_equal(m->core.known, 15);
        for (unsigned i = 0; i < FW_AXES; i++) {
            // In true steps and in the controller's, from the switch; which is active from home_at on.
            const int64_t true_way = m->axis[i].steps - m->axis[i].home_at;
            const int64_t told_way = m->core.step.position[i] - m->core.registers.home_position[i];
            assert_true(true_way == told_way);
            assert_true(told_way == (up != 0 ? -200 : 200));
            assert_int_equal(m->core.registers.home_difference[i], 0);
        }
        assert_int_equal(m->core.registers.finished_id[0], m->core.registers.accepted_id[0]);
        free(m);
    }
}

// The reported difference is `wanted`, give or take a step.
static void check_difference(const struct machine *m, int32_t wanted) {
    assert_in_range(m->core.registers.home_difference[0] - wanted + 1, 0, 2);
}

static void repeats_and_reports_the_difference(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.home_slow[0] = 4000;
    m->core.registers.home_position[0] = -37000;
    home(m, 15);
    for (unsigned n = 0; n < 10; n++) {
        const int64_t target[FW_AXES] = {-20000 + 777 * (int64_t)n, 0, 0, 0};
        assert_int_equal(gonio_machine_move(m, 1, target), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(m, MINUTE_US));
        home(m, 1);
        check_difference(m, 0);
    }
    m->axis[0].steps += 123; // somebody turned it by hand
    home(m, 1);
    check_difference(m, -123);
    home(m, 1);
    check_difference(m, 0);
    free(m);
}

static void follows_the_order(void **state) {
    (void)state;
    struct machine *m = rig_new();
    const uint16_t order[FW_AXES] = {3, 1, 4, 2};
    for (unsigned i = 0; i < FW_AXES; i++)
        m->core.registers.home_order[i] = order[i];
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 15), FW_REFUSAL_NONE);
    uint16_t before = 0;
    unsigned n = 0;
    while (m->core.state == FW_STATE_HOMING) {
        gonio_machine_run(m, 1000);
        if (m->core.known == before)
            continue;
        static const uint16_t after[] = {2, 2 | 8, 2 | 8 | 1, 15};
        assert_int_equal(m->core.known, after[n++]);
        before = m->core.known;
    }
    assert_int_equal(n, 4);
    free(m);
}

static void takes_an_axis_without_switch_as_it_stands(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.home_order[2] = 0;
    m->core.registers.home_position[2] = 4711;
    home(m, 4);
    assert_int_equal(m->core.known, 4);
    assert_true(m->core.step.position[2] == 4711);
    assert_true(m->rising_edges == 0);
    free(m);
}

static void expect_alarm(struct machine *m, unsigned alarm) {
    home(m, 15);
    assert_int_equal(m->core.state, FW_STATE_ALARM);
    assert_int_equal(m->core.registers.alarm[0], alarm);
    assert_int_equal(m->core.registers.alarm_axis[0], 1);
    assert_int_equal(m->core.known, 1); // axis 0 came before it; nothing after it moved
    assert_true(m->axis[2].steps == 3000 && m->axis[3].steps == 4000);
    assert_true(m->core.registers.finished_id[0] != m->core.registers.accepted_id[0]);
    free(m);
}

static void missing_switch(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->axis[1].home_switch = MACHINE_SWITCH_MISSING;
    m->core.registers.home_travel[1] = 30000;
    expect_alarm(m, FW_ALARM_HOME_MISSING);
}

static void missing_switch_ends_on_the_limit(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->axis[1].home_switch = MACHINE_SWITCH_MISSING;
    expect_alarm(m, FW_ALARM_LIMIT_MIN);
}

static void stuck_switch(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->axis[1].home_switch = MACHINE_SWITCH_STUCK;
    expect_alarm(m, FW_ALARM_HOME_STUCK);
}

static void pressed_switch(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->axis[1].home_switch = MACHINE_SWITCH_PRESSED;
    expect_alarm(m, FW_ALARM_HOME_PRESSED);
    m = rig_new();
    m->core.registers.home_pressed[0] = 1; // tried, in vain
    m->core.registers.home_travel[1] = 30000;
    m->axis[1].home_switch = MACHINE_SWITCH_PRESSED;
    expect_alarm(m, FW_ALARM_HOME_PRESSED);
}

static void pressed_switch_lets_go(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.home_pressed[0] = 1;
    m->axis[0].steps = -38000;
    gonio_machine_run(m, 2000);
    home(m, 1);
    assert_int_equal(m->core.state, FW_STATE_IDLE);
    assert_true(m->axis[0].steps == -37000 + 200);
    free(m);
}

static void bouncing_switch(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->axis[1].home_switch = MACHINE_SWITCH_BOUNCING;
    m->axis[1].bounce_us = 20000;
    expect_alarm(m, FW_ALARM_HOME_BOUNCE);
}

static void a_little_bounce_is_borne(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->axis[1].home_switch = MACHINE_SWITCH_BOUNCING;
    m->axis[1].bounce_us = 700;
    home(m, 15);
    assert_int_equal(m->core.state, FW_STATE_IDLE);
    assert_true(m->axis[1].steps == -37000 + 200);
    free(m);
}

static void phase_until(struct machine *m, unsigned phase) {
    while (m->core.homing.phase != phase) {
        gonio_machine_run(m, 1000);
        assert_true(m->core.state == FW_STATE_HOMING);
    }
}

// It answered the fast approach, and not the slow one.
static void switch_that_dies_is_missing(void **state) {
    (void)state;
    struct machine *m = rig_new();
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 2), FW_REFUSAL_NONE);
    phase_until(m, FW_HOMING_BACK_OFF);
    m->axis[1].home_switch = MACHINE_SWITCH_MISSING;
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_HOME_MISSING);
    free(m);
}

static void switch_that_sticks_in_the_end_is_stuck(void **state) {
    (void)state;
    struct machine *m = rig_new();
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 2), FW_REFUSAL_NONE);
    phase_until(m, FW_HOMING_LEAVE);
    m->axis[1].home_switch = MACHINE_SWITCH_PRESSED;
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_HOME_STUCK);
    assert_int_equal(m->core.known, 0);
    free(m);
}

static void switch_that_lets_go_while_held_bounces(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.debounce[0] = 50;
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 2), FW_REFUSAL_NONE);
    phase_until(m, FW_HOMING_HOLD);
    m->axis[1].home_switch = MACHINE_SWITCH_MISSING;
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_HOME_BOUNCE);
    free(m);
}

static void a_way_of_years_is_no_way(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.home_travel[1] = 1000000000;
    m->core.registers.home_fast[1] = 1;
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 2), FW_REFUSAL_NONE);
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_HOME_MISSING);
    assert_true(m->rising_edges == 0);
    free(m);
}

static void stop_ends_homing(void **state) {
    (void)state;
    struct machine *m = rig_new();
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 15), FW_REFUSAL_NONE);
    gonio_machine_run(m, 1000000);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_STOP, 0), FW_REFUSAL_NONE);
    assert_int_equal(m->core.state, FW_STATE_STOPPING);
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_int_equal(m->core.state, FW_STATE_IDLE);
    assert_int_equal(m->core.known, 0);
    home(m, 15);
    assert_int_equal(m->core.known, 15);
    free(m);
}

// The process' own mechanics fit whatever parameters it is given: homing finds the switch, and both ends are reached.
static void placed_switches_fit_the_parameters(void **state) {
    (void)state;
    for (unsigned up = 0; up < 2; up++) {
        struct machine *m = rig_new();
        struct fw_registers *r = &m->core.registers;
        for (unsigned i = 0; i < FW_AXES; i++) {
            r->home_up[i] = (uint16_t)up;
            r->soft_min[i] = -5000 * ((int64_t)i - 1);
            r->soft_max[i] = 90000;
            r->home_position[i] = up != 0 ? 91000 : -7000 - 5000 * (int64_t)i;
            r->jerk[i] = i == 2 ? 2000 : i == 3 ? 0 : 20000000;
            r->home_travel[i] = i == 1 ? 600 : 80000;
        }
        gonio_machine_place(m);
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 15), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(m, 10ull * MINUTE_US));
        assert_int_equal(m->core.registers.alarm[0], FW_ALARM_NONE);
        assert_int_equal(m->core.known, 15);
        for (unsigned end = 0; end < 2; end++) {
            assert_int_equal(gonio_machine_move(m, 15, end == 0 ? r->soft_max : r->soft_min), FW_REFUSAL_NONE);
            assert_true(gonio_machine_settle(m, 10ull * MINUTE_US));
            assert_int_equal(m->core.state, FW_STATE_IDLE);
        }
        for (unsigned i = 0; i < FW_AXES; i++)
            assert_true(m->axis[i].steps == r->soft_min[i]);
        const int64_t stands = m->axis[0].steps;
        gonio_machine_place(m); // where it is known to be, it stays
        assert_true(m->axis[0].steps == stands);
        free(m);
    }
    struct machine *m = rig_new();
    m->core.registers.home_travel[0] = 3;
    m->core.registers.soft_min[0] = INT64_MIN;
    m->core.registers.soft_max[0] = m->core.registers.home_position[1] = INT64_MAX;
    gonio_machine_place(m);
    assert_true(m->axis[0].limit_min_at < -(1ll << 59) && m->axis[0].limit_max_at > 1ll << 59);
    free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(finds_the_switch),
                                       cmocka_unit_test(repeats_and_reports_the_difference),
                                       cmocka_unit_test(follows_the_order),
                                       cmocka_unit_test(takes_an_axis_without_switch_as_it_stands),
                                       cmocka_unit_test(missing_switch),
                                       cmocka_unit_test(missing_switch_ends_on_the_limit),
                                       cmocka_unit_test(stuck_switch),
                                       cmocka_unit_test(pressed_switch),
                                       cmocka_unit_test(pressed_switch_lets_go),
                                       cmocka_unit_test(bouncing_switch),
                                       cmocka_unit_test(a_little_bounce_is_borne),
                                       cmocka_unit_test(switch_that_dies_is_missing),
                                       cmocka_unit_test(switch_that_sticks_in_the_end_is_stuck),
                                       cmocka_unit_test(switch_that_lets_go_while_held_bounces),
                                       cmocka_unit_test(a_way_of_years_is_no_way),
                                       cmocka_unit_test(placed_switches_fit_the_parameters),
                                       cmocka_unit_test(stop_ends_homing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
