// SPDX-License-Identifier: BSD-3-Clause
// Who holds the rig: what claims it, what feeds the dead-man, and what a second master can do meanwhile; over the
// serial line and over connections.
#include "tests/unit/fw_rig.h"

enum { LIMIT_MS = 200, OTHER = 7, MINE = 0x1234, BLOCK = FW_REGISTER_command + 1 - FW_REGISTER_command_id };

static uint8_t reply[FW_PDU_MAX];

// A PDU by a channel; its exception code, 0: it was carried out.
static unsigned say(struct machine *m, uint32_t channel, const uint8_t *pdu, size_t length) {
    const size_t n = gonio_fw_modbus_pdu(&m->core, channel, pdu, length, reply);
    return n == 2 && (reply[0] & 0x80) != 0 ? reply[1] : 0;
}
#define SAY(m, channel, ...) say(m, channel, (const uint8_t[]){__VA_ARGS__}, sizeof(const uint8_t[]){__VA_ARGS__})

// Function 16 from `address` on.
static unsigned put(struct machine *m, uint32_t channel, unsigned address, unsigned count, const uint16_t *words) {
    uint8_t pdu[FW_PDU_MAX] = {16, (uint8_t)(address >> 8), (uint8_t)address, 0, (uint8_t)count, (uint8_t)(2 * count)};
    for (unsigned i = 0; i < count; i++) {
        pdu[6 + 2 * i] = (uint8_t)(words[i] >> 8);
        pdu[7 + 2 * i] = (uint8_t)words[i];
    }
    return say(m, channel, pdu, 6 + 2 * count);
}

// A command block; number 0: as masters wrote it before there was one.
static unsigned order(struct machine *m, uint32_t channel, uint32_t number, enum fw_command command, int64_t target) {
    const uint32_t id = m->core.registers.accepted_id[0] + 1;
    uint16_t words[2 + BLOCK] = {
        (uint16_t)(number >> 16), (uint16_t)number, (uint16_t)(id >> 16), (uint16_t)id, 3, 1000};
    for (unsigned axis = 0; axis < 2; axis++)
        for (unsigned i = 0; i < 4; i++)
            words[6 + 4 * axis + i] = (uint16_t)((uint64_t)target >> 16 * (3 - i));
    words[1 + BLOCK] = (uint16_t)command;
    return number != 0 ? put(m, channel, FW_REGISTER_heartbeat, 2 + BLOCK, words)
                       : put(m, channel, FW_REGISTER_command_id, BLOCK, words + 2);
}

static unsigned beat(struct machine *m, uint32_t channel, uint32_t number) {
    return put(m, channel, FW_REGISTER_heartbeat, 2, (const uint16_t[]){(uint16_t)(number >> 16), (uint16_t)number});
}

// Under way for seconds, held by MINE (or by nobody's number) on the channel.
static struct machine *held(uint32_t channel, uint32_t number) {
    struct machine *m = rig_homed();
    m->core.registers.deadman[0] = LIMIT_MS;
    m->core.registers.speed_max[0] = m->core.registers.speed_max[1] = 3000;
    assert_int_equal(order(m, channel, number, FW_COMMAND_MOVE, 30000), 0);
    assert_int_equal(m->core.state, FW_STATE_MOVING);
    assert_true(m->core.owner.number == (number != 0 ? number : FW_OWNER_UNNAMED));
    return m;
}

// Whether the owner's move outlives a second in which only `speak` is said, every 50 ms.
static bool outlives(struct machine *m, uint32_t channel, const uint8_t *pdu, size_t length) {
    for (unsigned i = 0; i < 20; i++) {
        say(m, channel, pdu, length);
        gonio_machine_run(m, 50000);
    }
    const bool lives = m->core.state == FW_STATE_MOVING;
    assert_true(lives || (m->core.registers.alarm[0] == FW_ALARM_DEADMAN && m->core.owner.number == 0));
    return lives;
}

