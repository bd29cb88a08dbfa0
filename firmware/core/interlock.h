// SPDX-License-Identifier: BSD-3-Clause
// Interlock: contacts, alarms and the safe state.
#ifndef FW_INTERLOCK_H
#define FW_INTERLOCK_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/core/enums.h"

struct fw_core;

enum { FW_CONTACTS_HOME = 0x000F, FW_CONTACTS_MIN = 0x00F0, FW_CONTACTS_MAX = 0x0F00, FW_NO_AXIS = 0xFFFF };

struct fw_interlock {
    volatile uint16_t active; // contacts
    volatile bool estop;      // pressed since the main loop looked
    volatile bool dark;       // until CLEAR the lamp stays off, whatever safe_lamp is
    bool hot;                 // OVERHEAT or SENSOR since the last CLEAR, also beside another alarm
    volatile uint16_t limit;  // limit contacts that stopped a movement since the main loop looked
};

// From the input interrupt: react to the contacts' raw levels, in the interrupt, before anything else.
void gonio_fw_interlock_input(struct fw_core *core, uint16_t raw);
// Whether the contacts are otherwise than the last interrupt found them. Main loop.
bool gonio_fw_interlock_differs(struct fw_core *core);
// Main loop.
void gonio_fw_interlock_poll(struct fw_core *core);
// Stop (decelerating, or at once), make safe and latch the alarm. Main loop.
void gonio_fw_interlock_alarm(struct fw_core *core, enum fw_alarm alarm, unsigned axis, bool halt);
// Lamp, shutter and motors to their configured safe state; the lamp off where `dark`. Any.
void gonio_fw_interlock_safe(struct fw_core *core);
// The CLEAR command.
enum fw_refusal gonio_fw_interlock_clear(struct fw_core *core);
// For the processor fault handler: step outputs, lamp, shutter and all motors off, whatever is configured, trusting
// nothing in memory.
void gonio_fw_interlock_fault(struct fw_core *core);

#endif
