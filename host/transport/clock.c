// SPDX-License-Identifier: BSD-3-Clause
#include "host/transport/clock.h"

#include <errno.h>
#include <limits.h>
#include <time.h>

#include "base/clock.h"

int64_t gonio_clock_ms(void) { return gonio_clock_ns() / 1000000; }

void gonio_clock_sleep_ms(int ms) {
    struct timespec rest = {ms / 1000, ms % 1000 * 1000000L};
    while (ms > 0 && nanosleep(&rest, &rest) != 0 && errno == EINTR) {
    }
}

gonio_deadline gonio_deadline_in_ms(int64_t ms) { return (gonio_deadline){gonio_clock_ms() + ms}; }

gonio_deadline gonio_deadline_in_s(double seconds) {
    const double bounded = seconds > 0 ? (seconds < 86400 ? seconds : 86400) : 0;
    return gonio_deadline_in_ms((int64_t)(bounded * 1000));
}

int gonio_deadline_left_ms(gonio_deadline deadline) {
    const int64_t left = deadline.at_ms - gonio_clock_ms();
    return left < 0 ? 0 : left > INT_MAX ? INT_MAX : (int)left;
}
