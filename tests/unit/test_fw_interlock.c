// SPDX-License-Identifier: BSD-3-Clause
// Emergency stop, dead-man, door, watchdog and the safe state on the simulated machine.
#include "tests/unit/fw_rig.h"

static struct machine *moving(void) {
    struct machine *m = rig_homed();
    const int64_t target[FW_AXES] = {31000, -28000, 3000, 4000};
    m->core.registers.lamp_rise[0] = 0;
    assert_true(gonio_fw_lamp_switch(&m->core, true) && gonio_fw_lamp_shutter(&m->core, true));
    assert_int_equal(gonio_machine_move(m, 3, target), FW_REFUSAL_NONE);
    gonio_machine_run(m, 300000);
    assert_int_equal(m->core.state, FW_STATE_MOVING);
    assert_true(m->lamp == 10000 && m->shutter && m->rising_edges > 0);
    return m;
}

static void emergency_stop_is_immediate_and_latched(void **state) {
    (void)state;
    struct machine *m = moving();
    m->core.registers.safe_motors[0] = 2;
    const uint64_t edges = m->rising_edges;
    gonio_machine_hold(m, FW_CONTACT_estop, true);
    // In the interrupt, before the main loop runs again.
    assert_true(!m->armed && m->pins == 0 && m->lamp == 0 && !m->shutter && m->motors == 2);
    gonio_machine_run(m, 50000);
    assert_true(m->rising_edges == edges);
    assert_int_equal(m->core.state, FW_STATE_ESTOP);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_EMERGENCY);
    assert_int_equal(m->core.known, 12);
    rig_check_positions(m);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_ACTIVE);
    gonio_machine_hold(m, FW_CONTACT_estop, false);
    gonio_machine_run(m, 50000);
    assert_int_equal(m->core.state, FW_STATE_ESTOP); // released is not cleared
    assert_false(gonio_fw_lamp_switch(&m->core, true));
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 15), FW_REFUSAL_STOPPED);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_NONE);
    assert_int_equal(m->core.state, FW_STATE_IDLE);
    assert_true(m->lamp == 0 && !m->shutter);
    free(m);
}

// A press shorter than a turn of the main loop counts.
static void short_press_counts(void **state) {
    (void)state;
    struct machine *m = moving();
    gonio_machine_hold(m, FW_CONTACT_estop, true);
    gonio_machine_hold(m, FW_CONTACT_estop, false);
    gonio_machine_run(m, 2000);
    assert_int_equal(m->core.state, FW_STATE_ESTOP);
    free(m);
}

static void raise_alarm(struct machine *m, unsigned alarm) {
    switch (alarm) {
    case FW_ALARM_EMERGENCY:
        gonio_machine_hold(m, FW_CONTACT_estop, true);
        break;
    case FW_ALARM_OVERHEAT:
        m->temperature = 249000;
        break;
    case FW_ALARM_SENSOR:
        m->temperature = INT32_MIN;
        break;
    case FW_ALARM_DOOR:
        gonio_machine_hold(m, FW_CONTACT_door, true);
        break;
    case FW_ALARM_LIMIT_MAX:
        gonio_machine_hold(m, FW_CONTACT_limit_max_0, true);
        break;
    default:
        gonio_fw_interlock_alarm(&m->core, (enum fw_alarm)alarm, FW_NO_AXIS, false);
        break;
    }
    gonio_machine_run(m, 3000);
}

static bool goes_dark(unsigned alarm) {
    return alarm == FW_ALARM_EMERGENCY || alarm == FW_ALARM_OVERHEAT || alarm == FW_ALARM_SENSOR;
}

