// SPDX-License-Identifier: BSD-3-Clause
// Lobe fits, lobe-spline models and their files, the automatic choice and its uncertainty.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/random.h"
#include "brdf/kind/lobe_spline.h"
#include "fit/lobes/fit.h"
#include "fit/tradeoff.h"
#include "gonio/fit.h"
#include "gonio/io.h"
#include "tests/unit/near.h"

static double uniform(uint64_t *state) { return gonio_random_next(state); }

static double normal(uint64_t *state) {
    double sum = -6; // Irwin-Hall
    for (int k = 0; k < 12; k++) {
        sum += uniform(state);
    }
    return sum;
}

static gonio_pair random_pair(uint64_t *state) {
    const double ti = acos(1 - 0.9 * uniform(state)), to = acos(1 - 0.9 * uniform(state));
    return (gonio_pair){ti, 0, to, 2 * GONIO_PI * uniform(state)};
}

// n samples of a spec with relative noise, which their sigma tells.
static gonio_samples *sampled(const char *spec, size_t n, double noise, uint64_t seed) {
    gonio_model *truth;
    gonio_samples *samples;
    assert_int_equal(gonio_model_from_spec(spec, &truth, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_new(truth->channels, noise > 0, &samples, NULL), GONIO_OK);
    samples->isotropic = true;
    for (size_t i = 0; i < n; i++) {
        const gonio_pair pair = random_pair(&seed);
        double values[8], sigma[8], zero[8] = {0};
        gonio_model_eval_pair(truth, &pair, values);
        for (int c = 0; c < truth->channels; c++) {
            sigma[c] = noise * values[c];
            values[c] += sigma[c] * normal(&seed);
        }
        assert_int_equal(
            gonio_samples_add(samples, &pair, values, noise > 0 ? sigma : NULL, noise > 0 ? zero : NULL, NULL),
            GONIO_OK);
    }
    gonio_model_free(truth);
    return samples;
}

static gonio_fit_options quick(const char *method) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = method;
    o.hold_out = 0;
    o.threads = 2;
    return o;
}

static gonio_model *fitted(const gonio_samples *samples, const gonio_fit_options *options, gonio_fit_report *report) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_fit(samples, options, &model, report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return model;
}

// The transform and its inverse, on both sides of eps; the slope against a difference.
static void test_transforms_invert(void **state) {
    (void)state;
    for (int kind = GONIO_TRANSFORM_LINEAR; kind <= GONIO_TRANSFORM_POSITIVE; kind++) {
        const gonio_transform transform = {4, 1e-3};
        for (double z = 4e-4; z < 1e3; z *= 1.3) {
            double up, down;
            const double t = gonio_transform_apply((gonio_transform_kind)kind, &transform, z);
            assert_near(gonio_transform_invert((gonio_transform_kind)kind, &transform, t), z, 1e-12 * (z + 1e-3));
            const double slope = gonio_transform_slope((gonio_transform_kind)kind, &transform, t);
            up = gonio_transform_invert((gonio_transform_kind)kind, &transform, t + 1e-5);
            down = gonio_transform_invert((gonio_transform_kind)kind, &transform, t - 1e-5);
            assert_near((up - down) / 2e-5, slope, 1e-3 * slope);
        }
    }
    const gonio_transform transform = {1, 1e-3};
    for (double t = -1e4; t < 1e4; t += 7.3) {
        const double z = gonio_transform_invert(GONIO_TRANSFORM_POSITIVE, &transform, t);
        assert_true(z > 0 && isfinite(z));
    }
}

static void test_files_give_the_same_bits(void **state) {
    (void)state;
    static const char *const methods[] = {"auto", "lsq"};
    gonio_samples *samples = sampled("ward:rho_d=0.3/0.1/0.2,rho_s=0.2,alpha=0.2", 200, 0.02, 3);
    char path[] = "/tmp/gonio-lobe-XXXXXX";
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    for (int m = 0; m < 2; m++) {
        const gonio_fit_options o = quick(methods[m]);
        gonio_model *model = fitted(samples, &o, NULL), *back;
        assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
        assert_int_equal(gonio_model_open(path, &back, NULL), GONIO_OK);
        assert_true(back->bytes == model->bytes && back->channels == 3);
        uint64_t seed = 3;
        for (int k = 0; k < 200; k++) {
            const gonio_pair p = random_pair(&seed);
            const gonio_vec3 wi = gonio_direction(p.theta_i, p.phi_i), wo = gonio_direction(p.theta_o, p.phi_o);
            double a[3], b[3];
            gonio_model_eval(model, wi, wo, a);
            gonio_model_eval(back, wi, wo, b);
            assert_memory_equal(a, b, sizeof a);
            assert_true(gonio_model_sigma(model, wi, wo, a) == gonio_model_sigma(back, wi, wo, b));
            assert_memory_equal(a, b, sizeof a);
        }
        gonio_model_free(back);
        gonio_model_free(model);
    }
    unlink(path);
    gonio_samples_free(samples);
}

