// SPDX-License-Identifier: BSD-3-Clause
// DeYoung's measures and transforms: closed forms, figures found otherwise, and what sigma explains.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/random.h"
#include "brdf/kind/transformed.h"
#include "fit/check/measures.h"
#include "fit/check/partial.h"
#include "fit/check/products.h"
#include "fit/check/significance.h"
#include "fit/check/triangles.h"
#include "gonio/check.h"
#include "gonio/io.h"
#include "gonio/plan.h"
#include "tests/unit/check_models.h"

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

static void a_white_diffuser_has_all_four_at_zero(void **state) {
    (void)state;
    gonio_model *m = from("lambert:rho=1");
    gonio_check_report r;
    assert_int_equal(gonio_check_model(m, 1, &r, NULL), GONIO_OK);
    assert_near(r.reciprocity, 0, 0);
    assert_near(r.excess, 0, 1e-9);
    assert_near(r.isotropy, 0, 0);
    assert_near(r.separability[0], 0, 1e-12);
    assert_near(r.energy, 1, 1e-9);
    gonio_check_report_free(&r);
    gonio_model_free(m);
    m = from("lambert:rho=0.1/0.7/0.3");
    gonio_samples *s = sampled(m, "uniform:15,anisotropic=1");
    r = report_of(s);
    assert_int_equal(r.form, GONIO_CHECK_UNIFORM);
    assert_near(r.reciprocity, 0, 0);
    assert_near(r.excess, 0, 0);
    assert_near(r.isotropy, 0, 1e-16);
    assert_near(r.separability[0], 0, 1e-12);
    assert_int_equal(r.energy_channel, 1);
    gonio_check_report_free(&r);
    gonio_samples_free(s);
    gonio_model_free(m);
}

// Found by a program of its own: Ward .1, .3, .05 x .3 at 15 deg, theta 15 to 75.
static void a_uniform_table_gives_the_known_figures(void **state) {
    (void)state;
    gonio_model *m = from("ward:rho_d=0.1,rho_s=0.3,alpha_x=0.05,alpha_y=0.3");
    gonio_samples *s = sampled(m, "uniform:15,anisotropic=1");
    gonio_check_report r = report_of(s);
    assert_near(r.isotropy, 0.0763957, 5e-8);
    assert_near(r.reciprocity, 0, 1e-30);
    assert_near(r.excess, 0, 0);
    assert_near(r.energy, 0.3912, 5e-5);
    assert_true(r.directions[0] == 120 && r.directions[1] == 120);
    gonio_check_report_free(&r);
    gonio_samples_free(s);
    gonio_model_free(m);
    m = from("ward:rho_d=0.3,rho_s=0.2,alpha=0.15"); // isotropic, sampled at every azimuth
    s = sampled(m, "uniform:30,anisotropic=1");
    s->isotropic = false;
    r = report_of(s);
    assert_near(r.isotropy, 0, 1e-10);
    gonio_check_report_free(&r);
    gonio_samples_free(s);
    gonio_model_free(m);
}

// An isotropic table's blocks have the singular values of the table that every azimuth of the light makes.
static void isotropic_tables_are_separated_by_frequency(void **state) {
    (void)state;
    gonio_model *m = from("ward:rho_d=0.3,rho_s=0.2,alpha=0.3");
    gonio_samples *small = sampled(m, "uniform:20,theta_max=80"),
                  *large = sampled(m, "uniform:20,theta_max=80,anisotropic=1");
    large->isotropic = false;
    gonio_check_report a = report_of(small), b = report_of(large);
    assert_true(a.directions[0] == b.directions[0] && a.directions[0] == 72);
    for (int k = 0; k < GONIO_CHECK_RANKS; k++) {
        assert_near(a.separability[k], b.separability[k], 1e-12);
    }
    assert_near(a.reciprocity, b.reciprocity, 1e-15);
    assert_near(a.energy, b.energy, 1e-12);
    gonio_check_report_free(&a);
    gonio_check_report_free(&b);
    gonio_samples_free(small);
    gonio_samples_free(large);
    gonio_model_free(m);
}

