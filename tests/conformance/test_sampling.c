// SPDX-License-Identifier: BSD-3-Clause
// Importance sampling of every kind of model in every form, isotropic and not, by its own lobes and by a table: the
// density integrates to 1, draws are distributed as it says, what is returned beside a direction is what the model says
// there, and no direction that light goes to is left out.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "tests/conformance/make_kind.h"
#include "tests/sampling_check.h"

#define DRAWS 3000
#define FINE 8 // 64 x 64 points of the integral
// One chi-square in 3.6 million lies beyond 5 deviates, and about 200 are made: a false alarm less often than once in
// 10,000 seeds. The seeds are fixed, so that it does not come and go.
#define DEVIATES 5

static const char *model_name; // for messages
static int cases;

static void integrates_and_agrees(const sampling_source *s, gonio_vec3 wi, double power, const char *how) {
    double expected[SAMPLING_CELLS];
    const double total = sampling_expect(s, wi, power, FINE, expected);
    if (!(fabs(total - 1) < 0.01)) {
        fail_msg("%s, %s, theta_i %.3g: the density integrates to %.6g", model_name, how,
                 gonio_degrees(gonio_direction_theta(wi)), total);
    }
    const double z = sampling_chi_square(s, wi, power, DRAWS, 11, expected);
    if (!(z < DEVIATES)) {
        fail_msg("%s, %s, theta_i %.3g: chi-square lies %.3g deviates off", model_name, how,
                 gonio_degrees(gonio_direction_theta(wi)), z);
    }
    cases++;
}

// What a draw returns, at special numbers too.
static void draws_are_told_rightly(const sampling_source *s, gonio_vec3 wi, const char *how) {
    static const double special[] = {0, 0x1p-53, 0.25, 0.5, 1 - 0x1p-53};
    uint64_t seed = 5;
    for (int k = 0; k < 60; k++) {
        const double u[2] = {k < 25 ? special[k % 5] : simulate_uniform(&seed),
                             k < 25 ? special[k / 5] : simulate_uniform(&seed)};
        gonio_vec3 wo;
        const double pdf = sampling_draw(s, wi, u, &wo), there = sampling_pdf(s, wi, wo);
        const double length = sqrt(wo.x * wo.x + wo.y * wo.y + wo.z * wo.z);
        if (!(wo.z > 0) || !(fabs(length - 1) < 1e-9) || !(pdf > 0) || !isfinite(pdf)) {
            fail_msg("%s, %s: u %.17g %.17g gives %g %g %g, density %g", model_name, how, u[0], u[1], wo.x, wo.y, wo.z,
                     pdf);
        }
        // At the mirror direction itself a table's density depends on the side that it is reached from.
        if (wo.z > 1e-3 && hypot(wo.x + wi.x, wo.y + wi.y) > 1e-9 && !(fabs(there - pdf) < 1e-5 * pdf)) {
            fail_msg("%s, %s: u %.17g %.17g drew with density %.9g, which is %.9g", model_name, how, u[0], u[1], pdf,
                     there);
        }
    }
}

static void nothing_is_left_out(const sampling_source *s, const char *how) {
    static const double special[][4] = {{0, 0, 0, 0},     {0, 0, 60, 30},        {50, 10, 0, 0},   {40, 0, 40, 180},
                                        {40, 0, 40, 0},   {90, 0, 89, 180},      {90, 45, 89, 45}, {89.9, 0, 10, 90},
                                        {89.9, 9, 89, 9}, {30, 359.9, 30, 180.1}};
    uint64_t seed = 3;
    double values[GONIO_CHANNELS_MAX];
    for (size_t k = 0; k < 100; k++) {
        gonio_pair p = simulate_pair(&seed, 0);
        if (k < sizeof special / sizeof *special) {
            const double *d = special[k];
            p = (gonio_pair){gonio_radians(d[0]), gonio_radians(d[1]), gonio_radians(d[2]), gonio_radians(d[3])};
        }
        const gonio_vec3 wi = gonio_direction(p.theta_i, p.phi_i), wo = gonio_direction(p.theta_o, p.phi_o);
        const double pdf = sampling_pdf(s, wi, wo);
        gonio_model_eval(s->model, wi, wo, values);
        for (int c = 0; c < s->model->channels; c++) {
            if (!isfinite(pdf) || (values[c] * wo.z > 0 && !(pdf > 0))) {
                fail_msg("%s, %s: theta_i %g theta_o %g: f_r %g, density %g", model_name, how, p.theta_i, p.theta_o,
                         values[c], pdf);
            }
        }
    }
}

static void check(const sampling_source *s, const char *how) {
    static const double incidences[][2] = {{0, 0}, {35, 20}, {75, 200}};
    for (size_t k = 0; k < 3; k++) {
        const gonio_vec3 wi = gonio_direction(gonio_radians(incidences[k][0]), gonio_radians(incidences[k][1]));
        draws_are_told_rightly(s, wi, how);
        if (k > 0) {
            integrates_and_agrees(s, wi, 1.5, how);
        }
    }
    nothing_is_left_out(s, how);
}

static void values_come_along(const gonio_model *model) {
    const gonio_vec3 wi = gonio_direction(0.5, 1);
    double values[GONIO_CHANNELS_MAX], again[GONIO_CHANNELS_MAX];
    gonio_vec3 wo;
    gonio_model_sample(model, wi, (double[]){0.3, 0.6}, &wo, values);
    gonio_model_eval(model, wi, wo, again);
    assert_memory_equal(values, again, (size_t)model->channels * sizeof *values);
}

