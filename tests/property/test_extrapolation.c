// SPDX-License-Identifier: BSD-3-Clause
// Fits of few samples never leave a sensible range, wherever they are evaluated: up to the horizon, far from the
// samples.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "brdf/kind/lobe_spline.h"
#include "gonio/fit.h"
#include "tests/simulate.h"

static const char *const materials[] = {
    "ward:rho_d=0.3,rho_s=0.2,alpha=0.15",
    "ward:rho_d=0.3,rho_s=0.2,alpha=0.03",
    "cook-torrance:rho_d=0.1,rho_s=0.6,alpha=0.25,f0=0.04",
    "ggx:rho_d=0.02,rho_s=0.9,alpha=0.1,f0=0.5",
    "lambert:rho=0.5",
};
#define MATERIALS (sizeof materials / sizeof *materials)

static gonio_model *fitted(const gonio_samples *samples, const char *method, gonio_fit_report *report) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = method;
    o.threads = 2;
    o.hold_out = report != NULL ? 0.2 : 0;
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_fit(samples, &o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return model;
}

static double largest(const gonio_samples *samples) {
    double value = 0;
    for (size_t i = 0; i < samples->n; i++) {
        value = fmax(value, samples->values[i]);
    }
    return value;
}

static double base_at(const gonio_lobe_spline_parts *parts, gonio_vec3 wi, gonio_vec3 wo) {
    double units[1 + GONIO_LOBES_MAX], sum = 0;
    gonio_lobe_base_units(&parts->base, wi, wo, units);
    for (int j = 0; j <= parts->base.lobes && parts->base.lobes > 0; j++) {
        sum += parts->base.strength[j] * units[j];
    }
    return sum;
}

// Cosines uniform to the horizon itself, which every tenth direction lies on.
static gonio_vec3 anywhere(uint64_t *state, size_t i) {
    const double z = i % 10 == 0 ? 0 : simulate_uniform(state);
    return gonio_direction(acos(z), 2 * GONIO_PI * simulate_uniform(state));
}

// At most 4 times the largest sample, or the base there; and the base itself at most 64 times (docs/fitting.md).
static void check_range(const gonio_model *model, const gonio_samples *samples, size_t directions, uint64_t seed) {
    const gonio_lobe_spline_parts *parts = gonio_lobe_spline_about(model);
    const double most = largest(samples);
    for (size_t i = 0; i < directions; i++) {
        const gonio_vec3 wi = anywhere(&seed, i), wo = anywhere(&seed, i / 10);
        double value, sigma = 0;
        gonio_model_eval(model, wi, wo, &value);
        const double limit = fmin(fmax(4.2 * most, 1.000001 * base_at(parts, wi, wo)), 64.1 * most);
        if (!(value >= 0 && value <= limit)) {
            fail_msg("%g at theta %g, %g deg; the largest sample is %g", value, acos(wi.z) * 180 / GONIO_PI,
                     acos(wo.z) * 180 / GONIO_PI, most);
        }
        assert_true(!gonio_model_sigma(model, wi, wo, &sigma) || (sigma >= 0 && isfinite(sigma)));
    }
}

static void test_sparse_sets_stay_in_range(void **state) {
    (void)state;
    static const char *const methods[] = {"auto", "lsq"};
    for (size_t m = 0; m < MATERIALS; m++) {
        for (uint64_t seed = 1; seed <= 2; seed++) {
            gonio_samples *samples = simulate_samples(materials[m], 110, 1, seed);
            for (int k = 0; k < (seed == 1 ? 2 : 1); k++) {
                gonio_model *model = fitted(samples, methods[k], NULL);
                check_range(model, samples, 40000, seed);
                gonio_model_free(model);
            }
            gonio_samples_free(samples);
        }
    }
}

// The iterative solver's models too.
static void test_large_sets_stay_in_range(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(materials[0], 2200, 1, 5);
    gonio_model *model = fitted(samples, "auto", NULL);
    check_range(model, samples, 40000, 5);
    gonio_model_free(model);
    gonio_samples_free(samples);
}

// What a fit of few samples predicts is better than no prediction at all: held-out errors below the values themselves.
static void test_held_out_errors_are_sane(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= 2; seed++) {
        gonio_samples *samples = simulate_samples(materials[0], 200, 1, seed);
        gonio_fit_report report;
        gonio_model *model = fitted(samples, "auto", &report);
        double squares = 0;
        for (size_t i = 0; i < samples->n; i++) {
            squares += samples->values[i] * samples->values[i] / (double)samples->n;
        }
        print_message("# held out: rmse %.3g, values %.3g, median_rel %.3g\n", report.held_out.rmse, sqrt(squares),
                      report.held_out.median_rel);
        assert_true(report.held_out.rmse < sqrt(squares));
        assert_true(report.held_out.median_rel < 0.02);
        gonio_model_free(model);
        gonio_samples_free(samples);
    }
}

// 8 to 10 samples, near the horizon as well: the values themselves, no peak, finite slopes.
static void test_a_handful_of_samples(void **state) {
    (void)state;
    for (size_t n = 1; n <= 12; n++) {
        gonio_samples *samples = simulate_samples("lambert:rho=0.5", n, 1, 100 + n);
        samples->pairs[0].theta_i = 89.9 * GONIO_PI / 180;
        gonio_model *model = fitted(samples, "auto", NULL);
        uint64_t stream = n;
        for (size_t i = 0; i < 5000; i++) {
            const gonio_vec3 wi = anywhere(&stream, i), wo = anywhere(&stream, i / 10);
            double value;
            gonio_model_eval(model, wi, wo, &value);
            assert_true(fabs(value - 0.5 / GONIO_PI) < 0.01 * value);
            const gonio_pair pair = {acos(wi.z), atan2(wi.y, wi.x), acos(wo.z), atan2(wo.y, wo.x)};
            double slope[4];
            gonio_model_gradient(model, &pair, 0, slope);
            for (int k = 0; k < 4; k++) {
                assert_true(fabs(slope[k]) < 0.1);
            }
        }
        gonio_model_free(model);
        gonio_samples_free(samples);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sparse_sets_stay_in_range),
        cmocka_unit_test(test_large_sets_stay_in_range),
        cmocka_unit_test(test_held_out_errors_are_sane),
        cmocka_unit_test(test_a_handful_of_samples),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
