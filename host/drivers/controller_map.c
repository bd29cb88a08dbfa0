// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/controller_map.h"

#include <stddef.h>

enum { SIGNED_u16 = 0, SIGNED_u32 = 0, SIGNED_i32 = 1, SIGNED_i64 = 1 };

const controller_register_info *gonio_controller_register(int address) {
    static const controller_register_info registers[] = {
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    {address, CONTROLLER_WORDS_##type, SIGNED_##type, minimum, maximum},
#include "firmware/regmap.def"
    };
    for (size_t i = 0; i < sizeof registers / sizeof *registers; i++) {
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
