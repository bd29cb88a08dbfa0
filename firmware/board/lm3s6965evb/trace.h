// SPDX-License-Identifier: BSD-3-Clause
// A variant of the program (FW_TRACE) that moves by itself and tells, by semihosting, when its step edges really left.
// What it adds to the step interrupt is half a dozen instructions, so that the timing stays what it is without.
#ifndef FW_TRACE_H
#define FW_TRACE_H

#include <stdint.h>

#include "firmware/board/cortex_m/cortex_m.h"

#ifdef FW_TRACE
// Where the next event is noted, clock in the upper 24 bits, edges in the lower 8; at trace_end: nowhere.
extern uint32_t *volatile trace_at;
extern uint32_t *const trace_end;

// An event is on the pins.
static inline void trace_edges(uint8_t edges) {
    uint32_t *at = trace_at;
    if (at != trace_end) {
        *at = SYST_CVR << 8 | edges;
        trace_at = at + 1;
    }
}
void trace_poll(void);
#else
static inline void trace_edges(uint8_t edges) { (void)edges; }
static inline void trace_poll(void) {}
#endif

#endif
