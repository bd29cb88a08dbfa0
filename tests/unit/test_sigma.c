// SPDX-License-Identifier: BSD-3-Clause
// The model's sigma: left-out predictions in closed form against fits without those samples, the law against residuals
// of a known one, and simulated truth.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/prior/extend.h"
#include "fit/sigma/blocks.h"
#include "fit/sigma/law.h"
#include "gonio/fit.h"
#include "tests/sparse_sets.h"
#include "tests/unit/near.h"

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.3"

static gonio_dataset ward_data(size_t n, double noise, uint64_t seed) {
    gonio_model *truth = simulate_truth(WARD);
    gonio_samples *samples = sigma_samples(truth, n, noise, &seed);
    gonio_dataset data;
    const gonio_dataset_options how = {.mirror = true, .domain = GONIO_LOG};
    assert_int_equal(gonio_dataset_init(&data, samples, &how, NULL), GONIO_OK);
    gonio_samples_free(samples);
    gonio_model_free(truth);
    return data;
}

// A record's residual is what a solver that never saw its block leaves there.
static void test_left_out_blocks_are_what_they_say(void **state) {
    (void)state;
    const double lambda = 1e-3, factor = 1;
    gonio_dataset data = ward_data(90, 0.03, 1);
    const gonio_smooth_form form = gonio_smooth_form_default(GONIO_NUSSELT, 2, true);
    gonio_smooth_dense *dense, *without;
    gonio_smooth_base base;
    gonio_influence f;
    gonio_sigma_records records;
    assert_int_equal(gonio_smooth_base_init(&base, &data, NULL, NULL), GONIO_OK);
    assert_int_equal(gonio_smooth_dense_new(&data, &form, NULL, &dense, NULL), GONIO_OK);
    assert_int_equal(gonio_influence_init(&f, dense, &data, &base, lambda, 0.1, NULL, NULL), GONIO_OK);
    assert_int_equal(gonio_influence_records(&f, &factor, &records, NULL), GONIO_OK);
    assert_true(records.near == data.n && records.n > data.n + 50);
    // All beyond an angle: the eighth of the samples with the largest theta_o comes right after the neighbourhoods.
    const size_t size = data.n / 8, first = records.n - 2 * size - 2 * (data.n / 4);
    bool keep[90];
    memset(keep, true, sizeof keep);
    for (size_t i = 0; i < size; i++) {
        keep[records.rows[first + i].centre] = false;
    }
    gonio_dataset part;
    assert_int_equal(gonio_dataset_select(&data, keep, &part, NULL), GONIO_OK);
    assert_int_equal(part.n, data.n - size);
    double *rest = malloc(part.n * sizeof *rest), *x = malloc(3 * data.n * sizeof *x);
    for (size_t i = 0, at = 0; i < data.n; i++) {
        if (keep[i]) {
            rest[at++] = base.rest[i];
        }
    }
    gonio_lattice lattice;
    assert_int_equal(gonio_smooth_dense_new(&part, &form, NULL, &without, NULL), GONIO_OK);
    assert_int_equal(gonio_smooth_dense_solve(without, rest, 1, &lambda, &lattice, NULL), GONIO_OK);
    gonio_dataset_locate(&data, GONIO_NUSSELT, x);
    for (size_t i = 0; i < size; i++) {
        const size_t centre = records.rows[first + i].centre;
        double predicted;
        gonio_lattice_eval(&lattice, x + 3 * centre, &predicted);
        const double e = base.rest[centre] - predicted;
        assert_near(sqrt(records.rows[first + i].square), fabs(e), 1e-4);
        // A prediction without noise would leave the sample's own.
        assert_true(records.rows[first + i].noise >= 1 / data.weights[centre] - 1e-9);
        assert_true(records.rows[first + i].signs[GONIO_SIGMA_UNKNOWN] > 0);
        assert_near(records.rows[first + i].signs[GONIO_SIGMA_CORRECTION], predicted * predicted, 1e-3);
        assert_true(records.rows[first + i].signs[GONIO_SIGMA_SLOPES] == 0); // no base
    }
    gonio_lattice_release(&lattice);
    gonio_smooth_dense_free(without);
    gonio_dataset_release(&part);
    free(rest);
    free(x);
    gonio_sigma_records_release(&records);
    gonio_influence_release(&f);
    gonio_smooth_dense_free(dense);
    gonio_smooth_base_release(&base);
    gonio_dataset_release(&data);
}

