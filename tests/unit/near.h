// SPDX-License-Identifier: BSD-3-Clause
// cmocka compares floats only; this compares doubles, within an absolute tolerance, and shows both.
#ifndef GONIO_TESTS_NEAR_H
#define GONIO_TESTS_NEAR_H

#include <math.h>

#define assert_near(actual, expected, tolerance)                                                                       \
    do {                                                                                                               \
        const double near_a = (actual), near_e = (expected), near_t = (tolerance);                                     \
        if (!(fabs(near_a - near_e) <= near_t)) {                                                                      \
            fail_msg("%s: %.17g, expected %.17g within %.3g", #actual, near_a, near_e, near_t);                        \
        }                                                                                                              \
    } while (0)

#endif
