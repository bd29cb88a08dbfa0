// SPDX-License-Identifier: BSD-3-Clause
// B-spline volumes: basis functions, knots, lofting against the whole least squares, and error bounds at every point of
// a table.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/bvb/bvb.h"
#include "fit/bvb/table.h"
#include "fit/smooth/matrix.h"
#include "gonio/plan.h"
#include "tests/simulate.h"

static const char names[3][32] = {"r", "g", "b"};
static const gonio_transform plain[3] = {{1, 0}, {1, 0}, {1, 0}};

// ---- basis functions ----

// The recurrence as the books have it.
static double basis_of(const double *t, size_t i, int order, double x) {
    if (order == 1) {
        return x >= t[i] && x < t[i + 1];
    }
    const double a = t[i + (size_t)order - 1] - t[i], b = t[i + (size_t)order] - t[i + 1];
    return (a > 0 ? (x - t[i]) / a * basis_of(t, i, order - 1, x) : 0) +
           (b > 0 ? (t[i + (size_t)order] - x) / b * basis_of(t, i + 1, order - 1, x) : 0);
}

static void basis_functions_are_those_of_the_recurrence(void **state) {
    (void)state;
    enum { COUNT = 9 };
    for (int order = 2; order <= 4; order++) {
        double knots[COUNT + 4], basis[4];
        gonio_knots_place(GONIO_KNOTS_KTP, 37, COUNT, order, knots);
        for (double x = 0; x < 1; x += 0.0137) {
            const size_t first = gonio_bvb_basis(knots, COUNT, order, x, basis);
            double sum = 0;
            for (size_t i = 0; i < COUNT; i++) {
                const bool there = i >= first && i < first + (size_t)order;
                assert_true(fabs((there ? basis[i - first] : 0) - basis_of(knots, i, order, x)) < 1e-13);
                sum += there ? basis[i - first] : 0;
            }
            assert_true(fabs(sum - 1) < 1e-13);
        }
    }
}

// ---- knots ----

// A peak of three columns in some polylines, on flat ones.
enum { LINES = 5, POINTS = 41, PEAK = 29 };
static void set_peak(float *values, double height) {
    for (int i = 0; i < LINES * POINTS; i++) {
        const int from = abs(i % POINTS - PEAK);
        values[i] = (float)(0.1 + (i / POINTS < 2 && from < 3 ? height * (3 - from) / 3 : 0));
    }
}

static void dominant_columns_are_nested_and_find_a_peak(void **state) {
    (void)state;
    float values[LINES * POINTS];
    set_peak(values, 50);
    for (int mean = 0; mean < 2; mean++) {
        gonio_columns c;
        double few[9 + 2], more[10 + 2];
        assert_int_equal(gonio_columns_init(&c, values, LINES, POINTS, 1, 1, 50, 20, mean, NULL, NULL), GONIO_OK);
        gonio_columns_knots(&c, 9, 2, few);
        gonio_columns_knots(&c, 10, 2, more);
        // Order 2: inner knots are the columns themselves, and one more adds to them.
        size_t kept = 0, near = 0;
        for (size_t k = 2; k < 9; k++) {
            for (size_t n = 2; n < 10; n++) {
                kept += few[k] == more[n];
            }
            near += fabs(few[k] * (POINTS - 1) - PEAK) <= 3;
        }
        assert_int_equal(kept, 7);
        assert_true(near >= 3);
        gonio_columns_release(&c);
    }
}

