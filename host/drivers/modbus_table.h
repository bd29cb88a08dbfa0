// SPDX-License-Identifier: BSD-3-Clause
// How a stepper drive of another maker is talked to over Modbus: a small table of registers, conditions and commands.
//
// A register is ADDRESS[:TYPE], with TYPE u16 (where none is given), s16, u32 or s32; @ before it where a slave with
// several axes has it once, for all of them. A condition is a register, [& MASK], [== NUMBER] (else: not 0); several
// stand behind |, of which one must hold. A command is what is written, one after the other behind &&: REGISTER =
// NUMBER, or `target`, or `speed`. Numbers are decimal or 0x.
#ifndef GONIO_DRIVERS_MODBUS_TABLE_H
#define GONIO_DRIVERS_MODBUS_TABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/keys.h"

enum { GONIO_MODBUS_TERMS = 6, GONIO_MODBUS_WRITES = 12, GONIO_MODBUS_FAULTS = 48, GONIO_MODBUS_TEXT = 256 };

typedef struct gonio_modbus_register {
    bool there, shared, is_signed;
    int address, words;
} gonio_modbus_register;

typedef struct gonio_modbus_condition {
    int n; // 0: it says nothing
    struct gonio_modbus_term {
        gonio_modbus_register at;
        uint32_t mask, value;
        bool equals; // to `value`; else: not 0
    } terms[GONIO_MODBUS_TERMS];
} gonio_modbus_condition;

typedef enum gonio_modbus_what { GONIO_MODBUS_NUMBER, GONIO_MODBUS_TARGET, GONIO_MODBUS_SPEED } gonio_modbus_what;

typedef struct gonio_modbus_command {
    int n;
    struct gonio_modbus_item {
        gonio_modbus_what what;
        gonio_modbus_register at; // of a number
        int64_t value;
    } writes[GONIO_MODBUS_WRITES];
} gonio_modbus_command;

typedef struct gonio_modbus_faults {
    int n;
    struct {
        uint32_t number;
        char text[56];
    } texts[GONIO_MODBUS_FAULTS];
} gonio_modbus_faults;

typedef struct gonio_modbus_table {
    int read, write; // functions: 3 or 4; 6 or 16
    int low_first;   // of two words
    gonio_modbus_register target, speed, position, fault;
    gonio_modbus_command open, move, home, stop, reset;
    gonio_modbus_condition moving, homed, alarm, arrived, limit;
    gonio_modbus_faults faults; // of the register `fault`
} gonio_modbus_table;

extern const gonio_key gonio_modbus_table_keys[]; // in the section ""
// The same keys, in the same order, as texts of a rig file's section [drive], which are taken after the table's.
typedef struct gonio_modbus_texts {
    char read[GONIO_MODBUS_TEXT], write[GONIO_MODBUS_TEXT], words[GONIO_MODBUS_TEXT], target[GONIO_MODBUS_TEXT],
        speed[GONIO_MODBUS_TEXT], position[GONIO_MODBUS_TEXT], fault[GONIO_MODBUS_TEXT], open[GONIO_MODBUS_TEXT],
        move[GONIO_MODBUS_TEXT], home[GONIO_MODBUS_TEXT], stop[GONIO_MODBUS_TEXT], reset[GONIO_MODBUS_TEXT],
        moving[GONIO_MODBUS_TEXT], homed[GONIO_MODBUS_TEXT], alarm[GONIO_MODBUS_TEXT], arrived[GONIO_MODBUS_TEXT],
        limit[GONIO_MODBUS_TEXT], faults[GONIO_MODBUS_TEXT];
} gonio_modbus_texts;

// A table that Gonio brings (leadshine, oriental-az) or, where the name has a dot or a slash, a file: lines
// `key = value`, comments after ; or #; "": none. Then the texts that are not empty. GONIO_E_INPUT, with the file's
// line where it is one.
gonio_status gonio_modbus_table_read(const char *name, const gonio_modbus_texts *texts, gonio_modbus_table *table,
                                     gonio_error *error);
// What a number in the register `fault` means, one fault or the bits of several; "" where the table does not say.
void gonio_modbus_fault_text(const gonio_modbus_table *table, uint32_t number, char *text, size_t size);

// Words and back.
void gonio_modbus_pack(const gonio_modbus_table *table, const gonio_modbus_register *at, int64_t value,
                       uint16_t words[2]);
int64_t gonio_modbus_unpack(const gonio_modbus_table *table, const gonio_modbus_register *at, const uint16_t words[2]);

#endif
