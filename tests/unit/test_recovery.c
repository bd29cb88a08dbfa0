// SPDX-License-Identifier: BSD-3-Clause
// Fits of formulae find random truths again: one or two of each here, a hundred in tests/bench/analytic_recovery.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/recovery.h"
#include "tests/unit/near.h"

static gonio_fit_options method(const char *name) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = name;
    o.hold_out = 0;
    o.threads = 1;
    return o;
}

static gonio_model *fitted(const gonio_samples *samples, const gonio_fit_options *o, gonio_fit_report *report) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_fit(samples, o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s: %s", o->method, error.message);
    }
    return model;
}

// Without noise to 1e-6; where the data hardly decide, f_r to 1e-6.
static void truths_are_found(void **state) {
    (void)state;
    for (size_t k = 0; k < RECOVERY_CASES; k++) {
        const recovery_case *c = &recovery_cases[k];
        if (c->lobes > 2 || (c->lobes == 2 && strcmp(c->method, "lafortune") != 0)) {
            continue;
        }
        uint64_t seed = 1 + k;
        const recovery r = recovery_run(c, 150, 0, &seed);
        if (r.failed || !r.converged || !((r.condition > 1e6 ? r.f_worst : r.worst) <= 1e-6)) {
            fail_msg("%s, %d lobes: %s, worst parameter %.2g, worst f_r %.2g, condition %.2g", c->method, c->lobes,
                     r.failed      ? "failed"
                     : r.converged ? "converged"
                                   : "did not converge",
                     r.worst, r.f_worst, r.condition);
        }
    }
}

// 2 % of noise: of a hundred or so parameters, all but a few within 3 of their stated sigmas.
static void sigmas_cover(void **state) {
    (void)state;
    int within = 0, parameters = 0;
    for (size_t k = 0; k < RECOVERY_CASES; k++) {
        const recovery_case *c = &recovery_cases[k];
        uint64_t seed = 101 + k;
        for (int t = 0; c->lobes == 1 && t < 2; t++) {
            const recovery r = recovery_run(c, 100, 0.02, &seed);
            assert_false(r.failed);
            within += r.within;
            parameters += r.parameters;
        }
    }
    print_message("# %d of %d parameters within 3 sigma\n", within, parameters);
    assert_true(within >= 0.95 * parameters);
}

// The arrow of several channels: strengths and their sigmas are those of fits of one channel with the shape that all
// share; a shape's sigma falls with the channels.
static void channels_share_shapes(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ward:rho_d=0.3,rho_s=0.2,alpha=0.2", 200, 3, 3);
    uint64_t seed = 5;
    for (size_t i = 0; i < samples->n * 3; i++) {
        samples->values[i] *= 1 + 0.02 * recovery_normal(&seed);
    }
    gonio_fit_options o = method("ward");
    gonio_model *shared = fitted(samples, &o, NULL);
    o.shapes = GONIO_SHAPES_CHANNEL;
    gonio_model *own = fitted(samples, &o, NULL);
    size_t count;
    const double *p = gonio_analytic_parameters(shared, &count), *q = gonio_analytic_parameters(own, &count);
    const double *sp = gonio_analytic_sigmas(shared), *sq = gonio_analytic_sigmas(own);
    assert_int_equal(count, 12);
    assert_true(p[2] == p[6] && p[6] == p[10] && q[2] != q[6] && q[6] != q[10]);
    for (int c = 0; c < 3; c++) {
        assert_near(p[4 * c], 0.3 * (1 + 0.01 * c), 4 * sp[4 * c]);
        assert_near(p[4 * c + 1], 0.2 * (1 + 0.01 * c), 4 * sp[4 * c + 1]);
        assert_near(p[4 * c + 2], 0.2, 4 * sp[4 * c + 2]);
        assert_near(sp[4 * c + 2] / sq[4 * c + 2], 1 / sqrt(3), 0.1);
    }
    gonio_model_free(shared);
    gonio_model_free(own);
    gonio_samples_free(samples);
}

// Whatever the residuals measure, samples without noise give the truth.
static void losses_agree_without_noise(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ggx:rho_d=0.2,rho_s=0.8,alpha=0.18,f0=0.05", 300, 1, 1);
    for (int loss = 0; loss < GONIO_LOSSES; loss++) {
        gonio_fit_options o = method("ggx");
        gonio_fit_report report;
        o.lobes = 1;
        o.loss = (gonio_loss)loss;
        gonio_model *model = fitted(samples, &o, &report);
        size_t count;
        const double *p = gonio_analytic_parameters(model, &count);
        assert_near(p[0], 0.2, 1e-7);
        assert_near(p[2], 0.18, 1e-7);
        assert_near(p[4], 0.05, 1e-6);
        assert_non_null(strstr(report.options, gonio_loss_names()[loss]));
        gonio_model_free(model);
    }
    gonio_samples_free(samples);
}

static void outliers_do_not_pull_the_lobe(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("cook-torrance:rho_d=0.3,rho_s=0.5,alpha=0.2,f0=0.1", 600, 1, 2);
    for (size_t i = 0; i < samples->n; i += 20) {
        samples->values[i] *= 50;
    }
    const gonio_fit_options o = method("cook-torrance");
    gonio_fit_report report;
    gonio_model_free(fitted(samples, &o, &report));
    assert_true(report.train.median_rel < 0.05);
    gonio_samples_free(samples);
}

// More lobes never describe the samples worse, and no more are taken than there are.
static void lobes_are_counted(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ggx:rho_d=0.1,rho_s=0.4,alpha=0.15+ward:rho_s=0.2,alpha=0.4", 120, 1, 4);
    gonio_fit_options o = method("lafortune");
    double before = INFINITY;
    for (o.lobes = 1; o.lobes <= 3; o.lobes++) {
        gonio_fit_report report;
        gonio_model *model = fitted(samples, &o, &report);
        const gonio_analytic_term *terms;
        assert_int_equal(gonio_analytic_terms(model, &terms), o.lobes);
        assert_true(report.train.rms_log < 1.02 * before);
        before = report.train.rms_log;
        gonio_model_free(model);
    }
    gonio_model *model;
    gonio_error error = {0};
    o = method("ward");
    o.lobes = 4;
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_USAGE);
    assert_non_null(strstr(error.message, "at most 3"));
    gonio_samples_free(samples);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(truths_are_found),
        cmocka_unit_test(sigmas_cover),
        cmocka_unit_test(channels_share_shapes),
        cmocka_unit_test(losses_agree_without_noise),
        cmocka_unit_test(outliers_do_not_pull_the_lobe),
        cmocka_unit_test(lobes_are_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