// Thetas that differ on both sides: f = (a + b theta_i)(c + d theta_o) is bilinear, so what is interpolated is exact.
static void eval_bilinear(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    (void)model;
    values[0] = (1 + gonio_direction_theta(wi)) * (2 - gonio_direction_theta(wo));
}
static const gonio_model_ops bilinear_ops = {.kind = "test", .eval = eval_bilinear, .free = keep_it};

static void exchanged_thetas_are_interpolated(void **state) {
    (void)state;
    const gonio_model m = HEAD(bilinear_ops, true);
    gonio_pair poses[4 * 8 * 7];
    size_t n = 0, compared = 0;
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        for (int o = 0; o < 8; o++) {
            const double ti = gonio_radians(15 + 20 * i), to = gonio_radians(10 * (o + 1));
            for (int f = 0; f < 7; f++) {
                poses[n++] = (gonio_pair){ti, 0, to, gonio_radians(30 * f)};
            }
            if (o > 0 && o < 7) { // exchanged, theta_i must lie within 15 to 75 deg
                const double d = (1 + ti) * (2 - to) - (1 + to) * (2 - ti);
                sum += d * d / 2;
                compared++;
            }
        }
    }
    gonio_samples *s;
    assert_int_equal(gonio_samples_of_model(&m, poses, n, 0, &s, NULL), GONIO_OK);
    gonio_check_report r = report_of(s);
    assert_int_equal(r.form, GONIO_CHECK_UNIFORM);
    assert_int_equal(r.reciprocity_range.compared, compared * 12);
    assert_near(r.reciprocity, sum / (double)compared, 1e-12);
    gonio_check_report_free(&r);
    gonio_samples_free(s);
}

static void one_product_has_rank_one(void **state) {
    (void)state;
    const gonio_model m = HEAD(product_ops, false);
    gonio_samples *s = sampled(&m, "uniform:15,anisotropic=1");
    gonio_check_report r = report_of(s);
    assert_true(r.separability[0] <= 1e-12);
    assert_true(r.reciprocity > 1e-3 && r.isotropy > 1e-3); // it has none of the others
    gonio_check_report_free(&r);
    gonio_samples_free(s);
}

// Four Gauss nodes in each of N / 4 panels of theta, equal steps of azimuth: far finer than the tolerance.
enum { N = 96, M = 96 };
static double phong_node(int k, double *weight) {
    static const double x[4] = {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526};
    static const double w[4] = {0.3478548451374538, 0.6521451548625461, 0.6521451548625461, 0.3478548451374538};
    *weight = w[k % 4] / 2 * 4 / N;
    return GONIO_PI / 2 * (k / 4 + (x[k % 4] + 1) / 2) * 4 / N;
}

// The albedo at ti, and the mean over outgoing theta and azimuth of the halved squares of f - f'.
static double independent(const phong *p, double ti, double *squares) {
    double albedo = 0;
    *squares = 0;
    for (int o = 0; o < N; o++) {
        double weight;
        const double to = phong_node(o, &weight);
        for (int f = 0; f < M; f++) {
            const gonio_vec3 a = gonio_direction(ti, 0), b = gonio_direction(to, 2 * GONIO_PI * (f + 0.5) / M);
            double there, back;
            eval_phong(&p->head, a, b, &there);
            eval_phong(&p->head, b, a, &back);
            *squares += weight / M * (there - back) * (there - back) / 2;
            albedo += weight / M * GONIO_PI * GONIO_PI * there * sin(to) * cos(to);
        }
    }
    return albedo;
}

