// SPDX-License-Identifier: BSD-3-Clause
// Random commands, contacts and times against a simple model of the machine: no limit is passed, no position is lost,
// nothing moves when it must not. GONIO_FW_SEQUENCES sets how many (`make firmware-soak`: ten million), GONIO_FW_STEPS
// after how many steps of random moves the count must be exact (a thousand million), GONIO_FW_BYTES how many random
// bytes must move nothing (a hundred million).
#include <stdio.h>

#include "tests/unit/fw_rig.h"

static uint64_t state_of_random, steps_seen;

static uint32_t draw(uint32_t below) { // splitmix64
    uint64_t z = state_of_random += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return (uint32_t)((z ^ z >> 31) >> 33) % below;
}

struct model {
    int64_t offset[FW_AXES]; // true steps less the controller's, as long as a position is known
    uint16_t known;
    bool forbidden; // nothing may step
    unsigned steps_forbidden;
};

static void watch(void *context, uint64_t now_us, uint8_t edges, uint8_t directions) {
    struct model *model = context;
    (void)now_us;
    (void)directions;
    if (model->forbidden && (edges & 15) != 0)
        model->steps_forbidden++;
}

static struct machine *quick_machine(void) {
    struct machine *m = rig_homed();
    struct fw_registers *r = &m->core.registers;
    for (unsigned i = 0; i < FW_AXES; i++) {
        m->axis[i].steps = m->core.step.position[i] = 0;
        r->speed_max[i] = 50000;
        r->acceleration[i] = 4000000;
        r->jerk[i] = 4000000000u;
        r->soft_min[i] = -150;
        r->soft_max[i] = 150;
        r->home_fast[i] = 20000;
        r->home_slow[i] = 4000;
        r->home_backoff[i] = 20;
        r->home_travel[i] = 500;
        r->home_position[i] = -170;
        m->axis[i].home_at = -170;
        m->axis[i].limit_min_at = -400;
        m->axis[i].limit_max_at = 200;
    }
    r->debounce[0] = 1;
    r->settle[0] = 0;
    r->energise[0] = 0;
    r->backlash[1] = 7;
    r->backlash[2] = -5;
    r->home_pressed[0] = 1;
    return m;
}

static void act(struct machine *m) {
    int64_t target[FW_AXES];
    for (unsigned i = 0; i < FW_AXES; i++)
        target[i] = (int64_t)draw(400) - 200;
    const uint16_t axes = (uint16_t)draw(16);
    switch (draw(12)) {
    case 0:
        gonio_machine_command(m, FW_COMMAND_HOME, axes);
        break;
    case 1:
        gonio_machine_command(m, FW_COMMAND_STOP, 0);
        break;
    case 2:
        gonio_machine_command(m, draw(4) == 0 ? FW_COMMAND_HALT : FW_COMMAND_TRIGGER, 0);
        break;
    case 3:
        gonio_machine_hold(m, draw(4) == 0 ? FW_CONTACT_estop : FW_CONTACT_door, draw(2) == 0);
        break;
    case 4:
        gonio_machine_hold(m, FW_CONTACT_estop, false);
        gonio_machine_hold(m, FW_CONTACT_door, false);
        gonio_machine_command(m, FW_COMMAND_CLEAR, 0);
        break;
    case 5:
        gonio_fw_lamp_switch(&m->core, draw(2) == 0);
        gonio_fw_lamp_shutter(&m->core, draw(2) == 0);
        break;
    default:
        gonio_machine_move(m, axes, target);
    }
}

static void check(struct machine *m, struct model *model) {
    const unsigned state = m->core.state;
    assert_true(m->wrong_edges == 0 && model->steps_forbidden == 0);
    for (unsigned i = 0; i < FW_AXES; i++) {
        // Known positions are true ones, whatever happened on the way; unless it is under way right now.
        if (!m->core.axis.under_way && (m->core.known >> i & 1) != 0)
            assert_true(m->core.step.position[i] == m->axis[i].steps);
        // Within what the switches allow: a move halts on the limit contact itself.
        assert_true(m->axis[i].steps <= 200 && m->axis[i].steps >= -400);
    }
    if (state == FW_STATE_ALARM || state == FW_STATE_ESTOP)
        assert_true(!m->shutter && !m->core.lamp.on && m->lamp == 0);
    // A known position never leaves the soft limits, not under way and not with backlash; homing ends inside, too.
    for (unsigned i = 0; i < FW_AXES && state != FW_STATE_HOMING; i++)
        if ((m->core.known >> i & 1) != 0)
            assert_true(m->core.step.position[i] >= -150 && m->core.step.position[i] <= 150);
}

