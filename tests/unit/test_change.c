// SPDX-License-Identifier: BSD-3-Clause
// DeYoung's transforms: what they leave, of tables, of tables read in passes and of models; sigma on the way.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "fit/check/measures.h"
#include "tests/unit/check_models.h"

static gonio_samples *changed(const gonio_samples *s, gonio_change_kind kind, int products, double delta) {
    const gonio_change change = {kind, products, delta, 1, false, false};
    gonio_samples *out;
    gonio_error error = {0};
    if (gonio_check_change(s, &change, 1, &out, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    assert_int_equal(out->n, s->n);
    return out;
}

static double measure(const gonio_samples *s, gonio_change_kind kind, int products) {
    gonio_check_report r = report_of(s);
    const double p = kind == GONIO_CHANGE_RECIPROCITY ? r.reciprocity
                     : kind == GONIO_CHANGE_ENERGY    ? r.excess
                     : kind == GONIO_CHANGE_ISOTROPY  ? r.isotropy
                                                      : r.separability[products - 1];
    gonio_check_report_free(&r);
    return p;
}

// Of a table that has none of the properties: each measure is 0 at delta 1, P_r a quarter and P_i, P_s half at one
// half.
static void transforms_of_tables_reach_zero(void **state) {
    (void)state;
    const gonio_model m = HEAD(product_ops, false);
    gonio_model *w = from("ward:rho_d=0.6,rho_s=0.9,alpha_x=0.2,alpha_y=0.4");
    gonio_samples *s = sampled(w, "uniform:30,anisotropic=1"), *other = sampled(&m, "uniform:30,anisotropic=1");
    for (size_t i = 0; i < s->n; i++) {
        s->values[i] = s->values[i] / cos(s->pairs[i].theta_i) + other->values[i];
    }
    static const struct {
        gonio_change_kind kind;
        int products;
        double half;
    } cases[] = {{GONIO_CHANGE_RECIPROCITY, 1, 0.25},
                 {GONIO_CHANGE_ISOTROPY, 1, 0.5},
                 {GONIO_CHANGE_SEPARABLE, 1, 0.5},
                 {GONIO_CHANGE_SEPARABLE, 3, 0.5},
                 {GONIO_CHANGE_ENERGY, 1, 0}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const double before = measure(s, cases[k].kind, cases[k].products);
        gonio_samples *half = changed(s, cases[k].kind, cases[k].products, 0.5);
        gonio_samples *whole = changed(s, cases[k].kind, cases[k].products, 1);
        assert_true(before > 1e-3);
        if (cases[k].half > 0) {
            assert_near(measure(half, cases[k].kind, cases[k].products) / before, cases[k].half, 1e-9);
        }
        assert_near(measure(whole, cases[k].kind, cases[k].products), 0, 1e-12 * before + 1e-15);
        gonio_samples_free(half);
        gonio_samples_free(whole);
    }
    gonio_samples_free(other);
    gonio_samples_free(s);
    gonio_model_free(w);
}

// The same of samples on no grid: the transform and the measure see the same interpolant. Sigma goes on.
static double measure_scattered(const gonio_samples *s, gonio_change_kind kind) {
    static const unsigned what[] = {GONIO_CHECK_OF_RECIPROCITY, GONIO_CHECK_OF_ENERGY, GONIO_CHECK_OF_ISOTROPY, 0};
    if (kind == GONIO_CHANGE_SEPARABLE || s->isotropic) {
        return measure(s, kind, 2);
    }
    gonio_check_report r = {0};
    assert_int_equal(gonio_check_interpolated(s, what[kind], 1, &r, NULL), GONIO_OK);
    const double p = kind == GONIO_CHANGE_RECIPROCITY ? r.reciprocity
                     : kind == GONIO_CHANGE_ENERGY    ? r.excess
                                                      : r.isotropy;
    gonio_check_report_free(&r);
    return p;
}

static void transforms_of_scattered_samples_reach_zero(void **state) {
    (void)state;
    static const double half[] = {[GONIO_CHANGE_RECIPROCITY] = 0.25, 0, 0.5, 0.5};
    for (int kind = GONIO_CHANGE_RECIPROCITY; kind <= GONIO_CHANGE_SEPARABLE; kind++) {
        const bool energy = kind == GONIO_CHANGE_ENERGY; // at a few incidences: each takes a quadrature
        for (int with = energy ? 1 : 0; with < 2; with++) {
            gonio_model *w = from("ward:rho_d=0.6,rho_s=0.9,alpha_x=0.2,alpha_y=0.4");
            const bool table = kind == GONIO_CHANGE_SEPARABLE;
            gonio_samples *plain = sampled(w, table    ? "nusselt:100"
                                              : energy ? "nusselt:400,anisotropic=1"
                                                       : "nusselt:100,anisotropic=1"),
                          *s;
            assert_int_equal(gonio_samples_new(1, with == 1, &s, NULL), GONIO_OK);
            s->isotropic = table;
            for (size_t i = 0; i < plain->n; i++) {
                if (energy && fabs(plain->pairs[i].theta_i - 1.2) > 0.08) {
                    continue;
                }
                const double z = plain->values[i] / cos(plain->pairs[i].theta_i);
                const double random = 0.01 * z * (1 + (double)(i % 3)), systematic = 0.02 * z;
                assert_int_equal(gonio_samples_add(s, &plain->pairs[i], &z, with == 1 ? &random : NULL,
                                                   with == 1 ? &systematic : NULL, NULL),
                                 GONIO_OK);
            }
            // One place twice, and one whose exchanged directions were measured.
            const gonio_pair twice[] = {s->pairs[5], gonio_pair_swapped(s->pairs[7])};
            for (int k = 0; k < 2; k++) {
                const double z = 1.5, sigma = 0.1;
                assert_int_equal(
                    gonio_samples_add(s, &twice[k], &z, with == 1 ? &sigma : NULL, with == 1 ? &sigma : NULL, NULL),
                    GONIO_OK);
            }
            const double before = measure_scattered(s, (gonio_change_kind)kind);
            assert_true(before > 1e-3);
            for (int whole = 0; whole < 2; whole++) {
                const gonio_change change = {(gonio_change_kind)kind, 2, whole ? 1 : 0.5, 1, false, false};
                gonio_samples *out;
                assert_int_equal(gonio_check_change(s, &change, 1, &out, NULL), GONIO_OK);
                const double after = measure_scattered(out, (gonio_change_kind)kind);
                if (whole || half[kind] > 0) {
                    assert_near(after / before, whole ? 0 : half[kind], whole ? 1e-12 : 0.02);
                }
                for (size_t i = 0; i < out->n && with; i++) {
                    assert_true(out->sigma_random[i] > 0 && out->sigma_systematic[i] > 0);
                }
                gonio_samples_free(out);
            }
            gonio_samples_free(s);
            gonio_samples_free(plain);
            gonio_model_free(w);
        }
    }
}

// Two values of one pair of directions, the second ten times as certain: the mean leans to it, and its sigma is less
// than either.
// Some table, of two channels with sigmas where `with`.
static gonio_samples *some_table(bool with) {
    const gonio_model m = HEAD(product_ops, false);
    gonio_samples *one = sampled(&m, "uniform:30,anisotropic=1"), *s;
    assert_int_equal(gonio_samples_new(with ? 2 : 1, with, &s, NULL), GONIO_OK);
    s->isotropic = false;
    snprintf(s->channel_names[0], GONIO_CHANNEL_NAME_MAX, "r");
    snprintf(s->channel_names[with ? 1 : 0], GONIO_CHANNEL_NAME_MAX, "%s", with ? "g" : "r");
    for (size_t i = 0; i < one->n; i++) {
        const double z[2] = {one->values[i] + gonio_random_uniform(i) * one->pairs[i].theta_i,
                             one->values[i] + gonio_random_uniform(i + 12345)};
        const double random[2] = {0.01 + 0.1 * gonio_random_uniform(i + 5), 0.02}, systematic[2] = {0.01, 0.03};
        assert_int_equal(gonio_samples_add(s, &one->pairs[i], z, with ? random : NULL, with ? systematic : NULL, NULL),
                         GONIO_OK);
    }
    gonio_samples_free(one);
    return s;
}

static void same_report(const gonio_check_report *passes, const gonio_check_report *whole, bool with) {
    assert_near(passes->reciprocity, whole->reciprocity, 1e-13 * whole->reciprocity);
    assert_near(passes->reciprocity_range.mean, whole->reciprocity_range.mean, 1e-9 * whole->reciprocity_range.mean);
    assert_near(passes->isotropy, whole->isotropy, 1e-13 * whole->isotropy);
    assert_near(passes->energy, whole->energy, 1e-13 * whole->energy);
    assert_near(passes->excess, whole->excess, 1e-13);
    for (int k = 0; k < 4; k++) {
        assert_near(passes->separability[k], whole->separability[k], 1e-7 * whole->separability[0]);
    }
    for (int k = 0; k < 3 && with; k++) {
        const gonio_check_test *p = k == 0   ? &passes->reciprocity_test
                                    : k == 1 ? &passes->isotropy_test
                                             : &passes->separability_test[1];
        const gonio_check_test *w = k == 0   ? &whole->reciprocity_test
                                    : k == 1 ? &whole->isotropy_test
                                             : &whole->separability_test[1];
        assert_near(p->chi2, w->chi2, 1e-6 * w->chi2);
        assert_near(p->dof, w->dof, 1e-6 * w->dof);
        assert_int_equal(p->channel, w->channel);
    }
    assert_true(!with || passes->energy_test.p == whole->energy_test.p);
}

// Read in passes, with memory for a few rows, a table gives the same figures and the same changed table.
static void tables_are_read_in_passes(void **state) {
    (void)state;
    char in[] = "/tmp/gonio-check-in-XXXXXX", out[] = "/tmp/gonio-check-out-XXXXXX";
    close(mkstemp(in));
    close(mkstemp(out));
    for (int with = 0; with < 2; with++) {
        gonio_samples *s = some_table(with == 1), *back;
        const size_t c = (size_t)s->channels;
        assert_int_equal(gonio_write_samples(s, in, NULL), GONIO_OK);
        gonio_check_report whole = report_of(s), passes;
        assert_int_equal(gonio_check_stream(in, 1000, &passes, NULL), GONIO_OK);
        same_report(&passes, &whole, with == 1);
        for (int kind = GONIO_CHANGE_RECIPROCITY; kind <= GONIO_CHANGE_SEPARABLE; kind++) {
            const gonio_change change = {(gonio_change_kind)kind, 2, 0.7, 0.8, false, false};
            gonio_samples *want;
            assert_int_equal(gonio_check_change(s, &change, 1, &want, NULL), GONIO_OK);
            assert_int_equal(gonio_check_stream_change(in, &change, 1000, out, NULL), GONIO_OK);
            assert_int_equal(gonio_read(out, NULL, &back, NULL, NULL), GONIO_OK);
            assert_true(back->n == want->n && !back->isotropic);
            for (size_t i = 0; i < want->n * c; i++) {
                assert_near(back->values[i], want->values[i], 1e-9 * (1 + fabs(want->values[i])));
                assert_true(with == 0 || fabs(back->sigma_random[i] / want->sigma_random[i] - 1) < 1e-9);
                assert_true(with == 0 || fabs(back->sigma_systematic[i] / want->sigma_systematic[i] - 1) < 1e-9);
                assert_near(back->pairs[i / c].phi_o, want->pairs[i / c].phi_o, 1e-12);
            }
            gonio_samples_free(back);
            gonio_samples_free(want);
        }
        gonio_check_report_free(&whole);
        gonio_check_report_free(&passes);
        // What is no such table is refused with its line.
        gonio_error error = {0};
        s->n--;
        assert_int_equal(gonio_write_samples(s, in, NULL), GONIO_OK);
        assert_int_equal(gonio_check_stream(in, 0, &passes, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "whole table"));
        gonio_samples_free(s);
    }
    unlink(in);
    unlink(out);
}

static void means_are_weighted_by_certainty(void **state) {
    (void)state;
    gonio_model *m = from("lambert:rho=0.5");
    gonio_samples *s = sampled(m, "uniform:30");
    add_noise(s, 0, 0, 1);
    for (size_t i = 0; i < s->n; i++) {
        const bool steep = s->pairs[i].theta_i > s->pairs[i].theta_o;
        s->values[i] = steep ? 1 : 2;
        s->sigma_random[i] = steep ? 0.1 : 0.01;
    }
    gonio_samples *t = changed(s, GONIO_CHANGE_RECIPROCITY, 1, 1);
    for (size_t i = 0; i < t->n; i++) {
        if (fabs(t->pairs[i].theta_i - t->pairs[i].theta_o) > 0.1) {
            assert_near(t->values[i], (1 / 0.01 + 2 / 0.0001) / (1 / 0.01 + 1 / 0.0001), 1e-12);
            assert_near(t->sigma_random[i], 1 / sqrt(1 / 0.01 + 1 / 0.0001), 1e-12);
        }
    }
    gonio_samples_free(t);
    gonio_samples_free(s);
    gonio_model_free(m);
}

static void mirror_and_clamp_change_sets(void **state) {
    (void)state;
    gonio_samples *s, *t;
    assert_int_equal(gonio_samples_new(1, true, &s, NULL), GONIO_OK);
    const gonio_pair p = {0.1, 0.2, 0.3, 0.5};
    const double v = -4, sigma = 2;
    assert_int_equal(gonio_samples_add(s, &p, &v, &sigma, &sigma, NULL), GONIO_OK);
    gonio_change change = {GONIO_CHANGE_MIRROR, 0, 1, 1, false, false};
    assert_int_equal(gonio_check_change(s, &change, 1, &t, NULL), GONIO_OK);
    assert_true(t->n == 2 && t->pairs[1].phi_i == -0.2 && t->values[1] == -4 && t->sigma_random[1] == 2);
    gonio_samples_free(t);
    change.kind = GONIO_CHANGE_CLAMP;
    assert_int_equal(gonio_check_change(s, &change, 1, &t, NULL), GONIO_OK);
    assert_true(t->n == 1 && t->values[0] == 0);
    gonio_samples_free(t);
    change = (gonio_change){GONIO_CHANGE_SEPARABLE, 0, 1, 1, false, false};
    assert_int_equal(gonio_check_change(s, &change, 1, &t, NULL), GONIO_E_USAGE);
    gonio_samples_free(s);
}

// A model stays one: P_r a quarter at one half and 0 at one, by powers too; what holds already is left alone.
static void transforms_of_models(void **state) {
    (void)state;
    phong p = {HEAD(phong_ops, true), 0.1, 0.3, 6, true, false};
    const gonio_vec3 a = gonio_direction(0.4, 0.3), b = gonio_direction(1.1, 2.8);
    double there, back, now, swapped;
    eval_phong(&p.head, a, b, &there);
    eval_phong(&p.head, b, a, &back);
    for (int geometric = 0; geometric < 2; geometric++) {
        const gonio_change half = {GONIO_CHANGE_RECIPROCITY, 1, 0.5, 1, false, geometric == 1};
        gonio_model *made;
        assert_int_equal(gonio_check_change_model(&p.head, &half, 1, &made, NULL), GONIO_OK);
        gonio_model_eval(made, a, b, &now);
        gonio_model_eval(made, b, a, &swapped);
        const double target = (there + back) / 2;
        assert_near(now, geometric ? sqrt(there * target) : (there + target) / 2, 1e-15);
        if (!geometric) {
            assert_near((now - swapped) / (there - back), 0.5, 1e-12);
        }
        gonio_model_free(made);
    }
    const gonio_change whole = {GONIO_CHANGE_RECIPROCITY, 1, 1, 1, false, false};
    gonio_model *ward = from("ward:rho_d=0.3,rho_s=0.2,alpha=0.3"), *same;
    assert_int_equal(gonio_check_change_model(ward, &whole, 1, &same, NULL), GONIO_OK);
    assert_ptr_equal(ward, same);
    gonio_model_free(same);
}

// A Phong lobe that is neither reciprocal nor passive; made so, it is both, and the albedo reaches 1.
static void models_are_made_physical(void **state) {
    (void)state;
    phong p = {HEAD(phong_ops, true), 0.6, 0.9, 8, false, true};
    gonio_model *made;
    gonio_physical_report report;
    assert_int_equal(gonio_check_make_physical(&p.head, true, true, 1, &made, &report, NULL), GONIO_OK);
    assert_true(report.reciprocity_before > 0 && report.energy_before > 1.1 && report.least_factor < 1 &&
                report.least_factor <= report.least_factor_bound);
    assert_near(report.energy, 0.9999, 1e-4);
    double most = 0;
    for (int k = 0; k < 12; k++) {
        double albedo, there, back;
        gonio_check_albedo(made, gonio_radians(3 + 7.7 * k), &albedo);
        most = fmax(most, albedo);
        const gonio_vec3 a = gonio_direction(0.1 * k, 0.3), b = gonio_direction(1.2, 0.5 * k);
        gonio_model_eval(made, a, b, &there);
        gonio_model_eval(made, b, a, &back);
        assert_near(there, back, 1e-16);
    }
    assert_near(most, 0.9975, 0.0026);
    gonio_model_free(made);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(transforms_of_tables_reach_zero), cmocka_unit_test(transforms_of_scattered_samples_reach_zero),
        cmocka_unit_test(tables_are_read_in_passes),       cmocka_unit_test(means_are_weighted_by_certainty),
        cmocka_unit_test(mirror_and_clamp_change_sets),    cmocka_unit_test(transforms_of_models),
        cmocka_unit_test(models_are_made_physical),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
