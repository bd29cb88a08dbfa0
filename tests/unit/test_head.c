// SPDX-License-Identifier: BSD-3-Clause
// What the measurement was: lines that go with samples, their files, what is made of them, and models.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/head.h"
#include "fit/options.h"
#include "gonio/check.h"
#include "gonio/fit.h"
#include "gonio/io.h"
#include "tests/unit/scratch.h"

#define ROWS "theta_i,phi_i,theta_o,phi_o,r,g\n10,0,20,180,1,2\n30,0,20,170,3,4\n"

static gonio_samples *read_text(const char *text, gonio_error *error) {
    char path[64];
    gonio_samples *s;
    scratch_file(path, text, strlen(text));
    gonio_read(path, NULL, &s, NULL, error);
    unlink(path);
    return s;
}

static gonio_samples *read_head(const char *head) {
    char text[4096];
    gonio_error error = {.line = -1};
    snprintf(text, sizeof text, "%s" ROWS, head);
    gonio_samples *s = read_text(text, &error);
    if (s == NULL) {
        fail_msg("%s: line %lld: %s", head, error.line, error.message);
    }
    return s;
}

static char *written(const gonio_samples *s) {
    char *text;
    size_t size;
    FILE *stream = open_memstream(&text, &size);
    assert_int_equal(gonio_write_samples_stream(s, stream, NULL), GONIO_OK);
    fclose(stream);
    return text;
}

// Every key that a value could hang on but does not, and any other: kept in order, under one spelling.
static void a_file_keeps_its_head(void **state) {
    (void)state;
    static const char head[] = "# sample: a tile\n"
                               "#Operator:  A. Person \n"
                               "# light half angle deg = 0.25\n"
                               "# solid_angle_sr = 1e-4\n"
                               "# spot diameter mm: 10\n"
                               "# temperature_c = -3.5\n"
                               "# light polarization = s\n"
                               "# detector_polarisation = p\n"
                               "# polarisation = unpolarised\n"
                               "# traceability = PTB 1234-2024, at an angle of 45 deg, scale of 1\n"
                               "# Oven No. 7 = warm\n"
                               "# just a remark\n"
                               "# units = 1/sr\n";
    static const char kept[] = "sample = a tile\noperator = A. Person\nlight_half_angle_deg = 0.25\n"
                               "aperture_solid_angle_sr = 1e-4\nspot_mm = 10\ntemperature_c = -3.5\n"
                               "light_polarisation = s\ndetector_polarisation = p\npolarisation = unpolarised\n"
                               "traceability = PTB 1234-2024, at an angle of 45 deg, scale of 1\noven_no__7 = warm\n";
    gonio_samples *s = read_head(head), *part;
    assert_string_equal(s->head, kept);
    char *text = written(s);
    gonio_samples *again = read_text(text, NULL);
    assert_string_equal(again->head, kept);
    char *twice = written(again);
    assert_string_equal(text, twice);
    char value[64];
    assert_true(gonio_head_find(s->head, "spot_mm", value, sizeof value));
    assert_string_equal(value, "10");
    assert_false(gonio_head_find(s->head, "spot", value, sizeof value));
    // What is made of the set carries it on.
    const bool one[2] = {true, false};
    assert_int_equal(gonio_samples_select(s, one, &part, NULL), GONIO_OK);
    assert_string_equal(part->head, kept);
    gonio_samples_free(part);
    assert_int_equal(gonio_samples_channel(s, 1, &part, NULL), GONIO_OK);
    assert_string_equal(part->head, kept);
    gonio_samples_free(part);
    const gonio_change mirror = {.kind = GONIO_CHANGE_MIRROR, .delta = 1, .ceiling = 1};
    assert_int_equal(gonio_check_change(s, &mirror, 1, &part, NULL), GONIO_OK);
    assert_string_equal(part->head, kept);
    gonio_samples_free(part);
    gonio_samples_free(s);
    gonio_samples_free(again);
    free(text);
    free(twice);
}

