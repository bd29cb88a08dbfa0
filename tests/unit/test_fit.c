// SPDX-License-Identifier: BSD-3-Clause
// The fit driver: choices, splits, tolerance, limits, streaming.
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

#ifdef __SANITIZE_ADDRESS__
#include <stdatomic.h>
// Of sanitizer/allocator_interface.h, which GCC's packages leave out.
int __sanitizer_install_malloc_and_free_hooks(void (*on_malloc)(const volatile void *, size_t),
                                              void (*on_free)(const volatile void *));
size_t __sanitizer_get_allocated_size(const volatile void *pointer);
#endif

#include "brdf/kind/lattice.h"
#include "gonio/fit.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"

static gonio_fit_options options(const char *method) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = method;
    return o;
}

static gonio_model *fit(const gonio_samples *samples, const gonio_fit_options *o, gonio_fit_report *report) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_fit(samples, o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return model;
}

static void assert_same_bits(const gonio_model *a, const gonio_model *b) {
    const gonio_lattice *x = gonio_lattice_model_lattice(a), *y = gonio_lattice_model_lattice(b);
    assert_non_null(x);
    assert_int_equal(x->count, y->count);
    assert_memory_equal(x->points, y->points, x->count * (size_t)x->channels * sizeof(float));
}

static void methods_are_listed(void **state) {
    (void)state;
    const char *const *names = gonio_fit_methods();
    assert_string_equal(names[0], "mba");
    gonio_samples *samples = simulate_samples(WARD, 10, 1, 1);
    gonio_model *model;
    gonio_error error = {0};
    const gonio_fit_options o = options("no-such");
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_USAGE);
    assert_non_null(strstr(error.message, "mba"));
    assert_null(model);
    gonio_samples_free(samples);
}

// The second of two sessions is a tenth off and says that it may be: as groups the first one counts, as one set they
// count alike.
static void sessions_weigh_by_all_of_their_uncertainty(void **state) {
    (void)state;
    double share[2];
    for (int groups = 0; groups < 2; groups++) {
        gonio_samples *exact = simulate_samples(WARD, 200, 1, 1), *both;
        assert_int_equal(gonio_samples_new(1, true, &both, NULL), GONIO_OK);
        for (size_t i = 0; i < exact->n; i++) {
            const double v = exact->values[i], random = 1e-3 * v, systematic = (i % 2 == 0 ? 1e-3 : 0.1) * v;
            const double value = i % 2 == 0 ? v : 1.1 * v;
            gonio_samples_add(both, &exact->pairs[i], &value, &random, &systematic, NULL);
            assert_int_equal(gonio_samples_set_group(both, i, groups == 1 && i % 2 == 1 ? 2 : 1, NULL), GONIO_OK);
        }
        gonio_fit_options o = options("lsq"); // which weighs, as auto does by it
        o.level = 3;
        gonio_model *model = fit(both, &o, NULL);
        double sum = 0, got;
        for (size_t i = 0; i < exact->n; i++) {
            gonio_model_eval_pair(model, &exact->pairs[i], &got);
            sum += got / exact->values[i] - 1;
        }
        share[groups] = sum / (double)exact->n / 0.1;
        gonio_model_free(model);
        gonio_samples_free(exact);
        gonio_samples_free(both);
    }
    print_message("%.3f of the second session's error as one set, %.3f as groups\n", share[0], share[1]);
    assert_true(share[0] > 0.4 && share[1] < 0.7 * share[0]); // a weight is never wholly trusted
}

static void impossible_options_are_wrong_usage(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 10, 1, 1);
    gonio_model *model;
    gonio_fit_options o[6];
    for (int i = 0; i < 6; i++) {
        o[i] = options("mba");
    }
    o[0].level = 10;
    o[1].hold_out = 1;
    o[2].folds = 1;
    o[3].tolerance = -1;
    o[4].thesis = true;
    o[4].domain = GONIO_LOG;
    o[5] = options("cbmba");
    o[5].diffuse_level = 6;
    for (int i = 0; i < 6; i++) {
        gonio_error error = {0};
        assert_int_equal(gonio_fit(samples, &o[i], &model, NULL, &error), GONIO_E_USAGE);
    }
    gonio_samples_free(samples);
}

