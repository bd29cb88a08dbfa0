// SPDX-License-Identifier: BSD-3-Clause
// The merge of one pixel's exposures: exactness, invariances, bias and variance against the Cramer-Rao bound, and what
// it refuses.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "tests/pixel.h"
#include "tests/unit/near.h"

static const merge_noise noise = {.dn_per_e = 0.4, .read_variance = 4, .ceiling = 3700};

static merge_term term(double value, double scale) {
    return (merge_term){.signal = value * scale, .scale = scale, .quantum_variance = 1.0 / 12};
}

static void test_exact_without_noise(void **state) {
    (void)state;
    const merge_term terms[] = {term(12.5, 1), term(12.5, 7), term(12.5, 100)};
    merge_result r;
    gonio_merge_pixel(&noise, 3, terms, &r);
    assert_int_equal(r.used, 3);
    assert_near(r.value, 12.5, 1e-12);
    double sum = 0;
    for (int j = 0; j < 3; j++) {
        sum += r.weight[j] * terms[j].scale;
    }
    assert_near(sum, 1, 1e-12); // unbiased whatever the weights
}

static void test_variance_is_the_inverse_information(void **state) {
    (void)state;
    const merge_term terms[] = {term(12.5, 1), term(12.5, 7), term(12.5, 100)};
    merge_result r;
    gonio_merge_pixel(&noise, 3, terms, &r);
    double information = 0;
    for (int j = 0; j < 3; j++) {
        const double v = 12.5 * terms[j].scale * 0.4 + 4 + 1.0 / 12;
        information += terms[j].scale * terms[j].scale / v;
    }
    assert_near(r.photon_variance + r.read_variance, 1 / information, 1e-12);
}

// n equal exposures are one of n times the photons: the value is their mean, the variance falls as 1/n.
static void test_repeats_average(void **state) {
    (void)state;
    merge_term terms[16];
    merge_result one, many;
    for (int j = 0; j < 16; j++) {
        terms[j] = term(30, 10);
        terms[j].signal += j % 2 ? 5 : -5;
    }
    gonio_merge_pixel(&noise, 16, terms, &many);
    terms[0].signal = 300;
    gonio_merge_pixel(&noise, 1, terms, &one);
    assert_near(many.value, 30, 1e-12);
    assert_near(many.photon_variance + many.read_variance, (one.photon_variance + one.read_variance) / 16, 1e-12);
}

static void test_order_does_not_matter(void **state) {
    (void)state;
    merge_term terms[] = {term(9, 1), term(11, 16), term(10, 60)};
    const merge_term swapped[] = {terms[2], terms[0], terms[1]};
    merge_result a, b;
    gonio_merge_pixel(&noise, 3, terms, &a);
    gonio_merge_pixel(&noise, 3, swapped, &b);
    assert_near(a.value, b.value, 1e-13);
}

static void test_saturated_is_excluded(void **state) {
    (void)state;
    merge_term terms[] = {term(10, 1), term(10, 1000)};
    terms[1].signal = 4000;
    terms[1].clipped = true;
    merge_result r;
    gonio_merge_pixel(&noise, 2, terms, &r);
    assert_int_equal(r.used, 1);
    assert_near(r.value, 10, 1e-12);
    assert_true(r.weight[1] == 0);
    // Predicted above the ceiling, though not clipped as read.
    terms[1] = term(10, 380);
    gonio_merge_pixel(&noise, 2, terms, &r);
    assert_int_equal(r.used, 1);
}

static void test_no_valid_exposure_is_said(void **state) {
    (void)state;
    merge_term terms[] = {term(5000, 1), term(5000, 2)};
    merge_result r;
    gonio_merge_pixel(&noise, 2, terms, &r);
    assert_int_equal(r.used, 0);
    assert_true(r.saturated);
    terms[0].clipped = terms[1].clipped = true;
    gonio_merge_pixel(&noise, 2, terms, &r);
    assert_int_equal(r.used, 0);
    assert_true(r.saturated);
    assert_true(r.value == 0);
}

// Bias and variance over five decades. Per point 20,000 pixels, fixed seed; the mean's deviation is tested at 0.1 %
// plus 5 standard errors and the variance at 1.1 times the bound plus 5 of its own (sqrt(2/20000) = 1 %): with 22
// points and two tests each the false-alarm rate is below 3e-5, and the seed is fixed.
static void test_bias_and_variance_reach_the_bound(void **state) {
    (void)state;
    const pixel_camera camera = pixel_camera_make(2.5, 2, 8);
    const merge_noise n = pixel_noise(&camera);
    const int trials = 20000;
    uint64_t random = 42;
    for (double rate = 3e-4; rate < 100; rate *= 1.8) {
        double information = 0, sum = 0, squares = 0;
        for (int j = 0; j < camera.n; j++) {
            const double t = camera.exposure_s[j];
            information += rate * t <= n.ceiling ? pixel_fisher(&camera, rate, t) : 0;
        }
        for (int i = 0; i < trials; i++) {
            merge_term terms[PIXEL_EXPOSURES];
            merge_result r;
            for (int j = 0; j < camera.n; j++) {
                terms[j] = pixel_expose(&camera, &random, rate, camera.exposure_s[j]);
            }
            gonio_merge_pixel(&n, camera.n, terms, &r);
            assert_true(r.used > 0);
            sum += r.value - rate;
            squares += (r.value - rate) * (r.value - rate);
        }
        const double mean = sum / trials, variance = squares / trials - mean * mean;
        assert_true(fabs(mean) <= 1e-3 * rate + 5 * sqrt(variance / trials));
        assert_true(variance * information <= 1.1 + 5 * sqrt(2.0 / trials));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exact_without_noise),
        cmocka_unit_test(test_variance_is_the_inverse_information),
        cmocka_unit_test(test_repeats_average),
        cmocka_unit_test(test_order_does_not_matter),
        cmocka_unit_test(test_saturated_is_excluded),
        cmocka_unit_test(test_no_valid_exposure_is_said),
        cmocka_unit_test(test_bias_and_variance_reach_the_bound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