static void figures_are_numbers(void **state) {
    (void)state;
    static const char *const keys[] = {"light_solid_angle_sr", "aperture_half_angle_deg", "spot_mm",
                                       "measured_mm",          "light_distance_mm",       "bandwidth_nm",
                                       "humidity_percent",     "reference_sigma_percent", "temperature_c"};
    static const char *const values[] = {"cold", "", "1 mm", "nan", "-1"};
    for (size_t k = 0; k < sizeof keys / sizeof *keys; k++) {
        for (size_t v = 0; v < sizeof values / sizeof *values; v++) {
            char text[256];
            gonio_error error = {.line = -1};
            if (strcmp(keys[k], "temperature_c") == 0 && strcmp(values[v], "-1") == 0) {
                continue;
            }
            snprintf(text, sizeof text, "# operator = b\n# %s = %s\n" ROWS, keys[k], values[v]);
            gonio_samples *s = read_text(text, &error);
            assert_null(s);
            assert_int_equal(error.line, 2);
            assert_non_null(strstr(error.message, keys[k]));
        }
    }
    gonio_error error = {0};
    assert_null(read_text("# light_polarisation = sideways\n" ROWS, &error));
    assert_non_null(strstr(error.message, "sideways"));
}

// No line can break out of its line, nor steer a terminal.
static void lines_stay_lines(void **state) {
    (void)state;
    gonio_samples *s = read_head("");
    assert_null(s->head);
    assert_int_equal(gonio_samples_tell(s, "notes", "a\nquantity = f_r cos\r\x1b[2J\xc2\x9b z ", NULL), GONIO_OK);
    assert_int_equal(gonio_samples_tell(s, "empty", " \n", NULL), GONIO_OK);
    assert_string_equal(s->head, "notes = a quantity = f_r cos  [2J  z\n");
    gonio_samples_free(s);
}

static void assert_same(const gonio_model *a, const gonio_model *b) {
    for (int k = 0; k < 20; k++) {
        const gonio_vec3 wi = gonio_direction(0.07 * k, k), wo = gonio_direction(1.5 - 0.07 * k, 2 * k);
        double x[3], y[3];
        gonio_model_eval(a, wi, wo, x);
        gonio_model_eval(b, wi, wo, y);
        assert_memory_equal(x, y, (size_t)a->channels * sizeof *x);
    }
}

// A model's file keeps what it was made of, for as many channels as there are, and evaluates as without it.
static void a_model_file_keeps_it(void **state) {
    (void)state;
    static const char *const specs[] = {"ward:rho_d=0.3,rho_s=0.2,alpha=0.2", "lambert:rho=0.3/0.2/0.1",
                                        "ward:rho_d=0.3,rho_s=0.2,alpha=0.2|lambert:rho=0.3"};
    for (size_t k = 0; k < sizeof specs / sizeof *specs; k++) {
        gonio_model *model, *back;
        char path[64];
        assert_int_equal(gonio_model_from_spec(specs[k], &model, NULL), GONIO_OK);
        char about[400] = "";
        for (int n = 0; n < 300; n += 37) { // of every length, across the multiples of 64
            scratch_file(path, "", 0);
            memset(about, 'x', (size_t)n);
            strcpy(about + n, "\na = b\n");
            assert_int_equal(gonio_model_tell(model, n == 0 ? NULL : about, NULL), GONIO_OK);
            assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
            for (int way = 0; way < 2; way++) {
                assert_int_equal((way == 0 ? gonio_model_open : gonio_model_map)(path, &back, NULL), GONIO_OK);
                if (n == 0) {
                    assert_null(back->about);
                } else {
                    assert_string_equal(back->about, about);
                }
                assert_same(model, back);
                gonio_model_free(back);
            }
            unlink(path);
        }
        gonio_model_free(model);
    }
}

