// SPDX-License-Identifier: BSD-3-Clause
// The extremes: what breaks a fitter first. docs/fitting.md has a line for each.
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/kind/lattice.h"
#include "fit/mba/mba.h"
#include "gonio/fit.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"

static gonio_fit_options plain(int level) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = "mba";
    o.level = level;
    o.hold_out = 0;
    o.coordinates = GONIO_NUSSELT;
    o.domain = GONIO_LINEAR;
    return o;
}

static gonio_model *fit(const gonio_samples *samples, const gonio_fit_options *o, gonio_fit_report *report) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_fit(samples, o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    const gonio_lattice *l = gonio_lattice_model_lattice(model);
    for (size_t i = 0; i < l->count; i++) {
        assert_true(isfinite(l->points[i]));
    }
    return model;
}

static gonio_samples *make(size_t n, const gonio_pair *pairs, const double *values) {
    gonio_samples *samples;
    assert_int_equal(gonio_samples_new(1, false, &samples, NULL), GONIO_OK);
    for (size_t i = 0; i < n; i++) {
        assert_int_equal(gonio_samples_add(samples, &pairs[i], &values[i], NULL, NULL, NULL), GONIO_OK);
    }
    return samples;
}

static double at(const gonio_model *model, gonio_pair pair) {
    double value;
    gonio_model_eval_pair(model, &pair, &value);
    return value;
}

static void no_samples_are_an_error(void **state) {
    (void)state;
    gonio_samples *samples = make(0, NULL, NULL);
    gonio_fit_options o = plain(3);
    gonio_model *model;
    gonio_error error = {0};
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_INPUT);
    assert_null(model);
    gonio_samples_free(samples);
}

// One sample is the whole BRDF: it must not decay away from itself (it does in the thesis' form).
static void one_sample_is_a_constant(void **state) {
    (void)state;
    const gonio_pair pair = {0.5, 0, 0.6, 3};
    const double value = 0.7;
    gonio_samples *samples = make(1, &pair, &value);
    for (int domain = 0; domain < 2; domain++) {
        gonio_fit_options o = plain(GONIO_LEVEL_AUTO);
        o.domain = (gonio_domain)domain;
        gonio_model *model = fit(samples, &o, NULL);
        uint64_t seed = 1;
        for (int i = 0; i < 100; i++) {
            assert_near(at(model, simulate_pair(&seed, 1)), value, 1e-6);
        }
        gonio_model_free(model);
    }
    gonio_fit_options o = plain(5);
    o.thesis = true;
    gonio_model *model = fit(samples, &o, NULL);
    assert_near(at(model, pair), value, 1e-6);
    assert_true(at(model, (gonio_pair){1.2, 0, 1.2, 0}) < 0.8 * value);
    gonio_model_free(model);
    gonio_samples_free(samples);
}

static void equal_positions_average(void **state) {
    (void)state;
    const gonio_pair pairs[2] = {{0.5, 0, 0.6, 3}, {0.5, 0, 0.6, 3}};
    const double values[2] = {1, 4};
    gonio_samples *samples = make(2, pairs, values);
    for (int level = 0; level <= 7; level++) {
        gonio_fit_options o = plain(level);
        gonio_model *model = fit(samples, &o, NULL);
        assert_near(at(model, pairs[0]), 2.5, 1e-6);
        gonio_model_free(model);
    }
    gonio_samples_free(samples);
}

static void all_in_one_cell(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 5000, 1, 1);
    for (size_t i = 0; i < samples->n; i++) {
        samples->pairs[i].theta_i = 0.5 + 1e-4 * samples->pairs[i].theta_i;
        samples->pairs[i].theta_o = 0.6 + 1e-4 * samples->pairs[i].theta_o;
        samples->pairs[i].phi_o = 2 + 1e-4 * samples->pairs[i].phi_o;
        samples->values[i] = 1 + 1e-3 * samples->pairs[i].theta_i;
    }
    gonio_fit_options o = plain(6);
    gonio_fit_report report;
    gonio_model *model = fit(samples, &o, &report);
    assert_true(report.train.max_abs < 1e-6);
    gonio_model_free(model);
    gonio_samples_free(samples);
}

static void all_on_one_plane(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 40000, 1, 2);
    for (size_t i = 0; i < samples->n; i++) {
        samples->pairs[i].theta_i = 0.5;
        samples->values[i] = 1 + pow(sin(samples->pairs[i].theta_o) * cos(samples->pairs[i].phi_o), 2);
    }
    gonio_fit_options o = plain(5), two = plain(5);
    o.threads = 1;
    two.threads = 3;
    gonio_fit_report report;
    gonio_model *a = fit(samples, &o, &report), *b = fit(samples, &two, NULL);
    assert_true(report.train.rmse < 1e-2);
    const gonio_lattice *x = gonio_lattice_model_lattice(a), *y = gonio_lattice_model_lattice(b);
    assert_memory_equal(x->points, y->points, x->count * sizeof(float));
    gonio_model_free(a);
    gonio_model_free(b);
    gonio_samples_free(samples);
}

