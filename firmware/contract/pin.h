// SPDX-License-Identifier: BSD-3-Clause
// What a board provides to the core: the outputs and inputs. Every contract function gets the core it works for (a
// microcontroller has one and may ignore it). "Any" means: also from interrupts.
#ifndef FW_CONTRACT_PIN_H
#define FW_CONTRACT_PIN_H

#include <stdbool.h>
#include <stdint.h>

struct fw_core;

// Stop the step timer and take all step outputs low. Any.
void gonio_fw_board_halt_steps(struct fw_core *core);
// Direction outputs, bit n: level of axis n. Main loop, between moves.
void gonio_fw_board_directions(struct fw_core *core, uint8_t levels);
// Motor enables, bit n: level of axis n; bit 4 + n: level of its brake, where the board has such an output. Any.
void gonio_fw_board_motors(struct fw_core *core, uint8_t levels);
// Raw levels of the contacts, bit n as regmap.def numbers them. Any.
uint16_t gonio_fw_board_inputs(struct fw_core *core);
// Have the input interrupt, which calls gonio_fw_interlock_input with gonio_fw_board_inputs, run as if a contact had
// changed. Main loop. The interrupt also comes at every change of a contact, and nothing preempts it.
void gonio_fw_board_inputs_pend(struct fw_core *core);
// Level of the shutter output. Any.
void gonio_fw_board_shutter(struct fw_core *core, bool high);
// Share of time at a high level of the lamp output, in 0.01 %. Any.
void gonio_fw_board_lamp(struct fw_core *core, uint16_t level);
// Level of the camera trigger output. Main loop.
void gonio_fw_board_trigger(struct fw_core *core, bool high);

#endif