// What the materials leave open at the places that physics adds to one plane's samples stands in the model's variance
// as far as a fit to each material's values there says.
static void test_added_places_pass_their_errors_on(void **state) {
    (void)state;
    enum { PROBES = 20 };
    const double lambda = 1e-3, factor = 0.5;
    uint64_t stream = 3;
    gonio_model *truth = simulate_truth(WARD);
    gonio_samples *samples = sparse_samples(truth, SPARSE_PLANE, 6, 0, &stream);
    const gonio_dataset_options how = {.mirror = true, .domain = GONIO_LOG};
    const gonio_smooth_form form = gonio_smooth_form_default(GONIO_NUSSELT, 2, true);
    gonio_dataset data;
    gonio_prior prior;
    gonio_smooth_dense *dense;
    gonio_smooth_base base;
    gonio_influence f;
    assert_int_equal(gonio_dataset_init(&data, samples, &how, NULL), GONIO_OK);
    assert_int_equal(gonio_prior_init(&prior, &data, NULL), GONIO_OK);
    assert_int_equal(gonio_prior_extend(&prior, &data, NULL), GONIO_OK);
    const size_t places = data.n - data.measured;
    assert_true(places > 20);
    assert_int_equal(gonio_smooth_base_init(&base, &data, NULL, NULL), GONIO_OK);
    assert_int_equal(gonio_smooth_dense_new(&data, &form, NULL, &dense, NULL), GONIO_OK);
    assert_int_equal(gonio_influence_init(&f, dense, &data, &base, lambda, 0.1, &prior, NULL), GONIO_OK);
    gonio_pair pairs[PROBES];
    double at[3 * PROBES], noise[PROBES], signs[GONIO_SIGMA_SIGNS * PROBES], passed[PROBES], plain[PROBES];
    double off[PROBES][GONIO_PRIOR_MATERIALS];
    for (size_t i = 0; i < PROBES; i++) {
        pairs[i] = simulate_pair(&stream, true);
        gonio_coordinates_isotropic(GONIO_NUSSELT, gonio_direction(pairs[i].theta_i, pairs[i].phi_i),
                                    gonio_direction(pairs[i].theta_o, pairs[i].phi_o), at + 3 * i);
    }
    assert_int_equal(gonio_influence_at(&f, &factor, PROBES, pairs, at, noise, signs, passed, NULL), GONIO_OK);
    double *errors = malloc(places * GONIO_PRIOR_MATERIALS * sizeof *errors), *rest = malloc(data.n * sizeof *rest);
    gonio_prior_errors(&prior, &data, errors);
    for (int k = -1; k < GONIO_PRIOR_MATERIALS; k++) {
        gonio_lattice lattice;
        memcpy(rest, base.rest, data.n * sizeof *rest);
        for (size_t i = 0; i < places && k >= 0; i++) {
            rest[data.measured + i] += errors[(size_t)k * places + i];
        }
        assert_int_equal(gonio_smooth_dense_solve(dense, rest, 1, &lambda, &lattice, NULL), GONIO_OK);
        for (size_t i = 0; i < PROBES; i++) {
            double value;
            gonio_lattice_eval(&lattice, at + 3 * i, &value);
            plain[i] = k < 0 ? value : plain[i];
            off[i][k < 0 ? 0 : k] = (value - plain[i]) / factor;
        }
        gonio_lattice_release(&lattice);
    }
    for (size_t i = 0; i < PROBES; i++) {
        assert_true(passed[i] > 0);
        assert_near(sqrt(passed[i]), sqrt(gonio_prior_variance(off[i])), 1e-4);
    }
    free(errors);
    free(rest);
    gonio_influence_release(&f);
    gonio_smooth_dense_free(dense);
    gonio_smooth_base_release(&base);
    gonio_prior_release(&prior);
    gonio_dataset_release(&data);
    gonio_samples_free(samples);
    gonio_model_free(truth);
}

