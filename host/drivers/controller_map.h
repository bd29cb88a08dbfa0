// SPDX-License-Identifier: BSD-3-Clause
// The controller's register table as the host sees it: compiled from firmware/regmap.def, never copied.
#ifndef GONIO_DRIVERS_CONTROLLER_MAP_H
#define GONIO_DRIVERS_CONTROLLER_MAP_H

#include <stdbool.h>
#include <stdint.h>

enum { CONTROLLER_WORDS_u16 = 1, CONTROLLER_WORDS_u32 = 2, CONTROLLER_WORDS_i32 = 2, CONTROLLER_WORDS_i64 = 4 };

// CONTROLLER_position: its address; CONTROLLER_SIZE_position: its words; CONTROLLER_EACH_position: words of one value.
enum controller_register {
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    CONTROLLER_##name = (address), CONTROLLER_SIZE_##name = (count)*CONTROLLER_WORDS_##type,                           \
    CONTROLLER_EACH_##name = CONTROLLER_WORDS_##type,
#include "firmware/regmap.def"
};
// What a read-only register must say, e.g. CONTROLLER_INITIAL_magic.
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    static const int64_t CONTROLLER_INITIAL_##name __attribute__((unused)) = (initial);
#include "firmware/regmap.def"

enum controller_command {
#define COMMAND(value, name, text) CONTROLLER_COMMAND_##name = (value),
#include "firmware/regmap.def"
};
enum controller_state {
#define STATE(value, name, text) CONTROLLER_STATE_##name = (value),
#include "firmware/regmap.def"
};
enum controller_alarm {
#define ALARM(value, name, text) CONTROLLER_ALARM_##name = (value),
#include "firmware/regmap.def"
};
enum controller_refusal {
#define REFUSAL(value, name, text) CONTROLLER_REFUSAL_##name = (value),
#include "firmware/regmap.def"
};
enum controller_lamp {
#define LAMP(value, name, text) CONTROLLER_LAMP_##name = (value),
#include "firmware/regmap.def"
};
enum controller_contact {
#define CONTACT(address, name, text) CONTROLLER_CONTACT_##name = (address),
#include "firmware/regmap.def"
};
enum controller_output {
#define OUTPUT(address, name, text) CONTROLLER_OUTPUT_##name = (address),
#include "firmware/regmap.def"
};
enum controller_coil {
#define COIL(address, name, text) CONTROLLER_COIL_##name = (address),
#include "firmware/regmap.def"
};

// A register: words of one value and how many values it has (one an axis), whether they may be negative, its bounds
// (equal: any), and whether it is a parameter.
typedef struct controller_register_info {
    const char *name, *unit, *text;
    int address, words, count;
    bool is_signed, parameter;
    int64_t minimum, maximum;
} controller_register_info;
const controller_register_info *gonio_controller_register(int address);   // by its first word; NULL: none
const controller_register_info *gonio_controller_register_at(int number); // in the table's order; NULL past the last

// Names and texts of the numbers; "unknown" where the table has none. Static storage.
const char *gonio_controller_state_text(int state);
const char *gonio_controller_alarm_name(int alarm);
const char *gonio_controller_alarm_text(int alarm);
const char *gonio_controller_refusal_text(int refusal);
const char *gonio_controller_cause_text(int cause);
const char *gonio_controller_lamp_name(int lamp);

#endif
