// What must happen, whatever comes together: every command in every state, with every kind of limit contact and
// homing, against a table that is written here once more, independently of the firmware.
#include <stdio.h>

#include "tests/unit/fw_rig.h"

enum { LIMIT_NONE, LIMIT_AHEAD, LIMIT_BEHIND, LIMITS, HOMED_NONE, HOMED_OTHER, HOMED_ALL, HOMINGS_END };
enum { HOMINGS = HOMINGS_END - HOMED_NONE, DOORS = 2, STATES = 6 };

// Columns: IDLE, MOVING, STOPPING, HOMING, ALARM, ESTOP. '+' done, 'B' busy, 'A' alarmed, 'E' emergency stop stands,
// 'm' as a move: also needs homing, a free limit and a closed door; 'd' also needs a closed door; '=' done, and clears.
static const char *const table[FW_COMMAND_RESTART + 1] = {
    [FW_COMMAND_MOVE] = "mBBBAE",    [FW_COMMAND_HOME] = "dBBBAE",    [FW_COMMAND_STOP] = "++++++",
    [FW_COMMAND_HALT] = "++++++",    [FW_COMMAND_CLEAR] = "+BBB==",   [FW_COMMAND_TRIGGER] = "dBBBAE",
    [FW_COMMAND_SAVE] = "+BBB++",    [FW_COMMAND_LOAD] = "+BBB++",    [FW_COMMAND_DEFAULTS] = "+BBB++",
    [FW_COMMAND_RELEASE] = "+BBB++", [FW_COMMAND_RESTART] = "+BBB++",
};

static void bring_to(struct machine *m, unsigned state) {
    const int64_t far[FW_AXES] = {30000, 30000, 30000, 30000};
    if (state == FW_STATE_MOVING || state == FW_STATE_STOPPING)
        assert_int_equal(machine_move(m, 15, far), FW_REFUSAL_NONE);
    if (state == FW_STATE_HOMING)
        assert_int_equal(machine_command(m, FW_COMMAND_HOME, 15), FW_REFUSAL_NONE);
    machine_run(m, 200000);
    if (state == FW_STATE_STOPPING)
        machine_command(m, FW_COMMAND_STOP, 0);
    if (state == FW_STATE_ALARM)
        fw_interlock_alarm(&m->core, FW_ALARM_DEADMAN, FW_NO_AXIS, false);
    if (state == FW_STATE_ESTOP) {
        machine_hold(m, FW_CONTACT_estop, true);
        machine_run(m, 2000);
        machine_hold(m, FW_CONTACT_estop, false);
        machine_run(m, 2000);
    }
    assert_int_equal(m->core.state, state);
}

static enum fw_refusal expected(unsigned command, unsigned state, unsigned limit, unsigned homed, bool door) {
    switch (table[command][state]) {
    case 'B':
        return FW_REFUSAL_BUSY;
    case 'A':
        return FW_REFUSAL_ALARMED;
    case 'E':
        return FW_REFUSAL_STOPPED;
    case 'd':
        return door ? FW_REFUSAL_ACTIVE : FW_REFUSAL_NONE;
    case 'm':
        if (door)
            return FW_REFUSAL_ACTIVE;
        if (homed != HOMED_ALL)
            return FW_REFUSAL_NOT_HOMED;
        return limit == LIMIT_AHEAD ? FW_REFUSAL_HARD_LIMIT : FW_REFUSAL_NONE;
    default:
        return FW_REFUSAL_NONE;
    }
}

// At rest, dark and shut, or on the way to rest.
static void check_safe(struct machine *m) {
    assert_true(m->lamp == 0 && !m->shutter);
    machine_settle(m, MINUTE_US);
    assert_true(!m->core.axis.under_way && !m->armed);
}

static void check_after(struct machine *m, unsigned command, unsigned state, enum fw_refusal refusal) {
    const bool starts = refusal == FW_REFUSAL_NONE && state == FW_STATE_IDLE;
    const unsigned now = m->core.state;
    if (starts && command == FW_COMMAND_MOVE)
        assert_int_equal(now, FW_STATE_MOVING);
    else if (starts && command == FW_COMMAND_HOME)
        assert_int_equal(now, FW_STATE_HOMING);
    else if (table[command][state] == '=')
        assert_int_equal(now, FW_STATE_IDLE);
    else if ((command == FW_COMMAND_STOP || command == FW_COMMAND_HALT) &&
             (state == FW_STATE_MOVING || state == FW_STATE_HOMING))
        assert_int_equal(now, FW_STATE_STOPPING);
    else
        assert_int_equal(now, state); // refused, or done without a change of state
    if (state == FW_STATE_ALARM || state == FW_STATE_ESTOP)
        check_safe(m);
    if (command == FW_COMMAND_HALT && refusal == FW_REFUSAL_NONE)
        assert_false(m->armed);
}

static void one(unsigned command, unsigned state, unsigned limit, unsigned homed, bool door) {
    struct machine *m = rig_homed();
    machine_command(m, FW_COMMAND_SAVE, 0); // so that LOAD finds some
    bring_to(m, state);
    // In motion a contact ahead, or the door, would itself end that state; the interlock tests see to that.
    const bool moves = state == FW_STATE_MOVING || state == FW_STATE_STOPPING || state == FW_STATE_HOMING;
    if (!moves && limit != LIMIT_NONE)
        machine_hold(m, limit == LIMIT_AHEAD ? FW_CONTACT_limit_max_1 : FW_CONTACT_limit_min_1, true);
    if (!moves && door)
        machine_hold(m, FW_CONTACT_door, true);
    if (!moves)
        m->core.known = homed == HOMED_ALL ? 15 : homed == HOMED_OTHER ? 13 : 0;
    for (unsigned i = 0; i < FW_AXES; i++)
        m->core.registers.target[i] = m->core.step.position[i] + 500;
    const uint16_t axes = 2;
    m->core.registers.command_id[0] = 0;
    const enum fw_refusal refusal = machine_command(m, (enum fw_command)command, axes);
    const enum fw_refusal wanted = expected(command, state, limit, homed, door);
    if (refusal != wanted)
        fail_msg("command %u in state %u, limit %u, homed %u, door %d: refusal %d, not %d", command, state, limit,
                 homed, door, (int)refusal, (int)wanted);
    check_after(m, command, state, refusal);
    assert_true(m->wrong_edges == 0);
    free(m);
}

static void every_combination(void **state) {
    (void)state;
    unsigned n = 0;
    for (unsigned command = FW_COMMAND_MOVE; command <= FW_COMMAND_RESTART; command++)
        for (unsigned s = 0; s < STATES; s++)
            for (unsigned limit = LIMIT_NONE; limit < LIMITS; limit++)
                for (unsigned homed = HOMED_NONE; homed < HOMINGS_END; homed++)
                    for (unsigned door = 0; door < DOORS; door++, n++)
                        one(command, s, limit, homed, door != 0);
    assert_int_equal(n, 11 * STATES * LIMITS * HOMINGS * DOORS);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_combination)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