// fit(k z) = k fit(z): bit for bit for powers of two, over the whole range of double, denormals too.
static void scaling_is_exact(void **state) {
    (void)state;
    static const double factors[] = {0x1p-100, 0x1p100, 0x1p-1000, 0x1p1000};
    for (int domain = 0; domain < 2; domain++) {
        gonio_samples *samples = simulate_samples(WARD, 800, 1, 3), *scaled = simulate_samples(WARD, 800, 1, 3);
        gonio_fit_options o = plain(5);
        o.domain = (gonio_domain)domain;
        gonio_model *model = fit(samples, &o, NULL);
        for (size_t k = 0; k < 4; k++) {
            for (size_t i = 0; i < samples->n; i++) {
                scaled->values[i] = samples->values[i] * factors[k];
            }
            gonio_model *other = fit(scaled, &o, NULL);
            uint64_t seed = 9;
            for (int i = 0; i < 200; i++) {
                const gonio_pair pair = simulate_pair(&seed, 1);
                assert_true(at(other, pair) == at(model, pair) * factors[k]);
            }
            gonio_model_free(other);
        }
        // Other factors: to rounding, from 1e-30 to 1e30.
        for (double factor = 1e-30; factor < 1e31; factor *= 1e30) {
            double worst = 0;
            for (size_t i = 0; i < samples->n; i++) {
                scaled->values[i] = samples->values[i] * factor;
            }
            gonio_model *other = fit(scaled, &o, NULL);
            uint64_t seed = 9;
            for (int i = 0; i < 200; i++) {
                const gonio_pair pair = simulate_pair(&seed, 1);
                worst = fmax(worst, fabs(at(other, pair) / factor - at(model, pair)));
            }
            assert_true(worst < 5e-6);
            gonio_model_free(other);
        }
        gonio_model_free(model);
        gonio_samples_free(samples);
        gonio_samples_free(scaled);
    }
}

static void denormals_are_values(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 500, 1, 4);
    gonio_fit_options o = plain(6);
    gonio_model *normal = fit(samples, &o, NULL);
    for (size_t i = 0; i < samples->n; i++) {
        samples->values[i] *= 1e-310;
    }
    gonio_model *denormal = fit(samples, &o, NULL);
    for (size_t i = 0; i < samples->n; i++) {
        assert_near(at(denormal, samples->pairs[i]) / 1e-310, at(normal, samples->pairs[i]), 1e-5);
    }
    gonio_model_free(normal);
    gonio_model_free(denormal);
    gonio_samples_free(samples);
}

// A peak of 1e6 over a base of 1e-3: the linear fit leaks and says so, the log one has no value below -eps.
static void a_huge_peak_does_not_leak_in_the_log_domain(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 1400, 1, 5);
    size_t peaks = 0;
    for (size_t i = 0; i < samples->n; i++) {
        const gonio_pair *p = &samples->pairs[i];
        const bool peak = fabs(p->theta_i - p->theta_o) < 0.15 && fabs(p->phi_o - GONIO_PI) < 0.2;
        samples->values[i] = peak ? 1e6 : 1e-3;
        peaks += peak;
    }
    assert_true(peaks > 0);
    gonio_fit_options linear = plain(6), log = plain(6);
    log.domain = GONIO_LOG;
    gonio_fit_report report;
    gonio_model *a = fit(samples, &linear, &report);
    assert_non_null(strstr(report.note, "--domain log"));
    gonio_model *b = fit(samples, &log, &report);
    const gonio_transform *transform;
    gonio_lattice_model_about(b, NULL, NULL, &transform);
    size_t leaks = 0;
    uint64_t seed = 6;
    for (int i = 0; i < 20000; i++) {
        const gonio_pair pair = simulate_pair(&seed, 1);
        leaks += at(a, pair) < -1;
        assert_true(at(b, pair) >= -transform->eps * transform->scale);
    }
    assert_true(leaks > 100); // so that this test would notice if the linear form stopped needing the warning
    gonio_model_free(a);
    gonio_model_free(b);
    gonio_samples_free(samples);
}

static void nan_and_infinity_never_enter(void **state) {
    (void)state;
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 3; k++) {
        gonio_samples *samples = simulate_samples(WARD, 50, 1, 7);
        gonio_fit_options o = plain(3);
        gonio_model *model;
        gonio_error error = {0};
        samples->values[17] = bad[k];
        assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "18"));
        samples->values[17] = 1;
        samples->pairs[17].theta_o = bad[k];
        assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_INPUT);
        samples->pairs[17].theta_o = 0.3;
        samples->pairs[17].phi_o = bad[k];
        assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_INPUT);
        samples->pairs[17].phi_o = 0;
        samples->pairs[17].theta_i = 1.6;
        assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_INPUT);
        gonio_samples_free(samples);
    }
    // Weights of 0, NaN or infinite sigma are no poison either.
    gonio_samples *samples;
    assert_int_equal(gonio_samples_new(1, true, &samples, NULL), GONIO_OK);
    static const double sigmas[] = {0, NAN, INFINITY, 1e-300, 1e300, 0.1};
    uint64_t seed = 3;
    for (int i = 0; i < 60; i++) {
        const gonio_pair pair = simulate_pair(&seed, 1);
        const double value = 0.5, none = 0;
        gonio_samples_add(samples, &pair, &value, &sigmas[i % 6], &none, NULL);
    }
    gonio_fit_options o = plain(5);
    gonio_model *model = fit(samples, &o, NULL);
    for (int i = 0; i < 100; i++) {
        assert_near(at(model, simulate_pair(&seed, 1)), 0.5, 1e-6);
    }
    gonio_model_free(model);
    gonio_samples_free(samples);
}