// The saved model is fitted to all samples, whatever is held out for the figures.
static void held_out_figures_do_not_change_the_model(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 600, 1, 2);
    gonio_fit_options o = options("mba");
    gonio_fit_report none, fifth, folds;
    o.level = 4;
    o.hold_out = 0;
    gonio_model *a = fit(samples, &o, &none);
    o.hold_out = 0.2;
    gonio_model *b = fit(samples, &o, &fifth);
    o.folds = 5;
    gonio_model *c = fit(samples, &o, &folds);
    assert_same_bits(a, b);
    assert_same_bits(a, c);
    assert_int_equal(none.held_out.samples, 0);
    assert_true(isnan(none.held_out.rmse));
    assert_int_equal(fifth.held_out.samples, 120);
    assert_int_equal(folds.held_out.samples, 600);
    assert_int_equal(folds.train.samples, 600);
    // Samples that the fit did not see are predicted worse.
    assert_true(fifth.held_out.rms_log > fifth.train.rms_log);
    assert_true(folds.held_out.rms_log > folds.train.rms_log);
    gonio_model_free(a);
    gonio_model_free(b);
    gonio_model_free(c);
    gonio_samples_free(samples);
}

static void tolerance_takes_the_smallest_level(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 1000, 1, 3);
    gonio_fit_options o = options("mba");
    double rmse[6];
    for (int level = 0; level < 6; level++) {
        gonio_fit_report report;
        o.level = level;
        gonio_model_free(fit(samples, &o, &report));
        rmse[level] = report.held_out.rmse;
    }
    o.level = GONIO_LEVEL_AUTO;
    o.tolerance = rmse[3];
    gonio_fit_report report;
    gonio_model_free(fit(samples, &o, &report));
    assert_true(report.held_out.rmse <= o.tolerance);
    for (int level = 0; level < report.level; level++) {
        assert_true(rmse[level] > o.tolerance);
    }
    o.tolerance = 1e-12;
    gonio_model *model;
    gonio_error error = {0};
    o.hold_out = 0.2;
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_CONVERGENCE);
    gonio_samples_free(samples);
}

static void max_bytes_is_kept(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 2000, 1, 4);
    gonio_fit_options o = options("mba");
    gonio_fit_report report;
    o.hold_out = 0;
    o.max_bytes = 8000;
    gonio_model_free(fit(samples, &o, &report));
    assert_true(report.bytes <= 8000);
    assert_int_equal(report.level, 3);
    o.level = 5;
    gonio_model *model;
    gonio_error error = {0};
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_RANGE);
    gonio_samples_free(samples);
}

// shared figures: the default fit of 1400 clean samples, judged where it saw none.
static void default_choice_is_accurate(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 1400, 1, 5), *unseen = simulate_samples(WARD, 4000, 1, 6);
    gonio_fit_options o = options("mba");
    o.coordinates = GONIO_NUSSELT;
    o.domain = GONIO_LOG;
    gonio_fit_report report;
    gonio_model *model = fit(samples, &o, &report);
    gonio_errors errors;
    assert_int_equal(gonio_errors_model(model, unseen, NULL, 0, &errors, NULL), GONIO_OK);
    assert_true(report.level >= 4 && report.level <= 7);
    assert_true(errors.median_rel < 0.03);
    // The report's held-out figures tell what unseen samples show.
    assert_true(report.held_out.rms_log < 2 * errors.rms_log && errors.rms_log < 2 * report.held_out.rms_log);
    gonio_model_free(model);
    gonio_samples_free(samples);
    gonio_samples_free(unseen);
}

