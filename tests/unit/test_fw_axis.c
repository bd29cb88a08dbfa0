// SPDX-License-Identifier: BSD-3-Clause
// Moves on the simulated machine: coordination, limits, backlash, stop and halt, bookkeeping.
#include "tests/unit/fw_rig.h"

static void arrives_exactly(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    const int64_t target[FW_AXES] = {30000, -20000, 3001, 4000};
    assert_int_equal(gonio_machine_move(m, 15, target), FW_REFUSAL_NONE);
    assert_true(gonio_machine_settle(m, MINUTE_US));
    for (unsigned i = 0; i < FW_AXES; i++)
        assert_true(m->axis[i].steps == target[i]);
    rig_check_positions(m);
    assert_int_equal(m->core.registers.finished_id[0], m->core.registers.accepted_id[0]);
    assert_int_equal(m->core.known, 15);
    assert_int_equal(m->pins, 0);
    free(m);
}

struct coordination {
    int64_t from[FW_AXES], way[FW_AXES], steps[FW_AXES];
    double worst;
};

// At every edge the axes lie within a step of the straight line through the leading one.
static void watch_coordination(void *context, uint64_t now_us, uint8_t edges, uint8_t directions) {
    struct coordination *c = context;
    (void)now_us;
    (void)directions;
    for (unsigned i = 0; i < FW_AXES; i++)
        c->steps[i] += edges >> i & 1;
    const double part = (double)c->steps[0] / (double)c->way[0];
    for (unsigned i = 1; i < FW_AXES; i++) {
        const double off = part * (double)c->way[i] - (double)c->steps[i];
        if (off > c->worst || -off > c->worst)
            c->worst = off < 0.0 ? -off : off;
    }
}

static void axes_keep_together(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->core.registers.speed_max[1] = 700; // slower than the others: it sets the pace
    const int64_t target[FW_AXES] = {31000, 12000, 3017, 4000};
    struct coordination c = {.way = {30000, 10000, 17, 0}};
    m->context = &c;
    m->on_edges = watch_coordination;
    assert_int_equal(gonio_machine_move(m, 15, target), FW_REFUSAL_NONE);
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_true(c.worst <= 1.0);
    rig_check_positions(m);
    free(m);
}

static void refuses_what_it_must(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    struct fw_registers *r = &m->core.registers;
    int64_t target[FW_AXES] = {36001, 0, 0, 0};
    assert_int_equal(gonio_machine_move(m, 1, target), FW_REFUSAL_SOFT_LIMIT);
    target[0] = -36001;
    assert_int_equal(gonio_machine_move(m, 1, target), FW_REFUSAL_SOFT_LIMIT);
    assert_int_equal(gonio_machine_move(m, 0, target), FW_REFUSAL_NO_AXIS);
    r->backlash[0] = 100;
    target[0] = -35950; // the overshoot would pass the limit
    assert_int_equal(gonio_machine_move(m, 1, target), FW_REFUSAL_SOFT_LIMIT);
    r->soft_max[1] = INT64_MAX;
    r->soft_min[1] = INT64_MIN;
    target[1] = INT64_MAX;
    assert_int_equal(gonio_machine_move(m, 2, target), FW_REFUSAL_TOO_FAR);
    target[1] = INT64_MIN;
    assert_int_equal(gonio_machine_move(m, 2, target), FW_REFUSAL_TOO_FAR);
    target[1] = 2000 + (int64_t)INT32_MAX;
    r->speed_max[1] = 1;
    assert_int_equal(gonio_machine_move(m, 2, target), FW_REFUSAL_TOO_FAR); // 68 years
    m->core.known = 14;
    target[0] = 0;
    assert_int_equal(gonio_machine_move(m, 1, target), FW_REFUSAL_NOT_HOMED);
    assert_int_equal(m->core.state, FW_STATE_IDLE);
    assert_true(m->rising_edges == 0);
    free(m);
}

