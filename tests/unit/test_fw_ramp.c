// SPDX-License-Identifier: BSD-3-Clause
// The ramp against the closed form of its seven phases, and its limits.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>

#include <cmocka.h>

#include "firmware/core/ramp.h"
#include "tests/unit/fw_reference.h"

static const struct fw_ramp_limits cases[] = {
    {0.2, 5.0, 500.0},    // all seven phases
    {0.2, 5.0, 0.0},      // trapezoid
    {0.2, 0.001, 0.0},    // triangle
    {100.0, 1000.0, 1e6}, // short: neither speed nor acceleration reached
    {0.01, 10.0, 1e5},    // long cruise
    {2e-5, 1.0, 1.0},     // fourteen hours
    {3.0, 40.0, 90.0},    // acceleration not reached
    {1e5, 1e7, 1e12},     // shorter than a segment
};
enum { CASES = sizeof cases / sizeof cases[0] };

static long double at(const struct fw_ramp *ramp, uint32_t time) {
    return (long double)gonio_fw_ramp_at(ramp, time) / (1ull << FW_RAMP_FRACTION_BITS);
}

static void follows_the_closed_form(void **state) {
    (void)state;
    for (unsigned i = 0; i < CASES; i++) {
        struct fw_ramp ramp;
        assert_true(gonio_fw_ramp_plan(&ramp, &cases[i]));
        const struct reference reference = reference_of(&ramp);
        const uint32_t step = ramp.duration / 5000 + 1;
        long double before = 0.0L;
        for (uint32_t time = 0; time <= ramp.duration; time += step) {
            const long double s = at(&ramp, time), exact = reference_at(&reference, time * (FW_SEGMENT_TICKS / 2.0L));
            assert_true(fabsl(s - exact) < 1e-15L);
            assert_true(s >= before - 1e-15L);
            before = s;
        }
        assert_true(gonio_fw_ramp_at(&ramp, 0) == 0);
        assert_true(gonio_fw_ramp_at(&ramp, ramp.duration) == 1ull << FW_RAMP_FRACTION_BITS);
        assert_true(gonio_fw_ramp_at(&ramp, UINT32_MAX) == 1ull << FW_RAMP_FRACTION_BITS);
    }
}

static void keeps_the_limits(void **state) {
    (void)state;
    for (unsigned i = 0; i < CASES; i++) {
        struct fw_ramp ramp;
        assert_true(gonio_fw_ramp_plan(&ramp, &cases[i]));
        const struct reference reference = reference_of(&ramp);
        const long double tick = 1e-6L, slack = 1.0L + 1e-12L;
        assert_true(reference.speed / tick <= cases[i].speed * slack);
        assert_true(reference.acceleration / (tick * tick) <= cases[i].acceleration * slack);
        if (cases[i].jerk > 0.0)
            assert_true(reference.jerk / (tick * tick * tick) <= cases[i].jerk * slack);
    }
}

// Rounding the phases up costs less than a segment each: at most 4 jerk, 2 acceleration phases and a cruise.
static void wastes_no_time(void **state) {
    (void)state;
    const struct {
        struct fw_ramp_limits limits;
        double seconds; // by hand
    } known[] = {
        {{0.2, 5.0, 500.0}, 5.0 + 0.04 + 0.01},      // 1/v + v/a + a/j
        {{0.2, 5.0, 0.0}, 5.0 + 0.04},               // 1/v + v/a
        {{0.2, 0.001, 0.0}, 2.0 * sqrt(1000.0)},     // 2 sqrt(1/a)
        {{3.0, 40.0, 90.0}, 4.0 * cbrt(0.5 / 90.0)}, // 4 (1/(2 j))^(1/3)
    };
    for (unsigned i = 0; i < sizeof known / sizeof known[0]; i++) {
        struct fw_ramp ramp;
        assert_true(gonio_fw_ramp_plan(&ramp, &known[i].limits));
        const double late = gonio_fw_ramp_seconds(&ramp) - known[i].seconds;
        assert_true(late >= -1e-9 && late < 7 * 256e-6);
    }
}

static void refuses_what_takes_days(void **state) {
    (void)state;
    const struct fw_ramp_limits limits = {1e-6, 1.0, 1.0};
    struct fw_ramp ramp;
    assert_false(gonio_fw_ramp_plan(&ramp, &limits));
}

static void cut_follows_on_and_ends_early(void **state) {
    (void)state;
    for (unsigned i = 0; i < CASES; i++) {
        struct fw_ramp ramp, cut;
        assert_true(gonio_fw_ramp_plan(&ramp, &cases[i]));
        for (unsigned part = 0; part <= 64; part++) {
            const uint32_t time = (uint32_t)((uint64_t)ramp.duration * part / 64) & ~1u;
            gonio_fw_ramp_cut(&cut, &ramp, time);
            assert_true(cut.duration <= ramp.duration && cut.duration >= time);
            assert_true(cut.end <= (1ull << FW_RAMP_FRACTION_BITS) + 1000);
            for (uint32_t k = 0; k <= 16; k++) {
                const uint32_t sample = (uint32_t)((uint64_t)time * k / 16);
                assert_true(fabsl(at(&cut, sample) - at(&ramp, sample)) < 1e-15L);
            }
            const struct reference was = reference_of(&ramp), is = reference_of(&cut);
            const long double slack = 1.0L + 1e-12L;
            assert_true(is.speed <= was.speed * slack && is.acceleration <= was.acceleration * slack);
            assert_true(is.jerk <= was.jerk * slack);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(follows_the_closed_form), cmocka_unit_test(keeps_the_limits),
                                       cmocka_unit_test(wastes_no_time), cmocka_unit_test(refuses_what_takes_days),
                                       cmocka_unit_test(cut_follows_on_and_ends_early)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
