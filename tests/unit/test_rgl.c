// SPDX-License-Identifier: BSD-3-Clause
// RGL tensors of several phi_i: values of the published evaluator on made-up files, the rule of two phi_i, files over a
// part of a turn.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/io.h"
#include "tests/fuzz/memory_file.h"
#include "tests/unit/near.h"

enum { V = 5, N = 4, L = 2, T = 4, SIZE = 1 << 16 };

typedef struct file {
    uint8_t data[SIZE];
    size_t head, body; // where the next description and the next data go
    int drawn;
} file;

static void put(file *f, size_t *at, uint64_t value, size_t bytes) {
    for (size_t k = 0; k < bytes; k++) {
        f->data[(*at)++] = (uint8_t)(value >> (8 * k));
    }
}

// values NULL: the next of a fixed sequence.
static void field(file *f, const char *name, const float *values, int ndim, const unsigned shape[5]) {
    size_t count = 1;
    put(f, &f->head, strlen(name), 2);
    memcpy(f->data + f->head, name, strlen(name));
    f->head += strlen(name);
    put(f, &f->head, (uint64_t)ndim, 2);
    put(f, &f->head, 10, 1);
    put(f, &f->head, f->body, 8);
    for (int d = 0; d < ndim; d++) {
        put(f, &f->head, shape[d], 8);
        count *= shape[d];
    }
    for (size_t k = 0; k < count; k++) {
        if (values == NULL) {
            f->drawn++;
        }
        const float value = values != NULL ? values[k] : 0.25f + (float)(f->drawn * 7919 % 101) / 64;
        uint32_t raw;
        memcpy(&raw, &value, 4);
        put(f, &f->body, raw, 4);
    }
    assert_true(f->head < 1024 && f->body < SIZE);
}

static const char *tensor(const float *phi_i, unsigned n) {
    static const float theta_i[T] = {0, 0.5f, 1, (float)(GONIO_PI / 2)}, nm[L] = {400, 500};
    file *f = calloc(1, sizeof *f);
    memcpy(f->data, "tensor_file\0\1\0", 14);
    f->head = 14;
    f->body = 1024;
    put(f, &f->head, 7, 4);
    field(f, "phi_i", phi_i, 1, (const unsigned[5]){n});
    field(f, "theta_i", theta_i, 1, (const unsigned[5]){T});
    field(f, "ndf", NULL, 2, (const unsigned[5]){3, 3});
    field(f, "sigma", NULL, 2, (const unsigned[5]){3, 3});
    field(f, "vndf", NULL, 4, (const unsigned[5]){n, T, V, V});
    field(f, "spectra", NULL, 5, (const unsigned[5]){n, T, L, N, N});
    field(f, "wavelengths", nm, 1, (const unsigned[5]){L});
    const char *path = memory_file(f->data, f->body);
    free(f);
    return path;
}

static gonio_model *open_tensor(const float *phi_i, unsigned n) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_read_table(tensor(phi_i, n), &model, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return model;
}

#define PI_F 3.14159265358979323846f
static const float whole[5] = {-PI_F, -PI_F / 2, 0, PI_F / 2, PI_F};
static const float two[2] = {-1, 1.5f};

// From powitacq (J. Dupuy and W. Jakob's published loader and evaluator) on files of the same bytes.
static void values_of_the_published_evaluator(void **state) {
    (void)state;
    static const double pairs[3][4] = {{30, 40, 50, 200}, {10, -100, 70, 20}, {75, 170, 5, -60}};
    static const double expected[2][3][2] = {
        {{0.386100076, 0.241999708}, {0.345437108, 0.314215917}, {0.164488664, 0.270051553}},
        {{0.223713396, 0.181848892}, {0.742481828, 0.392836087}, {0.160674114, 0.158886833}}};
    for (int k = 0; k < 2; k++) {
        gonio_model *model = open_tensor(k == 0 ? whole : two, k == 0 ? 5 : 2);
        assert_int_equal(model->isotropic, k == 1);
        assert_string_equal(model->channel_names[1], "500nm");
        for (int i = 0; i < 3; i++) {
            const gonio_pair p = {gonio_radians(pairs[i][0]), gonio_radians(pairs[i][1]), gonio_radians(pairs[i][2]),
                                  gonio_radians(pairs[i][3])};
            double v[2];
            gonio_model_eval_pair(model, &p, v);
            for (int c = 0; c < 2; c++) {
                assert_near(v[c], expected[k][i][c], 2e-5 * expected[k][i][c]); // single precision there
            }
        }
        gonio_model_free(model);
    }
}

// A file over half a turn is the same after half a turn; one over a quarter has two mirror planes.
static void part_of_a_turn(void **state) {
    (void)state;
    static const float half[3] = {-PI_F, -PI_F / 2, 0}, quarter[3] = {-PI_F, -3 * PI_F / 4, -PI_F / 2};
    gonio_model *m2 = open_tensor(half, 3), *m4 = open_tensor(quarter, 3);
    assert_false(m2->isotropic || m4->isotropic);
    for (int k = 1; k < 200; k++) { // in a mirror plane of the light these made-up values have no symmetry of their own
        const gonio_vec3 wi = gonio_direction(0.1 + 0.007 * k, 0.37 * k),
                         wo = gonio_direction(1.4 - 0.006 * k, 1.1 * k);
        double a[2], b[2];
        gonio_model_eval(m2, wi, wo, a);
        gonio_model_eval(m2, (gonio_vec3){-wi.x, -wi.y, wi.z}, (gonio_vec3){-wo.x, -wo.y, wo.z}, b);
        assert_near(a[0], b[0], 1e-12);
        gonio_model_eval(m4, wi, wo, a);
        gonio_model_eval(m4, (gonio_vec3){wi.x, -wi.y, wi.z}, (gonio_vec3){wo.x, -wo.y, wo.z}, b);
        assert_near(a[1], b[1], 1e-12);
        gonio_model_eval(m4, (gonio_vec3){-wi.x, wi.y, wi.z}, (gonio_vec3){-wo.x, wo.y, wo.z}, b);
        assert_near(a[1], b[1], 1e-12);
    }
    gonio_model_free(m2);
    gonio_model_free(m4);
}

static void samples_are_anisotropic(void **state) {
    (void)state;
    const gonio_read_options options = {.seed = 1, .settings = {{"limit", "500"}}};
    gonio_samples *s;
    assert_int_equal(gonio_read(tensor(whole, 5), &options, &s, NULL, NULL), GONIO_OK);
    assert_false(s->isotropic);
    bool turned = false;
    for (size_t i = 0; i < s->n; i++) {
        turned = turned || s->pairs[i].phi_i != s->pairs[0].phi_i;
    }
    assert_true(turned);
    gonio_samples_free(s);
}

static void other_turns_are_refused(void **state) {
    (void)state;
    static const float bad[][3] = {{-PI_F, -1, 1}, {0, PI_F, 2 * PI_F}, {-1, 0, 1}, {-PI_F, 0, -1}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        gonio_model *model;
        gonio_error error = {0};
        assert_int_equal(gonio_read_table(tensor(bad[k], 3), &model, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "phi_i"));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_of_the_published_evaluator),
        cmocka_unit_test(part_of_a_turn),
        cmocka_unit_test(samples_are_anisotropic),
        cmocka_unit_test(other_turns_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