struct said {
    uint8_t pdu[20];
    size_t length;
};
// Every function that reads, the one that writes no more than a token, and what ends in an exception or in nothing.
static const struct said reads[] = {{{1, 0, 0, 0, 2}, 5},
                                    {{2, 0, 0, 0, 14}, 5},
                                    {{3, 0, 0x10, 0, 8}, 5},
                                    {{4, 0, 0x10, 0, 8}, 5},
                                    {{6, 0, 0x10, 0, 9}, 5},
                                    {{22, 0, 0x10, 0, 0xF2, 0, 0x25}, 7},
                                    {{23, 0, 0x10, 0, 8, 0, 0x10, 0, 1, 2, 5, 5}, 12},
                                    {{8, 0, 0, 1, 2}, 5},
                                    {{8, 0, 11, 0, 0}, 5},
                                    {{43, 14, 1, 0}, 4}};
static const struct said refused[] = {{{99}, 1},
                                      {{3, 0, 10, 0, 1}, 5},
                                      {{6, 0, 0x11, 0, 1}, 5},                     // read only
                                      {{6, 1, 3, 0, 0}, 5},                        // out of range
                                      {{16, 2, 8, 0, 2, 4, 0, 0, 0x30, 0x39}, 10}, // a parameter while it moves
                                      {{16, 0, 0xFE, 0, 2, 4, 0, 0, 0, 0}, 10},    // heartbeat of nobody
                                      {{16, 0, 0xFE, 0, 1, 2, 0, 0}, 8},           // half of one
                                      {{6, 1, 0x14, 0, 77}, 5},                    // no such command
                                      {{5, 0, 9, 0xFF, 0}, 5},                     // no such coil
                                      {{8, 0, 4, 0, 0}, 5}};                       // listen only, while it moves

static void only_good_writes_feed(void **state) {
    (void)state;
    for (uint32_t channel = 0; channel < 2; channel++)
        for (unsigned who = 0; who < 2; who++) // the owner's own channel, and another
            for (unsigned name = 0; name < 2; name++) {
                const uint32_t speaker = who == 0 ? channel : OTHER;
                for (unsigned i = 0; i < sizeof reads / sizeof *reads; i++) {
                    struct machine *m = held(channel, name != 0 ? MINE : 0);
                    assert_int_equal(say(m, speaker, reads[i].pdu, reads[i].length), 0);
                    assert_false(outlives(m, speaker, reads[i].pdu, reads[i].length));
                    free(m);
                }
                for (unsigned i = 0; i < sizeof refused / sizeof *refused; i++) {
                    struct machine *m = held(channel, name != 0 ? MINE : 0);
                    assert_int_not_equal(say(m, speaker, refused[i].pdu, refused[i].length), 0);
                    assert_false(outlives(m, speaker, refused[i].pdu, refused[i].length));
                    free(m);
                }
            }
}

static void what_the_owner_writes_feeds(void **state) {
    (void)state;
    static const uint8_t heartbeat[] = {16, 0, 0xFE, 0, 2, 4, 0, 0, MINE >> 8, MINE & 255};
    static const uint8_t level[] = {6, 1, 0x18, 0, 9};
    for (uint32_t channel = 0; channel < 2; channel++) {
        struct machine *m = held(channel, MINE);
        assert_true(outlives(m, channel, heartbeat, sizeof heartbeat));
        assert_true(outlives(m, OTHER, heartbeat, sizeof heartbeat)); // it has connected anew
        free(m);
        m = held(channel, MINE); // on a line that several share a bare write may be anybody's
        assert_false(outlives(m, channel, level, sizeof level));
        free(m);
        m = held(channel, 0);
        assert_true(outlives(m, channel, level, sizeof level));
        free(m);
        m = held(channel, 0);
        assert_false(outlives(m, OTHER, level, sizeof level));
        free(m);
        m = held(channel, 0); // one that takes a number keeps the rig
        assert_int_equal(beat(m, OTHER, MINE), FW_EXCEPTION_FAILURE);
        assert_int_equal(beat(m, channel, MINE), 0);
        assert_true(m->core.owner.number == MINE);
        free(m);
    }
}

