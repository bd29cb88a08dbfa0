// SPDX-License-Identifier: BSD-3-Clause
// The slave, byte by byte: framing, every function code's good and bad requests, atomic writes, ids and tokens.
#include "tests/unit/fw_rig.h"

// Send a PDU as a frame; the reply's PDU lies in m->sent + 1, its length is returned (0: none).
static unsigned ask(struct machine *m, uint8_t unit, const uint8_t *pdu, unsigned length) {
    uint8_t frame[300];
    frame[0] = unit;
    memcpy(frame + 1, pdu, length);
    const uint16_t crc = gonio_fw_modbus_crc(frame, length + 1);
    frame[length + 1] = (uint8_t)crc;
    frame[length + 2] = (uint8_t)(crc >> 8);
    gonio_machine_receive(m, frame, length + 3);
    if (m->sent_length == 0)
        return 0;
    assert_true(m->sent_length >= 4 && m->sent[0] == unit);
    const uint16_t got = gonio_fw_modbus_crc(m->sent, m->sent_length - 2);
    assert_true(m->sent[m->sent_length - 2] == (got & 255) && m->sent[m->sent_length - 1] == got >> 8);
    assert_false(m->driving);
    return m->sent_length - 3;
}

#define ASK(m, ...) ask(m, 1, (const uint8_t[]){__VA_ARGS__}, sizeof(const uint8_t[]){__VA_ARGS__})
#define EXPECT(m, ...)                                                                                                 \
    do {                                                                                                               \
        const uint8_t wanted_[] = {__VA_ARGS__};                                                                       \
        assert_int_equal(m->sent_length - 3, sizeof wanted_);                                                          \
        assert_memory_equal(m->sent + 1, wanted_, sizeof wanted_);                                                     \
    } while (0)

static void crc_is_the_specified_one(void **state) {
    (void)state;
    // The polynomial's well-known check value: "123456789" gives 0x4B37.
    assert_int_equal(gonio_fw_modbus_crc((const uint8_t *)"123456789", 9), 0x4B37);
}

static void reads(void **state) {
    (void)state;
    struct machine *m = rig_new();
    ASK(m, 3, 0, 0, 0, 2);
    EXPECT(m, 3, 4, 'G', 'O', 0, 2);
    ASK(m, 4, 0, 6, 0, 2);
    EXPECT(m, 4, 4, 0, 0x0F, 0x42, 0x40);
    ASK(m, 3, 0, 6, 0, 1); // half a value
    EXPECT(m, 0x83, 2);
    ASK(m, 3, 0, 7, 0, 1);
    EXPECT(m, 0x83, 2);
    ASK(m, 3, 0, 10, 0, 1); // a gap
    EXPECT(m, 0x83, 2);
    ASK(m, 3, 0, 9, 0, 3);
    EXPECT(m, 0x83, 2);
    ASK(m, 3, 0, 0, 0, 0);
    EXPECT(m, 0x83, 3);
    ASK(m, 3, 0, 0, 0, 126);
    EXPECT(m, 0x83, 3);
    ASK(m, 3, 0xFF, 0xFF, 0, 2);
    EXPECT(m, 0x83, 2);
    ASK(m, 3, 0, 0, 0);
    EXPECT(m, 0x83, 3);
    m->core.step.position[1] = -2;
    ASK(m, 3, 0, 0x20, 0, 4);
    EXPECT(m, 3, 8, 255, 255, 255, 255, 255, 255, 255, 254);
    free(m);
}

