// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/parameters.h"

#include <stddef.h>

#include "firmware/contract/store.h"
#include "firmware/core/core.h"

// A slot: mark, sequence number, CRC of all that follows, number of payload words, payload (two 16-bit words in each).
// The mark is programmed last: without it the slot does not count, however far the writing got.
enum { MARK_AT, SEQUENCE_AT, CRC_AT, COUNT_AT, PAYLOAD_AT };
#define MARK 0x474F0001u // "GO", layout 1
#define CRC_START 0xFFFFFFFFu

// CRC-32 (IEEE 802.3, reflected 0x04C11DB7) of one more word, least significant byte first.
static uint32_t crc_word(uint32_t crc, uint32_t word) {
    crc ^= word;
    for (int i = 0; i < 32; i++)
        crc = (crc & 1) != 0 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
    return crc;
}

static bool add_word(void *context, uint16_t *word) {
    uint32_t *crc = context;
    *crc ^= *word;
    for (int i = 0; i < 16; i++)
        *crc = (*crc & 1) != 0 ? *crc >> 1 ^ 0xEDB88320u : *crc >> 1;
    return true;
}

void gonio_fw_parameters_note(struct fw_core *core) {
    struct fw_registers *r = &core->registers;
    struct fw_meaning *meaning = &core->meaning;
    unsigned changed = (unsigned)meaning->direction_invert ^ r->direction_invert[0];
    uint32_t crc = CRC_START;
    gonio_fw_registers_walk(core, add_word, &crc);
    r->generation[0] += crc != r->checksum[0];
    r->checksum[0] = crc;
    meaning->direction_invert = r->direction_invert[0];
    for (unsigned i = 0; i < FW_AXES; i++) {
        const bool other = meaning->steps_per_deg[i] != r->steps_per_deg[i] ||
                           meaning->home_position[i] != r->home_position[i] || meaning->home_up[i] != r->home_up[i];
        changed |= (unsigned)other << i;
        meaning->steps_per_deg[i] = r->steps_per_deg[i];
        meaning->home_position[i] = r->home_position[i];
        meaning->home_up[i] = r->home_up[i];
    }
    core->known &= (uint16_t)~changed;
    core->homing.homed_before &= (uint8_t)~changed; // or the next homing would find a difference of another scale
}

static uint32_t slot_crc(const uint32_t *page, uint32_t payload) {
    uint32_t crc = crc_word(CRC_START, page[SEQUENCE_AT]);
    for (uint32_t i = COUNT_AT; i < PAYLOAD_AT + payload; i++)
        crc = crc_word(crc, page[i]);
    return crc;
}

static bool valid(const uint32_t *page) {
    return page[MARK_AT] == MARK && page[COUNT_AT] <= FW_STORE_WORDS - PAYLOAD_AT &&
           slot_crc(page, page[COUNT_AT]) == page[CRC_AT];
}

// The slot that counts; FW_STORE_SLOTS: none. Sequence numbers wrap.
static unsigned newest(struct fw_core *core) {
    const uint32_t *a = gonio_fw_board_store_page(core, 0), *b = gonio_fw_board_store_page(core, 1);
    const bool a_valid = valid(a), b_valid = valid(b);
    if (a_valid && b_valid)
        return (int32_t)(a[SEQUENCE_AT] - b[SEQUENCE_AT]) > 0 ? 0 : 1;
    if (a_valid)
        return 0;
    return b_valid ? 1 : FW_STORE_SLOTS;
}

struct cursor {
    struct fw_core *core;
    const uint32_t *page;
    unsigned slot, words; // 16-bit words so far
    uint32_t pair;
};

static bool read_word(void *context, uint16_t *word) {
    struct cursor *c = context;
    const unsigned at = c->words++;
    if (at / 2 >= c->page[COUNT_AT])
        return false;
    const uint32_t pair = c->page[PAYLOAD_AT + at / 2];
    *word = (uint16_t)(at % 2 == 0 ? pair : pair >> 16);
    return true;
}

static bool put(struct cursor *c, unsigned index, uint32_t word) {
    return gonio_fw_board_store_program(c->core, c->slot, index, word) && c->page[index] == word;
}

static bool write_word(void *context, uint16_t *word) {
    struct cursor *c = context;
    const unsigned at = c->words++;
    if (at % 2 == 0) {
        c->pair = *word;
        return true;
    }
    return put(c, PAYLOAD_AT + at / 2, c->pair | (uint32_t)*word << 16);
}

bool gonio_fw_parameters_load(struct fw_core *core) {
    const unsigned slot = newest(core);
    if (slot == FW_STORE_SLOTS)
        return false;
    const struct fw_registers kept = core->registers;
    struct cursor c = {.core = core, .page = gonio_fw_board_store_page(core, slot), .slot = slot};
    // A table with more parameters than the slot holds: the rest keep their initial values.
    gonio_fw_registers_initialise(core, true);
    gonio_fw_registers_walk(core, read_word, &c);
    if (!gonio_fw_registers_valid(core)) { // of another table
        core->registers = kept;
        return false;
    }
    core->registers.store_slot[0] = (uint16_t)(slot + 1);
    return true;
}

bool gonio_fw_parameters_save(struct fw_core *core) {
    const unsigned old = newest(core), slot = old == 0 ? 1 : 0;
    const uint32_t sequence = old == FW_STORE_SLOTS ? 1 : gonio_fw_board_store_page(core, old)[SEQUENCE_AT] + 1;
    struct cursor c = {.core = core, .page = gonio_fw_board_store_page(core, slot), .slot = slot};
    if (!gonio_fw_board_store_erase(core, slot) || !gonio_fw_registers_walk(core, write_word, &c))
        return false;
    if (c.words % 2 != 0 && !put(&c, PAYLOAD_AT + c.words / 2, c.pair | 0xFFFF0000u))
        return false;
    if (!put(&c, SEQUENCE_AT, sequence) || !put(&c, COUNT_AT, (c.words + 1) / 2) ||
        !put(&c, CRC_AT, slot_crc(c.page, (c.words + 1) / 2)) || !put(&c, MARK_AT, MARK))
        return false;
    core->registers.store_slot[0] = (uint16_t)(slot + 1);
    return true;
}