static void knots_ascend_for_every_count(void **state) {
    (void)state;
    float values[LINES * POINTS];
    set_peak(values, 50);
    gonio_columns c;
    assert_int_equal(gonio_columns_init(&c, values, LINES, POINTS, 1, 1, 50, 1, false, NULL, NULL), GONIO_OK);
    for (int order = 2; order <= 4; order++) {
        for (size_t count = (size_t)order; count <= POINTS; count++) {
            for (int how = GONIO_KNOTS_DOMINANT; how <= GONIO_KNOTS_NKTP; how++) {
                double knots[POINTS + 4];
                if (how < GONIO_KNOTS_KTP) {
                    gonio_columns_knots(&c, count, order, knots);
                } else {
                    gonio_knots_place((gonio_knots)how, POINTS, count, order, knots);
                }
                for (size_t k = 0; k + 1 < count + (size_t)order; k++) {
                    const bool inside = k + 1 >= (size_t)order && k < count;
                    // A step of the table apart; the first of KTP's may lie nearer to the end.
                    const double apart = how == GONIO_KNOTS_KTP ? GONIO_BVB_GAP : 0.999 / (POINTS - 1);
                    assert_true(inside ? knots[k + 1] - knots[k] > apart : knots[k + 1] == knots[k]);
                }
                assert_true(knots[0] == 0 && knots[count + (size_t)order - 1] == 1);
            }
        }
    }
    gonio_columns_release(&c);
}

// ---- lofting ----

