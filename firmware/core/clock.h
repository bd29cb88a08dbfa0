// SPDX-License-Identifier: BSD-3-Clause
// Time in ticks of 1 us, in 32 bits that wrap every 71 minutes; this is the one place that compares them.
#ifndef FW_CLOCK_H
#define FW_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

#define FW_TICK_HZ 1000000u

// Whether a is before b; right as long as they are less than 2^31 ticks apart.
static inline bool fw_before(uint32_t a, uint32_t b) { return (int32_t)(a - b) < 0; }

#endif