// Everything a second master might write, at rest and under way: it is refused, and nothing has changed.
static void a_second_master_changes_nothing(void **state) {
    (void)state;
    static const struct said writes[] = {{{16, 2, 0x92, 0, 2, 4, 0, 0, 0, 0}, 10},          // deadman 0
                                         {{16, 2, 8, 0, 2, 4, 0, 0, 0x30, 0x39}, 10},       // a speed
                                         {{6, 2, 0x95, 0, 9}, 5},                           // safe_lamp
                                         {{22, 2, 0x95, 0, 0, 0, 9}, 7},                    // masked
                                         {{6, 1, 0x18, 0, 9}, 5},                           // lamp_level
                                         {{23, 0, 0x10, 0, 1, 1, 0x18, 0, 1, 2, 0, 9}, 12}, // and with a read
                                         {{5, 0, 0, 0xFF, 0}, 5},                           // the lamp
                                         {{15, 0, 0, 0, 2, 1, 3}, 7},
                                         {{16, 0, 0xFE, 0, 2, 4, 0, 0, 0, 77}, 10}}; // a claim
    for (uint32_t channel = 0; channel < 2; channel++)
        for (unsigned moving = 0; moving < 2; moving++)
            for (unsigned i = 0; i < sizeof writes / sizeof *writes; i++) {
                struct machine *m = held(channel, MINE);
                if (moving == 0) {
                    assert_int_equal(order(m, channel, MINE, FW_COMMAND_STOP, 0), 0);
                    m->core.registers.deadman[0] = 600000;
                    assert_true(gonio_machine_settle(m, MINUTE_US));
                }
                gonio_fw_core_refresh(&m->core);
                const struct fw_registers before = m->core.registers;
                const unsigned code = say(m, OTHER, writes[i].pdu, writes[i].length);
                assert_true(code == FW_EXCEPTION_FAILURE || (moving != 0 && code == FW_EXCEPTION_BUSY));
                assert_true(code == FW_EXCEPTION_BUSY || m->core.registers.refusal[0] == FW_REFUSAL_NOT_OWNER);
                m->core.registers.refusal[0] = before.refusal[0];
                assert_memory_equal(&m->core.registers, &before, sizeof before);
                assert_true(!m->core.lamp.on && !m->core.lamp.open && m->core.owner.number == MINE);
                free(m);
            }
}

static void a_second_master_moves_nothing_and_may_stop(void **state) {
    (void)state;
    for (uint32_t channel = 0; channel < 2; channel++)
        for (uint32_t speaker = channel; speaker <= OTHER; speaker += OTHER - channel)
            for (uint32_t number = 0; number < 100; number += 99)
                for (unsigned command = FW_COMMAND_MOVE; command <= FW_COMMAND_YIELD; command++) {
                    struct machine *m = held(channel, MINE);
                    const int64_t target = m->core.registers.target[0];
                    const uint32_t id = m->core.registers.accepted_id[0], heard = m->core.owner.heard;
                    gonio_machine_run(m, 20000);
                    const unsigned code = order(m, speaker, number, (enum fw_command)command, -500);
                    const bool stops = command == FW_COMMAND_STOP || command == FW_COMMAND_HALT;
                    assert_int_equal(code, stops ? 0 : FW_EXCEPTION_FAILURE);
                    assert_true(m->core.registers.target[0] == target && m->core.registers.accepted_id[0] == id);
                    assert_true(m->core.owner.number == MINE && m->core.owner.heard == heard);
                    assert_int_equal(m->core.state, stops ? FW_STATE_STOPPING : FW_STATE_MOVING);
                    free(m);
                }
}

static void it_is_let_go_of(void **state) {
    (void)state;
    for (uint32_t channel = 0; channel < 2; channel++) {
        struct machine *m = held(channel, MINE);
        assert_int_equal(order(m, channel, MINE, FW_COMMAND_YIELD, 0), FW_EXCEPTION_BUSY);
        order(m, channel, MINE, FW_COMMAND_HALT, 0);
        gonio_machine_run(m, 10000);
        m->core.known = 15;
        m->core.registers.lamp_rise[0] = 0;
        assert_int_equal(SAY(m, channel, 5, 0, 0, 0xFF, 0), 0); // the lamp
        assert_int_equal(order(m, channel, MINE, FW_COMMAND_YIELD, 0), 0);
        gonio_machine_run(m, 5000000); // silence: the lamp stays warm
        assert_true(m->core.owner.number == 0 && m->core.state == FW_STATE_IDLE && m->lamp == 10000);
        assert_int_equal(order(m, OTHER, 5, FW_COMMAND_MOVE, 900), 0);
        assert_true(m->core.owner.number == 5);
        free(m);
    }
}

