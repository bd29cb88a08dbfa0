// SPDX-License-Identifier: BSD-3-Clause
// CBMBA: the hash against libcmph's own look-up, the bricks against the dense lattice, dropping, the error-driven
// choice.
#include <cmph.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/bilevel/bilevel.h"
#include "fit/options.h"
#include "gonio/fit.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"

#define WARD "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"

static void packed_look_up_equals_libcmph(void **state) {
    (void)state;
    static const size_t counts[] = {1, 2, 3, 10, 1000, 15038};
    for (size_t k = 0; k < 6; k++) {
        const size_t n = counts[k];
        uint32_t *keys = malloc(n * sizeof *keys);
        bool *seen = calloc(n, sizeof *seen);
        for (size_t i = 0; i < n; i++) {
            keys[i] = (uint32_t)(i * 19 + i % 7);
        }
        void *packed;
        size_t length;
        gonio_perfect_hash hash;
        gonio_error error = {0};
        if (gonio_bilevel_hash(keys, n, &packed, &length, &error) != GONIO_OK) {
            fail_msg("%zu keys: %s", n, error.message);
        }
        assert_true(gonio_perfect_hash_unpack(packed, length, &hash));
        for (size_t i = 0; i < n; i++) {
            const uint32_t entry = gonio_perfect_hash_search(&hash, keys[i]);
            assert_true(entry < n && !seen[entry]); // minimal and perfect
            seen[entry] = true;
        }
        for (uint32_t key = 0; key < 5000; key++) {
            assert_int_equal(gonio_perfect_hash_search(&hash, key),
                             cmph_search_packed(packed, (const char *)&key, sizeof key));
        }
        for (size_t cut = 0; cut < length; cut += 1 + length / 50) {
            assert_false(gonio_perfect_hash_unpack(packed, cut, &hash));
        }
        free(packed);
        free(keys);
        free(seen);
    }
}

static void jenkins_hash_is_perfect(void **state) {
    (void)state;
    static const size_t counts[] = {0, 1, 2, 3, 10, 1000, 15038};
    for (size_t k = 0; k < sizeof counts / sizeof *counts; k++) {
        const size_t n = counts[k];
        uint32_t *keys = malloc((n + 1) * sizeof *keys);
        for (size_t i = 0; i < n; i++) {
            keys[i] = (uint32_t)(i * 19 + i % 7);
        }
        gonio_jenkins_hash hash;
        unsigned char *moves;
        gonio_error error = {0};
        if (gonio_bilevel_jenkins(keys, n, &hash, &moves, &error) != GONIO_OK) {
            fail_msg("%zu keys: %s", n, error.message);
        }
        bool *seen = calloc(hash.slots, sizeof *seen);
        assert_true(hash.slots <= n + n / 10 + 1); // as good as minimal
        for (size_t i = 0; i < n; i++) {
            const uint32_t slot = gonio_jenkins_search(&hash, keys[i]);
            assert_true(slot < hash.slots && !seen[slot]);
            seen[slot] = true;
        }
        for (uint32_t key = 0; key < 5000; key++) {
            assert_true(gonio_jenkins_search(&hash, key) < hash.slots);
        }
        free(moves);
        free(keys);
        free(seen);
    }
}

static void halves_round_to_nearest(void **state) {
    (void)state;
    for (uint32_t h = 0; h < 0x7c00; h++) {
        assert_int_equal(gonio_half_encode(gonio_half_decode((uint16_t)h)), h);
        assert_int_equal(gonio_half_encode(gonio_half_decode((uint16_t)(h | 0x8000))), h | 0x8000);
    }
    assert_near(gonio_half_decode(gonio_half_encode(1.0f / 3)), 1.0 / 3, 0x1p-13);
    assert_near(gonio_half_decode(gonio_half_encode(1e9f)), 65504, 0);
    assert_near(gonio_half_decode(0x3c00), 1, 0);
    assert_near(gonio_half_decode(0x0001), 0x1p-24, 0);
}

static gonio_lattice random_lattice(int level, int channels, double empty, uint64_t seed) {
    gonio_lattice l;
    assert_int_equal(gonio_lattice_init(&l, 3, level, channels, NULL), GONIO_OK);
    for (size_t i = 0; i < l.count; i++) {
        const bool zero = simulate_uniform(&seed) < empty;
        for (size_t c = 0; c < (size_t)channels; c++) {
            l.points[i * (size_t)channels + c] = zero ? 0 : (float)(2 * simulate_uniform(&seed) - 1);
        }
    }
    return l;
}

