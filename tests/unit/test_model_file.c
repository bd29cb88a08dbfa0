// SPDX-License-Identifier: BSD-3-Clause
// Model files: what is written comes back, and damage of every kind is named, not followed.
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

#include "brdf/kind/transformed.h"
#include "fit/options.h"
#include "gonio/fit.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"

static char path[64];

static gonio_model *fit(const char *method, const char *storage, gonio_domain domain, int channels) {
    gonio_samples *samples = simulate_samples(WARD, 1500, channels, 1);
    gonio_fit_options o;
    gonio_model *model;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.level = 4;
    o.diffuse_level = 2;
    o.drop_percent = 80;
    o.storage = storage;
    o.hold_out = 0;
    o.domain = domain;
    gonio_fit_options_for(&o, method); // without what it does not have
    if (gonio_fit(samples, &o, &model, NULL, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    gonio_samples_free(samples);
    return model;
}

static void assert_same_model(const gonio_model *a, const gonio_model *b) {
    uint64_t seed = 5;
    assert_int_equal(a->channels, b->channels);
    assert_int_equal(a->bytes, b->bytes);
    assert_int_equal(a->control_points, b->control_points);
    for (int c = 0; c < a->channels; c++) {
        assert_string_equal(a->channel_names[c], b->channel_names[c]);
    }
    for (int i = 0; i < 200; i++) {
        const gonio_pair pair = simulate_pair(&seed, 0);
        double x[8], y[8];
        gonio_model_eval_pair(a, &pair, x);
        gonio_model_eval_pair(b, &pair, y);
        assert_memory_equal(x, y, (size_t)a->channels * sizeof *x);
    }
}

static void written_models_come_back(void **state) {
    (void)state;
    static const char *const kinds[][2] = {
        {"mba", NULL}, {"cbmba", "float"}, {"cbmba", "half"}, {"cbmba", "byte"}, {"cbmba", "hash"}};
    for (size_t k = 0; k < 5; k++) {
        for (int channels = 1; channels <= 3; channels += 2) {
            gonio_model *model = fit(kinds[k][0], kinds[k][1], k % 2 ? GONIO_LOG : GONIO_LINEAR, channels), *back;
            gonio_error error = {0};
            assert_int_equal(gonio_model_save(model, path, &error), GONIO_OK);
            if (gonio_model_open(path, &back, &error) != GONIO_OK) {
                fail_msg("%s %s: %s", kinds[k][0], kinds[k][1] ? kinds[k][1] : "", error.message);
            }
            assert_same_model(model, back);
            gonio_model_free(back);
            assert_int_equal(gonio_model_map(path, &back, &error), GONIO_OK);
            assert_same_model(model, back);
            gonio_model_free(model);
            gonio_model_free(back);
        }
    }
    unlink(path);
}

static unsigned char *slurp(size_t *length) {
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    fseek(f, 0, SEEK_END);
    *length = (size_t)ftell(f);
    rewind(f);
    unsigned char *bytes = malloc(*length);
    assert_int_equal(fread(bytes, 1, *length, f), *length);
    fclose(f);
    return bytes;
}

static void spill(const unsigned char *bytes, size_t length) {
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, length, f), length);
    fclose(f);
}

static void assert_refused(const char *why) {
    gonio_model *model;
    gonio_error error = {0};
    assert_int_equal(gonio_model_open(path, &model, &error), GONIO_E_INPUT);
    assert_null(model);
    assert_string_equal(error.file, path);
    assert_true(error.byte >= 0);
    if (why != NULL && strstr(error.message, why) == NULL) {
        fail_msg("'%s' does not say '%s'", error.message, why);
    }
}

// A file cut anywhere and a byte changed anywhere.
static void damage_is_found(void **state) {
    (void)state;
    static const char *const storages[] = {NULL, "byte", "hash"};
    for (size_t k = 0; k < 3; k++) {
        gonio_model *model = fit(k == 0 ? "mba" : "cbmba", storages[k], GONIO_LINEAR, 1);
        assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
        gonio_model_free(model);
        size_t length;
        unsigned char *bytes = slurp(&length);
        uint64_t seed = 3;
        for (int i = 0; i < 300; i++) {
            const size_t at = i < 128 ? (size_t)i : (size_t)(simulate_uniform(&seed) * (double)length);
            bytes[at] ^= (unsigned char)(1 << i % 8);
            spill(bytes, length);
            assert_refused(NULL);
            bytes[at] ^= (unsigned char)(1 << i % 8);
        }
        for (int i = 0; i < 40; i++) {
            spill(bytes, (size_t)(simulate_uniform(&seed) * (double)length));
            assert_refused(NULL);
            assert_int_equal(gonio_model_map(path, &model, NULL), GONIO_E_INPUT);
            assert_null(model);
        }
        free(bytes);
    }
    spill((const unsigned char *)"", 0);
    assert_refused("not a Gonio model");
    static const char text[] = "theta_i,phi_i,theta_o,phi_o,r\n0,0,0,0,1\n0,0,0,0,1\n0,0,0,0,1\n0,0,0,0,1\n";
    spill((const unsigned char *)text, sizeof text - 1);
    assert_refused("GONIOMDL");
    unlink(path);
    gonio_model *model;
    gonio_error error = {0};
    assert_int_equal(gonio_model_open(path, &model, &error), GONIO_E_INPUT);
}