// Residuals drawn from a law whose roughness differs by a factor of 5 over the domain, and that grows with what the
// spline adds: the answer is within a factor of 1.6 of the true sigma at nine of ten places. 2,000 residuals, 16 in a
// window: their scale is known to 20 %.
static void test_the_law_is_found(void **state) {
    (void)state;
    uint64_t seed = 7;
    gonio_sigma_records records = {.power = {1, 0.6, 0.3}, .spread = {0.5, 0.25, 0.25}};
    const double noise = 0.04;
    for (size_t i = 0; i < 2000; i++) {
        gonio_sigma_record r = {.x = {3 * simulate_uniform(&seed), simulate_uniform(&seed)}, .weight = 1, .centre = i};
        r.noise = 1 + 0.2 * simulate_uniform(&seed);
        const double unknown = exp(6 * simulate_uniform(&seed) - 3), spline = exp(4 * simulate_uniform(&seed) - 2);
        const double rough = r.x[0] < 1.5 ? 0.3 : 1.5;
        const double e = sqrt(noise * r.noise + rough * rough * pow(unknown, 1.5) * spline) * sigma_normal(&seed);
        r.signs[GONIO_SIGMA_UNKNOWN] = unknown;
        r.signs[GONIO_SIGMA_CORRECTION] = spline;
        r.square = e * e;
        assert_int_equal(gonio_sigma_records_add(&records, &r, NULL), GONIO_OK);
    }
    records.near = records.n;
    gonio_sigma_law law;
    double *work = malloc(4 * records.n * sizeof *work);
    for (int told = 0; told < 2; told++) {
        assert_int_equal(gonio_sigma_law_fit(&records, told ? noise : -1, &law, NULL), GONIO_OK);
        int good = 0;
        for (int k = 0; k < 200; k++) {
            const double x[2] = {k % 2 == 0 ? 1.2 * simulate_uniform(&seed) : 1.8 + 1.2 * simulate_uniform(&seed),
                                 simulate_uniform(&seed)};
            const double unknown = exp(4 * simulate_uniform(&seed) - 2), spline = exp(2 * simulate_uniform(&seed) - 1);
            const double rough = k % 2 == 0 ? 0.3 : 1.5;
            const double truth = sqrt(0.1 * noise + rough * rough * pow(unknown, 1.5) * spline);
            const double signs[GONIO_SIGMA_SIGNS] = {unknown, spline, 0};
            const double found = sqrt(gonio_sigma_law_variance(&law, x, 0.1, signs, work));
            good += fabs(log(found / truth)) < log(1.6);
        }
        assert_true(good >= 180);
    }
    free(work);
    gonio_sigma_records_release(&records);
}

typedef struct tally {
    size_t n, within, below; // ratios; those up to 2; those up to the normal's median
    double largest;
} tally;

static void count_errors(const char *method, size_t n, double noise, uint64_t first, int seeds, tally tallies[3]) {
    gonio_model *truth = simulate_truth(WARD);
    for (uint64_t seed = first; seed < first + (uint64_t)seeds; seed++) {
        uint64_t stream = seed;
        gonio_samples *samples = sigma_samples(truth, n, noise, &stream);
        gonio_fit_options o;
        gonio_fit_options_default(&o);
        o.method = method;
        o.hold_out = 0;
        o.threads = 2;
        gonio_model *model;
        assert_int_equal(gonio_fit(samples, &o, &model, NULL, NULL), GONIO_OK);
        for (int k = 0; k < 450; k++) {
            const gonio_pair p = sigma_pair(&stream, k % 3, k % 9 > 5);
            double f, g, sigma;
            gonio_model_eval_pair(truth, &p, &f);
            gonio_model_eval_pair(model, &p, &g);
            assert_true(gonio_model_sigma(model, gonio_direction(p.theta_i, p.phi_i),
                                          gonio_direction(p.theta_o, p.phi_o), &sigma));
            assert_true(sigma > 0 && isfinite(sigma));
            tally *t = &tallies[k % 3];
            t->n++;
            t->within += fabs(f - g) <= 2 * sigma;
            t->below += fabs(f - g) <= 0.6745 * sigma;
        }
        gonio_model_free(model);
        gonio_samples_free(samples);
    }
    gonio_model_free(truth);
}

static void assert_shares(const tally t[3], const char *what, const double least[3], double most, double below_most) {
    static const char *const regions[] = {"dense", "sparse", "empty"};
    for (int r = 0; r < 3; r++) {
        const double within = (double)t[r].within / (double)t[r].n, below = (double)t[r].below / (double)t[r].n;
        print_message("# %s, %s: %.3f within 2 sigma, %.3f below the median\n", what, regions[r], within, below);
        assert_true(within >= least[r] && within <= most);
        assert_true(below <= below_most);
    }
}