static void phong_agrees_with_another_quadrature(void **state) {
    (void)state;
    for (int leaning = 0; leaning < 2; leaning++) {
        const phong p = {HEAD(phong_ops, true), 0.6, 0.9, 8, false, leaning == 1};
        gonio_check_report r;
        double reciprocity = 0, squares;
        assert_int_equal(gonio_check_model(&p.head, 1, &r, NULL), GONIO_OK);
        for (int k = 0; k < N; k++) {
            double weight;
            const double theta = phong_node(k, &weight);
            independent(&p, theta, &squares);
            reciprocity += weight * squares;
        }
        assert_near(r.reciprocity, reciprocity, 1e-6 * reciprocity + 1e-16);
        assert_true(leaning == 1 ? reciprocity > 1e-4 : reciprocity < 1e-16);
        for (size_t k = 0; k < r.incidences; k += 3) { // Gamma is what of it exceeds 1
            assert_near(r.albedos[k].value, independent(&p, r.albedos[k].theta_i, &squares), 1e-6);
        }
        gonio_check_report_free(&r);
    }
}

static void non_reciprocal_models_agree_with_sums(void **state) {
    (void)state;
    // f = cos(theta_i): the mean over theta of (cos a - cos b)^2 / 2 is 1/2 - 4/pi^2; the albedo is pi cos(theta_i).
    const gonio_model m = HEAD(lopsided_ops, true);
    gonio_check_report r;
    assert_int_equal(gonio_check_model(&m, 1, &r, NULL), GONIO_OK);
    assert_near(r.reciprocity, 0.5 - 4 / (GONIO_PI * GONIO_PI), 1e-6);
    const double edge = acos(1 / GONIO_PI); // below it more leaves than arrives
    assert_near(r.excess, (GONIO_PI * sin(edge) - edge) / (GONIO_PI / 2), 2e-3);
    assert_near(r.energy, GONIO_PI, 1e-6);
    assert_near(r.energy_theta_rad, 0, 0);
    gonio_check_report_free(&r);
}

// A table's sums go to the model's integrals: cells that fill the hemisphere.
static void grids_of_one_brdf_agree(void **state) {
    (void)state;
    gonio_model *m = from("ggx:rho_d=0.2,rho_s=0.3,alpha_x=0.5,alpha_y=0.8");
    double figures[2][3];
    for (int k = 0; k < 2; k++) {
        gonio_plan *plan;
        gonio_samples *s;
        assert_int_equal(gonio_check_cell_plan(k == 0 ? 5 : 9, false, &plan, NULL), GONIO_OK);
        assert_int_equal(gonio_samples_of_model(m, plan->poses, plan->n, 0, &s, NULL), GONIO_OK);
        gonio_check_report r = report_of(s);
        figures[k][0] = r.albedo;
        figures[k][1] = r.isotropy;
        figures[k][2] = r.energy;
        gonio_check_report_free(&r);
        gonio_samples_free(s);
        gonio_plan_free(plan);
    }
    // 18 and 10 deg; docs/physical.md has 10 and 5 deg, which agree within 1 %.
    assert_near(figures[1][0] / figures[0][0], 1, 0.03);
    assert_near(figures[1][1] / figures[0][1], 1, 0.03);
    assert_near(figures[1][2] / figures[0][2], 1, 0.03);
    gonio_model_free(m);
}

static void what_is_wrong_is_found(void **state) {
    (void)state;
    const gonio_model m = HEAD(broken_ops, true);
    gonio_check_report r;
    gonio_error error = {0};
    assert_int_equal(gonio_check_model(&m, 1, &r, &error), GONIO_E_FAILED);
    assert_non_null(strstr(error.message, "not finite"));
    gonio_samples *s;
    assert_int_equal(gonio_samples_new(1, false, &s, NULL), GONIO_OK);
    assert_int_equal(gonio_check_samples(s, 1, &r, &error), GONIO_E_INPUT);
    gonio_samples_free(s);
}

// ---- the parts ----

