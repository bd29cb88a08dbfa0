// SPDX-License-Identifier: BSD-3-Clause
// The registers of regmap.def as memory, and their access by address as Modbus has it.
#ifndef FW_REGISTERS_H
#define FW_REGISTERS_H

#include <stdbool.h>
#include <stdint.h>

struct fw_core;

struct fw_registers {
#define FW_TYPE_u16 uint16_t
#define FW_TYPE_u32 uint32_t
#define FW_TYPE_i32 int32_t
#define FW_TYPE_i64 int64_t
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text) FW_TYPE_##type name[count];
#include "firmware/regmap.def"
};

enum { FW_WRITE_MAX = 123 }; // words in one write

// Modbus exception codes (Application Protocol V1.1b3, section 7); 0: none.
enum fw_exception {
    FW_EXCEPTION_NONE = 0,
    FW_EXCEPTION_FUNCTION = 1,
    FW_EXCEPTION_ADDRESS = 2,
    FW_EXCEPTION_VALUE = 3,
    FW_EXCEPTION_FAILURE = 4, // refused: register refusal says why
    FW_EXCEPTION_BUSY = 6
};

// Every register to its initial value; parameters only, or all.
void gonio_fw_registers_initialise(struct fw_core *core, bool parameters_only);
// Read `count` words from `address`; values in a gap of the table, or half a value at an end, are an address error.
enum fw_exception gonio_fw_registers_read(struct fw_core *core, uint16_t address, uint16_t count, uint16_t *words);
// Whether such a read would succeed.
enum fw_exception gonio_fw_registers_readable(const struct fw_core *core, uint16_t address, uint16_t count);
// Check the whole write, and whether the channel in hand may write (core/owner.h), then carry it out: nothing is
// changed unless all of it is right, and the command at its end, the only thing that acts, is not refused.
enum fw_exception gonio_fw_registers_write(struct fw_core *core, uint16_t address, uint16_t count,
                                           const uint16_t *words);
// Call `visit` for each word of each parameter, in address order; false from it ends the walk and is returned.
bool gonio_fw_registers_walk(struct fw_core *core, bool (*visit)(void *context, uint16_t *word), void *context);
// Whether every parameter is within its range.
bool gonio_fw_registers_valid(const struct fw_core *core);

#endif
