// SPDX-License-Identifier: BSD-3-Clause
// Parameters in flash that loses power: one slot is always valid.
#include "tests/unit/fw_rig.h"

static uint32_t sentinel(const struct machine *m) { return m->core.registers.deadman[0]; }

static void restart(struct machine *m) {
    m->flash_operations_left = -1;
    gonio_machine_start(m, FW_CAUSE_POWER);
}

static void round_trip(void **state) {
    (void)state;
    struct machine *m = rig_new();
    assert_int_equal(m->core.registers.store_slot[0], 0);
    m->core.registers.soft_min[3] = -123456789012345;
    m->core.registers.backlash[1] = -17;
    m->core.registers.baud[0] = 57600;
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
    const struct fw_registers before = m->core.registers;
    restart(m);
    assert_int_equal(m->core.registers.store_slot[0], 1);
    // Every parameter, those of regmap.def and no others by name.
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    if (#access[0] == 'P')                                                                                             \
        assert_memory_equal(before.name, m->core.registers.name, sizeof before.name);
#include "firmware/regmap.def"
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_DEFAULTS, 0), FW_REFUSAL_NONE);
    assert_int_equal(m->core.registers.baud[0], 115200);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_LOAD, 0), FW_REFUSAL_NONE);
    assert_int_equal(m->core.registers.baud[0], 57600);
    free(m);
}

// What was stored by another table and is out of range here: LOAD is refused, and leaves what there is.
static void a_refused_load_changes_nothing(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.slave_address[0] = 0;
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
    m->core.registers.slave_address[0] = 9;
    m->core.registers.deadman[0] = 77;
    struct fw_registers before = m->core.registers;
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_LOAD, 0), FW_REFUSAL_STORE);
    before.command_id[0] = m->core.registers.command_id[0];
    assert_memory_equal(&before, &m->core.registers, sizeof before);
    restart(m);
    assert_int_equal(m->core.registers.store_slot[0], 0);
    assert_int_equal(m->core.registers.slave_address[0], 1);
    free(m);
}

// An erase may stop the processor for seconds: not while the lamp burns, in whatever state.
static void nothing_is_saved_beside_a_burning_lamp(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.lamp_rise[0] = 0;
    m->core.registers.safe_lamp[0] = 1000;
    assert_true(gonio_fw_lamp_switch(&m->core, true));
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NOT_SAFE); // before it has begun to rise
    gonio_machine_run(m, 5000);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NOT_SAFE);
    gonio_fw_interlock_alarm(&m->core, FW_ALARM_DEADMAN, FW_NO_AXIS, false);
    gonio_machine_run(m, 5000);
    assert_true(m->lamp == 1000);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NOT_SAFE);
    assert_int_equal(m->flash[0][0], 0xFFFFFFFF);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_CLEAR, 0), FW_REFUSAL_NONE);
    gonio_machine_run(m, 5000);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
    free(m);
}

struct parameter {
    const char *name;
    uint16_t address;
    unsigned words, count;
    int64_t minimum, maximum, initial;
};
static const struct parameter parameters[] = {
#define WORDS_u16 1
#define WORDS_u32 2
#define WORDS_i32 2
#define WORDS_i64 4
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    {#access[0] == 'P' ? #name : "", address, WORDS_##type, count, minimum, maximum, initial},
#include "firmware/regmap.def"
};

// Axes (bits) whose positions mean something else once the first `axis` of a parameter has changed.
static unsigned means(const char *name, unsigned axis) {
    static const char *const names[] = {"steps_per_deg", "home_position", "home_up", "direction_invert"};
    for (unsigned i = 0; i < 4; i++)
        if (strcmp(name, names[i]) == 0)
            return 1u << axis;
    return 0;
}

static void put(struct machine *m, const struct parameter *p, unsigned axis, int64_t value) {
    uint16_t words[4];
    for (unsigned i = 0; i < p->words; i++)
        words[i] = (uint16_t)((uint64_t)value >> 16 * (p->words - 1 - i));
    assert_int_equal(
        gonio_fw_registers_write(&m->core, (uint16_t)(p->address + axis * p->words), (uint16_t)p->words, words), 0);
}

// Every parameter of every axis: written as it is nothing changes; written otherwise the generation and the checksum
// tell, and what changes the meaning of a step makes that axis' position unknown, however it came.
static void a_changed_meaning_unhomes(void **state) {
    (void)state;
    enum { WRITTEN, DEFAULTED, LOADED, WAYS };
    unsigned tried = 0;
    for (unsigned i = 0; i < sizeof parameters / sizeof *parameters; i++)
        for (unsigned axis = 0; parameters[i].name[0] != 0 && axis < parameters[i].count; axis++)
            for (unsigned way = 0; way < WAYS; way++) {
                const struct parameter *p = &parameters[i];
                struct machine *m = rig_new();
                assert_int_equal(gonio_machine_command(m, FW_COMMAND_DEFAULTS, 0), FW_REFUSAL_NONE);
                assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
                const int64_t other = p->initial < p->maximum ? p->initial + 1 : p->initial - 1;
                if (way != WRITTEN)
                    put(m, p, axis, other);
                m->core.known = 15;
                m->core.homing.homed_before = 15;
                const uint32_t generation = m->core.registers.generation[0], checksum = m->core.registers.checksum[0];
                put(m, p, axis, way == WRITTEN ? p->initial : other); // as it is
                assert_true(m->core.known == 15 && m->core.registers.generation[0] == generation);
                if (way == WRITTEN)
                    put(m, p, axis, other);
                else
                    assert_int_equal(gonio_machine_command(m, way == LOADED ? FW_COMMAND_LOAD : FW_COMMAND_DEFAULTS, 0),
                                     0);
                assert_int_equal(m->core.registers.generation[0], generation + 1);
                assert_true(m->core.registers.checksum[0] != checksum);
                if (m->core.known != (15 & ~means(p->name, axis)) || m->core.homing.homed_before != m->core.known)
                    fail_msg("%s, axis %u: homed %u", p->name, axis, m->core.known);
                free(m);
                tried++;
            }
    assert_true(tried > 200);
}

static void empty_flash_has_nothing_to_load(void **state) {
    (void)state;
    struct machine *m = rig_new();
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_LOAD, 0), FW_REFUSAL_STORE);
    free(m);
}