// At the ends of what registers hold: refused, and nothing overflows.
static void the_ends_of_the_numbers(void **state) {
    (void)state;
    static const uint16_t registers[] = {FW_REGISTER_soft_min, FW_REGISTER_soft_max, FW_REGISTER_home_position};
    static const int64_t values[] = {INT64_MIN, INT64_MIN + 1, -(INT64_C(1) << 53) - 1, (INT64_C(1) << 53) + 1,
                                     INT64_MAX};
    struct machine *m = rig_homed();
    for (unsigned i = 0; i < 3; i++)
        for (unsigned k = 0; k < 5; k++) {
            const uint64_t v = (uint64_t)values[k];
            const uint16_t words[4] = {(uint16_t)(v >> 48), (uint16_t)(v >> 32), (uint16_t)(v >> 16), (uint16_t)v};
            assert_int_equal(gonio_fw_registers_write(&m->core, registers[i], 4, words), FW_EXCEPTION_VALUE);
        }
    for (int32_t backlash = -1000000; backlash <= 1000000; backlash += 1000000)
        for (unsigned k = 0; k < 5; k++) {
            m->core.registers.backlash[0] = backlash;
            const int64_t target[FW_AXES] = {values[k], 0, 0, 0};
            assert_int_equal(gonio_machine_move(m, 1, target), FW_REFUSAL_SOFT_LIMIT);
        }
    free(m);
}

static void backlash_arrives_from_one_side(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->core.registers.backlash[0] = 100;
    m->core.registers.backlash[1] = -70;
    const int64_t targets[][FW_AXES] = {
        {5000, 5000, 0, 0}, {-5000, -5000, 0, 0}, {4999, 4999, 0, 0}, {4990, 5001, 0, 0}};
    for (unsigned i = 0; i < 4; i++) {
        assert_int_equal(gonio_machine_move(m, 3, targets[i]), FW_REFUSAL_NONE);
        uint8_t last = 0;
        while (m->core.state == FW_STATE_MOVING) {
            if (m->core.axis.under_way)
                last = (uint8_t)(m->core.axis.up | m->core.axis.down << 4);
            gonio_machine_run(m, 100);
        }
        assert_int_equal(last & 0x12, 0); // axis 0 came moving up, axis 1 down
        assert_true(m->axis[0].steps == targets[i][0] && m->axis[1].steps == targets[i][1]);
    }
    rig_check_positions(m);
    free(m);
}

// Writing the target registers while a two-legged move is under way must not change where it ends.
static void target_is_latched(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->core.registers.backlash[0] = 500;
    const int64_t target[FW_AXES] = {-1000, 0, 0, 0};
    assert_int_equal(gonio_machine_move(m, 1, target), FW_REFUSAL_NONE);
    gonio_machine_run(m, 10000);
    m->core.registers.target[0] = 30000;
    m->core.registers.command_axes[0] = 15;
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_true(m->axis[0].steps == -1000);
    rig_check_positions(m);
    free(m);
}

static void stop_decelerates_and_knows(void **state) {
    (void)state;
    for (uint64_t after = 0; after < 1800000; after += 37000) {
        struct machine *m = rig_homed();
        const int64_t target[FW_AXES] = {31000, -28000, 3000, 4000};
        assert_int_equal(gonio_machine_move(m, 3, target), FW_REFUSAL_NONE);
        gonio_machine_run(m, after);
        const int64_t at = m->axis[0].steps;
        const bool moving = m->core.axis.under_way;
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_STOP, 0), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(m, MINUTE_US));
        assert_int_equal(m->core.state, FW_STATE_IDLE);
        assert_int_equal(m->core.known, 15);
        rig_check_positions(m);
        // v^2/2a + v a/2j = 1000 + 100 steps, and the milliseconds until it begins
        assert_true(m->axis[0].steps - at <= 1100 + 100 && m->axis[0].steps <= 31000);
        if (moving && m->axis[0].steps < 31000)
            assert_true(m->core.registers.finished_id[0] != m->core.registers.accepted_id[0]);
        free(m);
    }
}

