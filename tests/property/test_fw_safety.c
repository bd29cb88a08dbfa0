// SPDX-License-Identifier: BSD-3-Clause
// What must happen, whatever comes together: every command in every state, with every kind of limit contact, homing,
// door and lamp, at the very moment a contact changes and after the main loop has seen it; at rest and under way. The
// tables are written here once more, independently of the firmware.
#include <stdio.h>

#include "tests/unit/fw_rig.h"

enum { LIMIT_NONE, LIMIT_AHEAD, LIMIT_BEHIND, LIMITS };
enum { HOMED_NONE, HOMED_OTHER, HOMED_ALL, HOMINGS };
enum { STATES = FW_STATE_ESTOP + 1, SLOWING = STATES, COLUMNS, COMMANDS = FW_COMMAND_RESTART };

struct row {
    unsigned command, state, limit, homed;
    bool door, lamp, later; // later: the main loop has seen the contacts before the command comes
};

// Columns: IDLE, MOVING, STOPPING, HOMING, ALARM, ESTOP, and ALARM while the axes still slow down. '+' done, 'B' busy,
// 'A' alarmed, 'E' emergency stop stands, 'm' as a move: also needs homing, a free limit and a closed door; 'd' also
// needs a closed door; '=' done, and clears, once the cause is gone.
static const char *const table[COMMANDS + 1] = {
    [FW_COMMAND_MOVE] = "mBBBAEA",    [FW_COMMAND_HOME] = "dBBBAEA",    [FW_COMMAND_STOP] = "+++++++",
    [FW_COMMAND_HALT] = "+++++++",    [FW_COMMAND_CLEAR] = "+BBB==B",   [FW_COMMAND_TRIGGER] = "dBBBAEA",
    [FW_COMMAND_SAVE] = "+BBB++B",    [FW_COMMAND_LOAD] = "+BBB++B",    [FW_COMMAND_DEFAULTS] = "+BBB++B",
    [FW_COMMAND_RELEASE] = "+BBB++B", [FW_COMMAND_RESTART] = "+BBB++B",
};

static bool moves(const struct row *r) {
    return r->state == FW_STATE_MOVING || r->state == FW_STATE_STOPPING || r->state == FW_STATE_HOMING;
}

static bool alarmed(const struct row *r) { return r->state == FW_STATE_ALARM || r->state == FW_STATE_ESTOP; }

// A contact in the direction of motion halts all axes in the interrupt.
static bool hits(const struct row *r) { return moves(r) && r->limit == LIMIT_AHEAD; }

// An open door is an alarm where somebody could be hurt: motion or light.
static bool door_trips(const struct row *r) { return r->door && !alarmed(r) && (moves(r) || r->lamp); }

// The column of the table that the command meets.
static unsigned column(const struct row *r) {
    if (!r->later)
        return r->state;
    if (hits(r))
        return FW_STATE_ALARM;
    if (door_trips(r))
        return moves(r) ? SLOWING : FW_STATE_ALARM;
    return r->state;
}

static enum fw_refusal expected(const struct row *r) {
    const bool door_alarm = r->later && door_trips(r) && !hits(r);
    switch (table[r->command][column(r)]) {
    case 'B':
        return FW_REFUSAL_BUSY;
    case 'A':
        return FW_REFUSAL_ALARMED;
    case 'E':
        return FW_REFUSAL_STOPPED;
    case '=':
        return door_alarm ? FW_REFUSAL_ACTIVE : FW_REFUSAL_NONE;
    case 'd':
        return r->door ? FW_REFUSAL_ACTIVE : FW_REFUSAL_NONE;
    case 'm':
        if (r->door)
            return FW_REFUSAL_ACTIVE;
        if (r->homed != HOMED_ALL)
            return FW_REFUSAL_NOT_HOMED;
        return r->limit == LIMIT_AHEAD ? FW_REFUSAL_HARD_LIMIT : FW_REFUSAL_NONE;
    default:
        return FW_REFUSAL_NONE;
    }
}

static bool stops(const struct row *r) { return r->command == FW_COMMAND_STOP || r->command == FW_COMMAND_HALT; }