// Every byte of the section's description, changed with a true checksum, must not crash: the file is opened through
// gonio_model_open, which finds the damage first; a short file names what lacks.
static void test_damaged_files_are_refused(void **state) {
    (void)state;
    gonio_samples *samples = sampled("ward:rho_d=0.3,rho_s=0.2,alpha=0.2", 100, 0, 4);
    char path[] = "/tmp/gonio-lobe-XXXXXX";
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    const gonio_fit_options o = quick("auto");
    gonio_model *model = fitted(samples, &o, NULL), *back;
    assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
    gonio_model_free(model);
    for (long cut = 200; cut > 0; cut -= 37) {
        gonio_error error = {0};
        assert_int_equal(truncate(path, cut), 0);
        assert_int_equal(gonio_model_open(path, &back, &error), GONIO_E_INPUT);
        assert_string_equal(error.file, path);
        assert_null(back);
    }
    unlink(path);
    gonio_samples_free(samples);
}

// Simulated truth, 8 seeds pooled: errors lie within two sigma mostly, and sigma is not blown up either. Empty: the
// part of the domain that no sample came near.
static void test_sigma_covers_the_error(void **state) {
    (void)state;
    const char *spec = "ward:rho_d=0.3,rho_s=0.2,alpha=0.3";
    size_t n = 0, within = 0, far = 0, far_within = 0;
    gonio_model *truth;
    assert_int_equal(gonio_model_from_spec(spec, &truth, NULL), GONIO_OK);
    for (uint64_t seed = 20; seed < 24; seed++) {
        gonio_samples *samples = sampled(spec, 250, 0.03, seed);
        const gonio_fit_options o = quick("auto");
        gonio_model *model = fitted(samples, &o, NULL);
        uint64_t stream = seed;
        for (int k = 0; k < 500; k++) {
            gonio_pair p = random_pair(&stream);
            const bool empty = k % 5 == 0;
            p.theta_o = empty ? 1.52 : p.theta_o; // the samples end at 84 deg
            double f, g, sigma;
            gonio_model_eval_pair(truth, &p, &f);
            gonio_model_eval_pair(model, &p, &g);
            assert_true(gonio_model_sigma(model, gonio_direction(p.theta_i, p.phi_i),
                                          gonio_direction(p.theta_o, p.phi_o), &sigma));
            assert_true(sigma > 0 && isfinite(sigma));
            *(empty ? &far : &n) += 1;
            *(empty ? &far_within : &within) += fabs(f - g) <= 2 * sigma;
        }
        gonio_model_free(model);
        gonio_samples_free(samples);
    }
    gonio_model_free(truth);
    print_message("# within 2 sigma: %.3f among the samples, %.3f beyond them\n", (double)within / (double)n,
                  (double)far_within / (double)far);
    assert_true((double)within >= 0.85 * (double)n);
    assert_true((double)far_within >= 0.7 * (double)far);
}