static void writes(void **state) {
    (void)state;
    struct machine *m = rig_new();
    ASK(m, 6, 0, 0x10, 0x12, 0x34);
    EXPECT(m, 6, 0, 0x10, 0x12, 0x34);
    assert_int_equal(m->core.registers.token[0], 0x1234);
    ASK(m, 6, 0, 0x11, 0, 1); // read only
    EXPECT(m, 0x86, 2);
    ASK(m, 6, 1, 3, 0, 0); // command_speed 0
    EXPECT(m, 0x86, 3);
    ASK(m, 6, 2, 8, 0, 1); // half a value
    EXPECT(m, 0x86, 2);
    ASK(m, 16, 2, 8, 0, 2, 4, 0, 0, 0x30, 0x39);
    EXPECT(m, 16, 2, 8, 0, 2);
    assert_int_equal(m->core.registers.speed_max[0], 12345);
    ASK(m, 16, 2, 8, 0, 4, 8, 0, 0, 0, 7, 0, 1, 0, 0); // second value out of range: the first is not taken either
    EXPECT(m, 0x90, 3);
    assert_int_equal(m->core.registers.speed_max[0], 12345);
    ASK(m, 16, 2, 8, 0, 2, 3, 0, 0, 0);
    EXPECT(m, 0x90, 3);
    ASK(m, 16, 2, 8, 0, 124, 248);
    EXPECT(m, 0x90, 3);
    ASK(m, 16, 2);
    EXPECT(m, 0x90, 3);
    ASK(m, 6, 2);
    EXPECT(m, 0x86, 3);
    ASK(m, 16, 2, 0x40, 0, 2, 4, 255, 255, 255, 251); // backlash_0 = -5
    assert_int_equal(m->core.registers.backlash[0], -5);
    free(m);
}

static void masks(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.token[0] = 0x12; // the specification's example
    ASK(m, 22, 0, 0x10, 0, 0xF2, 0, 0x25);
    EXPECT(m, 22, 0, 0x10, 0, 0xF2, 0, 0x25);
    assert_int_equal(m->core.registers.token[0], 0x17);
    ASK(m, 22, 0, 0x11, 0, 0xF2, 0, 0x25);
    EXPECT(m, 0x96, 2);
    ASK(m, 22, 0, 10, 0, 0, 0, 0);
    EXPECT(m, 0x96, 2);
    ASK(m, 22, 0, 0x10);
    EXPECT(m, 0x96, 3);
    free(m);
}

static void reads_and_writes_with_a_token(void **state) {
    (void)state;
    struct machine *m = rig_new();
    ASK(m, 23, 0, 0x10, 0, 2, 0, 0x10, 0, 1, 2, 0xAB, 0xCD);
    EXPECT(m, 23, 4, 0xAB, 0xCD, 0, 0);
    ASK(m, 23, 0, 10, 0, 1, 0, 0x10, 0, 1, 2, 1, 2); // a bad read: nothing is written
    EXPECT(m, 0x97, 2);
    assert_int_equal(m->core.registers.token[0], 0xABCD);
    ASK(m, 23, 0, 0x10, 0, 1, 0, 0x11, 0, 1, 2, 1, 2);
    EXPECT(m, 0x97, 2);
    ASK(m, 23, 0, 0x10, 0, 126, 0, 0x10, 0, 1, 2, 1, 2);
    EXPECT(m, 0x97, 3);
    ASK(m, 23, 0, 0x10, 0, 1, 0, 0x10, 0, 1, 4, 1, 2);
    EXPECT(m, 0x97, 3);
    ASK(m, 23, 0);
    EXPECT(m, 0x97, 3);
    free(m);
}

static void bits(void **state) {
    (void)state;
    struct machine *m = rig_new();
    ASK(m, 5, 0, 1, 0xFF, 0);
    EXPECT(m, 5, 0, 1, 0xFF, 0);
    assert_true(m->shutter);
    ASK(m, 1, 0, 0, 0, 2);
    EXPECT(m, 1, 1, 2);
    ASK(m, 15, 0, 0, 0, 2, 1, 1);
    EXPECT(m, 15, 0, 0, 0, 2);
    assert_true(!m->shutter && m->core.lamp.on);
    ASK(m, 5, 0, 0, 0, 1); // neither on nor off
    EXPECT(m, 0x85, 3);
    ASK(m, 5, 0, 2, 0xFF, 0);
    EXPECT(m, 0x85, 2);
    ASK(m, 5, 0);
    EXPECT(m, 0x85, 3);
    ASK(m, 1, 0, 0, 0, 3);
    EXPECT(m, 0x81, 2);
    ASK(m, 1, 0, 0, 0, 0);
    EXPECT(m, 0x81, 3);
    ASK(m, 1, 0, 0);
    EXPECT(m, 0x81, 3);
    ASK(m, 15, 0, 1, 0, 2, 1, 1);
    EXPECT(m, 0x8F, 2);
    ASK(m, 15, 0, 0, 0, 2, 2, 1, 1);
    EXPECT(m, 0x8F, 3);
    ASK(m, 15, 0, 0);
    EXPECT(m, 0x8F, 3);
    gonio_machine_hold(m, FW_CONTACT_door, true);
    gonio_machine_hold(m, FW_CONTACT_home_2, true);
    ASK(m, 2, 0, 0, 0, 14);
    EXPECT(m, 2, 2, 4, 0x20);
    ASK(m, 2, 0, 13, 0, 1);
    EXPECT(m, 2, 1, 1);
    ASK(m, 2, 0, 13, 0, 2);
    EXPECT(m, 0x82, 2);
    gonio_machine_run(m, 5000); // the door, with the lamp on: alarm
    ASK(m, 5, 0, 1, 0xFF, 0);
    EXPECT(m, 0x85, 4);
    assert_int_equal(m->core.registers.refusal[0], FW_REFUSAL_ALARMED);
    ASK(m, 5, 0, 1, 0, 0); // off is always possible
    EXPECT(m, 5, 0, 1, 0, 0);
    free(m);
}