// Nothing dropped: diffuse + sparse is diffuse + dense, in every form, at borders and corners of bricks too.
static void every_form_holds_the_lattice(void **state) {
    (void)state;
    static const double tolerance[] = {2e-6, 2e-3, 2e-2, 2e-6, 2e-6};
    for (int level = 1; level <= 5; level++) {
        for (int channels = 1; channels <= 3; channels += 2) {
            for (int storage = 0; storage < GONIO_STORAGES; storage++) {
                gonio_lattice diffuse = random_lattice(0, channels, 0, 1);
                gonio_lattice dense = random_lattice(level, channels, 0.7, (uint64_t)level + 2);
                gonio_bilevel_parts parts;
                gonio_error error = {0};
                if (gonio_bilevel_pack(&diffuse, &dense, 0, (gonio_storage)storage, &parts, &error) != GONIO_OK) {
                    fail_msg("%s", error.message);
                }
                uint64_t seed = 7;
                for (int i = 0; i < 300; i++) {
                    double x[3], expected[3];
                    float values[3] = {0};
                    for (int d = 0; d < 3; d++) {
                        const double u = simulate_uniform(&seed);
                        x[d] = i % 3 == 0 ? floor(u * 9) / 8 : u;
                    }
                    const gonio_position position = gonio_position_of(x, 3);
                    gonio_sparse_add(&parts.sparse, &position, values);
                    gonio_lattice_eval(&dense, x, expected);
                    for (int c = 0; c < channels; c++) {
                        assert_near(values[c], expected[c], tolerance[storage]);
                    }
                }
                gonio_bilevel_parts_release(&parts);
                gonio_lattice_release(&diffuse);
                gonio_lattice_release(&dense);
            }
        }
    }
}

static void the_smallest_are_dropped(void **state) {
    (void)state;
    gonio_lattice diffuse = random_lattice(0, 1, 0, 1), dense = random_lattice(3, 1, 0, 2);
    gonio_bilevel_parts parts;
    assert_int_equal(gonio_bilevel_pack(&diffuse, &dense, 90, GONIO_STORAGE_HASH, &parts, NULL), GONIO_OK);
    assert_int_equal(parts.kept, 133); // 10 % of 11^3
    float least = INFINITY;
    size_t larger = 0;
    for (size_t i = 0; i < parts.kept; i++) {
        assert_near(parts.sparse.values[i], dense.points[gonio_sparse_key(&parts.sparse, i)], 0);
        least = fminf(least, fabsf(parts.sparse.values[i]));
    }
    for (size_t i = 0; i < dense.count; i++) {
        larger += fabsf(dense.points[i]) >= least;
    }
    assert_int_equal(larger, parts.kept);
    // Table 7.1's bytes: (key + value) a kept point and the hash.
    assert_int_equal(gonio_sparse_bytes(&parts.sparse), 133 * 7 + parts.sparse.packed_length);
    gonio_bilevel_parts_release(&parts);
    // Ties are broken by index, zeros are never kept, and dropping all keeps nothing.
    for (size_t i = 0; i < dense.count; i++) {
        dense.points[i] = i % 2 ? 0.5f : 0;
    }
    assert_int_equal(gonio_bilevel_pack(&diffuse, &dense, 90, GONIO_STORAGE_HASH, &parts, NULL), GONIO_OK);
    assert_int_equal(parts.kept, 133);
    gonio_bilevel_parts_release(&parts);
    for (int storage = 0; storage < GONIO_STORAGES; storage++) {
        assert_int_equal(gonio_bilevel_pack(&diffuse, &dense, 100, (gonio_storage)storage, &parts, NULL), GONIO_OK);
        assert_int_equal(parts.kept, 0);
        const double x[3] = {0.3, 0.4, 0.5};
        const gonio_position position = gonio_position_of(x, 3);
        float value = 0;
        gonio_sparse_add(&parts.sparse, &position, &value);
        assert_near(value, 0, 0);
        gonio_bilevel_parts_release(&parts);
    }
    gonio_lattice_release(&diffuse);
    gonio_lattice_release(&dense);
}

// Kameya 2002, 7.1.2: without dropping, (D,S,0) is the fit of level S. So it is where the second fit begins at D + 1, in
// three dimensions and in four.
static void nothing_dropped_is_the_multilevel_fit(void **state) {
    (void)state;
    static const char *const specs[] = {"ward:rho_d=0.3,rho_s=0.2,alpha_x=0.2,alpha_y=0.4", WARD};
    for (int isotropic = 0; isotropic < 2; isotropic++) {
        gonio_samples *samples = simulate_samples(specs[isotropic], 500, 1, 9);
        for (int diffuse = 0; diffuse < 3; diffuse++) {
            gonio_fit_options o;
            gonio_model *dense, *both;
            gonio_fit_options_default(&o);
            o.hold_out = 0;
            o.thesis = true;
            o.level = isotropic ? 5 : 3;
            o.method = "mba";
            assert_int_equal(gonio_fit(samples, &o, &dense, NULL, NULL), GONIO_OK);
            o.method = "cbmba";
            o.diffuse_level = diffuse;
            o.drop_percent = 0;
            o.storage = diffuse == 1 && isotropic ? "hash" : "jenkins";
            assert_int_equal(gonio_fit(samples, &o, &both, NULL, NULL), GONIO_OK);
            uint64_t seed = 3;
            for (int k = 0; k < 500; k++) {
                const gonio_pair pair = simulate_pair(&seed, 0);
                double a, b;
                gonio_model_eval_pair(dense, &pair, &a);
                gonio_model_eval_pair(both, &pair, &b);
                assert_near(a, b, 2e-6);
            }
            gonio_model_free(dense);
            gonio_model_free(both);
        }
        gonio_samples_free(samples);
    }
}

