// SPDX-License-Identifier: BSD-3-Clause
// The fast multilevel fit against the plain transcription of the thesis, and what it must satisfy by itself.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/mba/mba.h"
#include "tests/golden/oracle.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"

static const gonio_scatter_options thesis = {GONIO_NUSSELT, GONIO_LINEAR, GONIO_SYMMETRY_MIRROR, false, 0};

static gonio_lattice fit(const gonio_samples *samples, const gonio_scatter_options *options, int level, int threads) {
    gonio_scatter scatter;
    gonio_lattice lattice;
    gonio_error error = {0};
    if (gonio_scatter_init(&scatter, samples, options, &error) != GONIO_OK ||
        gonio_mba_fit(&scatter, NULL, level, threads, &lattice, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    // In units of the values: the scale is a power of two, so this is exact.
    for (size_t i = 0; i < lattice.count * (size_t)lattice.channels; i++) {
        lattice.points[i] *= (float)scatter.transforms[i % (size_t)lattice.channels].scale;
    }
    gonio_scatter_release(&scatter);
    return lattice;
}

// The oracle sees the mirrored samples as samples; the fast fit folds them into the lattice's symmetry.
static oracle_lattice fit_oracle(const gonio_samples *samples, int level, bool mirrored) {
    const size_t n = samples->n * (mirrored ? 2 : 1);
    double *x = malloc(n * 3 * sizeof *x), *z = malloc(n * sizeof *z);
    for (size_t i = 0; i < n; i++) {
        gonio_pair pair = samples->pairs[i % samples->n];
        pair = i < samples->n ? pair : gonio_pair_mirrored(pair);
        gonio_scatter_locate(GONIO_NUSSELT, 3, &pair, x + 3 * i);
        z[i] = samples->values[i % samples->n * (size_t)samples->channels];
    }
    oracle_lattice result = oracle_fit(level, n, x, z);
    free(x);
    free(z);
    return result;
}

static double largest(const double *values, size_t n) {
    double result = 0;
    for (size_t i = 0; i < n; i++) {
        result = fmax(result, fabs(values[i]));
    }
    return result;
}

static void equals_the_oracle(void **state) {
    (void)state;
    for (int level = 0; level <= 6; level += 2) {
        for (int mirrored = 0; mirrored < 2; mirrored++) {
            gonio_samples *samples = simulate_samples(WARD, 3000, 1, 1);
            gonio_scatter_options options = thesis;
            options.symmetry = mirrored ? GONIO_SYMMETRY_MIRROR : 0;
            gonio_lattice fast = fit(samples, &options, level, 1);
            oracle_lattice plain = fit_oracle(samples, level, mirrored);
            const double scale = largest(samples->values, samples->n);
            for (size_t i = 0; i < fast.count; i++) {
                assert_near(fast.points[i], plain.points[i], 1e-5 * scale);
            }
            free(plain.points);
            gonio_lattice_release(&fast);
            gonio_samples_free(samples);
        }
    }
}

static void assert_same_bits(const gonio_lattice *a, const gonio_lattice *b) {
    assert_int_equal(a->count, b->count);
    assert_memory_equal(a->points, b->points, a->count * (size_t)a->channels * sizeof(float));
}

// Coarse levels, levels as fine as the samples' order, and finer ones; more than two chunks, so that threads really
// share the work.
static void bits_do_not_depend_on_threads(void **state) {
    (void)state;
    static const struct {
        int dims, channels, level;
    } cases[] = {{3, 1, 7}, {3, 3, 6}, {3, 31, 5}, {4, 1, 5}, {4, 2, 4}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        gonio_samples *samples = simulate_samples(WARD, 40000, cases[k].channels, 2);
        samples->isotropic = cases[k].dims == 3;
        gonio_lattice one = fit(samples, &thesis, cases[k].level, 1), two = fit(samples, &thesis, cases[k].level, 2),
                      seven = fit(samples, &thesis, cases[k].level, 7);
        assert_same_bits(&one, &two);
        assert_same_bits(&one, &seven);
        gonio_lattice_release(&one);
        gonio_lattice_release(&two);
        gonio_lattice_release(&seven);
        gonio_samples_free(samples);
    }
}

// All samples in a few cells of the first axis: most segments have nothing to do.
static void threads_agree_on_crowded_planes(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 40000, 1, 12);
    for (size_t i = 0; i < samples->n; i++) {
        samples->pairs[i].theta_i = i % 3 == 0 ? 0.5 : i % 3 == 1 ? 0.52 : GONIO_PI / 2;
    }
    gonio_lattice one = fit(samples, &thesis, 7, 1), seven = fit(samples, &thesis, 7, 7);
    assert_same_bits(&one, &seven);
    gonio_lattice_release(&one);
    gonio_lattice_release(&seven);
    gonio_samples_free(samples);
}

static void order_of_samples_does_not_matter(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 20000, 1, 3);
    gonio_lattice before = fit(samples, &thesis, 6, 1);
    const double scale = largest(samples->values, samples->n);
    uint64_t seed = 4;
    for (size_t i = samples->n - 1; i > 0; i--) {
        const size_t j = (size_t)(simulate_uniform(&seed) * (double)(i + 1));
        const gonio_pair pair = samples->pairs[i];
        const double value = samples->values[i];
        samples->pairs[i] = samples->pairs[j];
        samples->values[i] = samples->values[j];
        samples->pairs[j] = pair;
        samples->values[j] = value;
    }
    gonio_lattice after = fit(samples, &thesis, 6, 1);
    for (size_t i = 0; i < before.count; i++) {
        assert_near(before.points[i], after.points[i], 1e-6 * scale);
    }
    gonio_lattice_release(&before);
    gonio_lattice_release(&after);
    gonio_samples_free(samples);
}

