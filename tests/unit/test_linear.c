// SPDX-License-Identifier: BSD-3-Clause
// Linear bases: how many terms, orthogonality, reciprocity, the horizon; what their fits find.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/analytic/formula.h"
#include "brdf/kind/linear.h"
#include "gonio/fit.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"

static const gonio_linear_basis *const bases[] = {&gonio_basis_koenderink, &gonio_basis_harmonics};

static void terms_are_counted(void **state) {
    (void)state;
    // Kameya 2002: 55 terms at order 8.
    static const int koenderink[] = {1, 2, 5, 8, 14, 20, 30, 40, 55, 70, 91, 112, 140};
    for (int order = 0; order <= 12; order++) {
        assert_int_equal(gonio_basis_koenderink.terms(order, true), koenderink[order]);
    }
    assert_int_equal(gonio_basis_koenderink.terms(20, true), 506);
    assert_int_equal(gonio_basis_harmonics.terms(1, true), 1);
    assert_int_equal(gonio_basis_harmonics.terms(8, true), 40);
    assert_int_equal(gonio_basis_harmonics.terms(8, false), 666);
    for (int b = 0; b < 2; b++) {
        for (int isotropic = 0; isotropic < 2; isotropic++) {
            assert_true(bases[b]->order_max[isotropic] == 0 ||
                        bases[b]->terms(bases[b]->order_max[isotropic], isotropic) <= GONIO_LINEAR_TERMS_MAX);
        }
    }
}

// A.3 of Kameya 2002 as it stands.
#define FACTORIALS(type, name)                                                                                         \
    static double name(int n, int l, double r) {                                                                       \
        type sum = 0;                                                                                                  \
        for (int s = 0; s <= (n - l) / 2; s++) {                                                                       \
            type term = s % 2 == 0 ? 1 : -1;                                                                           \
            for (int k = 2; k <= n - s; k++) {                                                                         \
                term *= (type)k;                                                                                       \
            }                                                                                                          \
            for (int k = 2; k <= s; k++) {                                                                             \
                term /= (type)k;                                                                                       \
            }                                                                                                          \
            for (int k = 2; k <= (n + l) / 2 - s; k++) {                                                               \
                term /= (type)k;                                                                                       \
            }                                                                                                          \
            for (int k = 2; k <= (n - l) / 2 - s; k++) {                                                               \
                term /= (type)k;                                                                                       \
            }                                                                                                          \
            sum += term * (type)pow(r, n - 2 * s);                                                                     \
        }                                                                                                              \
        return (double)sum;                                                                                            \
    }
FACTORIALS(double, factorials)
FACTORIALS(float, narrow_factorials)

// |R_n^l(r)| out of a row: its last terms are n = m = order, 2 Th_n^l(theta)^2 for equal directions.
static double by_row(int n, int l, double r) {
    double row[GONIO_LINEAR_TERMS_MAX];
    const gonio_vec3 w = gonio_direction(2 * asin(r / sqrt(2)), 0.3);
    gonio_basis_koenderink.row(n, true, w, w, row);
    const int last = gonio_basis_koenderink.terms(n, true) - 1;
    return sqrt(row[last - (n - l) / 2] * GONIO_PI / (n + 1));
}

// |R_n^l(1)| = 1: the recurrence keeps it to rounding; short of r = 1 the sum of factorials loses a digit every four
// orders.
static void recurrence_keeps_what_factorials_lose(void **state) {
    (void)state;
    static const int orders[] = {4, 8, 12, 16, 20};
    for (int k = 0; k < 5; k++) {
        double worst[3] = {0};
        for (int l = 0; l <= orders[k]; l += 2) {
            worst[0] = fmax(worst[0], fabs(by_row(orders[k], l, 1) - 1));
            for (double r = 0.85; r < 1; r += 0.03) {
                const double value = by_row(orders[k], l, r);
                worst[1] = fmax(worst[1], fabs(fabs(factorials(orders[k], l, r)) - value));
                worst[2] = fmax(worst[2], fabs(fabs(narrow_factorials(orders[k], l, r)) - value));
            }
        }
        print_message("# order %2d: recurrence %.1e, factorials in double %.1e, in float %.1e\n", orders[k], worst[0],
                      worst[1], worst[2]);
        assert_true(worst[0] < 1e-13 && worst[1] < 1e-9);
        assert_true(orders[k] < 20 || (worst[1] > 1e-12 && worst[2] > 1e-3));
    }
}

// Normalised on the hemisphere: root 2 times Y_20 .. as tables give them, over the cosine.
static void harmonics_have_their_closed_forms(void **state) {
    (void)state;
    const gonio_vec3 i = gonio_direction(0.5, 0.3), o = gonio_direction(1.1, 2.0);
    double row[GONIO_LINEAR_TERMS_MAX];
    gonio_basis_harmonics.row(3, true, i, o, row);
    const double l1 = sqrt(3 / (2 * GONIO_PI)), scale = sqrt(7 / (8 * GONIO_PI));
    const double l3_i = scale * (5 * i.z * i.z - 3), l3_o = scale * (5 * o.z * o.z - 3);
    const double along = i.x * o.x + i.y * o.y, across = i.y * o.x - i.x * o.y;
    const double expected[] = {2 * l1 * l1, l1 * (l3_i + l3_o), 2 * l3_i * l3_o, 15 / GONIO_PI * along,
                               105 / (4 * GONIO_PI) * (along * along - across * across)};
    assert_int_equal(gonio_basis_harmonics.terms(3, true), 5);
    for (int k = 0; k < 5; k++) {
        assert_near(row[k], expected[k], 1e-12);
    }
    // The same function out of the terms in four dimensions: those of m = 1 are cos cos + sin sin.
    double all[GONIO_LINEAR_TERMS_MAX];
    gonio_basis_harmonics.row(2, false, i, o, all);
    assert_int_equal(gonio_basis_harmonics.terms(2, false), 6);
    assert_near(all[0], expected[0], 1e-12);
    assert_near(all[2] + all[5], expected[3], 1e-12);
}