static void halt_stops_at_once_and_forgets(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    const int64_t target[FW_AXES] = {31000, -28000, 3000, 4000};
    assert_int_equal(gonio_machine_move(m, 3, target), FW_REFUSAL_NONE);
    gonio_machine_run(m, 300000);
    const uint64_t edges = m->rising_edges;
    assert_true(edges > 0);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HALT, 0), FW_REFUSAL_NONE);
    gonio_machine_run(m, 100000);
    assert_true(m->rising_edges == edges);
    assert_int_equal(m->core.state, FW_STATE_IDLE);
    assert_int_equal(m->core.known, 12); // axes 2 and 3 stood
    assert_int_equal(m->pins, 0);
    rig_check_positions(m); // counted right all the same
    free(m);
}

static void limit_switch_halts_all(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->axis[1].limit_max_at = 20000;
    const int64_t target[FW_AXES] = {30000, 30000, 30000, 30000};
    assert_int_equal(gonio_machine_move(m, 15, target), FW_REFUSAL_NONE);
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_int_equal(m->core.state, FW_STATE_ALARM);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_LIMIT_MAX);
    assert_int_equal(m->core.registers.alarm_axis[0], 1);
    assert_true(m->axis[1].steps == 20000); // not a step further
    assert_int_equal(m->core.known, 0);
    rig_check_positions(m);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_NONE);
    m->core.known = 15;
    assert_int_equal(gonio_machine_move(m, 2, target), FW_REFUSAL_HARD_LIMIT);
    const int64_t back[FW_AXES] = {0, 0, 0, 0};
    gonio_machine_hold(m, FW_CONTACT_limit_min_1, true);
    assert_int_equal(gonio_machine_move(m, 2, back), FW_REFUSAL_HARD_LIMIT);
    gonio_machine_release(m, FW_CONTACT_limit_min_1);
    assert_int_equal(gonio_machine_move(m, 2, back), FW_REFUSAL_NONE);
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_true(m->axis[1].steps == 0);
    free(m);
}

// The controller slows a move down rather than ask more of the step interrupt than it can do.
static void step_rate_is_bounded(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    for (unsigned i = 0; i < FW_AXES; i++) {
        m->core.registers.speed_max[i] = 62500;
        m->core.registers.acceleration[i] = 4000000;
        m->core.registers.jerk[i] = 0;
    }
    m->core.registers.step_rate_max[0] = 100000;
    const int64_t target[FW_AXES] = {-30000, -30000, -30000, -30000};
    assert_int_equal(gonio_machine_move(m, 15, target), FW_REFUSAL_NONE);
    gonio_machine_run(m, 300000);
    const uint64_t edges = m->rising_edges;
    gonio_machine_run(m, 100000);
    assert_in_range(m->rising_edges - edges, 9950, 10004);
    free(m);
}

// What simulators plan with: the time from the limits alone, which the move itself exceeds by rounding and waiting.
static void seconds_are_what_a_move_takes(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->core.registers.backlash[1] = 100;
    m->core.registers.speed_max[2] = 900;
    m->core.registers.jerk[3] = 0;
    const int64_t targets[][FW_AXES] = {
        {5000, 5000, 3000, 4000}, {5000, -3000, 3000, 4000}, {5001, -3000, 3000, 4000}, {-9000, -3100, 500, -20000}};
    for (unsigned n = 0; n < 4; n++) {
        int64_t from[FW_AXES];
        for (unsigned i = 0; i < FW_AXES; i++)
            from[i] = m->core.step.position[i];
        const double seconds = gonio_fw_axis_seconds(&m->core, from, targets[n]);
        const uint64_t start = m->now_us;
        assert_int_equal(gonio_machine_move(m, 15, targets[n]), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(m, MINUTE_US));
        const double took = 1e-6 * (double)(m->now_us - start);
        assert_true(took > seconds && took < seconds + 0.015);
        assert_true(gonio_fw_axis_seconds(&m->core, targets[n], targets[n]) == 0.0);
    }
    free(m);
}

