// SPDX-License-Identifier: BSD-3-Clause
// Lamp with soft start and warm-up, shutter, photodiode monitor, camera trigger.
#ifndef FW_LAMP_H
#define FW_LAMP_H

#include <stdbool.h>
#include <stdint.h>

struct fw_core;

struct fw_lamp {
    volatile bool on, open;   // as wanted: the coils
    volatile uint16_t output; // drive in 0.01 %
    volatile uint8_t state;   // enum fw_lamp_state
    uint32_t drive;           // drive in 0.01 %, 16 fraction bits
    uint32_t since;           // ms, of WARMING
    uint32_t sum;             // of photodiode readings
    uint16_t readings;
    int64_t first_us; // of the first of them
    bool pulsing;
    uint32_t pulse_since; // ms
};

// Switch on or off; refused (false) unless the machine is free of alarms. Off is never refused.
bool gonio_fw_lamp_switch(struct fw_core *core, bool on);
bool gonio_fw_lamp_shutter(struct fw_core *core, bool open);
// Begin a camera trigger pulse.
void gonio_fw_lamp_trigger(struct fw_core *core);
// Drive to safe_lamp, or to nothing where the interlock has it dark; shutter closed. Any.
void gonio_fw_lamp_safe(struct fw_core *core);
// Lamp, shutter and trigger to what they should be, at the levels that output_invert asks for. Any.
void gonio_fw_lamp_outputs(struct fw_core *core);
// Lamp and shutter outputs off, whatever the lamp should be: for the processor fault handler.
void gonio_fw_lamp_dark(struct fw_core *core);
// Once a millisecond, from the main loop.
void gonio_fw_lamp_poll(struct fw_core *core);

#endif