static void every_kind_draws_as_its_density_says(void **state) {
    (void)state;
    const gonio_sampler_size sizes[2] = {{5, 6, 16, 8}, {6, 1, 16, 10}};
    kind_maker maker;
    for (size_t k = 0; kind_maker_at(k, &maker); k++) {
        for (int isotropic = maker.isotropic_only ? 1 : 0; isotropic < 2; isotropic++) {
            char name[128];
            gonio_model *model = kind_make(&maker, isotropic != 0, k % 2 ? 1 : 3);
            snprintf(name, sizeof name, "%s (%s), %s", maker.kind, maker.form, isotropic ? "isotropic" : "anisotropic");
            model_name = name;
            check(&(sampling_source){model, NULL}, "lobes");
            values_come_along(model);
            gonio_sampler *table;
            assert_int_equal(gonio_sampler_new(model, &sizes[isotropic], &table, NULL), GONIO_OK);
            check(&(sampling_source){model, table}, "table");
            gonio_sampler_free(table);
            gonio_model_free(model);
        }
    }
    print_message("# %d cases\n", cases);
}

// Lobes so narrow that a table must find them, so wide that half of them lies below the horizon, and so flat that their
// facets lie along the light.
static void extreme_lobes_are_drawn_rightly(void **state) {
    (void)state;
    static const struct {
        const char *spec;
        double power; // of the cells' spacing
    } lobes[] = {{"ggx:rho_s=1,alpha=0.001", 8},
                 {"ward:rho_s=1,alpha=0.001", 8},
                 {"blinn-phong:rho_s=1,n=100000", 8},
                 {"cook-torrance:rho_s=1,m=0.003,f0=0.04", 8},
                 {"ggx:rho_s=1,alpha_x=1,alpha_y=3", 1.5},
                 {"ward:rho_s=1,alpha=2", 1.5},
                 {"blinn-phong:rho_s=1,n=0", 1.5},
                 {"cook-torrance:rho_s=1,m=5", 1.5},
                 {"lambert:rho=0", 1.5},
                 {"oren-nayar:rho=1,sigma=1", 1.5}};
    for (size_t k = 0; k < sizeof lobes / sizeof *lobes; k++) {
        gonio_model *model = simulate_truth(lobes[k].spec);
        model_name = lobes[k].spec;
        for (int tilt = 5; tilt < 90; tilt += 40) {
            integrates_and_agrees(&(sampling_source){model, NULL}, gonio_direction(gonio_radians(tilt), 1),
                                  lobes[k].power, "lobes");
        }
        nothing_is_left_out(&(sampling_source){model, NULL}, "lobes");
        gonio_model_free(model);
    }
    const gonio_sampler_size size = {8, 1, 24, 24};
    for (size_t k = 0; k < 2; k++) {
        gonio_model *model = simulate_truth(lobes[k].spec);
        gonio_sampler *table;
        model_name = lobes[k].spec;
        assert_int_equal(gonio_sampler_new(model, &size, &table, NULL), GONIO_OK);
        integrates_and_agrees(&(sampling_source){model, table}, gonio_direction(0.7, 1), 8, "table");
        gonio_sampler_free(table);
        gonio_model_free(model);
    }
}

// The part of the light that the estimate says is reflected, and its relative variance.
static double albedo_variance(const gonio_model *model, gonio_vec3 wi, double *albedo) {
    double sum = 0, squares = 0, f;
    enum { SIDE = 24 };
    for (int k = 0; k < SIDE * SIDE; k++) {
        const double u[2] = {(k % SIDE + 0.5) / SIDE, (k / SIDE + 0.5) / SIDE};
        gonio_vec3 wo;
        const double pdf = gonio_model_sample(model, wi, u, &wo, &f), weight = f * wo.z / pdf;
        sum += weight / (SIDE * SIDE);
        squares += weight * weight / (SIDE * SIDE);
    }
    *albedo = sum;
    return squares / (sum * sum) - 1;
}

// A table is kept where it scatters less, and both estimate the same.
static void preparing_lessens_the_variance(void **state) {
    (void)state;
    const kind_maker maker = kind_forms[1]; // a spline, which has no lobes of its own
    gonio_model *model = kind_make(&maker, true, 1);
    const gonio_vec3 wi = gonio_direction(0.9, 2);
    double before_albedo, after_albedo;
    const double before = albedo_variance(model, wi, &before_albedo);
    assert_int_equal(gonio_model_prepare_sampling(model, NULL), GONIO_OK);
    assert_non_null(model->sampler);
    const struct gonio_sampler *kept = model->sampler;
    assert_int_equal(gonio_model_prepare_sampling(model, NULL), GONIO_OK);
    assert_ptr_equal(model->sampler, kept);
    const double after = albedo_variance(model, wi, &after_albedo);
    print_message("# variance %.3g, prepared %.3g\n", before, after);
    assert_true(after < 0.1 * before && after < 0.01);
    assert_true(fabs(after_albedo - before_albedo) < 0.01 * before_albedo);
    gonio_model_free(model);
    // A diffuser's cosine cannot be bettered.
    model = simulate_truth("lambert:rho=0.5");
    assert_int_equal(gonio_model_prepare_sampling(model, NULL), GONIO_OK);
    assert_null(model->sampler);
    gonio_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kind_draws_as_its_density_says),
        cmocka_unit_test(extreme_lobes_are_drawn_rightly),
        cmocka_unit_test(preparing_lessens_the_variance),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