// Power fails in the middle of every single operation of a save; after the restart the old or the new parameters are
// there, whole, and the next save works.
static void a_cut_at_every_write_keeps_a_slot(void **state) {
    (void)state;
    struct machine *m = rig_new();
    for (uint32_t v = 1; v <= 3; v++) { // both slots used
        m->core.registers.deadman[0] = v;
        m->core.registers.trigger_pulse[0] = (uint16_t)v;
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
    }
    uint32_t kept = 3, cuts = 0;
    for (int64_t operations = 1;; operations++) {
        m->core.registers.deadman[0] = kept + 1;
        m->core.registers.trigger_pulse[0] = (uint16_t)(kept + 1);
        m->flash_operations_left = operations;
        const enum fw_refusal refusal = gonio_machine_command(m, FW_COMMAND_SAVE, 0);
        restart(m);
        assert_true(m->core.registers.store_slot[0] != 0);
        assert_true(sentinel(m) == kept || sentinel(m) == kept + 1);
        assert_int_equal(m->core.registers.trigger_pulse[0], sentinel(m));
        if (refusal == FW_REFUSAL_NONE) {
            assert_int_equal(sentinel(m), kept + 1);
            break;
        }
        kept = sentinel(m);
        cuts++;
        if (operations % 7 == 0) { // a whole save in between: the slots change places
            m->core.registers.deadman[0] = ++kept;
            m->core.registers.trigger_pulse[0] = (uint16_t)kept;
            assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
        }
    }
    assert_true(cuts > 80); // an erase and every word
    free(m);
}

static void every_flipped_bit_is_seen(void **state) {
    (void)state;
    struct machine *m = rig_new();
    for (uint32_t v = 1; v <= 2; v++) {
        m->core.registers.deadman[0] = v;
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
    }
    const unsigned words = 4 + m->flash[1][3];
    for (unsigned bit = 0; bit < 32 * words; bit++) {
        m->flash[1][bit / 32] ^= 1u << bit % 32;
        restart(m);
        assert_int_equal(sentinel(m), 1);
        assert_int_equal(m->core.registers.store_slot[0], 1);
        m->flash[1][bit / 32] ^= 1u << bit % 32;
    }
    restart(m);
    assert_int_equal(sentinel(m), 2);
    free(m);
}

// CRC-32 (IEEE 802.3) without the last inversion, byte by byte: the firmware's goes word by word.
static uint32_t crc32_of(const uint32_t *words, unsigned count, uint32_t crc) {
    for (unsigned i = 0; i < 4 * count; i++) {
        crc ^= words[i / 4] >> 8 * (i % 4) & 255;
        for (int k = 0; k < 8; k++)
            crc = (crc & 1) != 0 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
    }
    return crc;
}

// As after 2^32 - 2 saves: the newer slot is the one with the smaller number.
static void sequence_numbers_wrap(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->core.registers.deadman[0] = 1;
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
    uint32_t *page = m->flash[0];
    assert_int_equal(page[2], crc32_of(page + 3, 1 + page[3], crc32_of(page + 1, 1, 0xFFFFFFFF)));
    page[1] = 0xFFFFFFFE;
    page[2] = crc32_of(page + 3, 1 + page[3], crc32_of(page + 1, 1, 0xFFFFFFFF));
    for (uint32_t v = 2; v <= 5; v++) {
        m->core.registers.deadman[0] = v;
        assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
        restart(m);
        assert_int_equal(sentinel(m), v);
    }
    assert_true(m->flash[0][1] < 10);
    free(m);
}

static void flash_that_does_not_take_it_is_told(void **state) {
    (void)state;
    struct machine *m = rig_new();
    m->flash_operations_left = 0; // dead
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_STORE);
    m->flash_operations_left = -1;
    gonio_machine_hold(m, FW_CONTACT_door, false);
    assert_int_equal(gonio_machine_command(m, FW_COMMAND_SAVE, 0), FW_REFUSAL_NONE);
    free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(round_trip),
        cmocka_unit_test(a_refused_load_changes_nothing),
        cmocka_unit_test(nothing_is_saved_beside_a_burning_lamp),
        cmocka_unit_test(a_changed_meaning_unhomes),
        cmocka_unit_test(empty_flash_has_nothing_to_load),
        cmocka_unit_test(a_cut_at_every_write_keeps_a_slot),
        cmocka_unit_test(every_flipped_bit_is_seen),
        cmocka_unit_test(sequence_numbers_wrap),
        cmocka_unit_test(flash_that_does_not_take_it_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