static void reciprocal_and_finite(void **state) {
    (void)state;
    uint64_t seed = 3;
    for (int b = 0; b < 2; b++) {
        for (int isotropic = 0; isotropic < 2; isotropic++) {
            const int order = bases[b]->order_max[isotropic], terms = order > 0 ? bases[b]->terms(order, isotropic) : 0;
            for (int i = 0; i < 40 && order > 0; i++) {
                double there[GONIO_LINEAR_TERMS_MAX], back[GONIO_LINEAR_TERMS_MAX];
                const gonio_pair p = simulate_pair(&seed, 0);
                // Poles and the horizon among them.
                const double theta_i = i % 4 == 0 ? 0 : i % 4 == 1 ? GONIO_PI / 2 : p.theta_i;
                const gonio_vec3 wi = gonio_direction(theta_i, p.phi_i), wo = gonio_direction(p.theta_o, p.phi_o);
                bases[b]->row(order, isotropic, wi, wo, there);
                bases[b]->row(order, isotropic, wo, wi, back);
                for (int k = 0; k < terms; k++) {
                    assert_true(isfinite(there[k]));
                    assert_near(there[k], back[k], 1e-9 * (1 + fabs(there[k])));
                }
                assert_near(there[0], 1 / GONIO_PI * (b == 0 ? 1 : 3), 1e-12);
            }
        }
    }
}

static gonio_model *fitted(const gonio_samples *samples, const char *method, int order, gonio_fit_report *report) {
    gonio_fit_options o;
    gonio_model *model;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.method = method;
    o.hold_out = 0;
    o.order = order;
    if (gonio_fit(samples, &o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s: %s", method, error.message);
    }
    return model;
}

// Samples of a model of the basis are fitted by it to rounding, every coefficient.
static void coefficients_are_found(void **state) {
    (void)state;
    static const char *const methods[] = {"koenderink", "spherical-harmonics"};
    for (int b = 0; b < 2; b++) {
        for (int isotropic = b == 0; isotropic < 2; isotropic++) {
            const int order = isotropic ? 5 : 3, terms = bases[b]->terms(order, isotropic);
            double a[GONIO_LINEAR_TERMS_MAX];
            for (int k = 0; k < terms; k++) {
                a[k] = k == 0 ? 1 : 0.2 * sin(k) / (1 + k);
            }
            const char names[1][32] = {"value"};
            gonio_model *truth, *model;
            assert_int_equal(gonio_linear_new(bases[b], order, isotropic, 1, a, NULL, names, &truth, NULL), GONIO_OK);
            gonio_samples *samples;
            assert_int_equal(gonio_samples_new(1, false, &samples, NULL), GONIO_OK);
            samples->isotropic = isotropic;
            uint64_t seed = 7;
            for (int i = 0; i < 300; i++) {
                const gonio_pair pair = simulate_pair(&seed, isotropic);
                double value;
                gonio_model_eval_pair(truth, &pair, &value);
                assert_int_equal(gonio_samples_add(samples, &pair, &value, NULL, NULL, NULL), GONIO_OK);
            }
            model = fitted(samples, methods[b], order, NULL);
            const double *found = gonio_linear_coefficients(model, bases[b]);
            assert_non_null(found);
            for (int k = 0; k < terms; k++) {
                assert_near(found[k], a[k], 1e-7);
            }
            gonio_model_free(model);
            gonio_model_free(truth);
            gonio_samples_free(samples);
        }
    }
}

// With noise and hardly more samples than terms the ridge keeps the fit sane where it has no samples.
static void ridge_is_chosen(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ward:rho_d=0.3,rho_s=0.1,alpha=0.5", 70, 1, 11);
    uint64_t seed = 12;
    for (size_t i = 0; i < samples->n; i++) {
        samples->values[i] *= 1 + 0.1 * (2 * simulate_uniform(&seed) - 1);
    }
    gonio_fit_report report;
    gonio_model *model = fitted(samples, "koenderink", 8, &report),
                *truth = simulate_truth("ward:rho_d=0.3,rho_s=0.1,alpha=0.5");
    double worst = 0, ratio = 0;
    for (int i = 0; i < 500; i++) {
        const gonio_pair pair = simulate_pair(&seed, 1);
        double is, expected;
        gonio_model_eval_pair(model, &pair, &is);
        gonio_model_eval_pair(truth, &pair, &expected);
        worst = fmax(worst, fabs(is - expected));
        double sigma;
        assert_true(gonio_model_sigma(model, gonio_direction(pair.theta_i, pair.phi_i),
                                      gonio_direction(pair.theta_o, pair.phi_o), &sigma));
        ratio += gonio_square((is - expected) / sigma) / 500;
    }
    print_message("# error over sigma, root mean square: %.2f\n", sqrt(ratio));
    assert_true(ratio > 0.1 && ratio < 2);
    assert_true(worst < 0.2); // f_r is 0.1 to 0.4
    assert_non_null(strstr(report.options, "terms=55"));
    gonio_model_free(model);
    gonio_model_free(truth);
    gonio_samples_free(samples);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(terms_are_counted),
        cmocka_unit_test(recurrence_keeps_what_factorials_lose),
        cmocka_unit_test(harmonics_have_their_closed_forms),
        cmocka_unit_test(reciprocal_and_finite),
        cmocka_unit_test(coefficients_are_found),
        cmocka_unit_test(ridge_is_chosen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
