// SPDX-License-Identifier: BSD-3-Clause
// What a model says where nothing was measured: its support, values that follow physics, sigmas that hold there, and no
// more light than falls in.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/kind/transformed.h"
#include "fit/prior/kernel.h"
#include "fit/prior/passive.h"
#include "gonio/check.h"
#include "gonio/fit.h"
#include "tests/sparse_sets.h"

static gonio_model *fitted(const gonio_samples *samples, const char *method, gonio_fit_report *report) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = method;
    o.hold_out = 0;
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_fit(samples, &o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return model;
}

static double support_at(const gonio_model *model, const gonio_pair *p) {
    return gonio_model_support(model, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o));
}

static double sigma_at(const gonio_model *model, const gonio_pair *p) {
    double sigma = NAN;
    assert_true(
        gonio_model_sigma(model, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o), &sigma));
    return sigma;
}

// ---- support ----

static gonio_dataset data_of(const gonio_samples *samples) {
    gonio_dataset data;
    const gonio_dataset_options how = {.mirror = samples->isotropic, .domain = GONIO_LOG};
    assert_int_equal(gonio_dataset_init(&data, samples, &how, NULL), GONIO_OK);
    return data;
}

// 1 at a sample and at its images by reciprocity and mirroring, less farther off, nothing far away; and a sample more
// never takes support away.
static void test_support_is_that_of_the_samples(void **state) {
    (void)state;
    for (int isotropic = 0; isotropic < 2; isotropic++) {
        uint64_t stream = 3;
        gonio_samples *some =
            simulate_samples(isotropic ? "lambert:rho=0.5" : "ward:rho_s=0.2,alpha_x=0.2,alpha_y=0.4", 12, 1, 7);
        gonio_prior_kernel few, all;
        gonio_dataset data = data_of(some), part;
        bool keep[12];
        for (size_t i = 0; i < 12; i++) {
            keep[i] = i % 2 == 0;
        }
        assert_int_equal(gonio_dataset_select(&data, keep, &part, NULL), GONIO_OK);
        assert_int_equal(gonio_prior_kernel_init(&all, &data, NULL), GONIO_OK);
        assert_int_equal(gonio_prior_kernel_init(&few, &part, NULL), GONIO_OK);
        double work[12], least = 1;
        for (size_t i = 0; i < data.n; i++) {
            const gonio_pair swapped = gonio_pair_swapped(data.pairs[i]), mirrored = gonio_pair_mirrored(data.pairs[i]);
            assert_true(gonio_prior_kernel_support(&all, &data.pairs[i], work) > 0.98);
            assert_true(gonio_prior_kernel_support(&all, &swapped, work) > 0.98);
            assert_true(!isotropic || gonio_prior_kernel_support(&all, &mirrored, work) > 0.98);
        }
        for (int k = 0; k < 300; k++) {
            const gonio_pair p = simulate_pair(&stream, isotropic);
            const double more = gonio_prior_kernel_support(&all, &p, work);
            assert_true(more >= gonio_prior_kernel_support(&few, &p, work) - 1e-9 && more <= 1);
            least = fmin(least, more);
        }
        assert_true(least < 0.05);
        double freedom = 0;
        assert_int_equal(gonio_prior_kernel_freedom(&all, &freedom, NULL), GONIO_OK);
        assert_true(freedom > 3 && freedom <= 12);
        gonio_prior_kernel_release(&few);
        gonio_prior_kernel_release(&all);
        gonio_dataset_release(&part);
        gonio_dataset_release(&data);
        gonio_samples_free(some);
    }
}