static enum fw_refusal jog(struct machine *m, uint16_t axes, int64_t way) {
    for (unsigned i = 0; i < FW_AXES; i++)
        m->core.registers.target[i] = way;
    return gonio_machine_command(m, FW_COMMAND_JOG, axes);
}

// Homed or not, either way: by so much, no faster than home_slow, and as unhomed as before. Nothing else moves.
static void jogs_slowly(void **state) {
    (void)state;
    for (unsigned n = 0; n < 4 * FW_AXES; n++) {
        struct machine *m = rig_homed();
        const unsigned axis = n % FW_AXES;
        const bool homed = n < 2 * FW_AXES;
        const int64_t way = n / FW_AXES % 2 == 0 ? 5000 : -5000; // ten seconds of home_slow
        m->core.known = (uint16_t)(homed ? 15 : 15 & ~(1u << axis));
        m->core.registers.backlash[axis] = 300; // none is taken up
        const uint16_t known = m->core.known;
        int64_t before[FW_AXES];
        for (unsigned i = 0; i < FW_AXES; i++)
            before[i] = m->axis[i].steps;
        const uint64_t began = m->now_us;
        assert_int_equal(jog(m, (uint16_t)(1u << axis), way), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(m, MINUTE_US));
        assert_true(m->now_us - began >= 10 * 1000000u);
        for (unsigned i = 0; i < FW_AXES; i++)
            assert_true(m->axis[i].steps == before[i] + (i == axis ? way : 0));
        assert_int_equal(m->core.known, known);
        assert_int_equal(m->core.registers.finished_id[0], m->core.registers.accepted_id[0]);
        rig_check_positions(m);
        free(m);
    }
}

static void jogs_no_further(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->core.known = 14;
    assert_int_equal(jog(m, 1, 5001), FW_REFUSAL_TOO_FAR);
    assert_int_equal(jog(m, 1, -5001), FW_REFUSAL_TOO_FAR);
    assert_int_equal(jog(m, 1, INT64_MIN), FW_REFUSAL_TOO_FAR);
    assert_int_equal(jog(m, 0, 10), FW_REFUSAL_NO_AXIS);
    assert_int_equal(jog(m, 3, 10), FW_REFUSAL_NO_AXIS); // one at a time
    m->core.registers.soft_max[1] = m->axis[1].steps + 100;
    assert_int_equal(jog(m, 2, 101), FW_REFUSAL_SOFT_LIMIT); // it is homed
    gonio_machine_hold(m, FW_CONTACT_limit_max_0, true);
    gonio_machine_run(m, 2000);
    assert_int_equal(jog(m, 1, 10), FW_REFUSAL_HARD_LIMIT);
    assert_true(m->rising_edges == 0);
    assert_int_equal(jog(m, 1, -10), FW_REFUSAL_NONE); // off the switch
    assert_true(gonio_machine_settle(m, MINUTE_US));
    gonio_machine_hold(m, FW_CONTACT_limit_max_0, false);
    gonio_machine_run(m, 2000);
    assert_int_equal(jog(m, 1, 5000), FW_REFUSAL_NONE);
    gonio_machine_run(m, 1000000);
    gonio_machine_hold(m, FW_CONTACT_estop, true);
    gonio_machine_run(m, 2000);
    assert_true(m->core.state == FW_STATE_ESTOP && !m->core.axis.under_way);
    assert_int_equal(jog(m, 1, 10), FW_REFUSAL_STOPPED);
    free(m);
}