static gonio_bvb_table table_of(const char *spec, bool isotropic, int channels, int intervals) {
    gonio_bvb_table t;
    gonio_model *model = NULL;
    gonio_error error = {0};
    if (gonio_model_from_spec(spec, &model, &error) != GONIO_OK ||
        gonio_bvb_table_init(&t, isotropic, channels, intervals, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    assert_int_equal(model->channels, channels);
    gonio_bvb_table_of_model(&t, model, GONIO_TRANSFORM_LINEAR, plain, 1);
    gonio_model_free(model);
    return t;
}

// All basis functions of a volume at a node of its table: row[control points].
static void whole_row(const gonio_bvb_parts *p, const gonio_bvb_table *t, size_t node, double *row) {
    double basis[3][16] = {{0}};
    const size_t at[3] = {node / t->size[2] / t->size[1], node / t->size[2] % t->size[1], node % t->size[2]};
    for (int d = 0; d < 3; d++) {
        double b[4];
        const double x = (double)at[d] / (double)(t->size[d] - 1);
        const size_t first = gonio_bvb_basis(p->knots[d], p->count[d], p->order, x, b);
        memcpy(basis[d] + first, b, (size_t)p->order * sizeof *b);
    }
    for (size_t k = 0; k < gonio_bvb_points(p); k++) {
        row[k] = basis[0][k / p->count[2] / p->count[1]] * basis[1][k / p->count[2] % p->count[1]] *
                 basis[2][k % p->count[2]];
    }
}

// On a table, one pass after the other is the least squares of all control points together (eq. 5).
static void lofting_is_the_whole_least_squares(void **state) {
    (void)state;
    gonio_bvb_table t = table_of("ward:rho_d=0.3,rho_s=0.2,alpha=0.3", true, 1, 6);
    const gonio_loft loft = {.order = 4, .knots = GONIO_KNOTS_DOMINANT, .count = {5, 4, 7}, .unit = 1, .threads = 1};
    gonio_bvb_parts p;
    assert_int_equal(gonio_bvb_loft(&t, &loft, &p, NULL), GONIO_OK);
    const size_t n = gonio_bvb_points(&p);
    double *normal = calloc(n * n, sizeof *normal), *right = calloc(n, sizeof *right), row[5 * 4 * 7];
    const double largest = gonio_bvb_table_lengths(&t).largest;
    assert_int_equal(n, 5 * 4 * 7);
    for (size_t node = 0; node < gonio_bvb_nodes(&t); node++) {
        whole_row(&p, &t, node, row);
        for (size_t i = 0; i < n; i++) {
            for (size_t k = 0; k < n && row[i] != 0; k++) {
                normal[i * n + k] += row[i] * row[k];
            }
            right[i] += row[i] * (double)t.values[node];
        }
    }
    // The normal equations hold at the lofted control points, to the rounding of their floats.
    for (size_t i = 0; i < n; i++) {
        double sum = 0, size = 0;
        for (size_t k = 0; k < n; k++) {
            sum += normal[i * n + k] * (double)p.points[k];
            size += normal[i * n + k];
        }
        assert_true(fabs(sum - right[i]) < 1e-6 * size * largest);
    }
    free(normal);
    free(right);
    gonio_bvb_parts_release(&p);
    gonio_bvb_table_release(&t);
}

// ---- bounds ----

// The largest and the mean length of what a model says beside its table, by the model's own evaluation.
static gonio_bvb_lengths evaluated(const gonio_bvb_table *t, const gonio_model *model) {
    gonio_bvb_lengths left = {0, 0};
    for (size_t k = 0; k < gonio_bvb_nodes(t); k++) {
        const size_t outer = k / t->size[2] / t->size[1];
        const size_t node[4] = {outer % t->size[0], k / t->size[2] % t->size[1], k % t->size[2], outer / t->size[0]};
        const gonio_pair pair = gonio_bvb_table_pair(t, node);
        double values[3], square = 0;
        // An azimuth means nothing where a direction is the normal, and its last node is its first.
        if (pair.theta_i == 0 || pair.theta_o == 0 || node[2] + 1 == t->size[2] ||
            (node[3] > 0 && node[3] + 1 == t->size[3])) {
            continue;
        }
        gonio_model_eval_pair(model, &pair, values);
        for (int c = 0; c < t->channels; c++) {
            const double d = values[c] - (double)t->values[k * (size_t)t->channels + (size_t)c];
            square += d * d;
        }
        left.largest = fmax(left.largest, sqrt(square));
        left.mean += sqrt(square) / (double)gonio_bvb_nodes(t);
    }
    return left;
}

static gonio_model *model_of(const gonio_bvb_table *table, const gonio_fit_options *o, gonio_bvb_report *report) {
    gonio_bvb_table copy = *table;
    gonio_model *model;
    gonio_error error = {0};
    const size_t bytes = gonio_bvb_nodes(table) * (size_t)table->channels * sizeof(float);
    copy.values = malloc(bytes);
    memcpy(copy.values, table->values, bytes);
    if (gonio_bvb_fit_table(&copy, GONIO_TRANSFORM_LINEAR, plain, names, o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    gonio_bvb_table_release(&copy);
    return model;
}

static void error_bounds_hold_at_every_point(void **state) {
    (void)state;
    static const struct {
        const char *spec;
        bool isotropic;
        int intervals;
    } cases[] = {{"ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.15", true, 12},
                 {"ggx:rho_d=0.1/0.2/0.3,rho_s=0.4,alpha=0.02,f0=0.5", true, 12},
                 {"ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha_x=0.2,alpha_y=0.4", false, 4}};
    static const double rates[] = {0.3, 0.02, 1e-4};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        gonio_bvb_table t = table_of(cases[k].spec, cases[k].isotropic, 3, cases[k].intervals);
        for (int how = 0; how < 9; how++) {
            gonio_fit_options o;
            gonio_bvb_report report;
            gonio_fit_options_default(&o);
            o.threads = 1;
            o.order = 2 + how % 3;
            o.rate = rates[how / 3];
            o.knots = how % 2 == 0 ? NULL : "dominant-mean";
            gonio_model *model = model_of(&t, &o, &report);
            const gonio_bvb_lengths left = evaluated(&t, model);
            if (!(left.largest <= o.rate * report.table.largest * (1 + 1e-6)) ||
                !(left.largest <= report.error.largest + 1e-6 * report.table.largest)) {
                fail_msg("%s, order %d, rate %g: errs by %g of %g; the report says %g", cases[k].spec, o.order, o.rate,
                         left.largest, report.table.largest, report.error.largest);
            }
            gonio_model_free(model);
        }
        gonio_bvb_table_release(&t);
    }
}

static void as_many_points_as_the_table_has_interpolate(void **state) {
    (void)state;
    gonio_bvb_table t = table_of("ggx:rho_d=0.1/0.2/0.3,rho_s=0.4,alpha=0.02,f0=0.5", true, 3, 9);
    static const char *const knots[] = {"adaptive", "dominant-raw", "ktp", "nktp"};
    for (int how = 0; how < 12; how++) {
        gonio_fit_options o;
        gonio_bvb_report report;
        gonio_fit_options_default(&o);
        o.order = 2 + how % 3;
        o.knots = knots[how / 3];
        o.points[0] = o.points[1] = 10;
        o.points[2] = 37;
        gonio_model *model = model_of(&t, &o, &report);
        assert_true(report.error.largest < 1e-6 * report.table.largest);
        assert_int_equal(model->control_points, 10 * 10 * 37);
        gonio_model_free(model);
    }
    gonio_bvb_table_release(&t);
}

static void dominant_columns_beat_equal_spacing_at_equal_points(void **state) {
    (void)state;
    gonio_bvb_table t = table_of("ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.05", true, 3, 18);
    double error[2];
    for (int how = 0; how < 2; how++) {
        gonio_fit_options o;
        gonio_bvb_report report;
        gonio_fit_options_default(&o);
        o.order = 2;
        o.knots = how == 0 ? "adaptive" : "nktp";
        o.points[0] = o.points[1] = 12;
        o.points[2] = 9;
        gonio_model_free(model_of(&t, &o, &report));
        error[how] = report.error.largest;
    }
    assert_true(error[0] < 0.5 * error[1]);
    gonio_bvb_table_release(&t);
}

// ---- samples ----

static void samples_on_a_grid_are_the_table(void **state) {
    (void)state;
    static const char *const specs[] = {"ward:rho_d=0.3,rho_s=0.2,alpha=0.15",
                                        "ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.4"};
    for (int isotropic = 0; isotropic < 2; isotropic++) {
        const int intervals = isotropic ? 9 : 4;
        gonio_bvb_table t = table_of(specs[!isotropic], isotropic != 0, 1, intervals);
        gonio_samples *samples;
        gonio_model *truth = simulate_truth(specs[!isotropic]), *model;
        assert_int_equal(gonio_samples_new(1, false, &samples, NULL), GONIO_OK);
        samples->isotropic = isotropic != 0;
        for (size_t k = 0; k < gonio_bvb_nodes(&t); k++) {
            const size_t outer = k / t.size[2] / t.size[1];
            const size_t node[4] = {outer % t.size[0], k / t.size[2] % t.size[1], k % t.size[2], outer / t.size[0]};
            double value;
            // Half of the azimuths, once a closed circle, and of isotropic samples no theta beyond 80 deg.
            if (node[2] + 1 < t.size[2] && (!isotropic || (node[2] <= t.size[2] / 2 && node[0] < 9 && node[1] < 9)) &&
                (isotropic || node[3] + 1 < t.size[3])) {
                const gonio_pair pair = gonio_bvb_table_pair(&t, node);
                gonio_model_eval_pair(truth, &pair, &value);
                assert_int_equal(gonio_samples_add(samples, &pair, &value, NULL, NULL, NULL), GONIO_OK);
            }
        }
        gonio_fit_options o;
        gonio_fit_report report;
        gonio_fit_options_default(&o);
        o.method = "bvb";
        o.hold_out = 0;
        o.rate = 1e-6;
        assert_int_equal(gonio_fit(samples, &o, &model, &report, NULL), GONIO_OK);
        assert_non_null(strstr(report.note, "grid"));
        assert_true(report.train.max_rel < 1e-3);
        gonio_model_free(model);
        gonio_model_free(truth);
        gonio_samples_free(samples);
        gonio_bvb_table_release(&t);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(basis_functions_are_those_of_the_recurrence),
        cmocka_unit_test(dominant_columns_are_nested_and_find_a_peak),
        cmocka_unit_test(knots_ascend_for_every_count),
        cmocka_unit_test(lofting_is_the_whole_least_squares),
        cmocka_unit_test(error_bounds_hold_at_every_point),
        cmocka_unit_test(as_many_points_as_the_table_has_interpolate),
        cmocka_unit_test(dominant_columns_beat_equal_spacing_at_equal_points),
        cmocka_unit_test(samples_on_a_grid_are_the_table),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
