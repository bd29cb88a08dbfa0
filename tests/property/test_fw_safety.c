// SPDX-License-Identifier: BSD-3-Clause
// What must happen, whatever comes together: every command in every state, by the master that holds the rig, by another
// one and where nobody holds it, with every kind of limit contact, homing, door and lamp, and of a move's take-up of
// backlash; at the very moment a contact changes and after the main loop has seen it; at rest and under way. The tables
// are written here once more, independently of the firmware.
#include <stdio.h>

#include "tests/unit/fw_rig.h"

enum { LIMIT_NONE, LIMIT_AHEAD, LIMIT_BEHIND, LIMITS };
enum { HOMED_NONE, HOMED_OTHER, HOMED_ALL, HOMINGS };
enum { STATES = FW_STATE_ESTOP + 1, SLOWING = STATES, COLUMNS, COMMANDS = FW_COMMAND_YIELD };
enum { OWNER_NOBODY, OWNER_US, OWNER_OTHER, OWNERS };
enum { TAKE_UP_NONE, TAKE_UP_INSIDE, TAKE_UP_OUTSIDE, TAKE_UPS };
enum { OUR_NUMBER = 5, OTHER_NUMBER = 9 };

struct row {
    unsigned command, state, limit, homed, owner, take_up;
    bool door, lamp, later; // later: the main loop has seen the contacts before the command comes
};

// Columns: IDLE, MOVING, STOPPING, HOMING, ALARM, ESTOP, and ALARM while the axes still slow down. '+' done, 'B' busy,
// 'A' alarmed, 'E' emergency stop stands, 'm' as a move: also needs homing, a free limit and a closed door; 'd' also
// needs a closed door; 's' done with the lamp off; '=' done, and clears, once the cause is gone.
static const char *const table[COMMANDS + 1] = {
    [FW_COMMAND_MOVE] = "mBBBAEA",    [FW_COMMAND_HOME] = "dBBBAEA",    [FW_COMMAND_STOP] = "+++++++",
    [FW_COMMAND_HALT] = "+++++++",    [FW_COMMAND_CLEAR] = "+BBB==B",   [FW_COMMAND_TRIGGER] = "dBBBAEA",
    [FW_COMMAND_SAVE] = "sBBBssB",    [FW_COMMAND_LOAD] = "+BBB++B",    [FW_COMMAND_DEFAULTS] = "+BBB++B",
    [FW_COMMAND_RELEASE] = "+BBB++B", [FW_COMMAND_RESTART] = "+BBB++B", [FW_COMMAND_YIELD] = "+BBB++B",
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

static bool stops(const struct row *r) { return r->command == FW_COMMAND_STOP || r->command == FW_COMMAND_HALT; }

static enum fw_refusal expected(const struct row *r) {
    if (r->owner == OWNER_OTHER && !stops(r))
        return FW_REFUSAL_NOT_OWNER;
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
        if (r->take_up == TAKE_UP_OUTSIDE)
            return FW_REFUSAL_SOFT_LIMIT;
        return r->limit == LIMIT_AHEAD ? FW_REFUSAL_HARD_LIMIT : FW_REFUSAL_NONE;
    case 's':
        return r->lamp && column(r) == FW_STATE_IDLE ? FW_REFUSAL_NOT_SAFE : FW_REFUSAL_NONE;
    default:
        return FW_REFUSAL_NONE;
    }
}

// The take-up comes back onto the contact that was behind the axis, which is held here.
static bool takes_up_onto_contact(const struct row *r, enum fw_refusal refusal) {
    return r->command == FW_COMMAND_MOVE && refusal == FW_REFUSAL_NONE && r->take_up != TAKE_UP_NONE &&
           r->limit == LIMIT_BEHIND;
}

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
    if (takes_up_onto_contact(r, refusal))
        return FW_ALARM_LIMIT_MIN;
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
    if (takes_up_onto_contact(r, refusal) || (r->command == FW_COMMAND_RELEASE && refusal == FW_REFUSAL_NONE))
        known &= 13u;
    if (r->command == FW_COMMAND_DEFAULTS && refusal == FW_REFUSAL_NONE)
        known = 0; // the switches are elsewhere in them
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

// The command as a master writes it, without a number where nobody holds the rig; why it was refused.
static enum fw_refusal order(struct machine *m, const struct row *r) {
    enum {
        BARE = FW_REGISTER_command_id - FW_REGISTER_heartbeat,
        BLOCK = FW_REGISTER_command + 1 - FW_REGISTER_heartbeat
    };
    const uint32_t id = m->core.registers.accepted_id[0] + 1;
    uint16_t words[BLOCK] = {0, OUR_NUMBER, (uint16_t)(id >> 16), (uint16_t)id, 2, 1000};
    for (unsigned i = 0; i < 4; i++) // axis 1
        words[BARE + 4 + 4 + i] = (uint16_t)((uint64_t)(m->axis[1].steps + 500) >> 16 * (3 - i));
    words[BLOCK - 1] = (uint16_t)r->command;
    if (r->owner == OWNER_NOBODY)
        gonio_fw_registers_write(&m->core, FW_REGISTER_command_id, BLOCK - BARE, words + BARE);
    else
        gonio_fw_registers_write(&m->core, FW_REGISTER_heartbeat, BLOCK, words);
    gonio_machine_run(m, 0);
    return (enum fw_refusal)m->core.registers.refusal[0];
}

