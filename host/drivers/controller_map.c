// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/controller_map.h"

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
