// SPDX-License-Identifier: BSD-3-Clause
// Every method of the list, in every coordinates and domain: what was asked for is what the model says; and what all
// methods promise of scaling, order, threads and the smallest sets.
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

#include "brdf/analytic/formula.h"
#include "fit/options.h"
#include "fit/tradeoff.h"
#include "tests/simulate.h"
#include "tests/unit/key_values.h"

#define ISOTROPIC "ward:rho_d=0.3,rho_s=0.2,alpha=0.3"
#define ANISOTROPIC "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.4"
#define SAMPLES 16      // a second lobe needs 14
#define MORE_SAMPLES 40 // lobes below a spline need 30
#define LEVEL 2

static char path[64];

static const gonio_key *key_of(size_t offset) {
    const gonio_key *key = gonio_fit_keys;
    while (key->offset != offset || key->name == NULL) {
        key++;
    }
    return key;
}

#define HAS(method, member) gonio_method_has(method, key_of(offsetof(gonio_fit_options, member)))

// The quickest fit of a method.
static gonio_fit_options quick(const gonio_method *method) {
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.method = method->name;
    o.hold_out = 0;
    o.threads = 1;
    if (HAS(method, diffuse_level)) {
        o.diffuse_level = LEVEL - 1;
    }
    if (HAS(method, level)) {
        o.level = LEVEL;
    }
    if (HAS(method, table_step)) {
        o.table_step = 30;
    }
    o.fill = HAS(method, fill) ? "kernel" : NULL; // of one that costs nothing
    return o;
}

static gonio_model *fitted(const gonio_samples *samples, const gonio_fit_options *o, gonio_fit_report *report) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_fit(samples, o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s, %s, %s: %s", o->method, gonio_coordinates_name(o->coordinates), gonio_domain_name(o->domain),
                 error.message);
    }
    return model;
}

// ---- what was asked for ----

// Of a saved lattice, cbmba or lobe-spline model, those of methods with coordinates (docs/formats.md): the section
// begins at the byte that stands at 48 of the head, and there, from byte 8 on, the numbers of the coordinates and of
// the transform.
static void read_saved(char kind[16], uint32_t *coordinates, uint32_t *transform) {
    unsigned char head[64];
    uint64_t section;
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fread(head, sizeof head, 1, file), 1);
    memcpy(kind, head + 16, 16);
    memcpy(&section, head + 48, sizeof section);
    assert_int_equal(fseek(file, (long)section + 8, SEEK_SET), 0);
    assert_int_equal(fread(coordinates, sizeof *coordinates, 1, file), 1);
    assert_int_equal(fread(transform, sizeof *transform, 1, file), 1);
    fclose(file);
}

static void check_said(const gonio_method *method, const gonio_fit_options *o, const gonio_model *model,
                       const gonio_fit_report *report) {
    uint32_t coordinates, transform;
    char kind[16];
    assert_string_equal(report->method, method->name);
    assert_string_equal(model->ops->kind, method->kind);
    if (o->coordinates != GONIO_COORDINATES_AUTO) {
        assert_int_equal(report->coordinates, o->coordinates);
    }
    if (o->domain != GONIO_DOMAIN_AUTO) {
        assert_int_equal(report->domain, o->domain);
    }
    assert_in_range(report->coordinates, 0, GONIO_COORDINATES - 1);
    assert_in_range(report->domain, 0, GONIO_DOMAINS - 1);
    if (o->level != GONIO_LEVEL_AUTO) {
        assert_int_equal(report->level, o->level);
    }
    if (!HAS(method, coordinates)) {
        return;
    }
    assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
    read_saved(kind, &coordinates, &transform);
    assert_string_equal(kind, method->kind);
    assert_int_equal(coordinates, report->coordinates);
    assert_int_equal(transform == 0, report->domain == GONIO_LINEAR);
}

// A method that lacks an option says so, and names those that it has.
static void check_refused(const gonio_samples *samples, const gonio_method *method, const gonio_fit_options *o) {
    gonio_model *model;
    gonio_error error = {0};
    assert_int_equal(gonio_fit(samples, o, &model, NULL, &error), GONIO_E_USAGE);
    assert_null(model);
    assert_non_null(strstr(error.message, method->name));
    assert_non_null(strstr(error.message, "it has --method"));
}

typedef struct counts {
    int fits, refusals;
} counts;