static gonio_model *fit(const gonio_samples *samples, gonio_fit_options *o, gonio_fit_report *report) {
    gonio_model *model;
    gonio_error error = {0};
    o->method = "cbmba";
    if (gonio_fit(samples, o, &model, report, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return model;
}

static void the_smallest_model_keeps_the_error(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 600, 1, 3);
    gonio_fit_options o;
    gonio_fit_report loose, tight;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    o.max_error = 0.05;
    gonio_model_free(fit(samples, &o, &loose));
    assert_true(loose.train.rmse <= 0.05);
    o.max_error = 0.005;
    gonio_model_free(fit(samples, &o, &tight));
    assert_true(tight.train.rmse <= 0.005);
    assert_true(loose.bytes < tight.bytes);
    o.max_error = 1e-9;
    gonio_model *model;
    gonio_error error = {0};
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, &error), GONIO_E_CONVERGENCE);
    gonio_samples_free(samples);
}

static double unseen_rmse(const gonio_samples *samples, const gonio_samples *unseen, const char *method) {
    gonio_fit_options o;
    gonio_model *model;
    gonio_errors errors;
    gonio_fit_options_default(&o);
    o.method = method;
    o.level = 5;
    o.diffuse_level = 3;
    o.drop_percent = 98;
    o.coordinates = GONIO_NUSSELT;
    o.domain = GONIO_LINEAR;
    o.hold_out = 0;
    gonio_fit_options_for(&o, method); // without what it does not have
    assert_int_equal(gonio_fit(samples, &o, &model, NULL, NULL), GONIO_OK);
    assert_int_equal(gonio_errors_model(model, unseen, NULL, 0, &errors, NULL), GONIO_OK);
    gonio_model_free(model);
    return errors.rmse;
}

// What 98 % of the specular control points carried is not lost: bricks are corrected after the dropping.
static void bricks_keep_the_error_of_the_dense_lattice(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 10000, 1, 5), *unseen = simulate_samples(WARD, 10000, 1, 6);
    assert_true(unseen_rmse(samples, unseen, "cbmba") <= 1.005 * unseen_rmse(samples, unseen, "mba"));
    gonio_samples_free(samples);
    gonio_samples_free(unseen);
}

static void same_samples_give_the_same_bytes(void **state) {
    (void)state;
    gonio_samples *samples = simulate_samples(WARD, 1000, 1, 4);
    gonio_fit_options o;
    gonio_fit_options_default(&o);
    o.hold_out = 0;
    o.diffuse_level = 2;
    o.level = 4;
    o.drop_percent = 90;
    o.storage = "hash";
    gonio_model *a = fit(samples, &o, NULL), *b = fit(samples, &o, NULL);
    assert_int_equal(gonio_model_save(a, "/tmp/gonio_test_cbmba_a", NULL), GONIO_OK);
    assert_int_equal(gonio_model_save(b, "/tmp/gonio_test_cbmba_b", NULL), GONIO_OK);
    assert_int_equal(system("cmp -s /tmp/gonio_test_cbmba_a /tmp/gonio_test_cbmba_b"), 0);
    remove("/tmp/gonio_test_cbmba_a");
    remove("/tmp/gonio_test_cbmba_b");
    gonio_model_free(a);
    gonio_model_free(b);
    gonio_samples_free(samples);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packed_look_up_equals_libcmph),
        cmocka_unit_test(jenkins_hash_is_perfect),
        cmocka_unit_test(nothing_dropped_is_the_multilevel_fit),
        cmocka_unit_test(halves_round_to_nearest),
        cmocka_unit_test(every_form_holds_the_lattice),
        cmocka_unit_test(the_smallest_are_dropped),
        cmocka_unit_test(the_smallest_model_keeps_the_error),
        cmocka_unit_test(same_samples_give_the_same_bytes),
        cmocka_unit_test(bricks_keep_the_error_of_the_dense_lattice),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