static void test_limits_are_kept(void **state) {
    (void)state;
    gonio_samples *samples = sampled("ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 150, 0, 5);
    gonio_fit_options o = quick("auto");
    gonio_fit_report report;
    o.max_bytes = 6000;
    gonio_model *model = fitted(samples, &o, &report);
    assert_true(report.bytes <= 6000 + 1024); // the head is beside it
    assert_true(strstr(report.note, "next better") != NULL && strstr(report.note, "next cheaper") != NULL);
    gonio_model_free(model);
    o.max_bytes = 0;
    o.max_error = 10; // anything will do: the smallest
    model = fitted(samples, &o, &report);
    assert_int_equal(report.level, 0);
    gonio_model_free(model);
    o.max_error = 0;
    o.max_bytes = 10; // nothing is that small: the smallest, and the note says so
    model = fitted(samples, &o, &report);
    assert_int_equal(report.level, 0);
    assert_true(strstr(report.note, "nothing smaller was found") != NULL);
    gonio_model_free(model);
    o.max_bytes = 0;
    // Times are measured: only what cannot depend on the clock is asked for here.
    o.max_error = 0;
    o.max_ns = 1e9;
    model = fitted(samples, &o, &report);
    assert_true(strstr(report.note, "an evaluation takes") != NULL && strstr(report.note, "above") == NULL);
    gonio_model_free(model);
    o.max_ns = 1e-3;
    model = fitted(samples, &o, &report);
    assert_true(strstr(report.note, "above the limit") != NULL);
    gonio_model_free(model);
    o.max_ns = 0;
    o.max_seconds = 1e-3; // one form is fitted all the same
    model = fitted(samples, &o, &report);
    assert_true(report.train.median_rel < 0.1);
    gonio_model_free(model);
    gonio_samples_free(samples);
}

// The front: no row on it is beaten by another in all three, and every other row is.
static void test_pareto_front(void **state) {
    (void)state;
    enum { N = 40 };
    static gonio_tradeoff_row rows[N];
    uint64_t seed = 6;
    for (int i = 0; i < N; i++) {
        rows[i] = (gonio_tradeoff_row){.eval_ns = pow(10, 1 + floor(4 * uniform(&seed)))};
        rows[i].report.bytes = (size_t)(1 + 10 * uniform(&seed));
        rows[i].report.held_out.samples = 1;
        rows[i].report.held_out.rms_log = floor(10 * uniform(&seed));
    }
    rows[3].status = GONIO_E_FAILED;
    gonio_tradeoff_mark_pareto(rows, N);
    assert_false(rows[3].pareto);
    for (int i = 0; i < N; i++) {
        bool beaten = i == 3;
        for (int j = 0; j < N; j++) {
            const gonio_errors *a = &rows[j].report.held_out, *b = &rows[i].report.held_out;
            const bool no_worse = j != 3 && a->rms_log <= b->rms_log && rows[j].report.bytes <= rows[i].report.bytes &&
                                  rows[j].eval_ns <= rows[i].eval_ns;
            beaten |= no_worse && (a->rms_log < b->rms_log || rows[j].report.bytes < rows[i].report.bytes ||
                                   rows[j].eval_ns < rows[i].eval_ns);
        }
        assert_true(rows[i].pareto == !beaten);
    }
}

// The iterative solver's choice: it tells its neighbours, and takes the coarsest level that meets the error.
static void test_large_sets_tell_their_neighbours(void **state) {
    (void)state;
    gonio_samples *samples = sampled("ward:rho_d=0.3,rho_s=0.2,alpha=0.3", 250, 0, 5);
    gonio_fit_options o = quick("lsq");
    gonio_fit_report free_choice, report;
    o.coordinates = GONIO_NUSSELT;
    o.iterations = 10;
    gonio_model *model = fitted(samples, &o, &free_choice);
    assert_true(strstr(free_choice.note, "next better: none") != NULL);
    assert_true(strstr(free_choice.note, "next cheaper: nusselt") != NULL);
    gonio_model_free(model);
    o.max_error = 10;
    model = fitted(samples, &o, &report);
    assert_int_equal(report.level, 0);
    assert_true(strstr(report.note, "above the limit") == NULL);
    gonio_model_free(model);
    o.max_error = 1e-12;
    model = fitted(samples, &o, &report);
    assert_int_equal(report.level, free_choice.level);
    assert_true(strstr(report.note, "above the limit") != NULL);
    gonio_model_free(model);
    gonio_samples_free(samples);
}

// Measured paint, half of its samples: what the choice reaches on geometries that it did not see. (All of them:
// bench_accuracy.)
static void test_real_paint(void **state) {
    (void)state;
    const char *folder = getenv("GONIO_DATA");
    char path[4096];
    snprintf(path, sizeof path, "%s/cornell/garnet_red.brdf", folder != NULL ? folder : "../shared/data");
    if (access(path, R_OK) != 0) {
        print_message("no %s\n", path);
        skip();
    }
    gonio_read_options read;
    gonio_read_options_default(&read);
    gonio_samples *all, *red;
    assert_int_equal(gonio_read(path, &read, &all, NULL, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_channel(all, 25, &red, NULL), GONIO_OK);
    bool keep[red->n];
    for (size_t i = 0; i < red->n; i++) {
        keep[i] = i % 2 == 0;
    }
    gonio_samples *half;
    assert_int_equal(gonio_samples_select(red, keep, &half, NULL), GONIO_OK);
    gonio_fit_options o = quick("auto");
    o.hold_out = 0.2;
    gonio_fit_report report;
    gonio_model *model = fitted(half, &o, &report);
    print_message("# median_rel %.4f, rms_log %.4f\n", report.held_out.median_rel, report.held_out.rms_log);
    assert_true(report.held_out.median_rel <= 0.013);
    assert_true(report.held_out.rms_log <= 0.12);
    gonio_model_free(model);
    gonio_samples_free(half);
    gonio_samples_free(red);
    gonio_samples_free(all);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_transforms_invert),
        cmocka_unit_test(test_files_give_the_same_bits),
        cmocka_unit_test(test_damaged_files_are_refused),
        cmocka_unit_test(test_sigma_covers_the_error),
        cmocka_unit_test(test_limits_are_kept),
        cmocka_unit_test(test_large_sets_tell_their_neighbours),
        cmocka_unit_test(test_pareto_front),
        cmocka_unit_test(test_real_paint),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
