// SPDX-License-Identifier: BSD-3-Clause
// The k-th smallest against a full sort.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/order_statistic.h"

#define MOST 1000

static uint64_t seed = 11;
static uint64_t next(uint64_t limit) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (seed >> 33) % limit;
}

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

// The k-th is right, and nothing came or went.
static void assert_ranked(const double *values, size_t n, size_t k) {
    double sorted[MOST], work[MOST];
    memcpy(sorted, values, n * sizeof *values);
    memcpy(work, values, n * sizeof *values);
    qsort(sorted, n, sizeof *sorted, by_value);
    assert_true(gonio_order_statistic(work, n, k) == sorted[k]);
    qsort(work, n, sizeof *work, by_value);
    assert_memory_equal(work, sorted, n * sizeof *work);
}

// Every pattern of up to 4 distinct values, every k.
static void short_arrays(void **state) {
    (void)state;
    for (size_t n = 1; n <= 6; n++) {
        for (unsigned pattern = 0; pattern < 1u << 2 * n; pattern++) {
            double values[6];
            for (size_t i = 0; i < n; i++) {
                values[i] = pattern >> 2 * i & 3;
            }
            for (size_t k = 0; k < n; k++) {
                assert_ranked(values, n, k);
            }
        }
    }
}

static void long_arrays(void **state) {
    (void)state;
    static double values[MOST];
    for (int kind = 0; kind < 6; kind++) {
        for (int repeat = 0; repeat < 40; repeat++) {
            const size_t n = 1 + next(MOST);
            for (size_t i = 0; i < n; i++) {
                const double random = (double)next(1000000) - 5e5, up = (double)i;
                const double kinds[] = {random, (double)next(3), up, -up, 7, i % 2 ? up : (double)(n - i)};
                values[i] = kinds[kind];
            }
            assert_ranked(values, n, next(n));
            assert_ranked(values, n, 0);
            assert_ranked(values, n, n - 1);
            assert_ranked(values, n, n / 2);
        }
    }
}

static void infinities_are_numbers(void **state) {
    (void)state;
    const double values[] = {INFINITY, -1, -INFINITY, 1e308, INFINITY, 0};
    for (size_t k = 0; k < 6; k++) {
        assert_ranked(values, 6, k);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(short_arrays),
        cmocka_unit_test(long_arrays),
        cmocka_unit_test(infinities_are_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