// Any alarm with any safe_lamp; alone, and beside one that stands already.
static void safe_state_is_as_configured(void **state) {
    (void)state;
    static const uint16_t safe[] = {0, 2500, 10000};
    for (unsigned first = FW_ALARM_EMERGENCY; first <= FW_ALARM_DOOR; first++)
        for (unsigned second = FW_ALARM_EMERGENCY; second <= FW_ALARM_DOOR; second++)
            for (unsigned i = 0; i < 3; i++) {
                struct machine *m = moving();
                m->core.registers.safe_lamp[0] = safe[i];
                m->core.registers.safe_motors[0] = 15;
                raise_alarm(m, first);
                assert_true(m->lamp == (goes_dark(first) ? 0 : safe[i]) && !m->shutter && m->motors == 3);
                raise_alarm(m, second);
                assert_true(m->lamp == (goes_dark(first) || goes_dark(second) ? 0 : safe[i]) && !m->shutter);
                assert_int_equal(m->core.registers.alarm[0], first);
                gonio_machine_run(m, 2000000);
                assert_true(m->lamp == (goes_dark(first) || goes_dark(second) ? 0 : safe[i]));
                // A cause that is still there is not cleared, whichever alarm came first.
                const bool stands = goes_dark(first) || (goes_dark(second) && m->core.interlock.hot) ||
                                    second == FW_ALARM_EMERGENCY || first == FW_ALARM_DOOR;
                assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0),
                                 stands ? FW_REFUSAL_ACTIVE : FW_REFUSAL_NONE);
                free(m);
            }
    struct machine *m = rig_homed(); // a lamp that was off is not switched on
    m->core.registers.safe_lamp[0] = 2500;
    raise_alarm(m, FW_ALARM_UNDERRUN);
    assert_true(m->lamp == 0);
    free(m);
    m = moving(); // dark until CLEAR: another alarm after it does not light it
    m->core.registers.safe_lamp[0] = 10000;
    raise_alarm(m, FW_ALARM_SENSOR);
    m->temperature = 25000;
    gonio_machine_run(m, 2000000);
    assert_true(m->lamp == 0);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_NONE);
    assert_true(gonio_fw_lamp_switch(&m->core, true));
    gonio_machine_run(m, 3000);
    raise_alarm(m, FW_ALARM_UNDERRUN);
    assert_true(m->lamp == 10000);
    free(m);
}

static void silence_makes_safe(void **state) {
    (void)state;
    struct machine *m = moving();
    m->core.registers.deadman[0] = 200;
    m->core.registers.safe_motors[0] = 1;
    gonio_machine_run(m, 300000);
    assert_int_equal(m->core.state, FW_STATE_MOVING); // nobody holds the rig: it does not count
    free(m);
    m = moving();
    m->core.registers.deadman[0] = 200;
    m->core.registers.safe_motors[0] = 1;
    const uint8_t heartbeat[] = {16, 0, 0xFE, 0, 2, 4, 0, 0, 0, 9};
    uint8_t reply[FW_PDU_MAX];
    for (int i = 0; i < 5; i++) {
        assert_int_equal(gonio_fw_modbus_pdu(&m->core, FW_CHANNEL_LINE, heartbeat, sizeof heartbeat, reply), 5);
        gonio_machine_run(m, 150000);
        assert_int_equal(m->core.state, FW_STATE_MOVING);
    }
    gonio_machine_run(m, 55000);
    assert_int_equal(m->core.state, FW_STATE_ALARM);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_DEADMAN);
    assert_true(m->lamp == 0 && !m->shutter && m->core.axis.under_way && m->motors == 3); // decelerating
    gonio_machine_run(m, 300000);
    assert_true(!m->core.axis.under_way && m->motors == 1);
    assert_int_equal(m->core.known, 15 & ~2); // the one that lost its current
    rig_check_positions(m);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_NONE);
    free(m);
}

// An RS-485 receiver that stays on while sending hands every reply back, the last byte somewhat late. No reply, good or
// bad, short or long, may be taken for a request: silence stays silence.
static void an_echo_is_no_request(void **state) {
    (void)state;
    static const uint8_t requests[][14] = {
        {1, 3, 0, 0x10, 0, 0x30}, {1, 16, 0, 0x10, 0, 1, 2, 0, 7}, {1, 6, 0, 0x10, 0, 7}, {1, 99}, {1, 1, 0, 0, 0, 2}};
    static const unsigned lengths[] = {6, 9, 6, 2, 6};
    for (unsigned i = 0; i < 5; i++)
        for (uint32_t late = 0; late <= 90; late += 45) {
            struct machine *m = moving();
            m->core.registers.deadman[0] = 200;
            m->echo = true;
            m->echo_us = late;
            uint8_t frame[16];
            memcpy(frame, requests[i], lengths[i]);
            const uint16_t crc = gonio_fw_modbus_crc(frame, lengths[i]);
            frame[lengths[i]] = (uint8_t)crc;
            frame[lengths[i] + 1] = (uint8_t)(crc >> 8);
            for (unsigned k = 0; k < 2; k++) { // what is left of the echo must not spoil the next request
                gonio_machine_receive(m, frame, lengths[i] + 2);
                gonio_machine_run(m, 20000);
                assert_true(!m->core.modbus.sending && m->sent_length >= 5 && m->core.modbus.length == 0);
            }
            const unsigned sent = m->sent_length;
            gonio_machine_run(m, 400000);
            assert_int_equal(m->sent_length, sent);
            assert_int_equal(m->core.modbus.counter[FW_COUNT_MESSAGES], 2);
            free(m);
        }
}