// Drivers whose enable input is active low: off at rest, on in a move, off when released and in the safe state.
static void enables_of_either_polarity(void **state) {
    (void)state;
    for (unsigned low = 0; low < 16; low++) {
        struct machine *m = rig_homed();
        m->enable_low = (uint8_t)low;
        m->core.registers.motors_invert[0] = (uint16_t)low;
        gonio_fw_core_parameters_changed(&m->core);
        assert_int_equal(m->motors ^ low, 0);
        const int64_t target[FW_AXES] = {100, 200, 300, 400};
        assert_int_equal(gonio_machine_move(m, 15, target), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(m, MINUTE_US));
        assert_int_equal(m->motors ^ low, 15);
        rig_check_positions(m); // no step of a motor that is off
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_RELEASE, 5), FW_REFUSAL_NONE);
        assert_int_equal(m->motors ^ low, 10);
        m->core.registers.safe_motors[0] = 2;
        gonio_machine_hold(m, FW_CONTACT_estop, true);
        gonio_machine_run(m, 2000);
        assert_int_equal(m->motors ^ low, 2);
        gonio_fw_interlock_fault(&m->core);
        assert_int_equal(m->motors ^ low, 0);
        free(m);
    }
}

// ---- brakes ----

// When motor and brake of axis 1 changed, and the first and last step; us, 0: never.
typedef struct seen {
    struct machine *m;
    unsigned low;
    uint64_t energised, opened, stepped, closed, off;
} seen;

static void see_step(void *context, uint64_t now_us, uint8_t edges, uint8_t directions) {
    (void)directions;
    seen *s = context;
    if ((edges & 2) != 0 && s->stepped == 0)
        s->stepped = now_us;
    assert_true((edges & 2) == 0 || ((s->m->motors ^ s->low) & 0x22) == 0x22); // no step with a closed brake
}

static void watch(seen *s, uint64_t us) {
    for (const uint64_t until = s->m->now_us + us; s->m->now_us < until;) {
        const unsigned before = s->m->motors ^ s->low;
        gonio_machine_run(s->m, 100);
        const unsigned now = s->m->motors ^ s->low, rose = now & ~before, fell = before & ~now;
        s->energised = (rose & 0x02) != 0 ? s->m->now_us : s->energised;
        s->opened = (rose & 0x20) != 0 ? s->m->now_us : s->opened;
        s->closed = (fell & 0x20) != 0 ? s->m->now_us : s->closed;
        s->off = (fell & 0x02) != 0 ? s->m->now_us : s->off;
    }
}

static struct machine *rig_braked(unsigned low) {
    struct machine *m = rig_homed();
    struct fw_registers *r = &m->core.registers;
    r->brakes[0] = 2;
    r->brakes_invert[0] = (uint16_t)(low >> 4);
    r->motors_invert[0] = (uint16_t)(low & 15);
    m->enable_low = (uint8_t)(low & 15);
    r->brake_delay[0] = 40;
    r->energise[0] = 7;
    gonio_fw_core_parameters_changed(&m->core);
    return m;
}

// The motor holds before its brake opens, and steps when that is open; the brake grips before the motor lets go.
static void a_brake_and_its_motor_overlap(void **state) {
    (void)state;
    static const unsigned polarities[] = {0x00, 0x20, 0x02, 0x22};
    for (size_t i = 0; i < sizeof polarities / sizeof *polarities; i++) {
        struct machine *m = rig_braked(polarities[i]);
        seen s = {.m = m, .low = polarities[i]};
        m->on_edges = see_step;
        m->context = &s;
        assert_int_equal((m->motors ^ s.low) & 0x22, 0);
        const int64_t target[FW_AXES] = {100, m->axis[1].steps + 2000, 300, 400};
        assert_int_equal(gonio_machine_move(m, 15, target), FW_REFUSAL_NONE);
        s.energised = m->now_us;
        watch(&s, 2000000);
        rig_check_positions(m);
        assert_true(s.opened - s.energised >= 7000 && s.opened - s.energised < 10000);
        assert_true(s.stepped - s.opened >= 39900 && s.stepped - s.opened < 60000);
        assert_int_equal((m->motors ^ s.low) & 0xF0, 0x20); // open as long as the motor is on; others have none
        s.stepped = 0;
        const uint64_t again = m->now_us;
        assert_int_equal(gonio_machine_move(m, 2, (const int64_t[FW_AXES]){0, 1000}), FW_REFUSAL_NONE);
        watch(&s, 500000);
        assert_true(s.stepped - again < 30000); // nothing to wait for
        gonio_machine_command(m, FW_COMMAND_RELEASE, 2);
        s.closed = m->now_us;
        watch(&s, 100000);
        assert_true(s.off - s.closed >= 40000 && s.off - s.closed < 43000);
        assert_int_equal((m->motors ^ s.low) & 0x22, 0);
        free(m);
    }
}