static void check_case(const gonio_samples *samples, const gonio_method *method, gonio_coordinates coordinates,
                       gonio_domain domain, counts *n) {
    gonio_fit_options o = quick(method);
    gonio_fit_report report;
    gonio_error error = {0};
    gonio_model *model;
    o.coordinates = coordinates;
    o.domain = domain;
    if ((coordinates != GONIO_COORDINATES_AUTO && !HAS(method, coordinates)) ||
        (domain != GONIO_DOMAIN_AUTO && !HAS(method, domain))) {
        check_refused(samples, method, &o);
        n->refusals++;
        return;
    }
    const gonio_status status = gonio_fit(samples, &o, &model, &report, &error);
    if (status == GONIO_E_UNSUPPORTED && !samples->isotropic) {
        n->refusals++; // cbmba has three dimensions
        return;
    }
    if (status != GONIO_OK) {
        fail_msg("%s, %s, %s: %s", method->name, gonio_coordinates_name(coordinates), gonio_domain_name(domain),
                 error.message);
    }
    assert_int_equal(model->isotropic, samples->isotropic);
    check_said(method, &o, model, &report);
    gonio_model_free(model);
    n->fits++;
}

static void test_what_was_asked_for(void **state) {
    (void)state;
    gonio_samples *isotropic = simulate_samples(ISOTROPIC, SAMPLES, 1, 1);
    gonio_samples *anisotropic = simulate_samples(ANISOTROPIC, SAMPLES, 1, 2);
    counts n = {0, 0};
    int methods = 0;
    for (; gonio_method_at(methods) != NULL; methods++) {
        for (int c = GONIO_COORDINATES_AUTO; c < GONIO_COORDINATES; c++) {
            // In three dimensions; a domain left open in coordinates that are not is for the four.
            // All coordinates left open: every domain; else one domain after the other.
            for (int d = c == GONIO_COORDINATES_AUTO ? GONIO_DOMAIN_AUTO : c % GONIO_DOMAINS; d < GONIO_DOMAINS;
                 d += c == GONIO_COORDINATES_AUTO ? 1 : GONIO_DOMAINS) {
                check_case(isotropic, gonio_method_at(methods), (gonio_coordinates)c, (gonio_domain)d, &n);
            }
            check_case(anisotropic, gonio_method_at(methods), (gonio_coordinates)c, GONIO_DOMAIN_AUTO, &n);
        }
    }
    print_message("# %d methods x %d coordinates x %d domains, auto among both, and 4-D: %d fits say what was asked "
                  "for, %d are refused\n",
                  methods, 1 + GONIO_COORDINATES, 1 + GONIO_DOMAINS, n.fits, n.refusals);
    assert_int_equal(n.fits + n.refusals, methods * (1 + GONIO_DOMAINS + GONIO_COORDINATES + 1 + GONIO_COORDINATES));
    gonio_samples_free(isotropic);
    gonio_samples_free(anisotropic);
}

// The rows of the trade-off are the methods': none twice, and each fits what it is named for.
static void test_forms_of_the_trade_off(void **state) {
    (void)state;
    const size_t n = gonio_tradeoff_forms(NULL, 0);
    gonio_tradeoff_form *forms = calloc(n, sizeof *forms);
    gonio_samples *samples = simulate_samples(ISOTROPIC, MORE_SAMPLES, 1, 3);
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    o.table_step = 30;
    o.fill_store = gonio_fill_store_new(); // the tables' forms are filled once
    assert_non_null(forms);
    assert_int_equal(gonio_tradeoff_forms(forms, n), n);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < i; j++) {
            assert_false(gonio_tradeoff_rivals(&forms[i], &forms[j]) && forms[i].level == forms[j].level &&
                         forms[i].domain == forms[j].domain);
        }
        if (forms[i].level > LEVEL) {
            continue; // as the coarse ones, in more time
        }
        gonio_tradeoff_row row;
        gonio_error error = {0};
        assert_int_equal(gonio_tradeoff_measure(samples, &o, &forms[i], &row, NULL, &error), GONIO_OK);
        if (row.status != GONIO_OK) {
            fail_msg("%s: %s", forms[i].method, row.error.message);
        }
        assert_true(forms[i].level == GONIO_LEVEL_AUTO || forms[i].level == row.report.level);
        assert_true(forms[i].coordinates == GONIO_COORDINATES_AUTO || forms[i].coordinates == row.report.coordinates);
        assert_true(forms[i].domain == GONIO_DOMAIN_AUTO || forms[i].domain == row.report.domain);
    }
    gonio_fill_store_free(o.fill_store);
    free(forms);
    gonio_samples_free(samples);
}