static void door_closes_the_shutter(void **state) {
    (void)state;
    struct machine *m = moving();
    gonio_machine_hold(m, FW_CONTACT_door, true);
    gonio_machine_run(m, 2000);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_DOOR);
    assert_false(m->shutter);
    gonio_machine_settle(m, MINUTE_US);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_ACTIVE);
    gonio_machine_hold(m, FW_CONTACT_door, false);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_NONE);
    gonio_machine_hold(m, FW_CONTACT_door, true); // idle and dark: one may change the sample
    gonio_machine_run(m, 10000);
    assert_int_equal(m->core.state, FW_STATE_IDLE);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 1), FW_REFUSAL_ACTIVE);
    assert_false(gonio_fw_lamp_switch(&m->core, true) || gonio_fw_lamp_shutter(&m->core, true));
    free(m);
}

static void hot_or_blind_lamp_goes_out(void **state) {
    (void)state;
    struct machine *m = moving();
    m->temperature = 90001;
    gonio_machine_run(m, 3000);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_OVERHEAT);
    assert_true(m->lamp == 0);
    gonio_machine_settle(m, MINUTE_US);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_ACTIVE);
    m->temperature = 60000;
    gonio_machine_run(m, 3000);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_NONE);
    free(m);
    m = moving();
    m->temperature = INT32_MIN;
    gonio_machine_run(m, 3000);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_SENSOR);
    gonio_machine_settle(m, MINUTE_US);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_ACTIVE);
    free(m);
}

static void first_alarm_is_kept(void **state) {
    (void)state;
    struct machine *m = moving();
    m->temperature = 90001;
    gonio_machine_run(m, 3000);
    gonio_machine_hold(m, FW_CONTACT_estop, true);
    gonio_machine_run(m, 3000);
    assert_int_equal(m->core.state, FW_STATE_ESTOP);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_OVERHEAT);
    free(m);
}

static void contacts_can_be_inverted_and_left_out(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->core.registers.input_enable[0] = 0x0FFF;
    gonio_machine_hold(m, FW_CONTACT_estop, true);
    gonio_machine_run(m, 3000);
    assert_int_equal(m->core.state, FW_STATE_IDLE);
    m->core.registers.input_enable[0] = 0x3FFF;
    m->core.registers.input_invert[0] = 0x3FFF; // the machine's wiring follows: levels invert, meanings stay
    gonio_machine_run(m, 3000);
    assert_int_equal(m->core.state, FW_STATE_ESTOP);
    free(m);
}

static void watchdog_bites_what_hangs(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    gonio_machine_run(m, 2000000);
    assert_false(m->bitten);
    assert_int_equal(gonio_fw_core_self_test(&m->core, 1), FW_REFUSAL_UNKNOWN);
    assert_int_equal(gonio_fw_core_self_test(&m->core, 0xDEAD), FW_REFUSAL_NONE);
    gonio_machine_run(m, 600000);
    assert_true(m->bitten);
    gonio_machine_start(m, FW_CAUSE_WATCHDOG);
    assert_int_equal(m->core.registers.reset_cause[0], FW_CAUSE_WATCHDOG);
    assert_int_equal(m->core.known, 0);
    free(m);
}

// A step timer that no longer interrupts starves the watchdog, too.
static void watchdog_bites_when_the_step_timer_dies(void **state) {
    (void)state;
    struct machine *m = moving();
    m->armed = false;
    gonio_machine_run(m, 600000);
    assert_true(m->bitten);
    free(m);
}

static void fault_makes_safe_first(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->motors = 15;
    assert_int_equal(gonio_fw_core_self_test(&m->core, 0xFA17), FW_REFUSAL_NONE);
    assert_true(m->fault && m->motors == 0 && m->lamp == 0 && !m->shutter);
    free(m);
    m = moving();
    assert_int_equal(gonio_fw_core_self_test(&m->core, 0xFA17), FW_REFUSAL_NOT_SAFE);
    assert_false(m->fault);
    free(m);
}

static void late_producer_is_an_alarm(void **state) {
    (void)state;
    struct machine *m = moving();
    m->core.step.producing = false; // as if it were never let in again
    gonio_machine_run(m, 5000);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_UNDERRUN);
    assert_int_equal(m->core.known, 12);
    rig_check_positions(m);
    free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(emergency_stop_is_immediate_and_latched),
        cmocka_unit_test(short_press_counts),
        cmocka_unit_test(safe_state_is_as_configured),
        cmocka_unit_test(silence_makes_safe),
        cmocka_unit_test(an_echo_is_no_request),
        cmocka_unit_test(door_closes_the_shutter),
        cmocka_unit_test(hot_or_blind_lamp_goes_out),
        cmocka_unit_test(first_alarm_is_kept),
        cmocka_unit_test(contacts_can_be_inverted_and_left_out),
        cmocka_unit_test(watchdog_bites_what_hangs),
        cmocka_unit_test(watchdog_bites_when_the_step_timer_dies),
        cmocka_unit_test(fault_makes_safe_first),
        cmocka_unit_test(late_producer_is_an_alarm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