static void diagnoses(void **state) {
    (void)state;
    struct machine *m = rig_new();
    ASK(m, 8, 0, 0, 0xA5, 0x37);
    EXPECT(m, 8, 0, 0, 0xA5, 0x37);
    ASK(m, 99);
    EXPECT(m, 0xE3, 1);
    gonio_machine_receive(m, (const uint8_t[]){1, 3, 0, 0, 0, 1, 0, 0}, 8); // wrong CRC
    assert_int_equal(m->sent_length, 0);
    ask(m, 7, (const uint8_t[]){3, 0, 0, 0, 1}, 5); // somebody else's
    ask(m, 0, (const uint8_t[]){6, 0, 0x10, 0, 9}, 5);
    assert_int_equal(m->core.registers.token[0], 9); // broadcast: done, not answered
    ASK(m, 8, 0, 11, 0, 0);
    EXPECT(m, 8, 0, 11, 0, 5);
    ASK(m, 8, 0, 12, 0, 0);
    EXPECT(m, 8, 0, 12, 0, 1);
    ASK(m, 8, 0, 13, 0, 0);
    EXPECT(m, 8, 0, 13, 0, 1);
    ASK(m, 8, 0, 14, 0, 0);
    EXPECT(m, 8, 0, 14, 0, 7);
    ASK(m, 8, 0, 15, 0, 0);
    EXPECT(m, 8, 0, 15, 0, 1);
    for (uint8_t sub = 16; sub <= 18; sub++) {
        ASK(m, 8, 0, sub, 0, 0);
        EXPECT(m, 8, 0, sub, 0, 0);
    }
    ASK(m, 8, 0, 2, 0, 0);
    EXPECT(m, 8, 0, 2, 0, 0);
    ASK(m, 8, 0, 10, 0, 0);
    ASK(m, 8, 0, 13, 0, 0);
    EXPECT(m, 8, 0, 13, 0, 0);
    ASK(m, 8, 0, 20, 0, 0);
    EXPECT(m, 8, 0, 20, 0, 0);
    ASK(m, 8, 0, 3, 0, 0);
    EXPECT(m, 0x88, 1);
    ASK(m, 8, 0, 11, 0, 1);
    EXPECT(m, 0x88, 3);
    ASK(m, 8, 0);
    EXPECT(m, 0x88, 3);
    ASK(m, 8, 0, 11, 0);
    EXPECT(m, 0x88, 3);
    assert_int_equal(ASK(m, 8, 0, 4, 0, 0), 0); // listen only
    assert_int_equal(ASK(m, 3, 0, 0, 0, 1), 0);
    assert_int_equal(ASK(m, 8, 0, 1, 0, 0), 0); // back, without an answer
    ASK(m, 8, 0, 1, 0xFF, 0);
    EXPECT(m, 8, 0, 1, 0xFF, 0);
    free(m);
}