static void triangles_fill_the_hemisphere(void **state) {
    (void)state;
    // An octant: the integral of the cosine over it is pi / 4.
    assert_near(gonio_projected_solid_angle((gonio_vec3){0, 0, 1}, (gonio_vec3){1, 0, 0}, (gonio_vec3){0, 1, 0}),
                GONIO_PI / 4, 1e-15);
    enum { MANY = 400 };
    gonio_vec3 d[MANY];
    double weight[MANY], covered, sum = 0, cosine = 0;
    for (size_t k = 0; k < MANY; k++) { // half a grid, half at random, one twice
        d[k] = k < 144 ? gonio_direction(gonio_radians(10.0 * (double)(k / 18)), gonio_radians(20.0 * (double)(k % 18)))
                       : gonio_direction(asin(sqrt(gonio_random_uniform(2 * k))),
                                         2 * GONIO_PI * gonio_random_uniform(2 * k + 1));
    }
    assert_int_equal(gonio_triangles_weigh(d, MANY, false, weight, &covered, NULL), GONIO_OK);
    for (int k = 0; k < MANY; k++) {
        assert_true(weight[k] >= 0);
        sum += weight[k];
        cosine += weight[k] * d[k].z;
    }
    assert_near(sum, GONIO_PI, 1e-6);            // degenerate triangles of the pole, 18 times
    assert_near(cosine, 2 * GONIO_PI / 3, 0.03); // the rim has the values of what lies inside
    assert_true(covered > 0.9 && covered <= 1);
    assert_int_equal(gonio_triangles_weigh(d + 144, 1, false, weight, &covered, NULL), GONIO_OK);
    assert_near(weight[0], GONIO_PI, 1e-9);
    assert_near(covered, 0, 0);
}

static void chi_square_tails_are_known(void **state) {
    (void)state;
    assert_near(gonio_chi_square_beyond(2, 3), exp(-1.5), 1e-15);
    assert_near(gonio_chi_square_beyond(4, 50), 26 * exp(-25), 1e-20);
    assert_near(gonio_chi_square_beyond(1, 6.634896601021213), 0.01, 1e-12);
    assert_near(gonio_chi_square_beyond(100000, 100000), 0.4994, 1e-3);
    assert_near(gonio_chi_square_beyond(3, 0), 1, 0);
    assert_near(gonio_normal_beyond(1.959963984540054), 0.025, 1e-12);
    assert_true(isnan(gonio_chi_square_beyond(0, 1)));
}

static void read_hilbert(void *context, size_t row, double *values) {
    for (size_t k = 0; k < 500; k++) {
        values[k] = 1 / (double)(row + k + 1) + (row == k ? *(double *)context : 0);
    }
}

// The randomised search against the whole decomposition: within what it says it may miss.
static void products_come_with_their_error(void **state) {
    (void)state;
    double shift = 0.001;
    const gonio_row_source a = {500, 500, read_hilbert, &shift};
    gonio_products p;
    assert_int_equal(gonio_products_find(&a, 4, 2, &p, NULL), GONIO_OK);
    // The Hilbert matrix' eigenvalues plus the shift; the 500 of them fall below 1e-3 from the ninth on.
    double squares = 0;
    for (size_t r = 0; r < 500; r++) {
        double row[500];
        read_hilbert(&shift, r, row);
        for (int k = 0; k < 500; k++) {
            squares += row[k] * row[k];
        }
    }
    assert_near(p.squares, squares, 1e-12 * squares);
    assert_near(p.left, (500 - 36) * 1e-6, 3e-5); // the shift alone is outside the 36 directions that were searched
    double found = 0;
    for (int k = 0; k < 4; k++) {
        double dot = 0;
        for (int i = 0; i < 500; i++) {
            dot += p.u[k * 500 + i] * p.v[k * 500 + i];
        }
        assert_near(fabs(dot), 1, 1e-9); // symmetric: both sides are the same
        found += p.value[k] * p.value[k];
    }
    assert_near(found, 2.4363 * 2.4363, 3); // dominated by the first, near pi less what 500 rows cut off
    gonio_products_free(&p);
}