static void streamed_fit_equals_the_batch(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 900, 2, 7), *part;
    gonio_fit_options o = options("mba");
    gonio_fit_report a, b;
    gonio_model *batch = fit(samples, &o, &a), *streamed;
    gonio_fit_stream *stream;
    gonio_error error = {0};
    assert_int_equal(gonio_fit_stream_new(2, (const char(*)[32])samples->channel_names, &o, &stream, &error), GONIO_OK);
    assert_true(isnan(gonio_fit_stream_error(stream)));
    bool keep[900];
    for (size_t begin = 0; begin < samples->n; begin += 50) {
        for (size_t i = 0; i < samples->n; i++) {
            keep[i] = i >= begin && i < begin + 50;
        }
        assert_int_equal(gonio_samples_select(samples, keep, &part, NULL), GONIO_OK);
        assert_int_equal(gonio_fit_stream_add(stream, part, &error), GONIO_OK);
        gonio_samples_free(part);
    }
    assert_true(gonio_fit_stream_error(stream) > 0);
    assert_int_equal(gonio_fit_stream_finish(stream, &streamed, &b, &error), GONIO_OK);
    assert_same_bits(batch, streamed);
    assert_memory_equal(&a.held_out, &b.held_out, sizeof a.held_out);
    assert_int_equal(a.level, b.level);
    gonio_fit_stream_free(stream);
    gonio_model_free(batch);
    gonio_model_free(streamed);
    gonio_samples_free(samples);
}

static void anisotropic_samples_are_fitted_in_4d(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 4000, 1, 8), *unseen = simulate_samples(WARD, 500, 1, 9);
    uint64_t seed = 1;
    gonio_samples *both[2] = {samples, unseen};
    for (int k = 0; k < 2; k++) {
        both[k]->isotropic = false;
        for (size_t i = 0; i < both[k]->n; i++) {
            const double turn = 2 * GONIO_PI * simulate_uniform(&seed);
            both[k]->pairs[i].phi_i += turn;
            both[k]->pairs[i].phi_o += turn;
            both[k]->values[i] *= 1 + 0.5 * cos(2 * both[k]->pairs[i].phi_i) * sin(both[k]->pairs[i].theta_i);
        }
    }
    for (int system = 0; system < GONIO_COORDINATES; system++) {
        gonio_fit_options o = options("mba");
        o.level = 3;
        o.coordinates = (gonio_coordinates)system;
        o.domain = GONIO_LOG;
        gonio_model *model = fit(samples, &o, NULL);
        gonio_errors errors;
        assert_false(model->isotropic);
        assert_int_equal(model->control_points, 11 * 11 * 11 * 11);
        assert_int_equal(gonio_errors_model(model, unseen, NULL, 0, &errors, NULL), GONIO_OK);
        assert_true(errors.median_rel < 0.2);
        gonio_model_free(model);
    }
    gonio_samples_free(samples);
    gonio_samples_free(unseen);
}

// A limit below what a fit takes is refused with both figures and what would fit, by the fit and the stream alike.
static void memory_is_limited(void **state) {
    (void)state;
    gonio_error error = {0};
    gonio_fit_size size = {.samples = 1000, .channels = 31, .dims = 3};
    for (double before = 0; size.level <= GONIO_LEVEL_MAX; size.level++) {
        assert_true(gonio_fit_memory(&size) >= before);
        before = gonio_fit_memory(&size);
    }
    size.level = 9;
    assert_int_equal(gonio_fit_check_memory(&size, 1e9, &error), GONIO_E_MEMORY);
    assert_non_null(strstr(error.message, "1 GB, enough for level 7"));
    size = (gonio_fit_size){.samples = 50000000, .channels = 1, .dims = 3, .level = 6};
    assert_int_equal(gonio_fit_check_memory(&size, 1e9, &error), GONIO_E_MEMORY);
    assert_non_null(strstr(error.message, "samples at level 0"));

    gonio_samples *samples = simulate_samples(WARD, 40000, 1, 5);
    gonio_fit_options o;
    gonio_model *model;
    gonio_fit_options_default(&o);
    o.method = "mba";
    o.level = 7;
    o.max_memory = 20000000;
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_MEMORY);
    assert_non_null(strstr(error.message, "0.02 GB"));
    o.level = GONIO_LEVEL_AUTO; // takes what fits
    o.max_memory = 31000000;
    gonio_fit_report report;
    assert_int_equal(gonio_fit(samples, &o, &model, &report, &error), GONIO_OK);
    assert_true(report.level < 7);
    gonio_model_free(model);
    gonio_fit_stream *stream;
    o.level = 6;
    o.max_memory = 23000000;
    assert_int_equal(gonio_fit_stream_new(1, (const char(*)[32])samples->channel_names, &o, &stream, &error), GONIO_OK);
    assert_int_equal(gonio_fit_stream_add(stream, samples, &error), GONIO_E_MEMORY);
    gonio_fit_stream_free(stream);
    gonio_samples_free(samples);
}