static void identifies(void **state) {
    (void)state;
    struct machine *m = rig_new();
    ASK(m, 43, 14, 4, 0);
    EXPECT(m, 43, 14, 4, 0x82, 0, 0, 1, 0, 5, 'G', 'o', 'n', 'i', 'o');
    ASK(m, 43, 14, 1, 0);
    assert_int_equal(m->sent[7], 3);
    ASK(m, 43, 14, 2, 0);
    assert_int_equal(m->sent[7], 6);
    ASK(m, 43, 14, 3, 4);
    assert_int_equal(m->sent[7], 2);
    ASK(m, 43, 14, 2, 77); // unknown object in a stream: from the beginning
    assert_int_equal(m->sent[7], 6);
    ASK(m, 43, 14, 4, 6);
    EXPECT(m, 0xAB, 2);
    ASK(m, 43, 14, 5, 0);
    EXPECT(m, 0xAB, 3);
    ASK(m, 43, 14, 0, 0);
    EXPECT(m, 0xAB, 3);
    ASK(m, 43, 13, 1, 0);
    EXPECT(m, 0xAB, 1);
    ASK(m, 43, 14, 1);
    EXPECT(m, 0xAB, 3);
    ASK(m, 43);
    EXPECT(m, 0xAB, 3);
    free(m);
}

static void put_bytes(struct machine *m, const uint8_t *bytes, unsigned length, uint64_t idle) {
    for (unsigned i = 0; i < length; i++) {
        gonio_machine_run(m, m->core.modbus.character + (i > 0 ? idle : 0));
        gonio_fw_modbus_receive(&m->core, bytes[i], (uint32_t)m->now_us);
    }
}

// SL 2.5.1.1: 750 us between characters are allowed, more is not; 1750 us of silence end a frame, less does not.
static void frames_by_silence(void **state) {
    (void)state;
    struct machine *m = rig_new();
    const uint8_t request[] = {1, 3, 0, 0, 0, 1, 0x84, 0x0A};
    put_bytes(m, request, 8, 750);
    gonio_machine_run(m, 1749);
    assert_int_equal(m->sent_length, 0);
    gonio_machine_run(m, 1000);
    assert_int_equal(m->sent_length, 7);
    m->sent_length = 0;
    put_bytes(m, request, 8, 751);
    gonio_machine_run(m, 10000);
    assert_int_equal(m->sent_length, 0);
    put_bytes(m, request, 8, 0);
    gonio_machine_run(m, m->core.modbus.silence - 100);
    put_bytes(m, request, 8, 0); // too soon: both are spoilt
    gonio_machine_run(m, 10000);
    assert_int_equal(m->sent_length, 0);
    for (unsigned i = 0; i < 400; i++) // longer than any frame
        put_bytes(m, request, 1, 0);
    gonio_machine_run(m, 10000);
    assert_int_equal(m->sent_length, 0);
    put_bytes(m, request, 3, 0); // too short
    gonio_machine_run(m, 10000);
    put_bytes(m, request, 8, 0);
    gonio_machine_run(m, 10000);
    assert_int_equal(m->sent_length, 7);
    free(m);
}

static void gaps_scale_below_19200(void **state) {
    (void)state;
    struct machine *m = rig_new();
    gonio_fw_modbus_setup(&m->core, 9600);
    assert_int_equal(m->core.modbus.character, 1146); // 11 bits
    assert_int_equal(m->core.modbus.gap, 1719);
    assert_int_equal(m->core.modbus.silence, 4011);
    gonio_fw_modbus_setup(&m->core, 19200);
    assert_int_equal(m->core.modbus.silence, 2006);
    gonio_fw_modbus_setup(&m->core, 38400);
    assert_true(m->core.modbus.gap == 750 && m->core.modbus.silence == 1750);
    free(m);
}

// A frame that comes while the main loop is late or at work does not mix with the one before.
static void a_late_main_loop_spoils_nothing(void **state) {
    (void)state;
    struct machine *m = rig_new();
    const uint8_t request[] = {1, 3, 0, 0, 0, 1, 0x84, 0x0A};
    for (unsigned i = 0; i < 8; i++)
        gonio_fw_modbus_receive(&m->core, request[i], (uint32_t)m->now_us);
    gonio_fw_modbus_receive(&m->core, 0x55, (uint32_t)m->now_us + 5000); // the next frame's first byte
    gonio_machine_run(m, 10000);
    assert_int_equal(m->sent_length, 7);
    assert_int_equal(m->core.modbus.overruns, 1);
    free(m);
}

