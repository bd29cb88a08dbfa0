// SPDX-License-Identifier: BSD-3-Clause
// The step timer's interrupt as the Cortex-M boards have it, put together by the compiler from what a board's pins and
// timer need: no calls, no tables.
//
// The timer fires early by the longest way into the interrupt; the clock itself then tells when to put the edges out.
// Events that are too near for the timer are waited for in the same interrupt. One turn of that loop takes about a tick
// at 50 MHz (firmware/tools/cycles.py counts it), so edges that follow each other tick by tick do not pile up.
#ifndef FW_CORTEX_M_STEP_H
#define FW_CORTEX_M_STEP_H

#include "firmware/board/cortex_m/cortex_m.h"

#define INLINE __attribute__((always_inline)) static inline

// In cycles of the processor.
struct step_timing {
    int32_t tick;
    int32_t entry; // the timer fires this much before an event
    int32_t near;  // an event nearer than this is waited for
    int32_t leave; // from the clock's last look to the pins, and how much early an edge may leave
};

INLINE void step_interrupt_with(struct step_timing timing, void (*put)(uint8_t edges), void (*arm)(uint32_t cycles)) {
    struct fw_stepgen *g = &fw_core.step;
    if (!g->running)
        return;
    int32_t left = cycles_until(g->due, (uint32_t)timing.tick);
    for (;;) {
        if (left < -timing.tick)
            fw_core.registers.late_edges[0]++;
        while (left > timing.leave)
            left = cycles_until(g->due, (uint32_t)timing.tick);
        if (!g->running)
            return;
        put(g->edges);
        const enum fw_step_action action = fw_stepgen_next(g);
        if (action != FW_STEP_ARM) {
            if (action == FW_STEP_END)
                return;
            SCB_ICSR = ICSR_PENDSVSET;
        }
        left = cycles_until(g->due, (uint32_t)timing.tick);
        if (left > timing.near) {
            arm((uint32_t)(left - timing.entry)); // once for nothing where a contact has just halted all
            return;
        }
    }
}

INLINE void step_arm_with(struct fw_core *core, struct step_timing timing, void (*arm)(uint32_t cycles)) {
    // The clock tells 2^23 cycles ahead: sit out what is longer (energise may be a second).
    while ((int32_t)(core->step.due - gonio_fw_board_now(core)) > 40000)
        gonio_fw_board_watchdog_feed(core);
    arm((uint32_t)(cycles_until(core->step.due, (uint32_t)timing.tick) - timing.entry));
}

#endif
