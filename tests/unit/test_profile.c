// SPDX-License-Identifier: BSD-3-Clause
// The direct solver's further terms, a profile and the lobes' shares: leave-one-out against leaving out, and models
// with them, evaluated, saved and opened again.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "brdf/spline/profile.h"
#include "fit/lobes/fit.h"
#include "fit/smooth/loo.h"
#include "fit/smooth/modes.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"

#define SPEC "lambert:rho=0.2+ggx:rho_s=0.3,alpha=0.12,f0=0.05+ggx:rho_s=0.3,alpha=0.4,f0=0.05"
#define SAMPLES 150
#define LAMBDA 1e-3

typedef struct set {
    gonio_samples *samples;
    gonio_dataset data;
    gonio_smooth_base base; // Cook-Torrance lobes: the wrong family, so that there is something left
    gonio_smooth_form form;
} set;

static set set_up(size_t n) {
    set s = {.samples = simulate_samples(SPEC, n, 1, 7)};
    const gonio_dataset_options how = {.mirror = true, .domain = GONIO_LOG};
    gonio_lobe_base lobes;
    assert_int_equal(gonio_dataset_init(&s.data, s.samples, &how, NULL), GONIO_OK);
    assert_int_equal(gonio_lobe_fit(&s.data, GONIO_LOBE_COOK_TORRANCE, 2, NULL, &lobes, NULL), GONIO_OK);
    assert_int_equal(gonio_smooth_base_init(&s.base, &s.data, &lobes, NULL), GONIO_OK);
    s.form = gonio_smooth_form_default(GONIO_HALF_VECTOR, 2, true);
    s.form.profile = 0.3;
    s.form.profile_level = 4;
    s.form.profile_stretch[0] = 1;
    s.form.profile_stretch[1] = 10;
    return s;
}

static void tear_down(set *s) {
    gonio_smooth_base_release(&s->base);
    gonio_dataset_release(&s->data);
    gonio_samples_free(s->samples);
}

static gonio_smooth_dense *solver(const gonio_dataset *data, const gonio_smooth_form *form,
                                  const gonio_lobe_base *lobes) {
    gonio_smooth_dense *dense;
    assert_int_equal(gonio_smooth_dense_new(data, form, lobes, &dense, NULL), GONIO_OK);
    return dense;
}

// Lattice, profile and shares of a fit of `rest`, at a pair.
static double predicted(const gonio_smooth_dense *dense, const set *s, const double *rest, const gonio_pair *pair) {
    const double lambda = LAMBDA;
    const gonio_vec3 wi = gonio_direction(pair->theta_i, pair->phi_i), wo = gonio_direction(pair->theta_o, pair->phi_o);
    gonio_lattice lattice, profile;
    double *shares, x[3], y[2], sum, more = 0, mean[3], units[3], share[3];
    assert_int_equal(gonio_smooth_dense_solve(dense, rest, 1, &lambda, &lattice, NULL), GONIO_OK);
    assert_int_equal(gonio_smooth_dense_profile_solve(dense, rest, 1, &lambda, &profile, NULL), GONIO_OK);
    assert_int_equal(gonio_smooth_dense_shares_solve(dense, rest, 1, &lambda, &shares, NULL), GONIO_OK);
    gonio_coordinates_isotropic(GONIO_HALF_VECTOR, wi, wo, x);
    gonio_profile_locate(GONIO_HALF_VECTOR, x, y);
    gonio_lattice_eval(&lattice, x, &sum);
    if (profile.points != NULL) {
        gonio_lattice_eval(&profile, y, &more);
    }
    gonio_lobe_mean_strengths(&s->base.lobes, 1, mean);
    gonio_lobe_base_units(&s->base.lobes, wi, wo, units);
    gonio_lobe_shares(&s->base.lobes, mean, units, share);
    assert_near(share[0] + share[1] + share[2], 1, 1e-12);
    sum += more;
    for (int j = 0; j < 3 && shares != NULL; j++) {
        sum += shares[j] * share[j];
    }
    gonio_lattice_release(&lattice);
    gonio_lattice_release(&profile);
    free(shares);
    return sum;
}

