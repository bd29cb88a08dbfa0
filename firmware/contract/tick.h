// SPDX-License-Identifier: BSD-3-Clause
// What a board provides to the core: time and the order of its interrupts.
//
// Priorities, highest first: inputs (gonio_fw_interlock_input), step timer, UART receiver (gonio_fw_modbus_receive),
// producer (gonio_fw_stepgen_produce); then the main loop (gonio_fw_core_poll). The step timer's interrupt puts
// core->step.edges on the pins (low nibble: step outputs up, high nibble: down), calls fw_stepgen_next and does what
// that returns, again while the next event is due already.
#ifndef FW_CONTRACT_TICK_H
#define FW_CONTRACT_TICK_H

#include <stdint.h>

struct fw_core;

// Ticks of 1 us, wrapping at 2^32. Any.
uint32_t gonio_fw_board_now(struct fw_core *core);
// Have the step timer interrupt at core->step.due. Main loop.
void gonio_fw_board_step_arm(struct fw_core *core);
// Keep the producer out, and let it in again; the step timer goes on. Main loop; they do not nest.
void gonio_fw_board_lock(struct fw_core *core);
void gonio_fw_board_unlock(struct fw_core *core);

#endif
