// SPDX-License-Identifier: BSD-3-Clause
// The enumerations of regmap.def as C constants: FW_STATE_IDLE, FW_ALARM_NONE, FW_CONTACT_estop, ...
#ifndef FW_ENUMS_H
#define FW_ENUMS_H

enum fw_command {
#define COMMAND(value, name, text) FW_COMMAND_##name = (value),
#include "firmware/regmap.def"
};
enum fw_state {
#define STATE(value, name, text) FW_STATE_##name = (value),
#include "firmware/regmap.def"
};
enum fw_alarm {
#define ALARM(value, name, text) FW_ALARM_##name = (value),
#include "firmware/regmap.def"
};
enum fw_refusal {
#define REFUSAL(value, name, text) FW_REFUSAL_##name = (value),
#include "firmware/regmap.def"
};
enum fw_lamp_state {
#define LAMP(value, name, text) FW_LAMP_##name = (value),
#include "firmware/regmap.def"
};
enum fw_cause {
#define CAUSE(value, name, text) FW_CAUSE_##name = (value),
#include "firmware/regmap.def"
};
enum fw_contact {
#define CONTACT(address, name, text) FW_CONTACT_##name = (address),
#include "firmware/regmap.def"
    FW_CONTACTS
};
enum fw_coil {
#define COIL(address, name, text) FW_COIL_##name = (address),
#include "firmware/regmap.def"
    FW_COILS
};
enum fw_output {
#define OUTPUT(address, name, text) FW_OUTPUT_##name = (address),
#include "firmware/regmap.def"
};
// FW_REGISTER_position: the address.
enum fw_register {
#define REGISTER(address, name, type, count, access, unit, minimum, maximum, initial, text)                            \
    FW_REGISTER_##name = (address),
#include "firmware/regmap.def"
};

#endif