static void sequence(uint64_t seed) {
    state_of_random = seed;
    struct machine *m = quick_machine();
    struct model model = {0};
    m->context = &model;
    m->on_edges = watch;
    for (unsigned n = 3 + draw(4); n > 0; n--) {
        act(m);
        model.forbidden = m->core.state == FW_STATE_ESTOP || (m->core.interlock.active >> FW_CONTACT_estop & 1) != 0;
        gonio_machine_run(m, draw(8) == 0 ? 60000 : draw(9000));
        check(m, &model);
    }
    model.forbidden = false;
    assert_true(gonio_machine_settle(m, MINUTE_US)); // whatever it was, it comes to rest
    check(m, &model);
    steps_seen += m->rising_edges;
    free(m);
}

static void random_sequences(void **state) {
    (void)state;
    const char *wanted = getenv("GONIO_FW_SEQUENCES");
    const unsigned long long count = wanted != NULL ? strtoull(wanted, NULL, 10) : 3000;
    for (unsigned long long n = 1; n <= count; n++)
        sequence(n);
    printf("# %llu sequences, %llu steps\n", count, (unsigned long long)steps_seen);
    assert_true(steps_seen > 100 * count); // it did move
}

// Random moves at full speed, some of them stopped on the way, with backlash take-up: the count is where the motor is.
static void long_way_without_drift(void **state) {
    (void)state;
    const char *wanted = getenv("GONIO_FW_STEPS");
    const unsigned long long least = wanted != NULL ? strtoull(wanted, NULL, 10) : 2000000;
    struct machine *m = rig_homed();
    for (unsigned i = 0; i < FW_AXES; i++) {
        m->core.registers.speed_max[i] = 62500;
        m->core.registers.acceleration[i] = 4000000;
        m->core.registers.jerk[i] = i % 2 == 0 ? 0 : 4000000000u;
        m->core.registers.backlash[i] = (int32_t)i * 5 - 5;
    }
    state_of_random = 3;
    while (m->rising_edges < least) {
        int64_t target[FW_AXES];
        for (unsigned i = 0; i < FW_AXES; i++)
            target[i] = (int64_t)draw(71900) - 35950;
        assert_int_equal(gonio_machine_move(m, (uint16_t)(1 + draw(15)), target), FW_REFUSAL_NONE);
        if (draw(4) == 0) {
            gonio_machine_run(m, draw(400000));
            gonio_machine_command(m, FW_COMMAND_STOP, 0);
        }
        assert_true(gonio_machine_settle(m, 10ull * MINUTE_US));
        rig_check_positions(m);
        assert_int_equal(m->core.known, 15);
    }
    printf("# %llu steps\n", (unsigned long long)m->rising_edges);
    free(m);
}

// Bytes on the line that are no frames do nothing.
static void random_bytes_never_move_an_axis(void **state) {
    (void)state;
    const char *wanted = getenv("GONIO_FW_BYTES");
    const unsigned long long count = wanted != NULL ? strtoull(wanted, NULL, 10) : 300000;
    struct machine *m = rig_homed();
    state_of_random = 7;
    for (unsigned long long n = 0; n < count; n++) {
        gonio_fw_modbus_receive(&m->core, (uint8_t)draw(256), (uint32_t)m->now_us);
        if (draw(16) == 0)
            gonio_machine_run(m, 2500);
        m->sent_length = 0;
    }
    assert_true(m->rising_edges == 0);
    // One in some hundred million bytes ends a frame with a right CRC by chance; the dead-man then counts, and trips.
    assert_true(m->core.state == FW_STATE_IDLE || m->core.registers.alarm[0] == FW_ALARM_DEADMAN);
    free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(random_sequences), cmocka_unit_test(long_way_without_drift),
                                       cmocka_unit_test(random_bytes_never_move_an_axis)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
