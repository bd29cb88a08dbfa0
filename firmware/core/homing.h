// SPDX-License-Identifier: BSD-3-Clause
// Homing: for each axis in its order fast approach, back off, slow approach, hold, leave.
#ifndef FW_HOMING_H
#define FW_HOMING_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/core/enums.h"

struct fw_core;

enum fw_homing_phase {
    FW_HOMING_NONE,
    FW_HOMING_RELEASE, // it was pressed: away until it lets go
    FW_HOMING_RELEASED,
    FW_HOMING_FAST,
    FW_HOMING_OVERSHOOT, // decelerating after the fast approach
    FW_HOMING_BACK_OFF,
    FW_HOMING_SLOW,
    FW_HOMING_HOLD, // standing on the switch: does it hold?
    FW_HOMING_LEAVE
};

struct fw_homing {
    uint8_t left; // axes still to be homed
    uint8_t axis;
    uint8_t phase;           // enum fw_homing_phase
    uint8_t homed_before;    // axes that have been homed since start, so that a difference means something
    int64_t seen;            // where the fast approach met the switch
    uint32_t since;          // ms
    volatile uint16_t armed; // home contact that ends the slow approach in the interrupt
    volatile uint16_t edges; // changes of it since it was armed
};

// The HOME command, checked; begins it.
enum fw_refusal gonio_fw_homing_begin(struct fw_core *core);
// Main loop, in state HOMING. came_to_rest: a movement just ended.
void gonio_fw_homing_poll(struct fw_core *core, bool came_to_rest);
// Forget it; the axes keep what they had reached.
void gonio_fw_homing_abandon(struct fw_core *core);

#endif