// A white diffuser sends the share of each solid angle into it; a mirror-like lobe all of it into a cone about the
// mirror direction.
static void the_nine_reflectances(void **state) {
    (void)state;
    const gonio_pair p = {gonio_radians(45), 0, gonio_radians(45), GONIO_PI};
    const double cone = gonio_radians(10), share = pow(sin(cone), 2) * cos(p.theta_o); // of pi
    double nine[3][3];
    gonio_model *m = from("lambert:rho=0.8");
    gonio_check_reflectances(m, &p, cone, nine);
    for (int i = 0; i < 3; i++) {
        assert_near(nine[i][0], 0.8, 1e-12);
        assert_near(nine[i][1], 0.8 * share, 1e-5);
        assert_near(nine[i][2], 0.8, 1e-12);
    }
    gonio_model_free(m);
    m = from("ggx:rho_s=1,alpha=0.01");
    gonio_check_reflectances(m, &p, cone, nine);
    assert_near(nine[0][1], 1, 0.1);
    assert_near(nine[2][1], share, 0.2 * share); // of an even sky a mirror shows as much as a diffuser
    gonio_model_free(m);
}

// ---- what sigma explains ----

// Seeds 1 to 6; a physical set's p below 1e-6 in any of them happens to fewer than 1e-5 of all choices of seeds. The
// defect has an rms of 2 % (the cosines differ by about 0.4): `make significance` finds it in all of 1,000.
static void sigma_explains_what_it_makes_and_no_more(void **state) {
    (void)state;
    gonio_model *m = from("ggx:rho_d=0.3,rho_s=0.1,alpha=0.25,f0=0.1");
    for (uint64_t seed = 1; seed <= 6; seed++) {
        const bool scattered = seed % 2 == 0, defect = seed > 4;
        gonio_samples *s = sampled(m, scattered ? "nusselt:1400" : "uniform:15");
        add_noise(s, 0.005, defect ? 0.03 : 0, seed);
        gonio_check_test test;
        double part;
        if (scattered) {
            assert_int_equal(gonio_partial_test(s, GONIO_TEST_RECIPROCITY, 1, &test, &part, NULL), GONIO_OK);
        } else {
            gonio_check_report r = report_of(s);
            test = r.reciprocity_test;
            assert_near(r.reciprocity / r.reciprocity_expected, defect ? r.reciprocity / r.reciprocity_expected : 1,
                        0.6);
            gonio_check_report_free(&r);
        }
        assert_true(defect ? test.p < 1e-3 : test.p > 1e-6);
        gonio_samples_free(s);
    }
    gonio_model_free(m);
}

// What is found of scattered samples does not depend on threads, and is near what the model has.
static void scattered_samples_are_judged_as_they_lie(void **state) {
    (void)state;
    gonio_model *m = from("ward:rho_d=0.3,rho_s=0.2,alpha=0.3");
    gonio_samples *s = sampled(m, "nusselt:500");
    gonio_check_report r = report_of(s), again, exact;
    assert_int_equal(gonio_check_samples(s, 3, &again, NULL), GONIO_OK);
    assert_int_equal(gonio_check_model(m, 1, &exact, NULL), GONIO_OK);
    assert_int_equal(r.form, GONIO_CHECK_SCATTERED);
    assert_near(r.energy, exact.energy, 0.05);
    assert_near(r.albedo, exact.albedo, 0.05);
    assert_true(r.reciprocity < 2 * r.reciprocity_expected);
    assert_near(r.isotropy, 0, 0);
    assert_true(r.reciprocity == again.reciprocity && r.energy == again.energy &&
                r.separability[3] == again.separability[3] && r.reciprocity_test.chi2 == again.reciprocity_test.chi2);
    gonio_check_report_free(&r);
    gonio_check_report_free(&again);
    gonio_check_report_free(&exact);
    gonio_samples_free(s);
    gonio_model_free(m);
}