static void a_full_transmitter_is_waited_for(void **state) {
    (void)state;
    struct machine *m = rig_new();
    const uint8_t request[] = {1, 3, 0, 0, 0, 1, 0x84, 0x0A};
    m->sent_length = 0;
    put_bytes(m, request, 8, 0);
    m->sent_length = MACHINE_SENT_MAX - 3;
    gonio_machine_run(m, 10000);
    assert_true(m->core.modbus.sending && m->driving);
    m->sent_length = 0;
    gonio_machine_run(m, 10000);
    assert_int_equal(m->sent_length, 4);
    assert_false(m->core.modbus.sending || m->driving);
    free(m);
}

static void a_repeated_move_is_harmless(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    uint8_t move[6 + 42] = {16, 1, 0, 0, 21, 42};
    uint8_t *words = move + 6;
    words[3] = 7;                  // command_id
    words[5] = 1;                  // axis 0
    words[6] = 3, words[7] = 0xE8; // full speed
    words[14] = 0x10;              // target_0 = 0x1000
    words[41] = FW_COMMAND_MOVE;
    ask(m, 1, move, sizeof move);
    EXPECT(m, 16, 1, 0, 0, 21);
    assert_int_equal(m->core.state, FW_STATE_MOVING);
    ask(m, 1, move, sizeof move); // the reply was lost, the host asks again
    EXPECT(m, 16, 1, 0, 0, 21);
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_true(m->axis[0].steps == 0x1000);
    const uint64_t edges = m->rising_edges;
    ask(m, 1, move, sizeof move);
    EXPECT(m, 16, 1, 0, 0, 21);
    assert_true(gonio_machine_settle(m, MINUTE_US) && m->rising_edges == edges);
    words[3] = 8;
    words[14] = 0x20;
    ask(m, 1, move, sizeof move);
    assert_int_equal(m->core.state, FW_STATE_MOVING);
    words[3] = 9; // another one meanwhile
    ask(m, 1, move, sizeof move);
    EXPECT(m, 0x90, 6);
    assert_int_equal(m->core.registers.refusal[0], FW_REFUSAL_BUSY);
    ASK(m, 16, 2, 8, 0, 2, 4, 0, 0, 0x30, 0x39); // a parameter while moving
    EXPECT(m, 0x90, 6);
    words[3] = 0;
    ask(m, 1, move, sizeof move);
    EXPECT(m, 0x90, 4);
    words[41] = 77;
    ask(m, 1, move, sizeof move);
    EXPECT(m, 0x90, 3);
    assert_int_equal(m->core.registers.refusal[0], FW_REFUSAL_UNKNOWN);
    assert_true(gonio_machine_settle(m, MINUTE_US));
    assert_true(m->axis[0].steps == 0x2000);
    free(m);
}

// A command block of `words` words from command_id on, its command at the usual place.
static unsigned order(struct machine *m, unsigned words, unsigned id, unsigned command, unsigned target,
                      unsigned after) {
    uint8_t pdu[6 + 2 * 24] = {16, 1, 0, 0, (uint8_t)words, (uint8_t)(2 * words)};
    uint8_t *w = pdu + 6;
    w[2] = (uint8_t)(id >> 8), w[3] = (uint8_t)id;
    w[5] = 1;
    w[6] = 3, w[7] = 0xE8;
    w[14] = (uint8_t)(target >> 8), w[15] = (uint8_t)target;
    w[40] = (uint8_t)(command >> 8), w[41] = (uint8_t)command;
    w[42] = (uint8_t)(after >> 8), w[43] = (uint8_t)after;
    return ask(m, 1, pdu, 6 + 2 * words);
}

static void nothing_moves_or_changes(struct machine *m, const struct fw_registers *before, bool lamp,
                                     const char *what) {
    gonio_fw_core_refresh(&m->core);
    struct fw_registers now = m->core.registers;
    now.refusal[0] = before->refusal[0]; // says why
    now.time[0] = before->time[0];
    now.monitor[0] = before->monitor[0];
    now.monitor_time[0] = before->monitor_time[0];
    if (m->sent_length < 5 || (m->sent[1] & 0x80) == 0 || memcmp(&now, before, sizeof now) != 0 ||
        m->rising_edges != 0 || m->core.axis.under_way || m->core.lamp.on != lamp || m->core.lamp.open)
        fail_msg("%s: function %u, exception %u", what, m->sent[1], m->sent[2]);
}