// What is said of it is what is kept of it: of every method that tells it, in every domain, from one sample on; scaled
// samples give scaled sigmas and the same support.
static void test_every_small_set_tells_its_support(void **state) {
    (void)state;
    static const char *const methods[] = {"auto", "lsq"};
    for (size_t k = 0; k < 2; k++) {
        for (size_t n = k == 0 ? 1 : 7; n <= 7; n += 7) {
            gonio_samples *samples = simulate_samples("ward:rho_d=0.3,rho_s=0.2,alpha=0.3", n, 3, 11);
            gonio_model *model = fitted(samples, methods[k], NULL), *scaled;
            for (size_t i = 0; i < 3 * n; i++) {
                samples->values[i] *= 0x1p40;
            }
            scaled = fitted(samples, methods[k], NULL);
            uint64_t stream = n;
            for (int q = 0; q < 40; q++) {
                const gonio_pair p = q < (int)n ? samples->pairs[q] : simulate_pair(&stream, 1);
                const double support = support_at(model, &p);
                double a[3], b[3];
                const gonio_vec3 wi = gonio_direction(p.theta_i, p.phi_i), wo = gonio_direction(p.theta_o, p.phi_o);
                assert_true(support >= 0 && support <= 1);
                assert_true(support == support_at(scaled, &p));
                assert_true(gonio_model_sigma(model, wi, wo, a) && gonio_model_sigma(scaled, wi, wo, b));
                for (int c = 0; c < 3; c++) {
                    assert_true(a[c] > 0 && fabs(b[c] - 0x1p40 * a[c]) <= 1e-6 * b[c]);
                }
            }
            gonio_model_free(scaled);
            gonio_model_free(model);
            gonio_samples_free(samples);
        }
    }
}

// A model that another stands in, changed or as one half of a sheet, tells the same; the half that is not there tells
// nothing.
static void test_models_in_models_tell_their_support(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ward:rho_d=0.3,rho_s=0.2,alpha=0.3", 7, 1, 11);
    gonio_model *model = fitted(samples, "auto", NULL), *changed, *copy = fitted(samples, "auto", NULL), *sheet;
    const gonio_transformed_parts how = {.what = GONIO_MADE_RECIPROCAL, .delta = 1};
    gonio_model *const halves[GONIO_HALVES] = {[GONIO_TRANSMISSION] = copy};
    assert_int_equal(gonio_transformed_new(model, &how, &changed, NULL), GONIO_OK);
    assert_int_equal(gonio_model_of_halves(halves, &sheet, NULL), GONIO_OK);
    for (size_t i = 0; i < samples->n; i++) {
        const gonio_pair p = samples->pairs[i], through = gonio_pair_lowered(p, GONIO_TRANSMISSION);
        const double support = support_at(model, &p);
        assert_true(support > 0.5);
        assert_true(support_at(changed, &p) == support);
        assert_true(support_at(sheet, &through) == support);
        assert_true(isnan(support_at(sheet, &p)) && isnan(support_at(model, &through)));
    }
    gonio_model_free(changed);
    gonio_model_free(sheet);
    gonio_samples_free(samples);
}

// ---- sigma ----

static const char *const materials[] = {
    "ward:rho_d=0.3,rho_s=0.2,alpha=0.15",
    "cook-torrance:rho_d=0.1,rho_s=0.6,alpha=0.25,f0=0.04",
    "lambert:rho=0.5",
    "ggx:rho_d=0.2,rho_s=0.5,alpha=0.2,f0=0.05",
    "oren-nayar:rho=0.5,sigma_deg=25",
    "blinn-phong:rho_d=0.2,rho_s=0.3,n=40",
};
#define MATERIALS (sizeof materials / sizeof *materials)

typedef struct tally {
    size_t n, within, far; // values; within 2 sigma; beyond 6
} tally;

static void count(sparse_design design, const char *spec, tally t[2]) {
    gonio_model *truth = simulate_truth(spec);
    uint64_t stream = 100;
    gonio_samples *samples = sparse_samples(truth, design, 5, 0, &stream);
    gonio_fit_report report = {0};
    gonio_model *model = fitted(samples, "auto", &report);
    for (int k = 0; k < 200; k++) {
        const gonio_pair p = sigma_pair(&stream, k % 2 == 1 ? 0 : 1 + k / 2 % 2, k % 3 == 2);
        double f, g;
        gonio_model_eval_pair(truth, &p, &f);
        gonio_model_eval_pair(model, &p, &g);
        tally *cell = &t[support_at(model, &p) >= 0.5];
        const double ratio = fabs(f - g) / sigma_at(model, &p);
        cell->n++;
        cell->within += ratio <= 2;
        cell->far += ratio > 6;
    }
    gonio_model_free(model);
    gonio_samples_free(samples);
    gonio_model_free(truth);
}