// A reader that does not know the text skips it; one that is too long for its place is refused.
static void what_is_not_known_is_skipped(void **state) {
    (void)state;
    gonio_model *model, *back;
    char path[64];
    gonio_error error = {0};
    scratch_file(path, "", 0);
    assert_int_equal(gonio_model_from_spec("lambert:rho=0.3", &model, NULL), GONIO_OK);
    assert_int_equal(gonio_model_tell(model, "a = b\n", NULL), GONIO_OK);
    assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
    FILE *file = fopen(path, "r+b");
    fseek(file, 128, SEEK_SET); // behind one name
    fputs("LATER..!", file);
    fclose(file);
    assert_int_equal(gonio_model_open(path, &back, &error), GONIO_E_INPUT); // the checksum covers it
    assert_int_equal(gonio_model_map(path, &back, NULL), GONIO_OK);
    assert_null(back->about);
    assert_same(model, back);
    gonio_model_free(back);
    assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
    file = fopen(path, "r+b");
    fseek(file, 136, SEEK_SET);
    fputc(200, file);
    fclose(file);
    assert_int_equal(gonio_model_map(path, &back, &error), GONIO_E_INPUT);
    assert_int_equal(error.byte, 136);
    gonio_model_free(model);
    unlink(path);
}

// fit -> head, what was sampled and how well; samples of the model -> the head alone.
static void a_fit_carries_it(void **state) {
    (void)state;
    gonio_samples *s, *back;
    assert_int_equal(gonio_samples_new(1, false, &s, NULL), GONIO_OK);
    strcpy(s->channel_names[0], "r");
    for (int k = 0; k < 200; k++) {
        const gonio_pair pair = {0.3 + 0.001 * k, 0, 0.005 * k, GONIO_PI * (k % 7) / 7};
        assert_int_equal(gonio_samples_add(s, &pair, &(double){1 + 0.01 * k}, NULL, NULL, NULL), GONIO_OK);
    }
    assert_int_equal(gonio_samples_tell(s, "operator", "me", NULL), GONIO_OK);
    gonio_fit_options options;
    gonio_fit_report report;
    gonio_coverage coverage, told;
    gonio_model *model;
    gonio_fit_options_default(&options);
    gonio_fit_options_for(&options, "mba");
    options.level = 2;
    assert_int_equal(gonio_fit(s, &options, &model, &report, NULL), GONIO_OK);
    assert_string_equal(model->about, "operator = me\n");
    assert_int_equal(gonio_coverage_of(s, &coverage, NULL), GONIO_OK);
    assert_int_equal(gonio_model_describe(model, &coverage, &report, NULL), GONIO_OK);
    assert_true(gonio_coverage_take(model->about, &told));
    char a[400], b[400];
    gonio_coverage_text(&coverage, a, sizeof a);
    gonio_coverage_text(&told, b, sizeof b);
    assert_string_equal(a, b);
    assert_int_equal(gonio_coverage_is_narrow(&told), gonio_coverage_is_narrow(&coverage));
    assert_true(gonio_head_find(model->about, "held_out", a, sizeof a) && strstr(a, "rmse") != NULL);
    assert_true(gonio_head_find(model->about, "fit", a, sizeof a) && strncmp(a, "mba level 2", 11) == 0);
    assert_false(gonio_coverage_take("sampled.samples = 3\n", &told));
    assert_false(gonio_coverage_take(NULL, &told));
    assert_int_equal(gonio_samples_of_model(model, s->pairs, s->n, 1, &back, NULL), GONIO_OK);
    assert_true(strncmp(back->head, "operator = me\norigin = ", 23) == 0 && strstr(back->head, "sampled") == NULL);
    char *lines = NULL;
    for (unsigned halves = 1; halves < 16; halves++) {
        coverage.halves = halves;
        assert_int_equal(gonio_coverage_put(&coverage, &lines, NULL), GONIO_OK);
        assert_true(gonio_coverage_take(lines, &told));
        assert_int_equal(told.halves, halves);
        free(lines);
        lines = NULL;
    }
    gonio_samples_free(back);
    gonio_samples_free(s);
    gonio_model_free(model);
}