// The border of the hemisphere is ordinary, one ulp to either side of it too.
static void borders_are_ordinary(void **state) {
    (void)state;
    const double right = GONIO_PI / 2;
    const double thetas[] = {0, nextafter(0, 1), nextafter(right, 0), right, nextafter(right, 2)};
    const double phis[] = {0, GONIO_PI / 2, GONIO_PI, nextafter(GONIO_PI, 4), -GONIO_PI / 2};
    gonio_pair pairs[125];
    double values[125];
    size_t n = 0;
    for (int i = 0; i < 5; i++) {
        for (int o = 0; o < 5; o++) {
            for (int p = 0; p < 5; p++) {
                pairs[n] = (gonio_pair){thetas[i], 0, thetas[o], phis[p]};
                // One value a place: ulps and the azimuth of the pole make none.
                values[n++] = 1 + (i > 1) + 2 * (o > 1) + (o > 1 ? cos(phis[p]) * cos(phis[p]) : 0);
            }
        }
    }
    gonio_samples *samples = make(n, pairs, values);
    for (int system = 0; system < 2; system++) {
        gonio_fit_options o = plain(4);
        o.coordinates = system == 0 ? GONIO_NUSSELT : GONIO_REFLECTED;
        gonio_fit_report report;
        gonio_model *model = fit(samples, &o, &report);
        assert_true(report.train.max_abs < (system == 0 ? 1e-5 : 0.5));
        gonio_model_free(model);
    }
    gonio_samples_free(samples);
}

static void memory_is_told_and_refused(void **state) {
    (void)state;
    // Figures by hand: 515^3 points and 259^3 coarser ones of 4 bytes; 11 planes of sums and a spare one, of 16.
    const double level9 = 515.0 * 515 * 515 * 4 + 259.0 * 259 * 259 * 4 + 12 * 515.0 * 515 * 16;
    assert_near(gonio_mba_memory(3, 9, 1, 1000, 1) / level9, 1, 0.01);
    gonio_error error = {0};
    gonio_samples *samples = simulate_samples(WARD, 20, 1, 8);
    samples->isotropic = false;
    gonio_fit_options o = plain(9);
    gonio_model *model;
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_MEMORY);
    assert_non_null(strstr(error.message, "GB, enough for level"));
    gonio_samples_free(samples);
}

// Many samples: more than one block, fitted in bounded memory; equal to rounding to the same data fitted as their mean.
static void several_blocks_are_one_fit(void **state) {
    (void)state;
    gonio_samples *few = simulate_samples(WARD, 1000, 1, 10), *many;
    assert_int_equal(gonio_samples_new(1, false, &many, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_reserve(many, 1200000, NULL), GONIO_OK);
    for (size_t i = 0; i < 1200000; i++) {
        gonio_samples_add(many, &few->pairs[i % few->n], &few->values[i % few->n], NULL, NULL, NULL);
    }
    gonio_scatter a, b;
    gonio_lattice x, y;
    const gonio_scatter_options form = {GONIO_NUSSELT, GONIO_LINEAR, 0, false, 0};
    assert_int_equal(gonio_scatter_init(&a, few, &form, NULL), GONIO_OK);
    assert_int_equal(gonio_scatter_init(&b, many, &form, NULL), GONIO_OK);
    assert_int_equal(gonio_mba_fit(&a, NULL, 2, 2, &x, NULL), GONIO_OK);
    assert_int_equal(gonio_mba_fit(&b, NULL, 2, 2, &y, NULL), GONIO_OK);
    for (size_t i = 0; i < x.count; i++) {
        assert_near(x.points[i], y.points[i], 1e-6);
    }
    gonio_lattice_release(&x);
    gonio_lattice_release(&y);
    gonio_scatter_release(&a);
    gonio_scatter_release(&b);
    gonio_samples_free(few);
    gonio_samples_free(many);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_samples_are_an_error),
        cmocka_unit_test(one_sample_is_a_constant),
        cmocka_unit_test(equal_positions_average),
        cmocka_unit_test(all_in_one_cell),
        cmocka_unit_test(all_on_one_plane),
        cmocka_unit_test(scaling_is_exact),
        cmocka_unit_test(denormals_are_values),
        cmocka_unit_test(a_huge_peak_does_not_leak_in_the_log_domain),
        cmocka_unit_test(nan_and_infinity_never_enter),
        cmocka_unit_test(borders_are_ordinary),
        cmocka_unit_test(memory_is_told_and_refused),
        cmocka_unit_test(several_blocks_are_one_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