// The bytes of a file, wherever they lie: the same model, the same refusals, and nothing read past their end (the
// sanitizer sees the end, since the buffer is exactly as long).
static void models_come_from_memory(void **state) {
    (void)state;
    static const char *const kinds[][2] = {{"mba", NULL}, {"cbmba", "byte"}, {"cbmba", "hash"}, {"ggx", NULL}};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        const gonio_domain domain = k < 3 ? GONIO_LINEAR : GONIO_DOMAIN_AUTO; // lobes alone have no domain
        gonio_model *model = fit(kinds[k][0], kinds[k][1], domain, 3), *back;
        assert_int_equal(gonio_model_save(model, path, NULL), GONIO_OK);
        size_t length;
        unsigned char *bytes = slurp(&length);
        for (size_t shift = 0; shift < 130; shift += shift < 4 ? 1 : 21) { // 64 among them
            unsigned char *moved = aligned_alloc(64, (shift + length + 63) / 64 * 64);
            memcpy(moved + shift, bytes, length);
            gonio_error error = {0};
            if (gonio_model_open_memory(moved + shift, length, &back, &error) != GONIO_OK) {
                fail_msg("%s at %zu: %s", kinds[k][0], shift, error.message);
            }
            assert_same_model(model, back);
            gonio_model_free(back);
            free(moved);
        }
        for (size_t i = 0; i < 200; i++) {
            const size_t at = i < 128 ? i : i * 7919 % length;
            bytes[at] ^= (unsigned char)(1 << i % 8);
            gonio_error error = {0};
            assert_int_equal(gonio_model_open_memory(bytes, length, &back, &error), GONIO_E_INPUT);
            assert_null(back);
            assert_string_equal(error.file, "(memory)");
            bytes[at] ^= (unsigned char)(1 << i % 8);
        }
        for (size_t shorter = 0; shorter < length; shorter += 1 + length / 50) {
            unsigned char *cut = malloc(shorter + 1);
            memcpy(cut + 1, bytes, shorter);
            assert_int_equal(gonio_model_open_memory(cut + 1, shorter, &back, NULL), GONIO_E_INPUT);
            assert_null(back);
            free(cut);
        }
        free(bytes);
        gonio_model_free(model);
    }
    unlink(path);
}

static void a_full_disk_leaves_nothing(void **state) {
    (void)state;
    gonio_model *model = fit("mba", NULL, GONIO_LINEAR, 1);
    gonio_error error = {0};
    assert_int_equal(gonio_model_save(model, "/nowhere/at/all.model", &error), GONIO_E_IO);
    gonio_model_free(model);
}

static void gradient_follows_the_model(void **state) {
    (void)state;
    for (int domain = 0; domain < 2; domain++) {
        gonio_model *model = fit("mba", NULL, (gonio_domain)domain, 1);
        uint64_t seed = 17;
        const double step = 1e-4;
        for (int i = 0; i < 100; i++) {
            gonio_pair pair = simulate_pair(&seed, 0);
            pair.theta_i = 0.1 + 0.8 * pair.theta_i;
            pair.theta_o = 0.1 + 0.8 * pair.theta_o;
            double gradient[4], *angle[4] = {&pair.theta_i, &pair.phi_i, &pair.theta_o, &pair.phi_o};
            gonio_model_gradient(model, &pair, 0, gradient);
            for (int k = 0; k < 4; k++) {
                const double at = *angle[k];
                double low, high;
                *angle[k] = at - step;
                low = gonio_model_eval_channel(model, gonio_direction(pair.theta_i, pair.phi_i),
                                               gonio_direction(pair.theta_o, pair.phi_o), 0);
                *angle[k] = at + step;
                high = gonio_model_eval_channel(model, gonio_direction(pair.theta_i, pair.phi_i),
                                                gonio_direction(pair.theta_o, pair.phi_o), 0);
                *angle[k] = at;
                assert_near((high - low) / (2 * step), gradient[k], 1e-3 * (1 + fabs(gradient[k])));
            }
        }
        gonio_model_free(model);
    }
}

// Models inside models are read to a depth of 8; halves stand outermost or not at all.
static void depth_is_bounded(void **state) {
    (void)state;
    const gonio_transformed_parts parts = {.what = GONIO_MADE_RECIPROCAL, .delta = 0.5};
    for (int depth = 7; depth <= 8; depth++) {
        gonio_model *m, *again;
        assert_int_equal(gonio_model_from_spec("ward:rho_d=0.3,rho_s=0.2,alpha=0.2", &m, NULL), GONIO_OK);
        for (int k = 0; k < depth; k++) {
            assert_int_equal(gonio_transformed_new(m, &parts, &m, NULL), GONIO_OK);
        }
        assert_int_equal(gonio_model_save(m, path, NULL), GONIO_OK);
        if (depth == 7) {
            assert_int_equal(gonio_model_open(path, &again, NULL), GONIO_OK);
            assert_same_model(m, again);
            gonio_model_free(again);
        } else {
            assert_refused("inside each other");
        }
        gonio_model_free(m);
    }
    gonio_model *sheet, *changed;
    assert_int_equal(gonio_model_from_spec("lambert:rho=0.2|lambert:rho=0.3", &sheet, NULL), GONIO_OK);
    assert_int_equal(gonio_transformed_new(sheet, &parts, &changed, NULL), GONIO_E_UNSUPPORTED);
    gonio_model_free(sheet);
    unlink(path);
}

int main(void) {
    snprintf(path, sizeof path, "/tmp/gonio_test_model_%ld", (long)getpid());
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(written_models_come_back),   cmocka_unit_test(damage_is_found),
        cmocka_unit_test(models_come_from_memory),    cmocka_unit_test(a_full_disk_leaves_nothing),
        cmocka_unit_test(gradient_follows_the_model), cmocka_unit_test(depth_is_bounded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
