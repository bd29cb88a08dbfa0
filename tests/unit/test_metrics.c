// SPDX-License-Identifier: BSD-3-Clause
// The error figures against values worked by hand.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/kind/analytic.h"
#include "gonio/metrics.h"
#include "tests/unit/near.h"

static gonio_samples *make(int channels, size_t n, const double *theta_deg, const double *values) {
    gonio_samples *s;
    assert_int_equal(gonio_samples_new(channels, false, &s, NULL), GONIO_OK);
    for (size_t i = 0; i < n; i++) {
        const gonio_pair p = {gonio_radians(theta_deg[i]), 0, 0, 0};
        assert_int_equal(gonio_samples_add(s, &p, values + i * (size_t)channels, NULL, NULL, NULL), GONIO_OK);
    }
    return s;
}

static void by_hand(void **state) {
    (void)state;
    const double theta[] = {0, 70, 80, 10}, f[] = {1, 2, -0.5, 0}, p[] = {1.5, 1, 0.25, -3};
    gonio_samples *s = make(1, 4, theta, f);
    gonio_errors e;
    assert_int_equal(gonio_errors_of(s, p, NULL, &e, NULL), GONIO_OK);
    assert_int_equal(e.samples, 4);
    assert_near(e.rmse, sqrt((0.25 + 1 + 0.5625 + 9) / 4), 1e-15);
    assert_near(e.max_abs, 3, 0);
    assert_near(e.max_rel, 1.5, 0);
    // |p - f|/(f + 1e-3), raised: 0.5/1.001, 1/2.001, 0.25/0.001, 0.
    assert_near(e.median_rel, 0.5 * (0.5 / 1.001 + 1 / 2.001), 1e-15);
    const double l0 = log(1.501 / 1.001), l1 = log(1.001 / 2.001), l2 = log(251);
    assert_near(e.rms_log, sqrt((l0 * l0 + l1 * l1 + l2 * l2) / 4), 1e-14);
    assert_near(e.rmse_70, sqrt((0.25 + 1 + 9) / 3), 1e-15);
    gonio_samples_free(s);
}

static void channels_are_averaged(void **state) {
    (void)state;
    const double theta[] = {0, 10, 20}, f[] = {1, 10, 0, 1, 20, 0, 1, 40, 0}, p[] = {2, 10, 0, 2, 23, 0, 2, 40, 0};
    gonio_samples *s = make(3, 3, theta, f);
    gonio_errors e;
    assert_int_equal(gonio_errors_of(s, p, NULL, &e, NULL), GONIO_OK);
    assert_near(e.rmse, sqrt((1.0 + 3 + 0) / 3), 1e-15); // mean squares 1, 9/3, 0
    assert_near(e.max_abs, (1.0 + 3 + 0) / 3, 1e-15);
    assert_near(e.max_rel, (1.0 + 3.0 / 40) / 2, 1e-15); // the third channel is zero throughout
    assert_near(e.median_rel, (1 / 1.001 + 0 + 0) / 3, 1e-15);
    const bool which[] = {true, false, true};
    assert_int_equal(gonio_errors_of(s, p, which, &e, NULL), GONIO_OK);
    assert_int_equal(e.samples, 2);
    assert_near(e.rmse, sqrt(1.0 / 3), 1e-15);
    gonio_samples_free(s);
}

static void nothing_gives_nan(void **state) {
    (void)state;
    const double theta[] = {80}, f[] = {1}, p[] = {1};
    gonio_samples *s = make(1, 1, theta, f);
    gonio_errors e;
    const bool which[] = {false};
    assert_int_equal(gonio_errors_of(s, p, which, &e, NULL), GONIO_OK);
    assert_int_equal(e.samples, 0);
    assert_true(isnan(e.rmse) && isnan(e.max_abs) && isnan(e.max_rel) && isnan(e.median_rel) && isnan(e.rms_log));
    assert_int_equal(gonio_errors_of(s, p, NULL, &e, NULL), GONIO_OK);
    assert_true(isnan(e.rmse_70)); // the one sample lies beyond 70 deg
    assert_near(e.rmse, 0, 0);
    gonio_samples_free(s);
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// The selection must agree with sorting for any order, with ties, odd and even counts.
static void median_equals_sorting(void **state) {
    (void)state;
    uint32_t seed = 12345;
    for (size_t n = 1; n < 200; n++) {
        double theta[200] = {0}, f[200] = {0}, p[200], sorted[200];
        for (size_t i = 0; i < n; i++) {
            seed = seed * 1664525u + 1013904223u;
            p[i] = (double)((seed >> 8) % (n % 3 == 0 ? 4 : 1000000));
            sorted[i] = p[i] / 1e-3;
        }
        gonio_samples *s = make(1, n, theta, f);
        gonio_errors e;
        assert_int_equal(gonio_errors_of(s, p, NULL, &e, NULL), GONIO_OK);
        qsort(sorted, n, sizeof *sorted, ascending);
        const double expected = n % 2 == 1 ? sorted[n / 2] : 0.5 * (sorted[n / 2] + sorted[n / 2 - 1]);
        assert_near(e.median_rel, expected, 1e-9 * expected);
        gonio_samples_free(s);
    }
}

static void a_model_is_evaluated_at_the_samples(void **state) {
    (void)state;
    gonio_model *m;
    assert_int_equal(gonio_model_from_spec("ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.15", &m, NULL), GONIO_OK);
    gonio_samples *s;
    assert_int_equal(gonio_samples_new(3, false, &s, NULL), GONIO_OK);
    for (int i = 0; i < 10000; i++) { // more than one block
        const gonio_pair p = {i * 1e-4, 0.1, 1 - i * 1e-4, 2};
        double v[3];
        gonio_model_eval_pair(m, &p, v);
        v[1] += 0.25;
        assert_int_equal(gonio_samples_add(s, &p, v, NULL, NULL, NULL), GONIO_OK);
    }
    gonio_errors e;
    assert_int_equal(gonio_errors_model(m, s, NULL, 0, &e, NULL), GONIO_OK);
    assert_near(e.rmse, 0.25 / sqrt(3), 1e-12);
    assert_near(e.max_abs, 0.25 / 3, 1e-12);
    gonio_model *one;
    assert_int_equal(gonio_model_from_spec("lambert:rho=0.5", &one, NULL), GONIO_OK);
    gonio_error error = {0};
    assert_int_equal(gonio_errors_model(one, s, NULL, 0, &e, &error), GONIO_E_INPUT);
    gonio_model_free(one);
    gonio_model_free(m);
    gonio_samples_free(s);
}

static void a_prediction_that_is_no_number_is_an_error(void **state) {
    (void)state;
    const double theta[] = {0, 10}, f[] = {1, 1}, p[] = {1, NAN};
    gonio_samples *s = make(1, 2, theta, f);
    gonio_errors e;
    gonio_error error = {0};
    assert_int_equal(gonio_errors_of(s, p, NULL, &e, &error), GONIO_E_FAILED);
    assert_non_null(strstr(error.message, "theta_i=10"));
    gonio_samples_free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(by_hand),
        cmocka_unit_test(channels_are_averaged),
        cmocka_unit_test(nothing_gives_nan),
        cmocka_unit_test(median_equals_sorting),
        cmocka_unit_test(a_model_is_evaluated_at_the_samples),
        cmocka_unit_test(a_prediction_that_is_no_number_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
