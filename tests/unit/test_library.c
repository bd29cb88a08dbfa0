// SPDX-License-Identifier: BSD-3-Clause
// Priors from a library: what they fit of few samples, what they refuse, and their file.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/io.h"
#include "gonio/library.h"
#include "gonio/metrics.h"
#include "tests/simulate.h"
#include "tests/unit/session_folder.h"

// A lab's paints: a matt base under lobes of two parameters, and one without.
static const char *const specs[] = {"ward:rho_d=0.30,rho_s=0.20,alpha=0.20", "ward:rho_d=0.10,rho_s=0.10,alpha=0.30",
                                    "ward:rho_d=0.50,rho_s=0.05,alpha=0.25", "ward:rho_d=0.20,rho_s=0.30,alpha=0.35",
                                    "ward:rho_d=0.40,rho_s=0.10,alpha=0.28", "ward:rho_d=0.05,rho_s=0.15,alpha=0.22",
                                    "ward:rho_d=0.60,rho_s=0.20,alpha=0.32", "lambert:rho=0.4"};
#define SPECS (sizeof specs / sizeof *specs)

static gonio_model *models[SPECS];
static gonio_library *library;

static void learn(int threads, gonio_library **out) {
    const gonio_library_options options = {.seed = 1, .threads = threads};
    gonio_error error = {0};
    if (gonio_library_learn((const gonio_model *const *)models, specs, SPECS, &options, out, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
}

static int begin(void **state) {
    (void)state;
    for (size_t i = 0; i < SPECS; i++) {
        models[i] = simulate_truth(specs[i]);
    }
    learn(1, &library);
    return 0;
}

static int end(void **state) {
    (void)state;
    for (size_t i = 0; i < SPECS; i++) {
        gonio_model_free(models[i]);
    }
    gonio_library_free(library);
    return 0;
}

static gonio_samples *sampled(const char *spec, const gonio_plan *plan) {
    gonio_model *truth = simulate_truth(spec);
    gonio_samples *samples;
    assert_int_equal(gonio_samples_of_model(truth, plan->poses, plan->n, 1, &samples, NULL), GONIO_OK);
    samples->isotropic = true;
    gonio_model_free(truth);
    return samples;
}

static gonio_plan *plan_of(const char *text) {
    gonio_plan *plan;
    assert_int_equal(gonio_plan_make(text, 9, &plan, NULL), GONIO_OK);
    return plan;
}

static gonio_plan *few_poses(size_t n, int threads) {
    gonio_plan *plan;
    assert_int_equal(gonio_library_plan(library, n, gonio_radians(80), 1, threads, &plan, NULL), GONIO_OK);
    assert_int_equal(plan->n, n);
    return plan;
}

// A paint of the library's kind from twelve poses: better than the library's mean by far, with a sigma that holds.
static void few_samples_are_enough(void **state) {
    (void)state;
    static const char paint[] = "ward:rho_d=0.25,rho_s=0.15,alpha=0.27";
    gonio_plan *few = few_poses(12, 1), *directions = plan_of("nusselt:400,theta_max=80");
    gonio_samples *samples = sampled(paint, few), *all = sampled(paint, directions);
    gonio_library_report report;
    gonio_errors errors;
    gonio_error error = {0};
    gonio_model *model;
    if (gonio_library_fit(library, samples, 1, &model, &report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    assert_true(report.samples == 12 && report.residual < report.limit);
    assert_int_equal(gonio_errors_model(model, all, NULL, 1, &errors, NULL), GONIO_OK);
    assert_true(errors.median_rel < 0.05 && errors.rms_log < 0.15);
    size_t within = 0;
    for (size_t i = 0; i < all->n; i++) {
        double f, sigma;
        const gonio_pair *p = &all->pairs[i];
        const gonio_vec3 wi = gonio_direction(p->theta_i, p->phi_i), wo = gonio_direction(p->theta_o, p->phi_o);
        gonio_model_eval(model, wi, wo, &f);
        assert_true(gonio_model_sigma(model, wi, wo, &sigma) && sigma > 0 && isfinite(sigma));
        within += fabs(f - all->values[i]) <= 2 * sigma;
    }
    assert_true(within > 0.85 * (double)all->n);
    gonio_model_free(model);
    gonio_samples_free(samples);
    gonio_samples_free(all);
    gonio_plan_free(few);
    gonio_plan_free(directions);
}

static void others_are_refused(void **state) {
    (void)state;
    gonio_plan *few = few_poses(12, 1);
    gonio_samples *mirror = sampled("ward:rho_d=0.01,rho_s=0.9,alpha=0.03", few);
    gonio_error error = {0};
    gonio_model *model;
    gonio_library_report report;
    const gonio_status status = gonio_library_fit(library, mirror, 1, &model, &report, &error);
    if (status != GONIO_E_MISMATCH) {
        fail_msg("residual %g, limit %g", report.residual, report.limit);
    }
    assert_non_null(strstr(error.message, "not like the library"));
    assert_null(model);
    mirror->isotropic = false;
    assert_int_equal(gonio_library_fit(library, mirror, 1, &model, NULL, &error), GONIO_E_UNSUPPORTED);
    mirror->n = 0;
    mirror->isotropic = true;
    assert_int_equal(gonio_library_fit(library, mirror, 1, &model, NULL, &error), GONIO_E_USAGE);
    gonio_samples_free(mirror);
    gonio_plan_free(few);
    const gonio_library_options options = {.threads = 1};
    gonio_library *none;
    assert_int_equal(gonio_library_learn((const gonio_model *const *)models, specs, 3, &options, &none, &error),
                     GONIO_E_INPUT);
    gonio_model *brushed = simulate_truth("ward:rho_d=0.1,rho_s=0.3,alpha_x=0.1,alpha_y=0.3");
    const gonio_model *four[] = {models[0], models[1], models[2], brushed};
    assert_int_equal(gonio_library_learn(four, specs, 4, &options, &none, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "anisotropic"));
    gonio_model_free(brushed);
}

static char *bytes_of(const char *file, size_t *n) {
    FILE *f = fopen(file, "rb");
    assert_non_null(f);
    fseek(f, 0, SEEK_END);
    *n = (size_t)ftell(f);
    rewind(f);
    char *bytes = malloc(*n);
    assert_int_equal(fread(bytes, 1, *n, f), *n);
    fclose(f);
    return bytes;
}

static void put_bytes(const char *file, const char *bytes, size_t n) {
    FILE *f = fopen(file, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, n, f), n);
    fclose(f);
}

// Threads change no byte; what is read back is the same; damage of any part is refused.
static void files(void **state) {
    (void)state;
    char again[128];
    snprintf(again, sizeof again, "%s-again", path);
    gonio_library *other, *back;
    gonio_error error = {0};
    learn(3, &other);
    assert_int_equal(gonio_library_save(library, path, &error), GONIO_OK);
    assert_int_equal(gonio_library_save(other, again, &error), GONIO_OK);
    size_t n, m;
    char *bytes = bytes_of(path, &n), *more = bytes_of(again, &m);
    assert_int_equal(n, m);
    assert_memory_equal(bytes, more, n);
    assert_int_equal(gonio_library_open(path, &back, &error), GONIO_OK);
    assert_int_equal(gonio_library_save(back, again, &error), GONIO_OK);
    free(more);
    more = bytes_of(again, &m);
    assert_int_equal(n, m);
    assert_memory_equal(bytes, more, n);
    gonio_library_free(back);
    gonio_library_free(other);
    const size_t places[] = {0, 9, 17, 30, 36, 41, 60, 70, 100, 140, 128 + 64 * SPECS + 8, n / 2, n - 1};
    for (size_t k = 0; k < sizeof places / sizeof *places; k++) {
        more[places[k]] ^= 4;
        put_bytes(again, more, n);
        assert_int_equal(gonio_library_open(again, &back, &error), GONIO_E_INPUT);
        assert_null(back);
        more[places[k]] ^= 4;
    }
    const size_t lengths[] = {0, 7, 64, 127, 128, 200, 4096, n - 1};
    for (size_t k = 0; k < sizeof lengths / sizeof *lengths; k++) {
        put_bytes(again, bytes, lengths[k]);
        assert_int_equal(gonio_library_open(again, &back, &error), GONIO_E_INPUT);
    }
    free(bytes);
    free(more);
}

static void plans(void **state) {
    (void)state;
    gonio_plan *one = few_poses(16, 1), *three = few_poses(16, 3), *fewer = few_poses(6, 1);
    assert_memory_equal(one->poses, three->poses, 16 * sizeof *one->poses);
    assert_memory_equal(one->poses, fewer->poses, 6 * sizeof *one->poses); // each is the best given those before
    for (size_t i = 0; i < one->n; i++) {
        assert_true(fmax(one->poses[i].theta_i, one->poses[i].theta_o) <= gonio_radians(80));
        for (size_t j = 0; j < i; j++) {
            assert_memory_not_equal(&one->poses[i], &one->poses[j], sizeof *one->poses);
        }
    }
    gonio_plan_free(one);
    gonio_plan_free(three);
    gonio_plan_free(fewer);
    static const char *const bad[] = {"prior:", "prior:x,N=0", "prior:x,N=", "prior:x,M=3", "prior:x,theta_max=95"};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_error error = {0};
        assert_true(gonio_library_plan_is(bad[k]));
        assert_int_equal(gonio_library_plan_make(bad[k], 1, 1, &one, &error), GONIO_E_USAGE);
        assert_non_null(strstr(error.message, "character"));
    }
    assert_int_equal(gonio_library_plan_make("prior:/nowhere/x,N=3", 1, 1, &one, NULL), GONIO_E_INPUT);
}

// The option of a fit: of twelve samples and more the better of the prior and the method is made, and it is said which.
static void as_an_option(void **state) {
    (void)state;
    gonio_plan *few = few_poses(16, 1);
    gonio_samples *samples = sampled("ward:rho_d=0.25,rho_s=0.15,alpha=0.27", few);
    gonio_fit_options options;
    gonio_fit_report report;
    gonio_error error = {0};
    gonio_model *model;
    assert_int_equal(gonio_library_save(library, path, &error), GONIO_OK);
    gonio_fit_options_default(&options);
    options.method = "mba";
    options.level = 2;
    options.hold_out = 0;
    options.threads = 1;
    snprintf(options.prior, sizeof options.prior, "%s", path);
    assert_int_equal(gonio_fit(samples, &options, &model, &report, &error), GONIO_OK);
    assert_non_null(strstr(report.note, "it was used"));
    assert_non_null(strstr(report.options, "prior of 8 models"));
    gonio_model_free(model);
    gonio_samples_free(samples);
    samples = sampled("phong:rho_d=0.01,rho_s=0.5,n=3", few);
    assert_int_equal(gonio_fit(samples, &options, &model, &report, &error), GONIO_OK);
    assert_true(strstr(report.note, "not used") != NULL && strstr(report.options, "prior") == NULL);
    gonio_model_free(model);
    gonio_samples_free(samples);
    gonio_plan_free(few);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(few_samples_are_enough),
        cmocka_unit_test(others_are_refused),
        cmocka_unit_test_setup_teardown(files, set_up, tear_down),
        cmocka_unit_test(plans),
        cmocka_unit_test_setup_teardown(as_an_option, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, begin, end);
}