static void test_leave_one_out_is_what_it_says(void **state) {
    (void)state;
    set s = set_up(SAMPLES);
    const double lambda = LAMBDA;
    double *residuals = malloc(s.data.n * sizeof *residuals), *rest = malloc(s.data.n * sizeof *rest);
    gonio_smooth_dense *dense = solver(&s.data, &s.form, &s.base.lobes);
    assert_int_equal(gonio_smooth_dense_loo(dense, s.base.rest, 1, 1, &lambda, &residuals, NULL), GONIO_OK);
    for (size_t out = 0; out < s.data.n; out += 29) {
        bool keep[SAMPLES];
        for (size_t i = 0, at = 0; i < s.data.n; i++) {
            keep[i] = i != out;
            if (keep[i]) {
                rest[at++] = s.base.rest[i];
            }
        }
        gonio_dataset part;
        assert_int_equal(gonio_dataset_select(&s.data, keep, &part, NULL), GONIO_OK);
        gonio_smooth_dense *without = solver(&part, &s.form, &s.base.lobes);
        assert_near(residuals[out], s.base.rest[out] - predicted(without, &s, rest, &s.data.pairs[out]), 2e-5);
        gonio_smooth_dense_free(without);
        gonio_dataset_release(&part);
    }
    gonio_smooth_dense_free(dense);
    free(residuals);
    free(rest);
    tear_down(&s);
}

// What the weights of the samples make of them elsewhere, which sigma is told from, is what lattice, profile and shares
// say there; and the variance at a sample is what leaving it out tells.
static void test_weights_predict_what_the_terms_say(void **state) {
    (void)state;
    enum { PLACES = 8 };
    set s = set_up(SAMPLES);
    for (size_t i = 0; i < PLACES; i++) {
        s.data.weights[i] = 1e-3;
    }
    for (int terms = 0; terms < 4; terms++) {
        gonio_smooth_form form = s.form;
        form.profile = terms & 1 ? form.profile : 0;
        gonio_smooth_dense *dense = solver(&s.data, &form, terms & 2 ? &s.base.lobes : NULL);
        double *weights = malloc(s.data.n * PLACES * sizeof *weights), *influence = malloc(s.data.n * s.data.n * 8);
        double shares[PLACES * GONIO_SMOOTH_SHARES], variance[PLACES], *x = malloc(3 * s.data.n * sizeof *x);
        gonio_dataset_locate(&s.data, GONIO_HALF_VECTOR, x);
        gonio_smooth_shares(&s.base.lobes, 1, PLACES, s.data.pairs, shares);
        assert_int_equal(gonio_smooth_dense_spread(dense, LAMBDA, PLACES, x, shares, weights, variance, NULL),
                         GONIO_OK);
        assert_int_equal(gonio_smooth_dense_influence(dense, LAMBDA, influence, NULL), GONIO_OK);
        for (size_t k = 0; k < PLACES; k++) {
            double sum = 0;
            for (size_t i = 0; i < s.data.n; i++) {
                sum += weights[k * s.data.n + i] * sqrt(s.data.weights[i]) * s.base.rest[i];
            }
            assert_near(sum, predicted(dense, &s, s.base.rest, &s.data.pairs[k]), 2e-5);
            // 1/Q_kk - 1 = w v, v the variance without the sample, whose weight w makes v/(1 + w v) of it.
            const double w = s.data.weights[k], wv = 1 / influence[k * s.data.n + k] - 1;
            assert_near(variance[k] / (wv / w / (1 + wv)), 1, 1e-4);
        }
        gonio_smooth_dense_free(dense);
        free(weights);
        free(influence);
        free(x);
    }
    tear_down(&s);
}

// The covariance by splines (fit/smooth/covariance.c) is the one that was summed mode by mode and decomposed.
static void compare_covariances(const gonio_dataset *data, const gonio_smooth_form *form) {
    const size_t n = data->n;
    gonio_smooth_dense *dense = solver(data, form, NULL);
    double *out = malloc(n * n * sizeof *out), *own = malloc(n * sizeof *own), *x = malloc(4 * n * sizeof *x);
    gonio_dataset_locate(data, form->coordinates, x);
    assert_int_equal(gonio_smooth_covariance(dense, n, x, dense->feature, dense->root, out, own, NULL), GONIO_OK);
    for (size_t i = 0; i < n; i++) {
        assert_near(own[i] * data->weights[i] / out[i * n + i], 1, 1e-12);
        for (size_t k = 0; k < n; k++) {
            double sum = 0;
            for (size_t j = 0; j < n; j++) {
                sum += dense->vectors[j * n + i] * dense->values[j] * dense->vectors[j * n + k];
            }
            assert_near(sum, out[i * n + k], 1e-12 * dense->values[n - 1]);
        }
    }
    gonio_smooth_dense_free(dense);
    free(out);
    free(own);
    free(x);
}