// ---- options ----

static void test_every_option_is_had_or_refused(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(ISOTROPIC, SAMPLES, 1, 4);
    int had = 0, refused = 0;
    for (int i = 0; gonio_method_at(i) != NULL; i++) {
        const gonio_method *method = gonio_method_at(i);
        for (const gonio_method_option *option = method->options; option->offset != 0; option++) {
            assert_true(key_of(option->offset) - gonio_fit_keys >= GONIO_FIT_KEYS_COMMON);
        }
        for (const gonio_key *key = gonio_fit_keys + 1; key->name != NULL; key++) {
            gonio_fit_options o;
            gonio_error error = {0};
            gonio_fit_options_default(&o);
            o.method = method->name;
            set_other(key, &o);
            if (gonio_method_has(method, key)) {
                assert_int_equal(gonio_fit_options_check(&o, method, &error), GONIO_OK);
                had++;
            } else {
                char name[40];
                check_refused(samples, method, &o);
                assert_int_equal(gonio_fit_options_check(&o, method, &error), GONIO_E_USAGE);
                gonio_key_option(key, name, sizeof name);
                assert_non_null(strstr(error.message, name));
                gonio_fit_options_for(&o, method->name);
                assert_int_equal(gonio_fit_options_check(&o, method, &error), GONIO_OK);
                refused++;
            }
        }
    }
    print_message("# %d options are had, %d refused\n", had, refused);
    gonio_samples_free(samples);
}

// ---- what all promise ----

#define DIRECTIONS 60

static void evaluate(const gonio_model *model, double values[DIRECTIONS]) {
    uint64_t seed = 99;
    for (int i = 0; i < DIRECTIONS; i++) {
        const gonio_pair pair = simulate_pair(&seed, 0);
        double v[GONIO_CHANNELS_MAX];
        gonio_model_eval_pair(model, &pair, v);
        values[i] = v[model->channels - 1];
    }
}

static void fit_values(const gonio_samples *samples, const gonio_fit_options *o, double values[DIRECTIONS]) {
    gonio_model *model = fitted(samples, o, NULL);
    evaluate(model, values);
    gonio_model_free(model);
}

static void scale(gonio_samples *samples, int exponent) {
    for (size_t i = 0; i < samples->n * (size_t)samples->channels; i++) {
        samples->values[i] = ldexp(samples->values[i], exponent);
    }
}

static void test_scaling_by_powers_of_two_is_exact(void **state) {
    (void)state;
    static const int exponents[] = {-40, 100};
    gonio_samples *samples = simulate_samples(ISOTROPIC, SAMPLES, 2, 5);
    for (int i = 0; gonio_method_at(i) != NULL; i++) {
        const gonio_fit_options o = quick(gonio_method_at(i));
        const gonio_formula *formula = gonio_formula_find(o.method);
        if (formula != NULL && formula->absolute) {
            continue; // the gloss of a dielectric is no matter of units
        }
        double plain[DIRECTIONS], scaled[DIRECTIONS];
        fit_values(samples, &o, plain);
        for (size_t k = 0; k < sizeof exponents / sizeof *exponents; k++) {
            scale(samples, exponents[k]);
            fit_values(samples, &o, scaled);
            scale(samples, -exponents[k]);
            for (int d = 0; d < DIRECTIONS; d++) {
                if (scaled[d] != ldexp(plain[d], exponents[k])) {
                    fail_msg("%s times 2^%d: %.17g, not %.17g", o.method, exponents[k], ldexp(scaled[d], -exponents[k]),
                             plain[d]);
                }
            }
        }
    }
    gonio_samples_free(samples);
}

static gonio_samples *reversed(const gonio_samples *samples) {
    gonio_samples *out;
    assert_int_equal(gonio_samples_new(samples->channels, false, &out, NULL), GONIO_OK);
    out->isotropic = samples->isotropic;
    memcpy(out->channel_names, samples->channel_names, (size_t)samples->channels * sizeof *samples->channel_names);
    for (size_t i = samples->n; i-- > 0;) {
        assert_int_equal(gonio_samples_add(out, &samples->pairs[i], samples->values + i * (size_t)samples->channels,
                                           NULL, NULL, NULL),
                         GONIO_OK);
    }
    return out;
}