#ifdef __SANITIZE_ADDRESS__
static atomic_llong heap, heap_peak;

static void on_malloc(const volatile void *pointer, size_t size) {
    (void)pointer;
    const long long now = atomic_fetch_add(&heap, (long long)size) + (long long)size;
    long long peak = atomic_load(&heap_peak);
    while (now > peak && !atomic_compare_exchange_weak(&heap_peak, &peak, now)) {
    }
}

static void on_free(const volatile void *pointer) {
    if (pointer != NULL) {
        atomic_fetch_sub(&heap, (long long)__sanitizer_get_allocated_size(pointer));
    }
}
#endif

// The prediction is a bound, and a close one: against the heap's peak, which the sanitizer's allocator tells. (The
// whole process' peak: tests/bench/fifty_million.c.)
static void memory_is_predicted(void **state) {
    (void)state;
#ifdef __SANITIZE_ADDRESS__
    __sanitizer_install_malloc_and_free_hooks(on_malloc, on_free);
    static const struct {
        size_t n;
        int channels, level;
        const char *method;
        double hold_out;
    } cases[] = {{200000, 1, 6, "mba", 0},  {50000, 1, 6, "mba", 0.2}, {20000, 5, 5, "mba", 0},
                 {20000, 5, 5, "mba", 0.2}, {2000, 1, 7, "mba", 0},    {50000, 1, 6, "cbmba", 0.2}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const long long before = atomic_load(&heap);
        gonio_samples *made = simulate_samples(WARD, cases[k].n, cases[k].channels, 5), *samples;
        bool *all = malloc(made->n * sizeof *all);
        memset(all, 1, made->n * sizeof *all);
        assert_int_equal(gonio_samples_select(made, all, &samples, NULL), GONIO_OK); // without spare capacity
        free(all);
        gonio_samples_free(made);
        gonio_fit_options o;
        gonio_model *model;
        gonio_fit_options_default(&o);
        o.method = cases[k].method;
        o.level = cases[k].level;
        o.hold_out = cases[k].hold_out;
        o.coordinates = GONIO_NUSSELT;
        o.domain = GONIO_LINEAR;
        o.threads = 2;
        const gonio_fit_size size = {.samples = samples->n,
                                     .channels = samples->channels,
                                     .dims = 3,
                                     .level = o.level,
                                     .method = o.method,
                                     .hold_out = o.hold_out,
                                     .threads = 2};
        atomic_store(&heap_peak, 0);
        assert_int_equal(gonio_fit(samples, &o, &model, NULL, NULL), GONIO_OK);
        const double measured = (double)(atomic_load(&heap_peak) - before);
        const double predicted = gonio_fit_memory(&size) - 20e6;
        print_message("# %zu samples x %d, level %d, %s, hold-out %g: %.3g MB of %.3g\n", samples->n, samples->channels,
                      o.level, o.method, o.hold_out, measured / 1e6, predicted / 1e6);
        assert_true(measured <= predicted && predicted <= 1.3 * measured);
        gonio_model_free(model);
        gonio_samples_free(samples);
    }
#else
    skip();
#endif
}

