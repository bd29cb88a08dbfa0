// SPDX-License-Identifier: BSD-3-Clause
// The monotonic clock that every bound on a device is counted on.
#ifndef GONIO_TRANSPORT_CLOCK_H
#define GONIO_TRANSPORT_CLOCK_H

#include <stdint.h>

int64_t gonio_clock_ms(void);
void gonio_clock_sleep_ms(int ms);

// A moment by which a call must have ended.
typedef struct gonio_deadline {
    int64_t at_ms;
} gonio_deadline;
gonio_deadline gonio_deadline_in_ms(int64_t ms);
gonio_deadline gonio_deadline_in_s(double seconds);  // at most a day; below 0 is 0
int gonio_deadline_left_ms(gonio_deadline deadline); // never below 0

#endif
