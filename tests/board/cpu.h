// SPDX-License-Identifier: BSD-3-Clause
// A Cortex-M0+ around Unicorn's instructions: their cycles, exceptions by priority, SysTick, NVIC, and the boot ROM's
// functions that the firmware calls.
#ifndef TESTS_BOARD_CPU_H
#define TESTS_BOARD_CPU_H

#include <unicorn/unicorn.h>

#include "tests/board/rp2040.h"

enum { EXCEPTIONS = 16 + 32, COST_WORDS = RP_SRAM_SIZE / 2, FAULT = 3, PENDSV = 14, SYSTICK = 15 };

struct cpu {
    uc_engine *engine;
    struct rp2040 chip;
    uint8_t *flash, *sram, *rom;
    uint8_t cost[COST_WORDS]; // of the block that begins there; 0: not yet known
    uint64_t stop_at;         // cycles
    uint64_t horizon;         // until when no block need look around; 0: at the next
    uint64_t stopped_block;   // a block that was stopped before it ran, and has been counted
    uint32_t vtor, icsr_pending, enabled, latched, priority[8], shpr3;
    unsigned active[8], depth; // exceptions, the outermost first
    bool systick_on;
    uint64_t systick_from, systick_wrap;
    bool dead;
    bool aligned; // look at each access to memory: ARMv6-M knows none that is not aligned
};

// flash: RP_FLASH_SIZE bytes, which the program erases and programs.
bool cpu_open(struct cpu *c, uint8_t *flash);
void cpu_close(struct cpu *c);
// As the boot ROM starts from flash: the second stage from memory. False: its checksum is wrong.
bool cpu_boot(struct cpu *c, uint32_t reason);
// Run until so many cycles have passed in all, with the restarts that the watchdog causes. False: it died.
bool cpu_run(struct cpu *c, uint64_t cycles);

#endif