// The sets of the bench (tests/bench/fit_support) with a fifth of their samples, of a material or two each. Pooled,
// 90 % and more of the truth lie within 2 sigma, where the samples support the model and where they do not; of a single
// set, whose errors go together, 80 %.
static void test_sigma_holds_where_nothing_was_measured(void **state) {
    (void)state;
    tally all[2] = {{0}};
    for (int d = 0; d < SPARSE_DESIGNS; d++) {
        tally t[2] = {{0}};
        for (size_t m = 0; m < (d == SPARSE_TWENTY ? 2 : 1); m++) {
            count((sparse_design)d, materials[((size_t)d + 3 * m) % MATERIALS], t);
        }
        for (int s = 0; s < 2; s++) {
            const double share = t[s].n > 0 ? (double)t[s].within / (double)t[s].n : 1;
            print_message("# %s, %s: %.3f of %zu within 2 sigma\n", sparse_names[d], s ? "supported" : "unsupported",
                          share, t[s].n);
            assert_true(t[s].n < 30 || share >= 0.8);
            all[s].n += t[s].n;
            all[s].within += t[s].within;
            all[s].far += t[s].far;
        }
    }
    for (int s = 0; s < 2; s++) {
        assert_true((double)all[s].within >= 0.9 * (double)all[s].n);
        assert_true((double)all[s].far <= 0.03 * (double)all[s].n);
    }
}

// ---- passivity ----

static double largest_albedo(const gonio_model *model) {
    double most = 0;
    for (int a = 0; a <= 75; a += 15) {
        double albedo;
        gonio_check_albedo(model, gonio_radians(a), &albedo);
        most = fmax(most, albedo);
    }
    return most;
}

// One plane of a bright metal: nothing measured says how much goes elsewhere, but it is no more than what is left. The
// same values trebled say so themselves, and the report warns.
static void test_no_more_light_than_falls_in(void **state) {
    (void)state;
    gonio_model *truth = simulate_truth("ggx:rho_d=0.05,rho_s=0.95,alpha=0.35,f0=0.9");
    uint64_t stream = 5;
    gonio_samples *samples = sparse_samples(truth, SPARSE_PLANE, 5, 0, &stream);
    gonio_fit_report report = {0};
    gonio_model *model = fitted(samples, "auto", &report);
    assert_true(largest_albedo(model) < 1.1);
    assert_null(strstr(report.note, "WARNING"));
    assert_non_null(strstr(report.note, "the samples say little"));
    gonio_model_free(model);
    for (size_t i = 0; i < samples->n; i++) {
        samples->values[i] *= 3;
    }
    model = fitted(samples, "auto", &report);
    assert_non_null(strstr(report.note, "WARNING"));
    gonio_model_free(model);
    gonio_samples_free(samples);
    gonio_model_free(truth);
}

// The integral that this rests on, against the check's.
static void test_albedos(void **state) {
    (void)state;
    static const char *const specs[] = {"lambert:rho=0.5", "ggx:rho_s=1,alpha=0.03",
                                        "ward:rho_d=0.3,rho_s=0.5,alpha=0.3", "ggx:rho_s=0.8,alpha=0.5,f0=0.5"};
    for (size_t m = 0; m < 4; m++) {
        gonio_model *truth = simulate_truth(specs[m]);
        for (int a = 0; a <= 70; a += 35) {
            double expected;
            gonio_check_albedo(truth, gonio_radians(a), &expected);
            const double found = gonio_passive_albedo(truth, gonio_radians(a));
            print_message("# %s at %d deg: %.4f, %.4f\n", specs[m], a, found, expected);
            assert_true(fabs(found - expected) < 0.03 * expected);
        }
        gonio_model_free(truth);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_support_is_that_of_the_samples),
        cmocka_unit_test(test_every_small_set_tells_its_support),
        cmocka_unit_test(test_models_in_models_tell_their_support),
        cmocka_unit_test(test_sigma_holds_where_nothing_was_measured),
        cmocka_unit_test(test_no_more_light_than_falls_in),
        cmocka_unit_test(test_albedos),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
