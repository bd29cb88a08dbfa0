// SPDX-License-Identifier: BSD-3-Clause
// The generator against its authors' vectors; the distributions by their moments.
//
// Statistics: seeds are fixed, so the runs are reproducible; each bound is 5 standard errors, a false alarm of 6e-7 for
// a fresh seed, with fewer than 60 bounds here: below 4e-5 together.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/direction.h"
#include "sim/random.h"
#include "tests/unit/near.h"

#define DRAWS 200000

// kat_vectors of the Random123 distribution (Salmon et al.): counter, key, result of philox4x32 with 10 rounds.
static void philox_known_answers(void **state) {
    (void)state;
    const uint32_t vectors[3][10] = {
        {0, 0, 0, 0, 0, 0, 0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8},
        {0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0x408f276d, 0x41c83b0e, 0xa20bc7c6,
         0x6d5451fd},
        {0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344, 0xa4093822, 0x299f31d0, 0xd16cfe09, 0x94fdcceb, 0x5001e420,
         0x24126ea1},
    };
    for (int k = 0; k < 3; k++) {
        const uint32_t *v = vectors[k];
        const uint64_t seed = (uint64_t)v[5] << 32 | v[4], pose = (uint64_t)v[3] << 32 | v[2];
        const sim_draw draw = gonio_sim_random(seed, (sim_effect)0, (int64_t)pose, (int32_t)v[1], v[0]);
        assert_memory_equal(draw.word, v + 6, sizeof draw.word);
    }
}

static void every_argument_matters(void **state) {
    (void)state;
    const sim_draw draws[] = {gonio_sim_random(1, SIM_SHOT, 5, 7, 9),
                              gonio_sim_random(2, SIM_SHOT, 5, 7, 9),
                              gonio_sim_random(1, SIM_READ, 5, 7, 9),
                              gonio_sim_random(1, SIM_SHOT, 6, 7, 9),
                              gonio_sim_random(1, SIM_SHOT, 5, 8, 9),
                              gonio_sim_random(1, SIM_SHOT, 5, 7, 10),
                              gonio_sim_random(1, SIM_SHOT, 5 + ((int64_t)1 << 40), 7, 9)};
    for (size_t a = 0; a < 7; a++) {
        for (size_t b = 0; b < a; b++) {
            assert_memory_not_equal(&draws[a], &draws[b], sizeof draws[a]);
        }
    }
}

static void normal_moments(void **state) {
    (void)state;
    double sum[5] = {0}, cross = 0;
    for (uint32_t k = 0; k < DRAWS; k++) {
        const sim_draw draw = gonio_sim_random(3, SIM_SHOT, 1, 1, k);
        double z[2];
        gonio_sim_normals(&draw, z);
        for (int power = 1; power <= 4; power++) {
            sum[power] += pow(z[0], power) / DRAWS;
        }
        cross += z[0] * z[1] / DRAWS;
    }
    const double e = 5 / sqrt(DRAWS);
    assert_near(sum[1], 0, e);
    assert_near(sum[2], 1, e * sqrt(2));
    assert_near(sum[3], 0, e * sqrt(15));
    assert_near(sum[4], 3, e * sqrt(96));
    assert_near(cross, 0, e);
}

static double poisson(double mean, uint32_t index) {
    const sim_draw draw = gonio_sim_random(17, SIM_SHOT, (int64_t)(mean * 1000), 0, index);
    double z[2];
    gonio_sim_normals(&draw, z);
    return mean < SIM_POISSON_EXACT ? gonio_sim_poisson_small(mean, gonio_sim_uniform(&draw, 0))
                                    : gonio_sim_poisson_large(mean, z[0]);
}

// Mean, variance and third central moment of a Poisson variable are all its mean m; the variances of their estimates
// from n draws are m/n, (m + 2 m^2)/n and (m + 24 m^2 + 15 m^3 + ...)/n to leading orders.
static void poisson_moments(void **state) {
    (void)state;
    const double means[] = {0.01, 0.3, 3, 29.9, 30, 47.3, 100, 1000, 9000};
    for (size_t k = 0; k < sizeof means / sizeof *means; k++) {
        const double m = means[k];
        double first = 0, second = 0, third = 0;
        for (uint32_t i = 0; i < DRAWS; i++) {
            const double d = poisson(m, i) - m;
            first += d / DRAWS;
            second += d * d / DRAWS;
            third += d * d * d / DRAWS;
        }
        assert_near(first, 0, 5 * sqrt(m / DRAWS));
        assert_near(second, m, 5 * sqrt((m + 2 * m * m) / DRAWS));
        assert_near(third, m, 5 * sqrt((m + 24 * m * m + 15 * m * m * m) / DRAWS));
    }
}

// The whole distribution just above the limit of the exact method: Pearson's chi squared over counts 15 to 48 at mean
// 31; 34 cells, so 33 degrees of freedom up to the tails left out: mean 33, standard deviation 8.1, bound at 5.5 of it
// (the upper tail of chi squared at 78 with 33 degrees: 2e-5).
static void poisson_large_is_poisson(void **state) {
    (void)state;
    const double mean = 31;
    double count[49] = {0}, chi2 = 0;
    for (uint32_t i = 0; i < DRAWS; i++) {
        const double n = poisson(mean, i);
        if (n >= 15 && n <= 48) {
            count[(int)n]++;
        }
    }
    for (int n = 15; n <= 48; n++) {
        const double expected = DRAWS * exp(n * log(mean) - mean - lgamma(n + 1.0));
        chi2 += (count[n] - expected) * (count[n] - expected) / expected;
    }
    assert_in_range((int)chi2, 9, 78);
}

// Its moments to 1e-3, by integrating over the normal density instead of drawing.
static void poisson_large_moments(void **state) {
    (void)state;
    const double means[] = {30, 31.37, 50.5, 200, 5000};
    for (size_t k = 0; k < sizeof means / sizeof *means; k++) {
        const double m = means[k], step = 1e-4;
        double moment[4] = {0};
        for (long i = -80000; i <= 80000; i++) {
            const double z = (double)i * step, weight = exp(-z * z / 2) / sqrt(2 * GONIO_PI) * step;
            const double d = gonio_sim_poisson_large(m, z) - m;
            moment[1] += weight * d;
            moment[2] += weight * d * d;
            moment[3] += weight * d * d * d;
        }
        assert_near(moment[1] / sqrt(m), 0, 1e-3);
        assert_near(moment[2] / m, 1, 1e-3);
        assert_near(moment[3] / m, 1, 0.02);
    }
}

static void extremes(void **state) {
    (void)state;
    assert_near(gonio_sim_poisson_small(0, 0.5), 0, 0);
    assert_near(gonio_sim_poisson_small(0, 1 - 1e-16), 0, 0);
    assert_true(gonio_sim_poisson_small(29.99, 1 - 0x1p-53) < 120);
    assert_true(gonio_sim_poisson_large(30, -8.6) >= 0);
    const sim_draw low = {{0, 0, 0, 0}}, high = {{~0u, ~0u, ~0u, ~0u}};
    assert_true(gonio_sim_uniform(&low, 0) > 0 && gonio_sim_uniform(&high, 1) < 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(philox_known_answers),
        cmocka_unit_test(every_argument_matters),
        cmocka_unit_test(normal_moments),
        cmocka_unit_test(poisson_moments),
        cmocka_unit_test(poisson_large_is_poisson),
        cmocka_unit_test(poisson_large_moments),
        cmocka_unit_test(extremes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
