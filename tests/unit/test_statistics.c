// SPDX-License-Identifier: BSD-3-Clause
// Medians and quantiles against a full sort; the generator against numbers of its paper's reference code; the nearest
// against all distances in order.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/nearest.h"
#include "base/random.h"
#include "base/statistics.h"

#define MOST 300

// Few different values, so that many are equal, and of both signs.
static void draw(uint64_t seed, size_t n, double *values) {
    for (size_t i = 0; i < n; i++) {
        const double u = gonio_random_uniform(seed * 1000 + i);
        values[i] = seed % 2 == 0 ? u - 0.5 : floor(6 * u) - 3;
    }
}

static void medians_are_those_of_the_sorted(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 400; seed++) {
        double values[MOST], sorted[MOST];
        const size_t n = 1 + seed % MOST;
        draw(seed, n, values);
        memcpy(sorted, values, sizeof sorted);
        gonio_sort(sorted, n);
        for (size_t i = 1; i < n; i++) {
            assert_true(sorted[i - 1] <= sorted[i]);
        }
        float few[MOST];
        for (size_t i = 0; i < n; i++) {
            few[i] = (float)values[i];
        }
        const double middle = n % 2 == 1 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);
        assert_true(gonio_median(values, n) == middle);
        assert_true(gonio_upper_median(values, n) == sorted[n / 2]);
        for (int k = 0; k <= 10; k++) {
            const size_t at = (size_t)(0.1 * k * (double)(n - 1) + 0.5);
            assert_true(gonio_quantile_f32(few, n, 0.1 * k) == (float)sorted[at]);
        }
        gonio_sort(values, n);
        assert_memory_equal(values, sorted, n * sizeof *values); // nothing came or went
    }
    assert_true(gonio_median(NULL, 0) == 0 && gonio_upper_median(NULL, 0) == 0 &&
                gonio_quantile_f32(NULL, 0, 0.5) == 0);
}

static void robust_spread_of_a_normal(void **state) {
    (void)state;
    enum { n = 20001 };
    float *values = malloc(n * sizeof *values), *before = malloc(n * sizeof *values);
    for (uint64_t i = 0; i < n; i++) {
        const double u = gonio_random_uniform(2 * i) + 0x1p-54, v = gonio_random_uniform(2 * i + 1);
        values[i] = i % 20 == 0 ? 1e6F : (float)(7 + 2 * sqrt(-2 * log(u)) * cos(6.283185307179586 * v));
    }
    memcpy(before, values, n * sizeof *values);
    double median, sigma;
    assert_int_equal(gonio_median_mad_f32(values, n, &median, &sigma, NULL), GONIO_OK);
    assert_memory_equal(before, values, n * sizeof *values);
    // A twentieth far above moves the median to the normal's 0.526-quantile, 7 + 2 x 0.066, and the deviation's by 6 %.
    assert_true(fabs(median - 7.13) < 0.07);
    assert_true(fabs(sigma - 2.14) < 0.1);
    free(values);
    free(before);
}

// The first outputs of SplitMix64 with seed 1234567, as the generators' published test vectors give them.
static void split_mix_is_the_published_one(void **state) {
    (void)state;
    static const uint64_t expected[] = {6457827717110365317u, 3203168211198807973u, 9817491932198370423u,
                                        4593380528125082431u, 16408922859458223821u};
    uint64_t stream = 1234567;
    for (uint64_t i = 0; i < 5; i++) {
        assert_true(gonio_random(1234567 + i * GONIO_RANDOM_STEP) == expected[i]);
        assert_true(gonio_random_next(&stream) == (double)(expected[i] >> 11) * 0x1p-53);
    }
}

static void nearest_are_the_first_of_the_sorted(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 300; seed++) {
        double values[MOST], sorted[MOST];
        const size_t n = 1 + seed % MOST, wanted = 1 + seed % GONIO_NEAREST_MAX;
        draw(seed, n, values);
        gonio_nearest nearest = {.wanted = wanted};
        assert_true(gonio_nearest_reach(&nearest) == INFINITY);
        for (size_t i = 0; i < n; i++) {
            gonio_nearest_show(&nearest, values[i], i);
        }
        memcpy(sorted, values, sizeof sorted);
        gonio_sort(sorted, n);
        assert_int_equal(nearest.found, n < wanted ? n : wanted);
        for (size_t k = 0; k < nearest.found; k++) {
            assert_true(nearest.distance[k] == sorted[k] && values[nearest.index[k]] == sorted[k]);
            assert_true(k == 0 || nearest.distance[k - 1] < sorted[k] || nearest.index[k - 1] < nearest.index[k]);
        }
        assert_true(gonio_nearest_reach(&nearest) == sorted[nearest.found - 1]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(medians_are_those_of_the_sorted),
        cmocka_unit_test(robust_spread_of_a_normal),
        cmocka_unit_test(split_mix_is_the_published_one),
        cmocka_unit_test(nearest_are_the_first_of_the_sorted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