// ---- Mueller matrices ----

static gonio_mueller_report judge(const double m[16], double sigma) {
    gonio_samples *s;
    gonio_mueller_report report;
    const double sigmas[16] = {sigma, sigma, sigma, sigma, sigma, sigma, sigma, sigma,
                               sigma, sigma, sigma, sigma, sigma, sigma, sigma, sigma},
                 zeros[16] = {0};
    assert_int_equal(gonio_samples_new(16, sigma > 0, &s, NULL), GONIO_OK);
    for (int e = 0; e < 16; e++) {
        snprintf(s->channel_names[e], GONIO_CHANNEL_NAME_MAX, "f_r%d%d", e / 4 + 1, e % 4 + 1);
    }
    const gonio_pair pair = {0.5, 0, 0.25, 1};
    assert_int_equal(gonio_samples_add(s, &pair, m, sigma > 0 ? sigmas : NULL, sigma > 0 ? zeros : NULL, NULL),
                     GONIO_OK);
    gonio_check_mueller(s, &report);
    gonio_samples_free(s);
    assert_int_equal(report.matrices, 1);
    return report;
}

// Matrices whose eigenvalues are known: a mirror and a polariser are pure (1, 0, 0, 0), a depolariser has four of a
// quarter, and what reverses one parameter alone is of nothing.
static void realisability(void **state) {
    (void)state;
    static const struct {
        double m[16], worst;
    } known[] = {
        {{2, 0, 0, 0, 0, 2, 0, 0, 0, 0, -2, 0, 0, 0, 0, -2}, 0},
        {{.5, .5, 0, 0, .5, .5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 0},
        {{3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 0.25},
        {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1}, -0.5},
        {{1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1}, 0}, // a rotator
        {{1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2}, -0.25},
    };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        const gonio_mueller_report r = judge(known[k].m, 0);
        assert_true(fabs(r.worst - known[k].worst) < 1e-9);
        assert_int_equal(r.unphysical, known[k].worst < -0.01);
        assert_string_equal(r.worst_channel, "f_r11");
    }
    assert_int_equal(judge(known[3].m, 0.01).unphysical, 1);
    assert_int_equal(judge(known[3].m, 0.2).unphysical, 0); // within its own uncertainty
}

// Sixteen columns are signed but for the first, whatever the policy; fifteen are columns like others.
static void a_matrix_in_a_file(void **state) {
    (void)state;
    for (int n = 15; n <= 16; n++) {
        char text[1000] = "theta_i,phi_i,theta_o,phi_o", row[400] = "10,0,20,180";
        for (int e = 0; e < n; e++) {
            char one[32];
            snprintf(one, sizeof one, ",m%d%d", e / 4 + 1, e % 4 + 1);
            strcat(text, one);
            strcat(row, e == 0 ? ",2" : e % 5 == 0 ? ",-1" : ",-0.125");
        }
        snprintf(text + strlen(text), sizeof text - strlen(text), "\n%s\n%s\n", row, row);
        gonio_error error = {0};
        gonio_samples *s = read_text(text, &error);
        assert_int_equal(s != NULL, n == 16);
        if (s != NULL) {
            assert_int_equal(s->n, 2);
            assert_true(s->values[5] == -1 && s->values[1] == -0.125);
        }
        gonio_samples_free(s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_keeps_its_head),
        cmocka_unit_test(figures_are_numbers),
        cmocka_unit_test(lines_stay_lines),
        cmocka_unit_test(a_model_file_keeps_it),
        cmocka_unit_test(what_is_not_known_is_skipped),
        cmocka_unit_test(a_fit_carries_it),
        cmocka_unit_test(realisability),
        cmocka_unit_test(a_matrix_in_a_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
