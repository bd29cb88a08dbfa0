// SPDX-License-Identifier: BSD-3-Clause
// What a board provides to the core: the watchdog and the way to start anew.
#ifndef FW_CONTRACT_WATCHDOG_H
#define FW_CONTRACT_WATCHDOG_H

#include <stdint.h>

struct fw_core;

// Reset the processor unless fed every ms milliseconds. Main loop, at start.
void gonio_fw_board_watchdog_start(struct fw_core *core, uint32_t ms);
void gonio_fw_board_watchdog_feed(struct fw_core *core);
// Reset now; the next start reports cause COMMAND. Main loop.
void gonio_fw_board_restart(struct fw_core *core);
// For self_test 0xFA17: cause a processor fault. Main loop.
void gonio_fw_board_fault(struct fw_core *core);

#endif