// Whatever is wrong with a write, anywhere in it: an exception, and all is as before.
static void all_or_nothing(void **state) {
    (void)state;
    enum { MOVE = FW_COMMAND_MOVE, HANG = 0xDEAD };
    static const struct {
        const char *what;
        unsigned words, id, command, target, after;
        uint16_t known, alarm;
    } blocks[] = {{"a move that runs on into a self-test", 22, 7, MOVE, 0x1000, HANG, 15, 0},
                  {"a move that runs on into a bad register", 22, 7, MOVE, 0x1000, 1, 15, 0},
                  {"a move that runs on into a gap", 23, 7, MOVE, 0x1000, 0, 15, 0},
                  {"a stop that runs on", 22, 7, FW_COMMAND_STOP, 0x1000, 1, 15, 0},
                  {"no command", 21, 7, 0, 0x1000, 0, 15, 0},
                  {"an unknown command", 21, 7, 77, 0x1000, 0, 15, 0},
                  {"no id", 21, 0, MOVE, 0x1000, 0, 15, 0},
                  {"not homed", 21, 7, MOVE, 0x1000, 0, 0, 0},
                  {"beyond a limit", 21, 7, MOVE, 0xFFFF, 0, 15, 0},
                  {"in an alarm", 21, 7, MOVE, 0x1000, 0, 15, FW_ALARM_UNDERRUN},
                  {"flash is empty", 21, 7, FW_COMMAND_LOAD, 0x1000, 0, 15, 0},
                  {"a save beside the lamp", 21, 7, FW_COMMAND_SAVE, 0x1000, 0, 15, 0}};
    for (unsigned i = 0; i < sizeof blocks / sizeof *blocks; i++) {
        struct machine *m = rig_homed();
        m->core.registers.lamp_rise[0] = 0;
        m->core.registers.monitor_average[0] = 4096;
        if (blocks[i].alarm != 0)
            gonio_fw_interlock_alarm(&m->core, (enum fw_alarm)blocks[i].alarm, FW_NO_AXIS, false);
        else
            assert_true(gonio_fw_lamp_switch(&m->core, true));
        gonio_machine_run(m, 5000);
        m->core.known = blocks[i].known;
        gonio_fw_core_refresh(&m->core);
        const struct fw_registers before = m->core.registers;
        order(m, blocks[i].words, blocks[i].id, blocks[i].command, blocks[i].target, blocks[i].after);
        nothing_moves_or_changes(m, &before, blocks[i].alarm == 0, blocks[i].what);
        free(m);
    }
    struct machine *m = rig_homed(); // coils: one that may, one that may not
    assert_true(gonio_fw_lamp_switch(&m->core, true));
    m->core.registers.lamp_level[0] = 0;
    gonio_machine_hold(m, FW_CONTACT_door, true);
    m->core.state = FW_STATE_IDLE;
    gonio_fw_core_refresh(&m->core);
    const struct fw_registers before = m->core.registers;
    uint8_t reply[FW_PDU_MAX];
    const size_t n = gonio_fw_modbus_pdu(&m->core, FW_CHANNEL_LINE, (const uint8_t[]){15, 0, 0, 0, 2, 1, 2}, 7, reply);
    m->sent_length = 5, m->sent[1] = reply[0], m->sent[2] = reply[1];
    assert_int_equal(n, 2);
    nothing_moves_or_changes(m, &before, true, "lamp off and shutter open, at an open door");
    free(m);
}