// With noise, what docs/uncertainty.md asks: 90 to 99 % within 2 sigma, pooled over seeds 40 to 51, 1,800 probes a
// region. Errors within one set are alike, so what varies is the share of a whole set: over seeds 40 to 55 its standard
// deviation was 0.05, 0.05 and 0.06 about 0.953, 0.955 and 0.968. The mean of twelve has 0.016, so another dozen of
// seeds would fall below 0.9 about once in a thousand, and above 0.99, in the empty region, about once in ten.
static void test_sigma_is_neither_too_small_nor_too_large(void **state) {
    (void)state;
    tally t[3] = {0};
    count_errors("auto", 150, 0.03, 40, 12, t);
    assert_shares(t, "noise 3 %", (const double[3]){0.9, 0.9, 0.9}, 0.99, 0.85);
}

// Without noise sigmas are too small beyond the samples. Where the truth's own lobe is chosen (8 of the seeds 40 to 55)
// the errors are those of rounding, all within; in the other 8 sets 0.55 to 0.95 of the empty region are, 0.68 in the
// mean: exact samples leave residuals among themselves that tell next to nothing about 18 degrees without any. So 0.47
// is no target, but what the mean of four such sets (of deviation 0.12) stays above; the samples' own region keeps
// 0.78.
static void test_sigma_without_noise(void **state) {
    (void)state;
    tally t[3] = {0};
    count_errors("auto", 150, 0, 41, 4, t);
    assert_shares(t, "no noise", (const double[3]){0.9, 0.78, 0.47}, 1, 0.9);
}

// The iterative solver's sigma, on a set that it makes up itself by left-out geometries. Over 8 other seeds the shares
// had means of 0.94, 0.83 and 0.69 and standard deviations of 0.03, 0.07 and 0.06: 4 of them below. In the empty region
// the spline goes on alone, without lobes, and sigma is a hint there rather than a bound (docs/fitting.md): 0.64 to
// 0.75 over seeds 60 to 62.
static void test_sigma_of_large_sets(void **state) {
    (void)state;
    tally t[3] = {0};
    count_errors("lsq", 2500, 0.03, 60, 1, t);
    assert_shares(t, "large", (const double[3]){0.82, 0.55, 0.44}, 1, 0.9);
}

// A sigma of k z is k times the sigma of z, and the same bits come at any number of threads.
static void test_sigma_scales_and_repeats(void **state) {
    (void)state;
    gonio_model *truth = simulate_truth(WARD), *models[3];
    for (int k = 0; k < 3; k++) {
        uint64_t stream = 5;
        gonio_samples *samples = sigma_samples(truth, 60, 0.03, &stream);
        for (size_t i = 0; i < samples->n; i++) {
            samples->values[i] *= k == 1 ? 0x1p20 : 1;
            samples->sigma_random[i] *= k == 1 ? 0x1p20 : 1;
        }
        gonio_fit_options o;
        gonio_fit_options_default(&o);
        o.method = "lsq";
        o.hold_out = 0;
        o.level = 3;
        o.threads = k == 2 ? 2 : 1;
        assert_int_equal(gonio_fit(samples, &o, &models[k], NULL, NULL), GONIO_OK);
        gonio_samples_free(samples);
    }
    uint64_t stream = 6;
    for (int k = 0; k < 100; k++) {
        const gonio_pair p = sigma_pair(&stream, k % 3, k % 2);
        double s[3];
        for (int m = 0; m < 3; m++) {
            assert_true(gonio_model_sigma(models[m], gonio_direction(p.theta_i, p.phi_i),
                                          gonio_direction(p.theta_o, p.phi_o), &s[m]));
        }
        assert_near(s[1], 0x1p20 * s[0], 1e-6 * s[1]);
        assert_memory_equal(&s[0], &s[2], sizeof s[0]);
    }
    for (int k = 0; k < 3; k++) {
        gonio_model_free(models[k]);
    }
    gonio_model_free(truth);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_left_out_blocks_are_what_they_say),
        cmocka_unit_test(test_added_places_pass_their_errors_on),
        cmocka_unit_test(test_the_law_is_found),
        cmocka_unit_test(test_sigma_is_neither_too_small_nor_too_large),
        cmocka_unit_test(test_sigma_without_noise),
        cmocka_unit_test(test_sigma_of_large_sets),
        cmocka_unit_test(test_sigma_scales_and_repeats),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