// "Results do not depend on the machine" in docs/fitting.md: within 1e-6 of the largest value.
static void test_order_of_the_samples_does_not_matter(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(ISOTROPIC, SAMPLES, 1, 6), *back = reversed(samples);
    double largest = 0;
    for (size_t k = 0; k < samples->n; k++) {
        largest = fmax(largest, samples->values[k]);
    }
    for (int i = 0; gonio_method_at(i) != NULL; i++) {
        const gonio_fit_options o = quick(gonio_method_at(i));
        double plain[DIRECTIONS], other[DIRECTIONS];
        fit_values(samples, &o, plain);
        fit_values(back, &o, other);
        for (int d = 0; d < DIRECTIONS; d++) {
            if (!(fabs(plain[d] - other[d]) <= 1e-6 * fmax(largest, fabs(plain[d])))) {
                fail_msg("%s: %.17g, in reversed order %.17g", o.method, plain[d], other[d]);
            }
        }
    }
    gonio_samples_free(samples);
    gonio_samples_free(back);
}

static void test_threads_give_the_same_bits(void **state) {
    (void)state;
    gonio_samples *sets[] = {simulate_samples(ISOTROPIC, SAMPLES, 3, 7), simulate_samples(ANISOTROPIC, SAMPLES, 1, 8)};
    for (int i = 0; gonio_method_at(i) != NULL; i++) {
        for (int set = 0; set < 2; set++) {
            gonio_fit_options o = quick(gonio_method_at(i));
            double first[DIRECTIONS], other[DIRECTIONS];
            gonio_model *model;
            if (gonio_fit(sets[set], &o, &model, NULL, NULL) == GONIO_E_UNSUPPORTED) {
                continue;
            }
            evaluate(model, first);
            gonio_model_free(model);
            for (o.threads = 2 + set; o.threads <= 3; o.threads++) {
                fit_values(sets[set], &o, other);
                assert_memory_equal(first, other, sizeof first);
            }
        }
    }
    gonio_samples_free(sets[0]);
    gonio_samples_free(sets[1]);
}

static void check_constant(const gonio_method *method, const gonio_model *model, const gonio_samples *one) {
    double value, values[DIRECTIONS];
    gonio_model_eval_pair(model, one->pairs, &value);
    if (!(fabs(value - one->values[0]) <= 1e-3 * one->values[0])) {
        fail_msg("%s: one sample of %g is fitted by %g", method->name, one->values[0], value);
    }
    evaluate(model, values);
    for (int d = 0; d < DIRECTIONS; d++) {
        assert_true(isfinite(values[d]));
    }
}

// One sample: its value there, or an error that says what is missing; never nonsense.
static void test_one_sample_and_none(void **state) {
    (void)state;
    gonio_samples *one = simulate_samples(ISOTROPIC, 1, 1, 9), *none;
    assert_int_equal(gonio_samples_new(1, false, &none, NULL), GONIO_OK);
    for (int i = 0; gonio_method_at(i) != NULL; i++) {
        const gonio_method *method = gonio_method_at(i);
        gonio_fit_options o = quick(method);
        gonio_model *model;
        gonio_error error = {0};
        if (gonio_fit(one, &o, &model, NULL, &error) == GONIO_OK) {
            check_constant(method, model, one);
            gonio_model_free(model);
        } else {
            assert_int_equal(error.status, GONIO_E_INPUT);
            assert_non_null(strstr(error.message, "need at least"));
        }
        assert_int_equal(gonio_fit(none, &o, &model, NULL, &error), GONIO_E_INPUT);
        assert_null(model);
        assert_non_null(strstr(error.message, "no samples"));
    }
    gonio_samples_free(one);
    gonio_samples_free(none);
}

int main(void) {
    snprintf(path, sizeof path, "/tmp/gonio_methods_%d.gonio", (int)getpid());
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_what_was_asked_for),
        cmocka_unit_test(test_forms_of_the_trade_off),
        cmocka_unit_test(test_every_option_is_had_or_refused),
        cmocka_unit_test(test_scaling_by_powers_of_two_is_exact),
        cmocka_unit_test(test_order_of_the_samples_does_not_matter),
        cmocka_unit_test(test_threads_give_the_same_bits),
        cmocka_unit_test(test_one_sample_and_none),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(path);
    return failed;
}