// A lamp that burns is held as well; without a dead-man nobody keeps the rig for ever who is not heard of any more.
static void silence_ends_it(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    m->core.registers.deadman[0] = LIMIT_MS;
    assert_int_equal(SAY(m, 1, 5, 0, 0, 0xFF, 0), 0);
    gonio_machine_run(m, 300000);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_DEADMAN);
    assert_int_equal(beat(m, 2, 9), 0); // free again
    gonio_machine_run(m, 300000);
    assert_true(m->core.owner.number == 0); // also while the alarm stands
    free(m);
    m = held(1, MINE);
    m->core.registers.deadman[0] = 0;
    gonio_machine_run(m, 8000000);
    assert_int_equal(m->core.state, FW_STATE_MOVING);
    assert_true(m->core.owner.number == MINE); // as long as it moves
    assert_true(gonio_machine_settle(m, MINUTE_US));
    gonio_machine_run(m, 6000000);
    assert_true(m->core.owner.number == 0 && m->core.state == FW_STATE_IDLE);
    free(m);
}

static void connections_end(void **state) {
    (void)state;
    struct machine *m = held(1, 0);
    gonio_fw_modbus_hung_up(&m->core, 1);
    gonio_machine_run(m, 100000);
    assert_int_equal(order(m, 2, 0, FW_COMMAND_MOVE, 5),
                     FW_EXCEPTION_BUSY); // nobody's now: it is taken over by who may
    gonio_machine_run(m, 150000);
    assert_int_equal(m->core.registers.alarm[0], FW_ALARM_DEADMAN); // and whoever does not is no host
    free(m);
    m = held(1, MINE);
    gonio_fw_modbus_hung_up(&m->core, 1);
    assert_int_equal(order(m, 2, 0, FW_COMMAND_CLEAR, 0), FW_EXCEPTION_FAILURE); // it may come back
    assert_int_equal(order(m, 2, MINE, FW_COMMAND_STOP, 0), 0);
    free(m);
}

// Deaf to STOP as well: not while something moves, not longer than its connection, not on others.
static void listen_only_ends(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    assert_int_equal(gonio_fw_modbus_pdu(&m->core, 1, (const uint8_t[]){8, 0, 4, 0, 0}, 5, reply), 0);
    assert_int_equal(gonio_fw_modbus_pdu(&m->core, 1, reads[2].pdu, 5, reply), 0);
    assert_true(gonio_fw_modbus_pdu(&m->core, 2, reads[2].pdu, 5, reply) > 2);
    gonio_fw_modbus_hung_up(&m->core, 2);
    assert_int_equal(gonio_fw_modbus_pdu(&m->core, 1, reads[2].pdu, 5, reply), 0);
    gonio_fw_modbus_hung_up(&m->core, 1);
    assert_true(gonio_fw_modbus_pdu(&m->core, 1, reads[2].pdu, 5, reply) > 2);
    assert_int_equal(gonio_fw_modbus_pdu(&m->core, 1, (const uint8_t[]){8, 0, 4, 0, 0}, 5, reply), 0);
    assert_int_equal(order(m, 2, MINE, FW_COMMAND_MOVE, 20000), 0);
    gonio_machine_run(m, 5000);
    assert_int_equal(order(m, 1, 0, FW_COMMAND_STOP, 0), 0);
    assert_int_equal(m->core.state, FW_STATE_STOPPING);
    assert_int_equal(SAY(m, 1, 8, 0, 4, 0, 0), FW_EXCEPTION_BUSY);
    free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_good_writes_feed),
        cmocka_unit_test(what_the_owner_writes_feeds),
        cmocka_unit_test(a_second_master_changes_nothing),
        cmocka_unit_test(a_second_master_moves_nothing_and_may_stop),
        cmocka_unit_test(it_is_let_go_of),
        cmocka_unit_test(silence_ends_it),
        cmocka_unit_test(connections_end),
        cmocka_unit_test(listen_only_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