static void test_both_covariances_are_one(void **state) {
    (void)state;
    static const char *const specs[] = {SPEC, "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.4"};
    for (size_t k = 0; k < 2; k++) {
        gonio_samples *samples = simulate_samples(specs[k], 40, 1, 7);
        for (gonio_coordinates c = 0; c < GONIO_COORDINATES; c++) {
            for (int mirror = 0; mirror < 2; mirror++) {
                const gonio_dataset_options how = {.mirror = mirror, .domain = GONIO_LOG};
                gonio_dataset data;
                assert_int_equal(gonio_dataset_init(&data, samples, &how, NULL), GONIO_OK);
                gonio_smooth_form form = gonio_smooth_form_default(c, k == 0 ? 3 : 2, mirror);
                form.stretch[1] = 10;
                form.reciprocity = 0.7;
                compare_covariances(&data, &form);
                gonio_dataset_release(&data);
            }
        }
        gonio_samples_free(samples);
    }
}

// A model with a small lambda meets its samples, before it is saved and after.
static void test_models_carry_the_terms(void **state) {
    (void)state;
    set s = set_up(60);
    const double lambda = 1e-9;
    static const char names[1][32] = {"value"};
    gonio_lobe_spline_parts parts;
    gonio_model *model, *back;
    char path[] = "/tmp/gonio-profile-XXXXXX";
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    gonio_smooth_dense *dense = solver(&s.data, &s.form, &s.base.lobes);
    assert_int_equal(gonio_smooth_dense_parts(dense, &s.data, &s.base, &lambda, &parts, NULL), GONIO_OK);
    assert_non_null(parts.profile.points);
    assert_non_null(parts.shares);
    parts.channel_names = names;
    assert_int_equal(gonio_lobe_spline_new(&parts, &model, NULL), GONIO_OK);
    assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
    assert_int_equal(gonio_model_open(path, &back, NULL), GONIO_OK);
    assert_true(back->bytes == model->bytes && back->control_points == 343 + 361);
    for (size_t i = 0; i < s.data.n; i++) {
        double a, b;
        gonio_model_eval_pair(model, &s.data.pairs[i], &a);
        gonio_model_eval_pair(back, &s.data.pairs[i], &b);
        assert_memory_equal(&a, &b, sizeof a);
        assert_near(a / s.data.values[i], 1, 1e-3);
    }
    gonio_model_free(model);
    gonio_model_free(back);
    gonio_smooth_dense_free(dense);
    unlink(path);
    tear_down(&s);
}

// One radius for every system's coordinates of the same pair.
static void test_profiles_do_not_depend_on_the_coordinates(void **state) {
    (void)state;
    static const gonio_coordinates systems[] = {GONIO_HALF_VECTOR, GONIO_HALF_VECTOR_NARROW, GONIO_HALF_VECTOR_WIDE};
    uint64_t seed = 11;
    for (int k = 0; k < 1000; k++) {
        const gonio_vec3 wi = gonio_direction(1.5 * simulate_uniform(&seed), 0);
        const gonio_vec3 wo = gonio_direction(1.5 * simulate_uniform(&seed), 6.2 * simulate_uniform(&seed));
        double x[3], y[2], first[2];
        for (int s = 0; s < 3; s++) {
            gonio_coordinates_isotropic(systems[s], wi, wo, x);
            gonio_profile_locate(systems[s], x, s == 0 ? first : y);
            if (s > 0) {
                assert_near(y[0], first[0], 1e-9);
                assert_near(y[1], first[1], 1e-12);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_leave_one_out_is_what_it_says),
        cmocka_unit_test(test_weights_predict_what_the_terms_say),
        cmocka_unit_test(test_both_covariances_are_one),
        cmocka_unit_test(test_models_carry_the_terms),
        cmocka_unit_test(test_profiles_do_not_depend_on_the_coordinates),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
