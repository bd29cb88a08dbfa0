// SPDX-License-Identifier: BSD-3-Clause
// The monotonic clock: never set back, counts while the machine runs.
#ifndef GONIO_BASE_CLOCK_H
#define GONIO_BASE_CLOCK_H

#include <stdint.h>
#include <time.h>

static inline int64_t gonio_clock_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static inline double gonio_clock_s(void) { return 1e-9 * (double)gonio_clock_ns(); }

#endif