// The alarm that stands when all has come to rest; NONE: state IDLE.
static unsigned alarm_at_rest(const struct row *r, enum fw_refusal refusal) {
    const bool cleared = r->command == FW_COMMAND_CLEAR && refusal == FW_REFUSAL_NONE;
    if (r->state == FW_STATE_ESTOP)
        return cleared ? FW_ALARM_NONE : FW_ALARM_EMERGENCY;
    if (r->state == FW_STATE_ALARM)
        return cleared ? FW_ALARM_NONE : FW_ALARM_DEADMAN;
    if (hits(r)) {
        if (cleared && r->later) // and the light is off by then
            return FW_ALARM_NONE;
        return r->state == FW_STATE_HOMING ? FW_ALARM_LIMIT_MIN : FW_ALARM_LIMIT_MAX;
    }
    if (door_trips(r))
        return FW_ALARM_DOOR;
    // Homing turns round at its switch, and then meets the contact that was behind it.
    if (r->state == FW_STATE_HOMING && r->limit == LIMIT_BEHIND && !stops(r))
        return FW_ALARM_LIMIT_MAX;
    // HOME goes down first, then up: it meets either contact.
    if (r->command == FW_COMMAND_HOME && refusal == FW_REFUSAL_NONE && r->limit != LIMIT_NONE)
        return r->limit == LIMIT_AHEAD ? FW_ALARM_LIMIT_MAX : FW_ALARM_LIMIT_MIN;
    return FW_ALARM_NONE;
}

static uint16_t known_of(const struct row *r) { return r->homed == HOMED_ALL ? 15 : r->homed == HOMED_OTHER ? 13 : 0; }

// Axes whose position is known in the end; only where no homing ends meanwhile.
static uint16_t known_at_rest(const struct row *r, enum fw_refusal refusal) {
    unsigned known = known_of(r);
    // Those that were under way, when all was halted, may have slipped.
    if (hits(r) || (moves(r) && r->command == FW_COMMAND_HALT))
        known &= r->state == FW_STATE_HOMING ? 14u : 0u;
    if (r->command == FW_COMMAND_RELEASE && refusal == FW_REFUSAL_NONE)
        known &= 13u;
    return (uint16_t)known;
}

static void bring_to(struct machine *m, const struct row *r) {
    const int64_t far[FW_AXES] = {12000, 12000, 12000, 12000};
    m->core.registers.lamp_rise[0] = 0;
    if (r->lamp && !alarmed(r))
        assert_true(gonio_fw_lamp_switch(&m->core, true) && gonio_fw_lamp_shutter(&m->core, true));
    if (r->state == FW_STATE_MOVING || r->state == FW_STATE_STOPPING)
        assert_int_equal(gonio_machine_move(m, 15, far), FW_REFUSAL_NONE);
    if (r->state == FW_STATE_HOMING)
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_HOME, 15), FW_REFUSAL_NONE);
    gonio_machine_run(m, 200000);
    if (r->state == FW_STATE_STOPPING) {
        gonio_machine_command(m, FW_COMMAND_STOP, 0);
        gonio_machine_run(m, 5000);
    }
    if (r->state == FW_STATE_ALARM)
        gonio_fw_interlock_alarm(&m->core, FW_ALARM_DEADMAN, FW_NO_AXIS, false);
    if (r->state == FW_STATE_ESTOP) {
        gonio_machine_hold(m, FW_CONTACT_estop, true);
        gonio_machine_run(m, 2000);
        gonio_machine_hold(m, FW_CONTACT_estop, false);
        gonio_machine_run(m, 2000);
    }
    assert_int_equal(m->core.state, r->state);
    assert_true(m->core.axis.under_way == moves(r));
}

// Under way all axes go up, but homing, which has axis 0 go down; at rest the command will have axis 1 go up.
static void close_contacts(struct machine *m, const struct row *r) {
    const bool down = r->state == FW_STATE_HOMING;
    if (r->limit == LIMIT_AHEAD)
        gonio_machine_hold(m, down ? FW_CONTACT_limit_min_0 : FW_CONTACT_limit_max_1, true);
    if (r->limit == LIMIT_BEHIND)
        gonio_machine_hold(m, down ? FW_CONTACT_limit_max_0 : FW_CONTACT_limit_min_1, true);
    if (r->door)
        gonio_machine_hold(m, FW_CONTACT_door, true);
    if (hits(r)) // in the interrupt, before anything else
        assert_true(!m->armed && m->pins == 0);
    if (r->later)
        gonio_machine_run(m, 2000);
}