static void check_owner(const struct machine *m, const struct row *r, enum fw_refusal refusal) {
    const uint32_t number = m->core.owner.number;
    const bool done = refusal == FW_REFUSAL_NONE, claims = done && !stops(r) && r->command != FW_COMMAND_YIELD;
    if (r->owner == OWNER_OTHER)
        assert_int_equal(number, OTHER_NUMBER);
    else if (r->owner == OWNER_US)
        assert_int_equal(number, done && r->command == FW_COMMAND_YIELD ? 0 : OUR_NUMBER);
    else
        assert_true(number == (claims ? FW_OWNER_UNNAMED : 0));
}

// Axis 1 goes up, and with this comes back down the last steps to its target.
static void set_take_up(struct machine *m, const struct row *r) {
    const int64_t past = m->axis[1].steps + 500 + 100;
    m->core.registers.backlash[1] = r->take_up != TAKE_UP_NONE ? -100 : 0;
    m->core.registers.soft_max[1] = r->take_up == TAKE_UP_OUTSIDE ? past - 1 : past;
}

static int64_t highest;
static void watch(void *context, uint64_t now_us, uint8_t edges, uint8_t directions) {
    const struct machine *m = context;
    (void)now_us, (void)edges, (void)directions;
    highest = m->axis[1].steps > highest ? m->axis[1].steps : highest;
}

static void check_row(const struct row *r) {
    struct machine *m = rig_homed();
    for (unsigned i = 0; i < FW_AXES; i++)
        m->core.registers.home_position[i] = m->axis[i].home_at;
    m->core.registers.deadman[0] = 0;
    gonio_fw_core_parameters_changed(&m->core);
    m->core.known = 15;
    gonio_machine_command(m, FW_COMMAND_SAVE, 0); // so that LOAD finds some
    bring_to(m, r);
    m->core.known = known_of(r);
    close_contacts(m, r);
    const int64_t before = m->axis[1].steps;
    if (r->owner != OWNER_NOBODY)
        m->core.owner =
            (struct fw_owner){r->owner == OWNER_US ? OUR_NUMBER : OTHER_NUMBER, FW_CHANNEL_LINE, m->core.ms};
    if (r->command == FW_COMMAND_MOVE)
        set_take_up(m, r);
    const int64_t most = m->core.registers.soft_max[1];
    highest = before;
    m->context = m;
    m->on_edges = r->command == FW_COMMAND_MOVE ? watch : NULL;
    const enum fw_refusal refusal = order(m, r);
    assert_int_equal(refusal, expected(r));
    check_owner(m, r, refusal);
    if (r->command == FW_COMMAND_HALT)
        assert_true(!m->armed && m->pins == 0);
    if (r->command == FW_COMMAND_RESTART && refusal == FW_REFUSAL_NONE)
        assert_true(m->restart && m->motors == 0 && m->lamp == 0 && !m->shutter);
    else
        check_at_rest(m, r, refusal);
    if (r->command == FW_COMMAND_MOVE && !moves(r)) // no further than the limit, and where it takes up as far as that
        assert_true(refusal != FW_REFUSAL_NONE
                        ? highest == before
                        : highest == before + (r->take_up != TAKE_UP_NONE ? 600 : 500) && highest <= most);
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
    for (unsigned n = 0; n < STATES * LIMITS * HOMINGS * 8 * OWNERS * TAKE_UPS; n++) {
        row = (struct row){.command = command,
                           .take_up = n / 8 / HOMINGS / LIMITS / STATES / OWNERS,
                           .owner = n / 8 / HOMINGS / LIMITS / STATES % OWNERS,
                           .state = n / 8 / HOMINGS / LIMITS % STATES,
                           .limit = n / 8 / HOMINGS % LIMITS,
                           .homed = n / 8 % HOMINGS,
                           .door = (n & 1) != 0,
                           .lamp = (n & 2) != 0,
                           .later = (n & 4) != 0};
        // Who asks is one thing, what is homed another; only a move takes up.
        if ((row.owner != OWNER_NOBODY && row.homed != HOMED_ALL) ||
            (row.take_up != TAKE_UP_NONE && (command != FW_COMMAND_MOVE || row.owner != OWNER_NOBODY)))
            continue;
        rows++;
        check_row(&row);
    }
}

static int tell_last_row(void **state) {
    (void)state;
    print_message(
        "# last row: command %u, state %u, limit %u, homed %u, owner %u, take-up %u, door %d, lamp %d, later %d\n",
        row.command, row.state, row.limit, row.homed, row.owner, row.take_up, row.door, row.lamp, row.later);
    return 0;
}

static void all_of_them(void **state) {
    (void)state;
    print_message("# %u rows\n", rows);
    assert_int_equal(rows, STATES * LIMITS * 8 * (COMMANDS * (HOMINGS + OWNERS - 1) + (TAKE_UPS - 1) * HOMINGS));
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
