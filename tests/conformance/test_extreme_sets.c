// SPDX-License-Identifier: BSD-3-Clause
// Every method on the sets that break fitters: it gives a model that answers finite numbers everywhere, and says so
// where its search did not converge, or it refuses with what is missing. Never NaN, never silent.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/method.h"
#include "tests/simulate.h"

#define CHANNELS 2

typedef double value_of(const gonio_pair *pair, size_t index, const double *truth);

typedef struct extreme {
    const char *name;
    size_t n;
    bool isotropic;
    value_of *value;
    bool in_plane; // all geometries in the plane of incidence, one incidence
} extreme;

static double tilt2(const gonio_pair *p) {
    const gonio_vec3 i = gonio_direction(p->theta_i, p->phi_i), o = gonio_direction(p->theta_o, p->phi_o);
    const double x = i.x + o.x, y = i.y + o.y, z = i.z + o.z;
    return (x * x + y * y) / (z * z);
}

// A mirror: 1e6 within a degree of the mirror direction over 1e-3.
static double mirror_peak(const gonio_pair *p, size_t index, const double *truth) {
    (void)index;
    (void)truth;
    return 1e-3 + 1e6 * exp(-tilt2(p) / 1e-4);
}
static double constant(const gonio_pair *p, size_t index, const double *truth) {
    (void)p;
    (void)index;
    (void)truth;
    return 0.25;
}
static double plain(const gonio_pair *p, size_t index, const double *truth) {
    (void)p;
    (void)index;
    return *truth;
}
static double half_zeros(const gonio_pair *p, size_t index, const double *truth) {
    (void)p;
    return index % 2 == 0 ? *truth : 0;
}
static double all_zeros(const gonio_pair *p, size_t index, const double *truth) {
    (void)p;
    (void)index;
    (void)truth;
    return 0;
}
static double noise_about_zero(const gonio_pair *p, size_t index, const double *truth) {
    (void)p;
    (void)truth;
    return index % 3 == 0 ? -1e-3 : 1e-3;
}

static const extreme extremes[] = {
    {"a mirror's peak", 24, true, mirror_peak, false}, {"a constant", 12, true, constant, false},
    {"five samples", 5, true, plain, false},           {"half zeros", 16, true, half_zeros, false},
    {"all zeros", 12, true, all_zeros, false},         {"noise about zero", 12, true, noise_about_zero, false},
    {"collinear columns", 14, true, plain, true},      {"four dimensions", 16, false, plain, false},
};
#define EXTREMES (sizeof extremes / sizeof *extremes)

static gonio_samples *make(const extreme *e) {
    gonio_model *truth = simulate_truth(e->isotropic ? "ward:rho_d=0.3,rho_s=0.2,alpha=0.3"
                                                     : "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.4");
    gonio_samples *samples;
    uint64_t seed = 21;
    assert_int_equal(gonio_samples_new(CHANNELS, false, &samples, NULL), GONIO_OK);
    samples->isotropic = e->isotropic;
    for (size_t k = 0; k < e->n; k++) {
        gonio_pair pair = simulate_pair(&seed, e->isotropic);
        double value, values[CHANNELS];
        if (e->in_plane) {
            pair = (gonio_pair){0.5, 0, 0.06 * (double)k, GONIO_PI};
        } else if (k % 3 == 0) { // near the mirror direction
            pair = (gonio_pair){pair.theta_i, pair.phi_i, pair.theta_i + 2e-3 * (double)(k % 7), pair.phi_i + GONIO_PI};
            pair.theta_o = fmin(pair.theta_o, 1.5);
        }
        gonio_model_eval_pair(truth, &pair, &value);
        values[0] = e->value(&pair, k, &value);
        values[1] = 0.5 * values[0];
        assert_int_equal(gonio_samples_add(samples, &pair, values, NULL, NULL, NULL), GONIO_OK);
    }
    snprintf(samples->channel_names[0], sizeof samples->channel_names[0], "500nm");
    snprintf(samples->channel_names[1], sizeof samples->channel_names[1], "600nm");
    gonio_model_free(truth);
    return samples;
}

static void check_answers(const gonio_method *method, const extreme *e, const gonio_model *model,
                          const gonio_samples *samples) {
    uint64_t seed = 5;
    for (size_t i = 0; i < 150; i++) {
        gonio_pair pair = i < samples->n ? samples->pairs[i] : simulate_pair(&seed, 0);
        double values[CHANNELS];
        pair.theta_o = i == 140 ? GONIO_PI / 2 : pair.theta_o; // the horizon and the pole
        pair.theta_i = i == 141 ? 0 : pair.theta_i;
        gonio_model_eval_pair(model, &pair, values);
        if (!isfinite(values[0]) || !isfinite(values[1])) {
            fail_msg("%s on %s: %g and %g at theta %g, %g", method->name, e->name, values[0], values[1],
                     gonio_degrees(pair.theta_i), gonio_degrees(pair.theta_o));
        }
    }
}

static struct { int fits, refusals, stuck; } counts;

static void fit_one(const gonio_method *method, const extreme *e, const gonio_samples *samples,
                    gonio_fill_store *store) {
    gonio_fit_options o;
    gonio_fit_report report;
    gonio_error error = {0};
    gonio_model *model;
    gonio_fit_options_default(&o);
    o.method = method->name;
    o.hold_out = 0;
    o.threads = 1;
    o.fill_store = store; // tables are filled by one fit of the set
    for (const gonio_method_option *has = method->options; has->offset != 0; has++) {
        o.level = has->offset == offsetof(gonio_fit_options, level) ? 2 : o.level;
        o.diffuse_level = has->offset == offsetof(gonio_fit_options, diffuse_level) ? 1 : o.diffuse_level;
        o.table_step = has->offset == offsetof(gonio_fit_options, table_step) ? 15 : o.table_step;
    }
    const gonio_status status = gonio_fit(samples, &o, &model, &report, &error);
    if (status == GONIO_OK) {
        check_answers(method, e, model, samples);
        if (!isfinite(report.train.rmse) || !isfinite(report.train.rms_log)) {
            fail_msg("%s on %s: errors of %g, %g", method->name, e->name, report.train.rmse, report.train.rms_log);
        }
        assert_null(strstr(report.options, "=nan")); // "dominant" is none
        assert_null(strstr(report.options, " nan"));
        assert_null(strstr(report.options, "-nan"));
        counts.stuck += strstr(report.note, "did not converge") != NULL;
        gonio_model_free(model);
        counts.fits++;
        return;
    }
    const bool said =
        status == GONIO_E_INPUT || status == GONIO_E_CONVERGENCE || (status == GONIO_E_UNSUPPORTED && !e->isotropic);
    if (!said || error.message[0] == 0) {
        fail_msg("%s on %s: status %d, '%s'", method->name, e->name, (int)status, error.message);
    }
    counts.refusals++;
}

static void every_method_survives_every_set(void **state) {
    (void)state;
    for (size_t k = 0; k < EXTREMES; k++) {
        gonio_samples *samples = make(&extremes[k]);
        gonio_fill_store *store = gonio_fill_store_new();
        for (int i = 0; gonio_method_at(i) != NULL; i++) {
            fit_one(gonio_method_at(i), &extremes[k], samples, store);
        }
        gonio_fill_store_free(store);
        gonio_samples_free(samples);
    }
    print_message("# %zu sets: %d fits, of which %d say that they did not converge, %d refusals\n", EXTREMES,
                  counts.fits, counts.stuck, counts.refusals);
    assert_true(counts.fits > 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_method_survives_every_set)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