static void check_at_rest(struct machine *m, const struct row *r, enum fw_refusal refusal) {
    assert_true(gonio_machine_settle(m, MINUTE_US));
    gonio_machine_run(m, 2000);
    const unsigned alarm = alarm_at_rest(r, refusal);
    assert_int_equal(m->core.registers.alarm[0], alarm);
    assert_int_equal(m->core.state, alarm == FW_ALARM_NONE        ? FW_STATE_IDLE
                                    : alarm == FW_ALARM_EMERGENCY ? FW_STATE_ESTOP
                                                                  : FW_STATE_ALARM);
    assert_true(!m->core.axis.under_way && !m->armed && m->pins == 0);
    if (alarm != FW_ALARM_NONE)
        assert_true(m->lamp == 0 && !m->shutter);
    const bool homing = r->state == FW_STATE_HOMING || (r->command == FW_COMMAND_HOME && refusal == FW_REFUSAL_NONE);
    if (!homing || hits(r))
        assert_int_equal(m->core.known, known_at_rest(r, refusal));
}

static void check_row(const struct row *r) {
    struct machine *m = rig_homed();
    for (unsigned i = 0; i < FW_AXES; i++)
        m->core.registers.home_position[i] = m->axis[i].home_at;
    gonio_machine_command(m, FW_COMMAND_SAVE, 0); // so that LOAD finds some
    bring_to(m, r);
    m->core.known = known_of(r);
    close_contacts(m, r);
    const int64_t before = m->axis[1].steps;
    for (unsigned i = 0; i < FW_AXES; i++)
        m->core.registers.target[i] = m->axis[i].steps + 500;
    const enum fw_refusal refusal = gonio_machine_command(m, (enum fw_command)r->command, 2);
    assert_int_equal(refusal, expected(r));
    if (r->command == FW_COMMAND_HALT)
        assert_true(!m->armed && m->pins == 0);
    if (r->command == FW_COMMAND_RESTART && refusal == FW_REFUSAL_NONE)
        assert_true(m->restart && m->motors == 0 && m->lamp == 0 && !m->shutter);
    else
        check_at_rest(m, r, refusal);
    if (!moves(r) && (refusal != FW_REFUSAL_NONE || (r->command != FW_COMMAND_MOVE && r->command != FW_COMMAND_HOME)))
        assert_true(m->axis[1].steps == before); // what is refused, or is no motion, moves nothing
    assert_true(m->wrong_edges == 0);
    if (m->core.known == 15)
        rig_check_positions(m);
    free(m);
}

// One test a command; each tells its last row, which is the one that failed where one did.
static struct row row;
static unsigned rows;

static void every_combination(void **state) {
    const unsigned command = *(const unsigned *)*state;
    for (unsigned n = 0; n < STATES * LIMITS * HOMINGS * 8; n++, rows++) {
        row = (struct row){.command = command,
                           .state = n / 8 / HOMINGS / LIMITS,
                           .limit = n / 8 / HOMINGS % LIMITS,
                           .homed = n / 8 % HOMINGS,
                           .door = (n & 1) != 0,
                           .lamp = (n & 2) != 0,
                           .later = (n & 4) != 0};
        check_row(&row);
    }
}

static int tell_last_row(void **state) {
    (void)state;
    print_message("# last row: command %u, state %u, limit %u, homed %u, door %d, lamp %d, later %d\n", row.command,
                  row.state, row.limit, row.homed, row.door, row.lamp, row.later);
    return 0;
}

static void all_of_them(void **state) {
    (void)state;
    print_message("# %u rows\n", rows);
    assert_int_equal(rows, COMMANDS * STATES * LIMITS * HOMINGS * 8);
}

int main(void) {
    static unsigned commands[COMMANDS];
    static char names[COMMANDS][32];
    struct CMUnitTest tests[COMMANDS + 1] = {[COMMANDS] = cmocka_unit_test(all_of_them)};
    for (unsigned i = 0; i < COMMANDS; i++) {
        commands[i] = i + 1;
        snprintf(names[i], sizeof names[i], "command_%u", i + 1);
        tests[i] = (struct CMUnitTest){names[i], every_combination, NULL, tell_last_row, &commands[i]};
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
