// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/controller_map.h"

#include <stddef.h>

enum { SIGNED_u16 = 0, SIGNED_u32 = 0, SIGNED_i32 = 1, SIGNED_i64 = 1 };

static const controller_register_info registers[] = {
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    {#name, unit, text, address, CONTROLLER_WORDS_##type, count, SIGNED_##type, #access[0] == 'P', minimum, maximum},
#include "firmware/regmap.def"
};
enum { REGISTERS = sizeof registers / sizeof *registers };

const controller_register_info *gonio_controller_register_at(int number) {
    return number >= 0 && number < REGISTERS ? &registers[number] : NULL;
}

const controller_register_info *gonio_controller_register(int address) {
    for (int i = 0; i < REGISTERS; i++) {
        if (registers[i].address == address) {
            return &registers[i];
        }
    }
    return NULL;
}

const char *gonio_controller_state_text(int state) {
    switch (state) {
#define STATE(value, name, text)                                                                                       \
    case value:                                                                                                        \
        return text;
#include "firmware/regmap.def"
    }
    return "unknown";
}

const char *gonio_controller_alarm_name(int alarm) {
    switch (alarm) {
#define ALARM(value, name, text)                                                                                       \
    case value:                                                                                                        \
        return #name;
#include "firmware/regmap.def"
    }
    return "unknown";
}

const char *gonio_controller_alarm_text(int alarm) {
    switch (alarm) {
#define ALARM(value, name, text)                                                                                       \
    case value:                                                                                                        \
        return text;
#include "firmware/regmap.def"
    }
    return "unknown";
}

const char *gonio_controller_refusal_text(int refusal) {
    switch (refusal) {
#define REFUSAL(value, name, text)                                                                                     \
    case value:                                                                                                        \
        return text;
#include "firmware/regmap.def"
    }
    return "unknown";
}

const char *gonio_controller_cause_text(int cause) {
    switch (cause) {
#define CAUSE(value, name, text)                                                                                       \
    case value:                                                                                                        \
        return text;
#include "firmware/regmap.def"
    }
    return "unknown";
}

const char *gonio_controller_lamp_name(int lamp) {
    switch (lamp) {
#define LAMP(value, name, text)                                                                                        \
    case value:                                                                                                        \
        return #name;
#include "firmware/regmap.def"
    }
    return "unknown";
}
