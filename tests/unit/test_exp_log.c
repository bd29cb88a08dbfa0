// SPDX-License-Identifier: BSD-3-Clause
// The vector functions of evaluation over the whole range of float: every exponent, both signs, each function within
// 0.50001 units in the last place of float, and within 8 of double, of libm's in long double.
// tests/bench/exp_log_range.c goes through all floats.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/exp_log.h"
#include "tests/unit/near.h"

// Every STRIDE-th float, a prime, so that no pattern of mantissas is left out: 2^32 / 2053 = 2.1 million.
#define STRIDE 2053u

typedef void function(gonio_d4 *x);

static void exp4(gonio_d4 *x) { gonio_exp4(x); }
static void log4(gonio_d4 *x) { gonio_log4(x); }
static void sinh4(gonio_d4 *x) { gonio_sinh4(x); }
static void asinh4(gonio_d4 *x) { gonio_asinh4(x); }
static void turns4(gonio_d4 *x) {
    const gonio_d4 s = {sin((*x)[0]), sin((*x)[1]), sin((*x)[2]), sin((*x)[3])};
    const gonio_d4 c = {cos((*x)[0]), cos((*x)[1]), cos((*x)[2]), cos((*x)[3])};
    gonio_quarter_turns4(&s, &c, x);
}

static long double turns(long double x) { return x / 1.570796326794896619231321691639751442L; }

// Largest error in units in the last place of float, and in the unit 2^-53 of the value.
typedef struct errors {
    double narrow, wide;
    size_t n;
} errors;

static double unit_of(long double exact) {
    int exponent;
    frexpl(exact, &exponent);
    return ldexp(1, exponent - 24 < -149 ? -149 : exponent - 24);
}

static void measure(function *f, long double (*exact)(long double), const float x[4], double floor, errors *e) {
    gonio_d4 y = {(double)x[0], (double)x[1], (double)x[2], (double)x[3]};
    f(&y);
    for (int k = 0; k < 4; k++) {
        const long double want = exact((long double)x[k]);
        const double off = (double)fabsl((long double)y[k] - want), size = fmax((double)fabsl(want), floor);
        e->narrow =
            fmax(e->narrow, (double)fabsl((long double)(float)y[k] - want) / unit_of(fmaxl(fabsl(want), floor)));
        e->wide = size > 0 ? fmax(e->wide, off / size * 0x1p53) : e->wide;
        e->n++;
    }
}

// floor: below it the error counts as absolute.
static errors sweep(function *f, long double (*exact)(long double), float low, float high, double floor) {
    errors e = {0};
    float x[4];
    int filled = 0;
    for (uint64_t bits = 0; bits <= UINT32_MAX; bits += STRIDE) {
        const uint32_t word = (uint32_t)bits;
        float value;
        memcpy(&value, &word, sizeof value);
        if (!(value >= low && value <= high)) {
            continue;
        }
        x[filled++] = value;
        if (filled == 4) {
            measure(f, exact, x, floor, &e);
            filled = 0;
        }
    }
    return e;
}

static void hold(const char *name, errors e) {
    print_message("# %s: %zu floats, %.6f units of float, %.2f units of double\n", name, e.n, e.narrow, e.wide);
    assert_true(e.n > 100000 && e.narrow <= 0.50001 && e.wide <= 8);
}

static void test_errors_over_all_floats(void **state) {
    (void)state;
    hold("exp", sweep(exp4, expl, -103.0F, 88.7F, 0)); // down to the smallest subnormal
    hold("ln", sweep(log4, logl, 0x1p-149F, 0x1.fffffep127F, 0));
    hold("sinh", sweep(sinh4, sinhl, -89.0F, 89.0F, 0));
    hold("asinh", sweep(asinh4, asinhl, 0, 0x1.fffffep127F, 1));
    hold("quarter turns", sweep(turns4, turns, 0, 1.5707963F, 0));
}

// Lanes do not know of each other, and what lies beyond the range is held.
static void test_lanes_and_ends(void **state) {
    (void)state;
    gonio_d4 x = {0, 1, -800, 800}, y;
    gonio_exp4(&x);
    assert_near(x[0], 1, 0);
    assert_near(x[1], exp(1), 1e-15);
    assert_near(x[2] / exp(-708), 1, 1e-13);
    assert_near(x[3] / exp(709), 1, 1e-13);
    x = (gonio_d4){NAN, INFINITY, -INFINITY, 0.5};
    gonio_exp4(&x);
    assert_true(isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]));
    x = (gonio_d4){0.3, 0.3, 0.3, 0.3};
    y = (gonio_d4){-5, 20, 0.3, 700};
    gonio_exp4(&x);
    gonio_exp4(&y);
    const double a = x[0], b = y[2];
    assert_memory_equal(&a, &b, sizeof a);
}

#ifdef GONIO_WIDE
#define WIDE_FORM(name)                                                                                                \
    GONIO_WIDE_TARGET static void name##_wide(gonio_d8 *x) { gonio_##name##8(x); }
WIDE_FORM(exp)
WIDE_FORM(log)
WIDE_FORM(sinh)
WIDE_FORM(asinh)

static void compare_wide(void (*wide)(gonio_d8 *), function *narrow, double low, double high) {
    for (int n = 0; n < 20000; n++) {
        double eight[8], four[8];
        for (int k = 0; k < 8; k++) {
            eight[k] = four[k] = low + (high - low) * (8 * n + k) / 160000;
        }
        wide((gonio_d8 *)eight);
        narrow((gonio_d4 *)four);
        narrow((gonio_d4 *)(four + 4));
        assert_memory_equal(eight, four, sizeof eight);
    }
}
#endif

static void test_eight_lanes_give_the_bits_of_four(void **state) {
    (void)state;
#ifdef GONIO_WIDE
    if (GONIO_WIDE) {
        compare_wide(exp_wide, exp4, -720, 720);
        compare_wide(log_wide, log4, 1e-3, 1e3);
        compare_wide(sinh_wide, sinh4, -90, 90);
        compare_wide(asinh_wide, asinh4, 0, 100);
        return;
    }
#endif
    print_message("no vectors of eight doubles here\n");
    skip();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_errors_over_all_floats),
        cmocka_unit_test(test_lanes_and_ends),
        cmocka_unit_test(test_eight_lanes_give_the_bits_of_four),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