// A centred table of every half that the model has.
static gonio_samples *sampled_sheet(const gonio_model *m, int step_deg) {
    gonio_plan *plan;
    gonio_samples *s;
    char text[80];
    snprintf(text, sizeof text, "uniform:%d,centred=1,anisotropic=1,transmission=1,back=1", step_deg);
    assert_int_equal(gonio_plan_make(text, 1, &plan, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_new(m->channels, false, &s, NULL), GONIO_OK);
    s->transmission = true;
    double values[GONIO_CHANNELS_MAX];
    for (size_t i = 0; i < plan->n; i++) {
        if (gonio_model_half(m, gonio_pair_half(plan->poses[i])) != NULL) {
            gonio_model_eval_pair(m, &plan->poses[i], values);
            assert_int_equal(gonio_samples_add(s, &plan->poses[i], values, NULL, NULL, NULL), GONIO_OK);
        }
    }
    gonio_plan_free(plan);
    return s;
}

// What is reflected and what goes through, by incidence and side: of a model, and of samples of it.
static void energy_of_a_sheet(void **state) {
    (void)state;
    gonio_check_report r;
    gonio_model *m;
    assert_int_equal(
        gonio_model_from_spec("lambert:rho=0.2/0.1|lambert:rho=0.3/0.6|lambert:rho=0.4|lambert:rho=0.1", &m, NULL),
        GONIO_OK);
    for (int sampled = 0; sampled < 2; sampled++) {
        if (sampled) {
            gonio_samples *s = sampled_sheet(m, 15);
            assert_int_equal(gonio_check_samples(s, 0, &r, NULL), GONIO_OK);
            gonio_samples_free(s);
        } else {
            assert_int_equal(gonio_check_model(m, 0, &r, NULL), GONIO_OK);
        }
        assert_true(r.transmission && r.half == GONIO_REFLECTION);
        assert_near(r.energy, 0.7, sampled ? 0.01 : 1e-3);
        assert_int_equal(r.energy_channel, 1);
        size_t back = 0;
        for (size_t k = 0; k < r.incidences; k++) {
            const gonio_check_albedo_point *a = &r.albedos[k];
            const bool behind = a->theta_i > GONIO_PI / 2;
            back += behind;
            assert_near(a->reflected, behind ? 0.4 : 0.15, sampled ? 0.01 : 1e-3);
            assert_near(a->transmitted, behind ? 0.1 : 0.45, sampled ? 0.01 : 1e-3);
            assert_near(a->value, a->reflected + a->transmitted, 1e-12);
        }
        assert_true(r.incidences > 0 && 2 * back == r.incidences);
        gonio_check_report_free(&r);
    }
    gonio_model_free(m);
    // Transmission alone is judged as such.
    assert_int_equal(gonio_model_from_spec("|ward:rho_d=0.3,rho_s=0.2,alpha=0.2", &m, NULL), GONIO_OK);
    assert_int_equal(gonio_check_model(m, 0, &r, NULL), GONIO_OK);
    assert_true(r.half == GONIO_TRANSMISSION && r.reciprocity < 1e-9 && r.separability[0] > 1e-3);
    assert_true(r.albedos[0].reflected == 0 && r.albedos[0].transmitted > 0.4);
    gonio_check_report_free(&r);
    gonio_model_free(m);
}

// The sum of what a sheet gives off is scaled down; its halves become isotropic by themselves; transmission has no
// exchanged value on its own side.
static void sheets_are_changed_half_by_half(void **state) {
    (void)state;
    for (int kind = 0; kind < GONIO_CHANGES; kind++) {
        const gonio_change change = {.kind = (gonio_change_kind)kind, .products = 1, .delta = 1, .ceiling = 1};
        gonio_model *m;
        gonio_samples *out;
        assert_int_equal(gonio_model_from_spec("lambert:rho=0.4|lambert:rho=0.9", &m, NULL), GONIO_OK);
        gonio_samples *s = sampled_sheet(m, 30);
        for (size_t i = 0; i < s->n; i++) { // neither isotropic nor reciprocal
            s->values[i] *= 1 + 0.3 * cos(s->pairs[i].phi_i) * sin(s->pairs[i].theta_i);
        }
        assert_int_equal(gonio_check_change(s, &change, 1, &out, NULL), GONIO_OK);
        assert_true(out->transmission && (out->n == s->n || kind == GONIO_CHANGE_MIRROR));
        gonio_check_report before = report_of(s), after = report_of(out);
        assert_true(before.energy > 1.3 && before.isotropy > 1e-3 && before.reciprocity > 1e-6);
        if (kind == GONIO_CHANGE_ENERGY) {
            assert_near(after.energy, 1, 1e-9);
        } else if (kind == GONIO_CHANGE_ISOTROPY) {
            assert_near(after.isotropy, 0, 1e-12);
        } else if (kind == GONIO_CHANGE_RECIPROCITY) {
            assert_near(after.reciprocity, 0, 1e-12 * before.reciprocity);
        } else if (kind == GONIO_CHANGE_SEPARABLE) {
            assert_near(after.separability[0], 0, 1e-12);
        }
        gonio_check_report_free(&before);
        gonio_check_report_free(&after);
        gonio_samples_free(out);
        gonio_samples_free(s);
        gonio_model_free(m);
    }
}

// A sheet of four different halves, none of them reciprocal; or one that is not isotropic.
static gonio_model *uneven_sheet(const char *alpha) {
    static const char *const rho[GONIO_HALVES] = {"rho_d=0.3,rho_s=0.2", "rho_d=0.7,rho_s=0.3", "rho_d=0.2,rho_s=0.1",
                                                  "rho_d=0.7,rho_s=0.2"};
    const double factors[2] = {1, 0.6};
    gonio_model *halves[GONIO_HALVES], *sheet;
    for (int h = 0; h < GONIO_HALVES; h++) {
        const gonio_transformed_parts parts = {.what = GONIO_MADE_SCALED, .delta = 1, .knots = 2, .factors = factors};
        char spec[96];
        gonio_model *ward;
        snprintf(spec, sizeof spec, "ward:%s,%s", rho[h], alpha);
        assert_int_equal(gonio_model_from_spec(spec, &ward, NULL), GONIO_OK);
        assert_int_equal(gonio_transformed_new(ward, &parts, &halves[h], NULL), GONIO_OK);
    }
    assert_int_equal(gonio_model_of_halves(halves, &sheet, NULL), GONIO_OK);
    return sheet;
}

static gonio_model *through_a_file(gonio_model *model) {
    gonio_model *read;
    assert_int_equal(gonio_model_save(model, "sheet.gonio", NULL), GONIO_OK);
    assert_int_equal(gonio_model_open("sheet.gonio", &read, NULL), GONIO_OK);
    unlink("sheet.gonio");
    gonio_model_free(model);
    return read;
}

static gonio_model *changed_sheet(gonio_change_kind kind, const char *alpha) {
    const gonio_change change = {.kind = kind, .products = 2, .delta = 1, .ceiling = 1};
    gonio_model *m = uneven_sheet(alpha);
    assert_int_equal(gonio_check_change_model(m, &change, 1, &m, NULL), GONIO_OK);
    for (int h = 0; h < GONIO_HALVES; h++) {
        assert_non_null(gonio_model_half(m, (gonio_half)h));
    }
    return through_a_file(m);
}

// Of both halves on one side.
static double albedo_from(const gonio_model *m, int side, double theta) {
    double of[2] = {0};
    gonio_check_albedo(gonio_model_half(m, (gonio_half)side), theta, &of[0]);
    gonio_check_albedo(gonio_model_half(m, (gonio_half)(side + GONIO_TRANSMISSION)), theta, &of[1]);
    return of[0] + of[1];
}

static void assert_passive(const gonio_model *m, double slack) {
    for (int side = 0; side < GONIO_HALVES; side += GONIO_REFLECTION_BACK) {
        for (int deg = 0; deg < 90; deg += 20) {
            const double albedo = albedo_from(m, side, gonio_radians(deg));
            if (!(albedo <= 1 + slack)) {
                fail_msg("albedo %g from side %d at %d deg", albedo, side, deg);
            }
        }
    }
}

static double value_at(const gonio_model *m, gonio_vec3 wi, gonio_vec3 wo) {
    return gonio_model_eval_channel(m, wi, wo, 0);
}

// A sheet as a model: it stays one, in a file too, and each property is there; energy is of both halves on the light's
// side, and reciprocity leaves what goes through as it is.
static void models_of_sheets_are_changed_half_by_half(void **state) {
    (void)state;
    const gonio_vec3 up = {0.1, 0, sqrt(0.99)}, aside = {0.3, 0.5, sqrt(0.66)}, down = {0.3, 0.1, -sqrt(0.9)};
    const gonio_vec3 turned_up = {0, 0.1, up.z}, turned_down = {-0.1, 0.3, down.z};
    gonio_model *m = uneven_sheet("alpha=0.3");
    const double through = value_at(m, up, down);
    assert_true(albedo_from(m, GONIO_REFLECTION, 0) > 1.2 && value_at(m, up, aside) != value_at(m, aside, up));
    gonio_model_free(m);

    m = changed_sheet(GONIO_CHANGE_ENERGY, "alpha=0.3");
    assert_passive(m, 2e-3);
    assert_near(albedo_from(m, GONIO_REFLECTION, 0), 1, 2e-3);
    assert_true(value_at(m, up, down) < 0.9 * through);
    gonio_model_free(m);

    m = changed_sheet(GONIO_CHANGE_RECIPROCITY, "alpha=0.3");
    assert_near(value_at(m, up, aside), value_at(m, aside, up), 1e-15);
    assert_true(value_at(m, up, down) == through);
    gonio_model_free(m);

    m = changed_sheet(GONIO_CHANGE_ISOTROPY, "alpha_x=0.3,alpha_y=0.5");
    assert_true(m->isotropic);
    assert_near(value_at(m, up, down), value_at(m, turned_up, turned_down), 1e-14);
    gonio_model_free(m);

    m = changed_sheet(GONIO_CHANGE_SEPARABLE, "alpha=0.3");
    assert_near(value_at(m, up, down), through, 0.1 * through);
    assert_true(value_at(m, up, down) != through);
    gonio_model_free(m);

    gonio_physical_report report;
    m = uneven_sheet("alpha=0.3");
    assert_int_equal(gonio_check_make_physical(m, true, true, 1, &m, &report, NULL), GONIO_OK);
    assert_true(report.energy_before > 1.2 && report.energy <= 1 && report.least_factor < 1);
    m = through_a_file(m);
    assert_passive(m, 1e-3); // what gonio_check_albedo is right to
    assert_near(value_at(m, up, aside), value_at(m, aside, up), 1e-15);
    gonio_model_free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(albedos),
        cmocka_unit_test(a_white_diffuser_has_all_four_at_zero),
        cmocka_unit_test(a_uniform_table_gives_the_known_figures),
        cmocka_unit_test(isotropic_tables_are_separated_by_frequency),
        cmocka_unit_test(exchanged_thetas_are_interpolated),
        cmocka_unit_test(one_product_has_rank_one),
        cmocka_unit_test(phong_agrees_with_another_quadrature),
        cmocka_unit_test(non_reciprocal_models_agree_with_sums),
        cmocka_unit_test(grids_of_one_brdf_agree),
        cmocka_unit_test(what_is_wrong_is_found),
        cmocka_unit_test(triangles_fill_the_hemisphere),
        cmocka_unit_test(chi_square_tails_are_known),
        cmocka_unit_test(products_come_with_their_error),
        cmocka_unit_test(the_nine_reflectances),
        cmocka_unit_test(sigma_explains_what_it_makes_and_no_more),
        cmocka_unit_test(scattered_samples_are_judged_as_they_lie),
        cmocka_unit_test(energy_of_a_sheet),
        cmocka_unit_test(sheets_are_changed_half_by_half),
        cmocka_unit_test(models_of_sheets_are_changed_half_by_half),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
