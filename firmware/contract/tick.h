// What a board provides to the core: time and the order of its interrupts.
//
// Priorities, highest first: inputs (fw_interlock_input), step timer, UART receiver (fw_modbus_receive), producer
// (fw_stepgen_produce); then the main loop (fw_core_poll). The step timer's interrupt puts core->step.edges on the pins
// (low nibble: step outputs up, high nibble: down), calls fw_stepgen_next and does what that returns, again while the
// next event is due already.
#ifndef FW_CONTRACT_TICK_H
#define FW_CONTRACT_TICK_H

#include <stdint.h>

struct fw_core;

// Ticks of 1 us, wrapping at 2^32. Any.
uint32_t fw_board_now(struct fw_core *core);
// Have the step timer interrupt at core->step.due. Main loop.
void fw_board_step_arm(struct fw_core *core);
// Keep the producer out, and let it in again; the step timer goes on. Main loop; they do not nest.
void fw_board_lock(struct fw_core *core);
void fw_board_unlock(struct fw_core *core);

#endif