static void counts_and_lengths_are_checked(void **state) {
    (void)state;
    struct machine *m = rig_new();
    ASK(m, 15, 0, 0, 0, 0, 0, 0); // no coils
    EXPECT(m, 0x8F, 3);
    ASK(m, 15, 0, 0, 7, 0xB1, 0xF7, 0); // more than 1968
    EXPECT(m, 0x8F, 3);
    ASK(m, 15, 0, 0, 0, 2, 1, 0, 0); // a byte too many
    EXPECT(m, 0x8F, 3);
    ASK(m, 16, 0, 0x10, 0, 0, 0); // no registers
    EXPECT(m, 0x90, 3);
    ASK(m, 16, 0, 0x10, 0, 1, 2, 0); // a byte too few
    EXPECT(m, 0x90, 3);
    ASK(m, 23, 0, 0x10, 0, 0, 0, 0x10, 0, 1, 2, 1, 2); // nothing to read
    EXPECT(m, 0x97, 3);
    ASK(m, 23, 0, 0x10, 0, 1, 0, 0x10, 0, 0, 0, 1, 2); // nothing to write
    EXPECT(m, 0x97, 3);
    ASK(m, 23, 0, 0x10, 0, 1, 0, 0x10, 0, 122, 244, 1, 2); // more than 121
    EXPECT(m, 0x97, 3);
    ASK(m, 23, 0, 0x10, 0, 1, 0, 0x10, 0, 1, 2, 1, 2, 3); // a byte too many
    EXPECT(m, 0x97, 3);
    ASK(m, 2, 0, 0, 7, 0xD1); // more than 2000
    EXPECT(m, 0x82, 3);
    ASK(m, 8, 0, 19, 0, 0);
    EXPECT(m, 0x88, 1);
    ASK(m, 8, 0, 1, 0, 1);
    EXPECT(m, 0x88, 3);
    ASK(m, 16, 0, 0x0A, 0, 1, 2, 0, 0); // a gap
    EXPECT(m, 0x90, 2);
    ASK(m, 16, 2, 9, 0, 1, 2, 0, 0); // the low half of a value
    EXPECT(m, 0x90, 2);
    ask(m, 0, (const uint8_t[]){8, 0, 4, 0, 0}, 5); // broadcast: listen only, nobody answers
    assert_int_equal(ASK(m, 3, 0, 0, 0, 1), 0);
    uint8_t reply[FW_PDU_MAX];
    const uint8_t request[FW_PDU_MAX + 1] = {3};
    assert_int_equal(gonio_fw_modbus_pdu(&m->core, FW_CHANNEL_LINE, request, 0, reply), 0);
    assert_int_equal(gonio_fw_modbus_pdu(&m->core, FW_CHANNEL_LINE, request, sizeof request, reply), 0);
    free(m);
}

static void self_tests(void **state) {
    (void)state;
    struct machine *m = rig_new();
    ASK(m, 6, 1, 0x15, 0x12, 0x34);
    EXPECT(m, 0x86, 3);
    ASK(m, 5, 0, 0, 0xFF, 0);
    gonio_machine_run(m, 10000);
    ASK(m, 6, 1, 0x15, 0xFA, 0x17); // not with the lamp on
    EXPECT(m, 0x86, 4);
    ASK(m, 5, 0, 0, 0, 0);
    gonio_machine_run(m, 10000);
    ASK(m, 6, 1, 0x15, 0xDE, 0xAD);
    EXPECT(m, 6, 1, 0x15, 0xDE, 0xAD);
    gonio_machine_run(m, 700000);
    assert_true(m->bitten);
    free(m);
}

static void restarts(void **state) {
    (void)state;
    struct machine *m = rig_homed();
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_RESTART, 0), FW_REFUSAL_NONE);
    assert_true(m->restart);
    free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(crc_is_the_specified_one),
        cmocka_unit_test(reads),
        cmocka_unit_test(writes),
        cmocka_unit_test(masks),
        cmocka_unit_test(reads_and_writes_with_a_token),
        cmocka_unit_test(bits),
        cmocka_unit_test(diagnoses),
        cmocka_unit_test(identifies),
        cmocka_unit_test(frames_by_silence),
        cmocka_unit_test(gaps_scale_below_19200),
        cmocka_unit_test(a_late_main_loop_spoils_nothing),
        cmocka_unit_test(a_full_transmitter_is_waited_for),
        cmocka_unit_test(a_repeated_move_is_harmless),
        cmocka_unit_test(all_or_nothing),
        cmocka_unit_test(counts_and_lengths_are_checked),
        cmocka_unit_test(self_tests),
        cmocka_unit_test(restarts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