// 40,000 samples are above the size from which threads help: the preparation, the order and the levels agree bit for
// bit for any number of threads, in each domain.
static void large_streams_equal_the_batch(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 40000, 1, 5);
    for (int domain = 0; domain < 2; domain++) {
        gonio_fit_options o;
        gonio_error error = {0};
        gonio_fit_options_default(&o);
        o.method = "mba";
        o.level = 4;
        o.coordinates = GONIO_NUSSELT;
        o.domain = (gonio_domain)domain;
        o.hold_out = 0;
        gonio_model *first = NULL;
        for (int threads = 1; threads <= 7; threads += 3) {
            gonio_fit_stream *stream;
            gonio_model *batch, *streamed;
            o.threads = threads;
            assert_int_equal(gonio_fit(samples, &o, &batch, NULL, &error), GONIO_OK);
            assert_int_equal(gonio_fit_stream_new(1, (const char(*)[32])samples->channel_names, &o, &stream, &error),
                             GONIO_OK);
            assert_int_equal(gonio_fit_stream_add(stream, samples, &error), GONIO_OK);
            assert_int_equal(gonio_fit_stream_finish(stream, &streamed, NULL, &error), GONIO_OK);
            assert_same_bits(batch, streamed);
            if (first != NULL) {
                assert_same_bits(first, batch);
                gonio_model_free(batch);
            } else {
                first = batch;
            }
            gonio_model_free(streamed);
            gonio_fit_stream_free(stream);
        }
        gonio_model_free(first);
    }
    gonio_samples_free(samples);
}

// Samples without uncertainties first, then some with: the batch holds zeros where there were none.
static void uncertainties_may_begin_late(void **state) {
    (void)state;
    gonio_error error = {0};
    gonio_samples *plain = simulate_samples("ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 300, 1, 5), *with, *all;
    assert_int_equal(gonio_samples_new(1, true, &with, &error), GONIO_OK);
    assert_int_equal(gonio_samples_new(1, true, &all, &error), GONIO_OK);
    memcpy(all->channel_names, plain->channel_names, sizeof *plain->channel_names);
    all->isotropic = with->isotropic = plain->isotropic;
    for (size_t i = 0; i < 300; i++) {
        const double sigma = 0.01 + 0.001 * (double)(i % 7);
        gonio_samples_add(all, &plain->pairs[i], &plain->values[i], NULL, NULL, &error);
        gonio_samples_add(with, &plain->pairs[i], &plain->values[i], &sigma, &sigma, &error);
    }
    for (size_t i = 0; i < 300; i++) {
        gonio_samples_add(all, &with->pairs[i], &with->values[i], &with->sigma_random[i], &with->sigma_systematic[i],
                          &error);
    }
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = "mba";
    o.level = 3;
    o.coordinates = GONIO_NUSSELT;
    o.domain = GONIO_LINEAR;
    o.hold_out = 0;
    gonio_model *batch, *streamed;
    gonio_fit_stream *stream;
    assert_int_equal(gonio_fit(all, &o, &batch, NULL, &error), GONIO_OK);
    assert_int_equal(gonio_fit_stream_new(1, (const char(*)[32])all->channel_names, &o, &stream, &error), GONIO_OK);
    assert_int_equal(gonio_fit_stream_add(stream, plain, &error), GONIO_OK);
    assert_int_equal(gonio_fit_stream_add(stream, with, &error), GONIO_OK);
    assert_int_equal(gonio_fit_stream_finish(stream, &streamed, NULL, &error), GONIO_OK);
    assert_same_bits(batch, streamed);
    gonio_model_free(batch);
    gonio_model_free(streamed);
    gonio_fit_stream_free(stream);
    gonio_samples_free(plain);
    gonio_samples_free(with);
    gonio_samples_free(all);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(methods_are_listed),
        cmocka_unit_test(impossible_options_are_wrong_usage),
        cmocka_unit_test(sessions_weigh_by_all_of_their_uncertainty),
        cmocka_unit_test(held_out_figures_do_not_change_the_model),
        cmocka_unit_test(tolerance_takes_the_smallest_level),
        cmocka_unit_test(max_bytes_is_kept),
        cmocka_unit_test(default_choice_is_accurate),
        cmocka_unit_test(streamed_fit_equals_the_batch),
        cmocka_unit_test(memory_is_limited),
        cmocka_unit_test(memory_is_predicted),
        cmocka_unit_test(large_streams_equal_the_batch),
        cmocka_unit_test(uncertainties_may_begin_late),
        cmocka_unit_test(anisotropic_samples_are_fitted_in_4d),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
