// SPDX-License-Identifier: BSD-3-Clause
// The monotonic clock: never set back, counts while the machine runs. And the wall clock.
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

// What a thread has computed, and what all of the process have, in seconds of a processor: others' load is no part of
// it.
static inline double gonio_clock_cpu_s(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
static inline double gonio_clock_thread_s(void) { return gonio_clock_cpu_s(CLOCK_THREAD_CPUTIME_ID); }
static inline double gonio_clock_process_s(void) { return gonio_clock_cpu_s(CLOCK_PROCESS_CPUTIME_ID); }

// The wall clock, seconds since 1970: may be set, and is for people.
static inline double gonio_clock_utc_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

#endif
