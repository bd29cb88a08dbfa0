// SPDX-License-Identifier: BSD-3-Clause
// Large least-squares fits: the penalty's planes, the multilevel preconditioner, and grazing factors.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/kind/lobe_spline.h"
#include "fit/smooth/cg.h"
#include "fit/smooth/loo.h"
#include "fit/smooth/penalty.h"
#include "fit/smooth/precondition.h"
#include "gonio/fit.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

static double *random_vector(size_t n, uint64_t seed) {
    double *v = malloc(n * sizeof *v);
    assert_non_null(v);
    for (size_t i = 0; i < n; i++) {
        v[i] = simulate_uniform(&seed) - 0.5;
    }
    return v;
}

static double dot(const double *a, const double *b, size_t n) {
    double sum = 0;
    for (size_t i = 0; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

static gonio_smooth_form stiff_form(gonio_coordinates coordinates, int level, int dims) {
    gonio_smooth_form form = gonio_smooth_form_default(coordinates, level, true);
    for (int d = 0; d < dims; d++) {
        form.stretch[d] = d == dims - 1 ? 1000 : 0.5 + d;
    }
    return form;
}

// phi^T R phi as fit/smooth/form.h writes it: differences along each axis, one by one.
static double roughness(const double *phi, int dims, size_t m, int level, const gonio_smooth_form *form) {
    const size_t n = (size_t)pow((double)m, dims);
    double sum = 0;
    for (size_t i = 0; i < n; i++) {
        size_t step = n;
        for (int d = 0; d < dims; d++) {
            step /= m;
            if (i / step % m + 2 < m) {
                const double bend = phi[i] - 2 * phi[i + step] + phi[i + 2 * step];
                sum += ldexp(form->stretch[d], level) * bend * bend;
            }
        }
        sum += GONIO_SMOOTH_RIDGE * phi[i] * phi[i];
    }
    return sum;
}

static void test_penalty_is_its_formula(void **state) {
    (void)state;
    for (int dims = 3; dims <= 4; dims++) {
        const int level = 2;
        const gonio_smooth_planes planes = gonio_smooth_planes_of(dims, level);
        const size_t n = planes.size * planes.points;
        const gonio_smooth_form form = stiff_form(GONIO_HALF_VECTOR, level, dims);
        double *phi = random_vector(n, 7), *out = calloc(n, sizeof *out);
        for (size_t plane = 0; plane < planes.size; plane++) {
            gonio_smooth_penalise(&planes, &form, 0.3, phi, out, plane);
        }
        const double expected = 0.3 * roughness(phi, dims, planes.size, level, &form);
        assert_near(dot(phi, out, n), expected, 1e-10 * expected);
        free(phi);
        free(out);
    }
}

static void test_folding_is_a_projection(void **state) {
    (void)state;
    const gonio_smooth_planes planes = gonio_smooth_planes_of(4, 1);
    const size_t m = planes.size, n = m * planes.points;
    double *a = random_vector(n, 3), *b = malloc(n * sizeof *b);
    memcpy(b, a, n * sizeof *b);
    for (size_t plane = 0; plane < m; plane++) {
        gonio_smooth_fold(&planes, 1u << 1 | 1u << 3, b, plane);
    }
    for (size_t i = 0; i < n; i++) {
        const size_t w = i % m, z = i / m % m, y = i / m / m % m, x = i / m / m / m;
        const size_t image = ((x * m + m - 1 - y) * m + z) * m + m - 1 - w;
        assert_near(b[i], 0.5 * (a[i] + a[image]), 1e-15);
    }
    free(a);
    free(b);
}

typedef struct preconditioned {
    int dims, level;
    gonio_coordinates coordinates;
} preconditioned;

// Symmetric and positive, or conjugate gradients would not be what they claim; the same bits from one thread and three.
static void test_preconditioner_is_symmetric_and_positive(void **state) {
    (void)state;
    static const preconditioned cases[] = {
        {3, 4, GONIO_HALF_VECTOR}, {3, 4, GONIO_NUSSELT}, {3, 0, GONIO_NUSSELT}, {4, 2, GONIO_REFLECTED}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const gonio_smooth_form form = stiff_form(cases[k].coordinates, cases[k].level, cases[k].dims);
        const size_t n = gonio_lattice_count(cases[k].dims, cases[k].level);
        double *lumped = random_vector(n, 1), *diagonal = malloc(n * sizeof *diagonal);
        for (size_t i = 0; i < n; i++) {
            lumped[i] = fmax(lumped[i], 0); // half of the lattice has no samples
            diagonal[i] = 0.1 * lumped[i];
        }
        gonio_smooth_precondition *p;
        assert_int_equal(
            gonio_smooth_precondition_new(cases[k].dims, &form, cases[k].level, 1e-4, lumped, diagonal, NULL, &p, NULL),
            GONIO_OK);
        double *a = random_vector(n, 5), *b = random_vector(n, 6), *pa = malloc(n * sizeof *pa),
               *pb = malloc(n * sizeof *pb), *again = malloc(n * sizeof *again);
        gonio_smooth_precondition_apply(p, NULL, a, pa);
        gonio_smooth_precondition_apply(p, NULL, b, pb);
        const double aa = dot(a, pa, n), bb = dot(b, pb, n);
        assert_true(aa > 0 && bb > 0);
        assert_near(dot(a, pb, n), dot(b, pa, n), 1e-4 * sqrt(aa * bb));
        gonio_pool *pool = gonio_pool_new(3);
        gonio_smooth_precondition_apply(p, pool, a, again);
        assert_memory_equal(again, pa, n * sizeof *pa);
        gonio_pool_free(pool);
        gonio_smooth_precondition_free(p);
        free(lumped);
        free(diagonal);
        free(a);
        free(b);
        free(pa);
        free(pb);
        free(again);
    }
}

// 3,000 samples on 42,875 control points, one axis 10,000 times as stiff: tens of iterations. (A diagonal alone, on
// 14,000 samples one level finer: the gradient at 0.002 and the held-out error at 8 times the solution's after 400.)
static void test_stiff_forms_converge(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ward:rho_d=0.3,rho_s=0.2,alpha=0.15", 3000, 1, 2);
    const gonio_dataset_options how = {.mirror = true, .domain = GONIO_LOG};
    gonio_dataset data;
    gonio_smooth_base base;
    gonio_smooth_cg *cg;
    gonio_smooth_cg_report report;
    assert_int_equal(gonio_dataset_init(&data, samples, &how, NULL), GONIO_OK);
    assert_int_equal(gonio_smooth_base_init(&base, &data, NULL, NULL), GONIO_OK);
    gonio_smooth_form form = gonio_smooth_form_default(GONIO_HALF_VECTOR, 5, true);
    form.stretch[2] = 1e4;
    assert_int_equal(gonio_smooth_cg_new(&data, &form, 2, &cg, NULL), GONIO_OK);
    double *points = calloc(gonio_smooth_cg_count(cg, 5), sizeof *points);
    assert_int_equal(gonio_smooth_cg_solve(cg, base.rest, 1, 5, 1e-5, 100, 1e-3, points, &report, NULL), GONIO_OK);
    print_message("# %d iterations, the gradient fell to %.2g\n", report.iterations, report.gradient);
    assert_true(report.gradient <= 1e-3);
    gonio_smooth_cg_free(cg);
    gonio_smooth_base_release(&base);
    gonio_dataset_release(&data);
    gonio_samples_free(samples);
    free(points);
}

// ---- grazing factors ----

static gonio_model *fitted(const gonio_samples *samples, int threads, gonio_fit_report *report) {
    gonio_fit_options o;
    gonio_model *model;
    gonio_fit_options_default(&o);
    o.method = "lsq";
    o.hold_out = 0;
    o.level = 4; // quick
    o.coordinates = GONIO_HALF_VECTOR;
    o.threads = threads;
    assert_int_equal(gonio_fit(samples, &o, &model, report, NULL), GONIO_OK);
    return model;
}

static void save_bytes(const gonio_model *model, char *path, char **bytes, size_t *size) {
    scratch_file(path, "", 0);
    assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    *bytes = malloc(1 << 20);
    *size = fread(*bytes, 1, 1 << 20, file);
    fclose(file);
}

// A lobe that rises as 1/sqrt(cos cos) has the factor found, whatever the number of threads, and it survives a file.
static void test_grazing_factor_is_chosen_and_saved(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ward:rho_d=0.001,rho_s=0.2,alpha=0.15", 4000, 1, 4);
    gonio_fit_report report;
    gonio_model *models[2] = {fitted(samples, 1, &report), fitted(samples, 3, &report)};
    assert_non_null(strstr(report.options, "grazing=0.5"));
    char paths[2][64], *bytes[2];
    size_t sizes[2];
    for (int k = 0; k < 2; k++) {
        save_bytes(models[k], paths[k], &bytes[k], &sizes[k]);
    }
    assert_int_equal(sizes[0], sizes[1]);
    assert_memory_equal(bytes[0], bytes[1], sizes[0]);
    gonio_model *read;
    assert_int_equal(gonio_model_open(paths[0], &read, NULL), GONIO_OK);
    uint64_t seed = 9;
    for (int i = 0; i < 2000; i++) {
        const gonio_pair pair = simulate_pair(&seed, 1);
        double a, b;
        gonio_model_eval_pair(models[0], &pair, &a);
        gonio_model_eval_pair(read, &pair, &b);
        assert_true(a == b);
    }
    gonio_model_free(read);
    for (int k = 0; k < 2; k++) {
        remove(paths[k]);
        free(bytes[k]);
        gonio_model_free(models[k]);
    }
    gonio_samples_free(samples);
}

// Up to the horizon, where the factor grows without end: positive, and at most 4 times the largest sample.
static void test_grazing_factor_is_bounded(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("ward:rho_d=0.001,rho_s=0.2,alpha=0.15", 4000, 1, 4);
    gonio_fit_report report;
    gonio_model *model = fitted(samples, 0, &report);
    const gonio_lobe_spline_parts *parts = gonio_lobe_spline_about(model);
    assert_true(parts->base.grazing > 0 && parts->base.lobes == 0);
    double largest = 0;
    for (size_t i = 0; i < samples->n; i++) {
        largest = fmax(largest, samples->values[i]);
    }
    uint64_t seed = 1;
    for (int i = 0; i < 100000; i++) {
        const double zi = i % 3 == 0 ? 1e-9 : simulate_uniform(&seed), zo = i % 5 == 0 ? 0 : simulate_uniform(&seed);
        double value;
        gonio_model_eval(model, gonio_direction(acos(zi), 0),
                         gonio_direction(acos(zo), 2 * GONIO_PI * simulate_uniform(&seed)), &value);
        assert_true(value >= 0 && value <= 4.2 * largest);
    }
    gonio_model_free(model);
    gonio_samples_free(samples);
}

// A file that asks for an exponent nobody writes is refused, not evaluated.
static void test_impossible_grazing_is_refused(void **state) {
    (void)state;
    static const char names[1][32] = {"y"};
    static const float exponents[] = {-1, 3, NAN};
    for (size_t k = 0; k < 3; k++) {
        gonio_lobe_spline_parts parts = {
            .channels = 1, .dims = 3, .kind = GONIO_TRANSFORM_POSITIVE, .channel_names = names};
        parts.transforms = malloc(sizeof *parts.transforms);
        parts.transforms[0] = (gonio_transform){1, 0.1};
        assert_int_equal(gonio_lattice_init(&parts.lattice, 3, 0, 1, NULL), GONIO_OK);
        parts.base = (gonio_lobe_base){.cosine_min = 0.1F, .grazing = exponents[k]};
        gonio_model *model, *read = NULL;
        assert_int_equal(gonio_lobe_spline_new(&parts, &model, NULL), GONIO_OK);
        char path[64], *bytes;
        size_t size;
        save_bytes(model, path, &bytes, &size);
        gonio_error error = {0};
        assert_int_equal(gonio_model_open(path, &read, &error), GONIO_E_INPUT);
        assert_null(read);
        remove(path);
        free(bytes);
        gonio_model_free(model);
    }
}

// ---- memory ----

// A limit lowers the level that is chosen, and refuses one that is given, with figures; nothing is fitted then.
static void test_memory_limits_the_level(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples("lambert:rho=0.5", 2600, 1, 6);
    gonio_fit_options o;
    gonio_fit_report report;
    gonio_model *model = NULL;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.method = "lsq";
    o.hold_out = 0;
    o.coordinates = GONIO_NUSSELT;
    o.max_memory = 23000000; // the program's 20 MB, the samples and a small lattice
    assert_int_equal(gonio_fit(samples, &o, &model, &report, &error), GONIO_OK);
    assert_true(report.level >= 1 && report.level <= 3);
    gonio_model_free(model);
    o.level = 6;
    assert_int_equal(gonio_fit(samples, &o, &model, &report, &error), GONIO_E_MEMORY);
    assert_non_null(strstr(error.message, "level 6"));
    assert_non_null(strstr(error.message, "GB"));
    gonio_samples_free(samples);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_memory_limits_the_level),
        cmocka_unit_test(test_penalty_is_its_formula),
        cmocka_unit_test(test_folding_is_a_projection),
        cmocka_unit_test(test_preconditioner_is_symmetric_and_positive),
        cmocka_unit_test(test_stiff_forms_converge),
        cmocka_unit_test(test_grazing_factor_is_chosen_and_saved),
        cmocka_unit_test(test_grazing_factor_is_bounded),
        cmocka_unit_test(test_impossible_grazing_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