// However it comes to it, the brake closes at once and the motor follows.
static void a_brake_closes_in_the_safe_state(void **state) {
    (void)state;
    for (int how = 0; how < 4; how++) {
        struct machine *m = rig_braked(0);
        m->core.registers.safe_motors[0] = 13;
        gonio_machine_move(m, 15, (const int64_t[FW_AXES]){20000, 20000, 300, 400});
        gonio_machine_run(m, how == 3 ? 20000 : 300000); // 3: while the move waits for the brake
        assert_int_equal(m->motors & 0x22, 0x22);
        if (how == 2) {
            gonio_fw_interlock_fault(&m->core);
            assert_int_equal(m->motors, 0); // nobody is there to wait
            free(m);
            continue;
        }
        if (how == 1)
            gonio_machine_command(m, FW_COMMAND_HALT, 0);
        gonio_machine_hold(m, FW_CONTACT_estop, true);
        gonio_machine_run(m, 100);
        assert_int_equal(m->motors & 0x22, 0x02);
        gonio_machine_run(m, 50000);
        assert_int_equal(m->motors & 0x22, 0);
        assert_true((m->core.known & 2) == 0);
        rig_check_positions(m);
        gonio_machine_release(m, FW_CONTACT_estop);
        gonio_machine_run(m, 2000);
        free(m);
    }
}

// A move that is stopped while it waits for its brake has not moved, and the next one moves as any.
static void a_move_that_waits_can_be_stopped(void **state) {
    (void)state;
    static const enum fw_command stops[] = {FW_COMMAND_STOP, FW_COMMAND_HALT};
    for (size_t i = 0; i < 2; i++) {
        struct machine *m = rig_braked(0);
        const int64_t at = m->axis[1].steps, target[FW_AXES] = {at, at + 500, at, at};
        gonio_machine_move(m, 2, target);
        gonio_machine_run(m, 20000);
        assert_true(m->core.axis.under_way && m->rising_edges == 0);
        gonio_machine_command(m, stops[i], 0);
        gonio_machine_run(m, 200000);
        assert_true(m->core.state == FW_STATE_IDLE && !m->core.axis.under_way && m->rising_edges == 0);
        assert_int_equal(m->core.known, 15);
        assert_int_equal(gonio_machine_move(m, 2, target), FW_REFUSAL_NONE);
        assert_true(gonio_machine_settle(m, MINUTE_US));
        assert_true(m->axis[1].steps == at + 500);
        rig_check_positions(m);
        free(m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(arrives_exactly),
                                       cmocka_unit_test(axes_keep_together),
                                       cmocka_unit_test(refuses_what_it_must),
                                       cmocka_unit_test(the_ends_of_the_numbers),
                                       cmocka_unit_test(backlash_arrives_from_one_side),
                                       cmocka_unit_test(target_is_latched),
                                       cmocka_unit_test(stop_decelerates_and_knows),
                                       cmocka_unit_test(halt_stops_at_once_and_forgets),
                                       cmocka_unit_test(limit_switch_halts_all),
                                       cmocka_unit_test(step_rate_is_bounded),
                                       cmocka_unit_test(seconds_are_what_a_move_takes),
                                       cmocka_unit_test(jogs_slowly),
                                       cmocka_unit_test(jogs_no_further),
                                       cmocka_unit_test(enables_of_either_polarity),
                                       cmocka_unit_test(a_brake_and_its_motor_overlap),
                                       cmocka_unit_test(a_brake_closes_in_the_safe_state),
                                       cmocka_unit_test(a_move_that_waits_can_be_stopped)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