// Weights are shared, so each channel is what a fit of it alone gives.
static void channels_equal_fits_of_their_own(void **state) {
    (void)state;
    static const int counts[] = {2, 3, 5, 31};
    for (size_t k = 0; k < 4; k++) {
        gonio_samples *all = simulate_samples(WARD, 2000, counts[k], 5), *alone;
        gonio_lattice together = fit(all, &thesis, 4, 1);
        for (int c = 0; c < counts[k]; c += counts[k] - 1) {
            assert_int_equal(gonio_samples_channel(all, c, &alone, NULL), GONIO_OK);
            gonio_lattice single = fit(alone, &thesis, 4, 1);
            const double scale = largest(alone->values, alone->n);
            for (size_t i = 0; i < single.count; i++) {
                assert_near(together.points[i * (size_t)counts[k] + (size_t)c], single.points[i], 2e-6 * scale);
            }
            gonio_lattice_release(&single);
            gonio_samples_free(alone);
        }
        gonio_lattice_release(&together);
        gonio_samples_free(all);
    }
}

// One isolated sample is interpolated: every control point of its cell carries its share.
static void impulse_is_interpolated(void **state) {
    (void)state;
    for (int dims = 3; dims <= 4; dims++) {
        gonio_samples *samples;
        assert_int_equal(gonio_samples_new(1, false, &samples, NULL), GONIO_OK);
        samples->isotropic = dims == 3;
        const gonio_pair pair = {0.4, 0, 0.7, 2};
        const double value = 3.25;
        gonio_samples_add(samples, &pair, &value, NULL, NULL, NULL);
        gonio_scatter_options options = thesis;
        options.symmetry = 0;
        for (int level = 0; level <= 4; level++) {
            gonio_lattice lattice = fit(samples, &options, level, 1);
            double x[4], at;
            gonio_scatter_locate(GONIO_NUSSELT, dims, &pair, x);
            gonio_lattice_eval(&lattice, x, &at);
            assert_near(at, value, 2e-6);
            gonio_lattice_release(&lattice);
        }
        gonio_samples_free(samples);
    }
}

static void weights_decide_between_samples(void **state) {
    (void)state;
    gonio_samples *samples;
    assert_int_equal(gonio_samples_new(1, true, &samples, NULL), GONIO_OK);
    const gonio_pair pair = {0.4, 0, 0.7, 2};
    // 12 decades between the weights: sigma 1e-6 against 1.
    const double values[] = {2, 5}, sigmas[] = {1e-6, 1}, none = 0;
    for (int i = 0; i < 2; i++) {
        gonio_samples_add(samples, &pair, &values[i], &sigmas[i], &none, NULL);
    }
    gonio_scatter_options options = thesis;
    options.weighted = true;
    gonio_lattice lattice = fit(samples, &options, 3, 1);
    double x[4], at;
    gonio_scatter_locate(GONIO_NUSSELT, 3, &pair, x);
    gonio_lattice_eval(&lattice, x, &at);
    assert_near(at, 2, 2e-6);
    gonio_lattice_release(&lattice);
    samples->sigma_random[0] = samples->sigma_random[1] = 0.3;
    lattice = fit(samples, &options, 3, 1);
    gonio_lattice_eval(&lattice, x, &at);
    assert_near(at, 3.5, 2e-6);
    gonio_lattice_release(&lattice);
    gonio_samples_free(samples);
}

// What no sample reaches keeps the coarser level's value. Samples end at kappa_i = 0.72; from level 4 on their cells
// share no control point with the cell of the hole at 0.97.
static void holes_keep_the_coarser_level(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 400, 1, 6);
    for (size_t i = 0; i < samples->n; i++) {
        samples->pairs[i].theta_i *= 0.3;
    }
    gonio_lattice coarse = fit(samples, &thesis, 3, 1), fine = fit(samples, &thesis, 6, 1);
    const double hole[3] = {0.97, 0.5, 0.5};
    double a, b;
    gonio_lattice_eval(&coarse, hole, &a);
    gonio_lattice_eval(&fine, hole, &b);
    assert_near(a, b, 1e-6);
    gonio_lattice_release(&coarse);
    gonio_lattice_release(&fine);
    gonio_samples_free(samples);
}

static void mirror_symmetry_is_exact(void **state) {
    (void)state;
    for (int system = 0; system < 3; system++) {
        gonio_samples *samples = simulate_samples(WARD, 500, 1, 8);
        gonio_scatter_options options = thesis;
        options.coordinates = (gonio_coordinates)system;
        gonio_lattice lattice = fit(samples, &options, 4, 1);
        uint64_t seed = 9;
        for (int i = 0; i < 100; i++) {
            const gonio_pair pair = simulate_pair(&seed, 1), mirrored = gonio_pair_mirrored(pair);
            double x[4], y[4], a, b;
            gonio_scatter_locate(options.coordinates, 3, &pair, x);
            gonio_scatter_locate(options.coordinates, 3, &mirrored, y);
            gonio_lattice_eval(&lattice, x, &a);
            gonio_lattice_eval(&lattice, y, &b);
            assert_near(a, b, 1e-6);
        }
        gonio_lattice_release(&lattice);
        gonio_samples_free(samples);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equals_the_oracle),
        cmocka_unit_test(bits_do_not_depend_on_threads),
        cmocka_unit_test(threads_agree_on_crowded_planes),
        cmocka_unit_test(order_of_samples_does_not_matter),
        cmocka_unit_test(channels_equal_fits_of_their_own),
        cmocka_unit_test(impulse_is_interpolated),
        cmocka_unit_test(weights_decide_between_samples),
        cmocka_unit_test(holes_keep_the_coarser_level),
        cmocka_unit_test(mirror_symmetry_is_exact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
