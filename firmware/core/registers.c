// SPDX-License-Identifier: BSD-3-Clause
#include "firmware/core/registers.h"

#include <stddef.h>

#include "firmware/core/core.h"

enum type { TYPE_u16, TYPE_u32, TYPE_i32, TYPE_i64 };
enum access { ACCESS_R, ACCESS_W, ACCESS_P, ACCESS_C };

struct descriptor {
    uint16_t address;
    uint8_t type, count, access;
    uint16_t offset;
    int64_t minimum, maximum, initial; // minimum = maximum: any value
};

static const struct descriptor table[] = {
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    {address, TYPE_##type, count, ACCESS_##access, offsetof(struct fw_registers, name), minimum, maximum, initial},
#include "firmware/regmap.def"
};
enum { TABLE = sizeof table / sizeof table[0] };

static unsigned words_of(const struct descriptor *d) {
    static const uint8_t words[] = {[TYPE_u16] = 1, [TYPE_u32] = 2, [TYPE_i32] = 2, [TYPE_i64] = 4};
    return words[d->type];
}

static unsigned end_of(const struct descriptor *d) { return d->address + words_of(d) * d->count; }

static const struct descriptor *find(unsigned address) {
    for (unsigned i = 0; i < TABLE; i++)
        if (address >= table[i].address && address < end_of(&table[i]))
            return &table[i];
    return NULL;
}

static void *place(struct fw_core *core, const struct descriptor *d, unsigned index) {
    static const uint8_t size[] = {[TYPE_u16] = 2, [TYPE_u32] = 4, [TYPE_i32] = 4, [TYPE_i64] = 8};
    return (char *)&core->registers + d->offset + size[d->type] * index;
}

static int64_t load(struct fw_core *core, const struct descriptor *d, unsigned index) {
    const void *at = place(core, d, index);
    switch (d->type) {
    case TYPE_u16:
        return *(const uint16_t *)at;
    case TYPE_u32:
        return *(const uint32_t *)at;
    case TYPE_i32:
        return *(const int32_t *)at;
    default:
        return *(const int64_t *)at;
    }
}

static void store(struct fw_core *core, const struct descriptor *d, unsigned index, int64_t value) {
    void *at = place(core, d, index);
    switch (d->type) {
    case TYPE_u16:
        *(uint16_t *)at = (uint16_t)value;
        break;
    case TYPE_u32:
        *(uint32_t *)at = (uint32_t)value;
        break;
    case TYPE_i32:
        *(int32_t *)at = (int32_t)value;
        break;
    default:
        *(int64_t *)at = value;
    }
}

static bool in_range(const struct descriptor *d, int64_t value) {
    return d->minimum == d->maximum || (value >= d->minimum && value <= d->maximum);
}

static void value_to_words(uint64_t value, unsigned count, uint16_t *words) {
    for (unsigned i = count; i-- > 0; value >>= 16)
        words[i] = (uint16_t)value;
}

static int64_t words_to_value(const struct descriptor *d, const uint16_t *words) {
    uint64_t value = 0;
    for (unsigned i = 0; i < words_of(d); i++)
        value = value << 16 | words[i];
    return d->type == TYPE_i32 ? (int32_t)(uint32_t)value : (int64_t)value;
}

void gonio_fw_registers_initialise(struct fw_core *core, bool parameters_only) {
    for (const struct descriptor *d = table; d < table + TABLE; d++)
        for (unsigned i = 0; i < d->count; i++)
            if (!parameters_only || d->access == ACCESS_P)
                store(core, d, i, d->initial);
}

enum fw_exception gonio_fw_registers_readable(const struct fw_core *core, uint16_t address, uint16_t count) {
    (void)core;
    for (unsigned at = address, end = (unsigned)address + count; at < end;) {
        const struct descriptor *d = find(at);
        if (d == NULL || (at - d->address) % words_of(d) != 0 || at + words_of(d) > end)
            return FW_EXCEPTION_ADDRESS;
        at += words_of(d);
    }
    return FW_EXCEPTION_NONE;
}

enum fw_exception gonio_fw_registers_read(struct fw_core *core, uint16_t address, uint16_t count, uint16_t *words) {
    const enum fw_exception exception = gonio_fw_registers_readable(core, address, count);
    if (exception != FW_EXCEPTION_NONE)
        return exception;
    gonio_fw_core_refresh(core);
    for (unsigned at = address, end = (unsigned)address + count; at < end;) {
        const struct descriptor *d = find(at);
        value_to_words((uint64_t)load(core, d, (at - d->address) / words_of(d)), words_of(d), words);
        words += words_of(d);
        at += words_of(d);
    }
    return FW_EXCEPTION_NONE;
}

static enum fw_exception writable(struct fw_core *core, unsigned address, unsigned end, const uint16_t *words) {
    for (unsigned at = address; at < end;) {
        const struct descriptor *d = find(at);
        if (d == NULL || d->access == ACCESS_R || (at - d->address) % words_of(d) != 0 || at + words_of(d) > end)
            return FW_EXCEPTION_ADDRESS;
        if (d->access == ACCESS_C && at + 1 != end) // what acts comes last
            return FW_EXCEPTION_ADDRESS;
        if (!in_range(d, words_to_value(d, words)))
            return FW_EXCEPTION_VALUE;
        if (d->access == ACCESS_P && !gonio_fw_core_at_rest(core)) {
            core->registers.refusal[0] = FW_REFUSAL_BUSY;
            return FW_EXCEPTION_BUSY;
        }
        at += words_of(d);
        words += words_of(d);
    }
    return FW_EXCEPTION_NONE;
}

static enum fw_exception act(struct fw_core *core, const struct descriptor *d, uint16_t value) {
    const enum fw_refusal refusal =
        d->address == FW_REGISTER_command ? gonio_fw_core_command(core, value) : gonio_fw_core_self_test(core, value);
    core->registers.refusal[0] = (uint16_t)refusal;
    if (refusal == FW_REFUSAL_NONE)
        return FW_EXCEPTION_NONE;
    if (refusal == FW_REFUSAL_UNKNOWN)
        return FW_EXCEPTION_VALUE;
    return refusal == FW_REFUSAL_BUSY ? FW_EXCEPTION_BUSY : FW_EXCEPTION_FAILURE;
}

// What is to be written, as its owner is asked for it.
static struct fw_claim claim_of(unsigned address, unsigned end, const uint16_t *words) {
    struct fw_claim claim = {.harmless = address == FW_REGISTER_token && end == address + 1};
    if (address == FW_REGISTER_heartbeat)
        claim.number = (uint32_t)words[0] << 16 | words[1];
    if (end == FW_REGISTER_command + 1)
        claim.command = words[end - 1 - address];
    return claim;
}

static void store_all(struct fw_core *core, unsigned address, unsigned end, const uint16_t *words) {
    for (unsigned at = address; at < end;) {
        const struct descriptor *d = find(at);
        store(core, d, (at - d->address) / words_of(d), words_to_value(d, words));
        at += words_of(d);
        words += words_of(d);
    }
}

// Store, and act where the last register acts; where that is refused, as if nothing had been written.
static enum fw_exception carry_out(struct fw_core *core, unsigned address, unsigned end, const uint16_t *words) {
    const struct descriptor *first = find(address), *last = find(end - 1);
    uint16_t before[FW_WRITE_MAX];
    gonio_fw_registers_read(core, (uint16_t)address, (uint16_t)(end - address), before);
    store_all(core, address, end, words);
    if (last->access == ACCESS_C) {
        const enum fw_exception exception = act(core, last, words[end - 1 - address]);
        if (exception != FW_EXCEPTION_NONE)
            store_all(core, address, end, before);
        return exception;
    }
    if (first->access == ACCESS_P) // the table does not mix them
        gonio_fw_core_parameters_changed(core);
    return FW_EXCEPTION_NONE;
}

enum fw_exception gonio_fw_registers_write(struct fw_core *core, uint16_t address, uint16_t count,
                                           const uint16_t *words) {
    const unsigned end = (unsigned)address + count;
    enum fw_exception exception = count > FW_WRITE_MAX ? FW_EXCEPTION_VALUE : writable(core, address, end, words);
    if (exception != FW_EXCEPTION_NONE)
        return exception;
    const struct fw_claim claim = claim_of(address, end, words);
    if (!gonio_fw_owner_allows(core, &claim)) {
        core->registers.refusal[0] = FW_REFUSAL_NOT_OWNER;
        return FW_EXCEPTION_FAILURE;
    }
    if (gonio_fw_owner_stops(&claim)) // by anybody: it leaves what the owner has written as it is
        exception = act(core, find(FW_REGISTER_command), claim.command);
    else
        exception = carry_out(core, address, end, words);
    if (exception == FW_EXCEPTION_NONE)
        gonio_fw_owner_wrote(core, &claim);
    return exception;
}

bool gonio_fw_registers_walk(struct fw_core *core, bool (*visit)(void *context, uint16_t *word), void *context) {
    for (const struct descriptor *d = table; d < table + TABLE; d++)
        for (unsigned i = 0; d->access == ACCESS_P && i < d->count; i++) {
            uint16_t words[4];
            value_to_words((uint64_t)load(core, d, i), words_of(d), words);
            for (unsigned k = 0; k < words_of(d); k++)
                if (!visit(context, &words[k]))
                    return false;
            store(core, d, i, words_to_value(d, words));
        }
    return true;
}

bool gonio_fw_registers_valid(const struct fw_core *core) {
    for (const struct descriptor *d = table; d < table + TABLE; d++)
        for (unsigned i = 0; d->access == ACCESS_P && i < d->count; i++)
            if (!in_range(d, load((struct fw_core *)(uintptr_t)core, d, i)))
                return false;
    return true;
}
