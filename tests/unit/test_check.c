// SPDX-License-Identifier: BSD-3-Clause
// Physical checks: figures known beforehand, and transforms that do what they say.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/check.h"
#include "gonio/io.h"
#include "gonio/plan.h"
#include "tests/unit/near.h"

static gonio_model *from(const char *spec) {
    gonio_model *m;
    assert_int_equal(gonio_model_from_spec(spec, &m, NULL), GONIO_OK);
    return m;
}

// Kinds of analytic models whose albedos are known: see test_analytic.c for Ward's, found by another quadrature.
static void albedos(void **state) {
    (void)state;
    static const struct {
        const char *spec;
        double theta_deg, albedo, tolerance;
    } known[] = {
        {"lambert:rho=0.5", 0, 0.5, 1e-3},
        {"lambert:rho=0.5", 80, 0.5, 1e-3},
        {"ward:rho_d=0.3,rho_s=0.2,alpha=0.1", 0, 0.3 + 0.2 * 0.9710516755670214, 1e-3},
        {"ward:rho_d=0.3,rho_s=0.2,alpha=0.1", 40, 0.3 + 0.2 * 0.7451352277925649, 1e-3},
        {"blinn-phong:rho_s=0.4,n=10", 0, 0.4, 1e-3},
        {"blinn-phong:rho_s=0.4,n=100000", 0, 0.4, 1e-3},
        {"ward:rho_s=1,alpha=0.002", 0, 1 - 3 * 0.002 * 0.002, 3e-3},
        {"ggx:rho_s=1,alpha=0.001", 30, 1, 5e-3}, // a mirror loses nothing
    };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        gonio_model *m = from(known[k].spec);
        double albedo;
        gonio_check_albedo(m, gonio_radians(known[k].theta_deg), &albedo);
        assert_near(albedo, known[k].albedo, known[k].tolerance);
        gonio_model_free(m);
    }
}

static void reports(void **state) {
    (void)state;
    gonio_check_report r;
    gonio_model *m = from("lambert:rho=0.1/0.7/0.3");
    assert_int_equal(gonio_check_model(m, 0, &r, NULL), GONIO_OK);
    assert_near(r.reciprocity, 0, 0);
    assert_near(r.isotropy, 0, 0);
    assert_near(r.energy, 0.7, 1e-3);
    assert_int_equal(r.energy_channel, 1);
    assert_near(r.separability[0], 0, 1e-9); // a constant is one product
    gonio_model_free(m);
    // Without its cosines Ward's lobe is a function of the half vector alone; with them two products nearly do.
    m = from("ward:rho_d=0.3,rho_s=0.2,alpha=0.1");
    assert_int_equal(gonio_check_model(m, 0, &r, NULL), GONIO_OK);
    assert_true(r.separability[0] < 0.05 && r.separability[0] > 1e-3 && r.separability[2] < 1e-3);
    for (int k = 1; k < GONIO_CHECK_RANKS; k++) {
        assert_true(r.separability[k] <= r.separability[k - 1]);
    }
    gonio_model_free(m);
    m = from("ggx:rho_s=1,alpha_x=0.1,alpha_y=0.5");
    assert_int_equal(gonio_check_model(m, 0, &r, NULL), GONIO_OK);
    assert_true(r.isotropy > 0.5 && r.reciprocity < 1e-9);
    gonio_model_free(m);
}

// What is found of a model is found of samples of it, whatever the thread count.
static void samples_are_judged_by_a_fit(void **state) {
    (void)state;
    gonio_model *m = from("ward:rho_d=0.3,rho_s=0.2,alpha=0.3");
    gonio_plan *plan;
    gonio_samples *s;
    gonio_check_report of_model, of_samples, again;
    assert_int_equal(gonio_plan_make("nusselt:1500", 1, &plan, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_of_model(m, plan->poses, plan->n, 0, &s, NULL), GONIO_OK);
    assert_int_equal(gonio_check_model(m, 0, &of_model, NULL), GONIO_OK);
    assert_int_equal(gonio_check_samples(s, 1, 1, &of_samples, NULL), GONIO_OK);
    assert_int_equal(gonio_check_samples(s, 1, 3, &again, NULL), GONIO_OK);
    assert_memory_equal(&of_samples, &again, sizeof again);
    assert_near(of_samples.energy, of_model.energy, 0.05);
    assert_near(of_samples.reciprocity, of_model.reciprocity, 0.05);
    assert_near(of_samples.isotropy, of_model.isotropy, 1e-9);
    s->n = 0;
    gonio_error error = {0};
    assert_int_equal(gonio_check_samples(s, 1, 1, &of_samples, &error), GONIO_E_INPUT);
    gonio_samples_free(s);
    gonio_plan_free(plan);
    gonio_model_free(m);
}

// f = cos(theta_i): twice as bright from above as from 60 deg, so not reciprocal.
static void eval_lopsided(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)model;
    (void)wo;
    values[0] = wi.z;
}

static void eval_broken(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)model;
    (void)wi;
    values[0] = wo.x > 0.5 ? NAN : 1;
}

static void what_is_wrong_is_found(void **state) {
    (void)state;
    static const char names[1][32] = {"y"};
    gonio_model_ops ops = {.kind = "test", .eval = eval_lopsided};
    const gonio_model model = {.ops = &ops, .channels = 1, .isotropic = true, .channel_names = names};
    gonio_check_report r;
    assert_int_equal(gonio_check_model(&model, 0, &r, NULL), GONIO_OK);
    assert_true(r.reciprocity > 0.2);
    assert_near(r.energy, GONIO_PI, 0.01); // at normal incidence
    assert_near(r.energy_theta_rad, 0, 0);
    ops.eval = eval_broken;
    gonio_error error = {0};
    assert_int_equal(gonio_check_model(&model, 0, &r, &error), GONIO_E_FAILED);
    assert_non_null(strstr(error.message, "not finite"));
}

static void transforms(void **state) {
    (void)state;
    gonio_samples *s, *t;
    assert_int_equal(gonio_samples_new(1, true, &s, NULL), GONIO_OK);
    s->isotropic = false;
    const gonio_pair p = {0.1, 0.2, 0.3, 0.5};
    const double v = -4, sigma = 2;
    assert_int_equal(gonio_samples_add(s, &p, &v, &sigma, &sigma, NULL), GONIO_OK);
    assert_int_equal(
        gonio_check_apply(s, GONIO_APPLY_MIRROR | GONIO_APPLY_RECIPROCITY | GONIO_APPLY_ENERGY, 2, &t, NULL), GONIO_OK);
    assert_int_equal(t->n, 4);
    assert_true(t->pairs[1].phi_i == -0.2 && t->pairs[2].theta_i == 0.3 && t->pairs[3].phi_i == -0.5);
    assert_true(t->values[3] == -2 && t->sigma_random[3] == 1 && !t->isotropic);
    gonio_samples_free(t);
    assert_int_equal(gonio_check_apply(s, GONIO_APPLY_ISOTROPY | GONIO_APPLY_CLAMP, 0.5, &t, NULL), GONIO_OK);
    assert_true(t->n == 1 && t->isotropic && t->pairs[0].phi_i == 0 && t->values[0] == 0 && t->sigma_random[0] == 2);
    assert_near(t->pairs[0].phi_o, 0.3, 1e-15);
    gonio_samples_free(t);
    gonio_samples_free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(albedos),
        cmocka_unit_test(reports),
        cmocka_unit_test(samples_are_judged_by_a_fit),
        cmocka_unit_test(what_is_wrong_is_found),
        cmocka_unit_test(transforms),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
