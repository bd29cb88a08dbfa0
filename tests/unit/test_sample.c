// SPDX-License-Identifier: BSD-3-Clause
// Sample sets and their splits.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/sample.h"
#include "tests/unit/near.h"

static uint64_t seed = 7;
static double uniform(void) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(seed >> 11) * 0x1p-53;
}

static gonio_samples *make(int channels, bool sigma) {
    gonio_samples *s;
    assert_int_equal(gonio_samples_new(channels, sigma, &s, NULL), GONIO_OK);
    for (int c = 0; c < channels; c++) {
        snprintf(s->channel_names[c], 32, "c%d", c);
    }
    return s;
}

static void add(gonio_samples *s, gonio_pair p, double value) {
    double v[4], r[4], y[4];
    for (int c = 0; c < s->channels; c++) {
        v[c] = value + c;
        r[c] = 3 * (c + 1);
        y[c] = 4 * (c + 1);
    }
    assert_int_equal(gonio_samples_add(s, &p, v, r, y, NULL), GONIO_OK);
}

// Every way from one set to another takes the groups along.
static void groups_stay_with_their_samples(void **state) {
    (void)state;
    gonio_samples *s = make(2, true), *part, *channel;
    bool keep[200];
    for (int i = 0; i < 200; i++) { // past several reserves
        add(s, (gonio_pair){0.001 * i, 0, 0.002 * i, 0}, i);
        if (i == 50) {
            assert_int_equal(gonio_samples_set_group(s, 50, 2, NULL), GONIO_OK);
        } else if (i == 150) {
            assert_int_equal(gonio_samples_set_group(s, 150, 3, NULL), GONIO_OK);
        }
        keep[i] = i % 7 == 3;
    }
    assert_int_equal(gonio_samples_select(s, keep, &part, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_channel(s, 1, &channel, NULL), GONIO_OK);
    for (size_t i = 0, k = 0; i < 200; i++) {
        const uint16_t group = i < 50 ? 1 : i < 150 ? 2 : 3;
        assert_int_equal(s->group[i], group);
        assert_int_equal(channel->group[i], group);
        if (keep[i]) {
            assert_int_equal(part->group[k++], group);
        }
    }
    gonio_samples_free(s);
    gonio_samples_free(part);
    gonio_samples_free(channel);
}

static gonio_pair degrees(double ti, double pi, double to, double po) {
    return (gonio_pair){gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
}

// Every half's directions in front of the surface and back, with the digits of their degrees.
static void halves_are_mirrored(void **state) {
    (void)state;
    static const double thetas[] = {0, 0.1, 17, 29.9, 30, 60, 89.99};
    for (int h = 0; h < GONIO_HALVES; h++) {
        for (size_t k = 0; k < sizeof thetas / sizeof *thetas; k++) {
            const gonio_pair front = degrees(thetas[k], 20, thetas[6 - k], -170);
            const gonio_pair lowered = gonio_pair_lowered(front, (gonio_half)h);
            assert_int_equal(gonio_pair_half(lowered), h);
            assert_int_equal(gonio_half_of(gonio_direction(lowered.theta_i, lowered.phi_i),
                                           gonio_direction(lowered.theta_o, lowered.phi_o)),
                             h);
            const gonio_pair raised = gonio_pair_raised(lowered);
            assert_memory_equal(&raised, &front, sizeof front);
        }
    }
    assert_int_equal(gonio_pair_half(degrees(90, 0, 90, 0)), GONIO_REFLECTION);
    assert_string_equal(gonio_half_name(GONIO_TRANSMISSION_BACK), "transmission-back");
}

// A sample at the horizon goes with the reflection, or with what else there is.
static void halves_of_a_set(void **state) {
    (void)state;
    for (int with = 0; with < 2; with++) {
        gonio_samples *s = make(2, true), *half;
        bool which[4];
        add(s, degrees(30, 0, 90, 0), 1);
        add(s, degrees(30, 0, 150, 90), 2);
        if (with) {
            add(s, degrees(30, 0, 80, 90), 3);
        }
        assert_int_equal(gonio_samples_halves(s), 1);
        assert_int_equal(gonio_samples_check(s, NULL), GONIO_E_INPUT);
        s->transmission = true;
        assert_int_equal(gonio_samples_check(s, NULL), GONIO_OK);
        assert_int_equal(gonio_samples_halves(s), with ? 3 : 2);
        assert_int_equal(gonio_samples_half(s, GONIO_TRANSMISSION, which, &half, NULL), GONIO_OK);
        assert_false(half->transmission);
        assert_int_equal(half->n, with ? 1 : 2);
        assert_int_equal(which[0], !with);
        assert_true(which[1]);
        assert_near(gonio_degrees(half->pairs[half->n - 1].theta_o), 30, 0);
        assert_near(half->values[2 * (half->n - 1)], 2, 0);
        gonio_samples_free(half);
        assert_int_equal(gonio_samples_half(s, GONIO_REFLECTION_BACK, NULL, &half, NULL), GONIO_OK);
        assert_int_equal(half->n, 0);
        gonio_samples_free(half);
        s->pairs[0].theta_i = GONIO_PI + 1e-8;
        assert_int_equal(gonio_samples_check(s, NULL), GONIO_E_INPUT);
        gonio_samples_free(s);
    }
}

static void unusable_samples_are_named(void **state) {
    (void)state;
    const double right = GONIO_PI / 2;
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    gonio_error error = {0};
    gonio_samples *s = make(2, false);
    assert_int_equal(gonio_samples_check(s, &error), GONIO_E_INPUT); // there is none
    add(s, (gonio_pair){0, 0, right, 1e9}, 1);
    add(s, (gonio_pair){right + 5e-10, 0, -5e-10, 0}, 1); // rounding of a right angle
    assert_int_equal(gonio_samples_check(s, &error), GONIO_OK);
    add(s, (gonio_pair){0, 0, 0, 0}, 1);
    for (int k = 0; k < 3; k++) {
        for (int a = 0; a < 4; a++) {
            double angles[4] = {0};
            angles[a] = bad[k];
            s->pairs[2] = (gonio_pair){angles[0], angles[1], angles[2], angles[3]};
            assert_int_equal(gonio_samples_check(s, &error), GONIO_E_INPUT);
            assert_non_null(strstr(error.message, "sample 3"));
        }
        s->pairs[2] = (gonio_pair){0, 0, 0, 0};
        s->values[5] = bad[k];
        assert_int_equal(gonio_samples_check(s, &error), GONIO_E_INPUT);
        assert_non_null(strstr(error.message, "sample 3, channel c1"));
        s->values[5] = 0;
    }
    s->pairs[2].theta_o = right + 2e-9;
    assert_int_equal(gonio_samples_check(s, &error), GONIO_E_INPUT);
    s->pairs[2].theta_o = -2e-9;
    assert_int_equal(gonio_samples_check(s, &error), GONIO_E_INPUT);
    gonio_samples_free(s);
}

static void what_is_added_is_there(void **state) {
    (void)state;
    gonio_samples *s = make(3, true);
    for (int i = 0; i < 1000; i++) {
        add(s, (gonio_pair){i, 0, 0, 0}, i);
    }
    assert_int_equal(s->n, 1000);
    assert_near(s->values[3 * 999 + 2], 1001, 0);
    assert_near(gonio_samples_sigma(s, 999, 1), 10, 1e-15); // hypot(6, 8)
    bool keep[1000] = {false};
    keep[3] = keep[500] = true;
    gonio_samples *few, *one;
    assert_int_equal(gonio_samples_select(s, keep, &few, NULL), GONIO_OK);
    assert_int_equal(few->n, 2);
    assert_true(few->pairs[1].theta_i == 500 && few->values[3] == 500 && few->sigma_systematic[5] == 12);
    assert_int_equal(gonio_samples_channel(few, 2, &one, NULL), GONIO_OK);
    assert_true(one->channels == 1 && one->values[1] == 502 && one->sigma_random[0] == 9);
    assert_string_equal(one->channel_names[0], "c2");
    gonio_samples_free(one);
    gonio_error error = {0};
    assert_int_equal(gonio_samples_channel(few, 3, &one, &error), GONIO_E_RANGE);
    assert_null(one);
    gonio_samples_free(few);
    gonio_samples_free(s);
    s = make(1, false);
    add(s, (gonio_pair){0}, 1);
    assert_null(s->sigma_random);
    assert_near(gonio_samples_sigma(s, 0, 0), 0, 0);
    gonio_samples_free(s);
    gonio_samples_free(NULL);
}

static void impossible_sets(void **state) {
    (void)state;
    gonio_samples *s;
    gonio_error error = {0};
    assert_int_equal(gonio_samples_new(0, false, &s, &error), GONIO_E_RANGE);
    assert_int_equal(gonio_samples_new(GONIO_CHANNELS_MAX + 1, false, &s, &error), GONIO_E_RANGE);
    s = make(3, true);
    assert_int_equal(gonio_samples_reserve(s, SIZE_MAX / 8, &error), GONIO_E_MEMORY);
    add(s, (gonio_pair){0}, 1); // still sound
    gonio_samples_free(s);
}

static void folds_keep_equal_geometries_together(void **state) {
    (void)state;
    gonio_samples *s = make(1, false);
    for (int i = 0; i < 500; i++) {
        const gonio_pair p = {1.5 * uniform(), 3 * uniform(), 1.5 * uniform(), 6 * uniform() - 3};
        gonio_pair turned = p;
        turned.phi_i += 1;
        turned.phi_o += 1;
        add(s, p, 1);
        add(s, p, 2);
        add(s, gonio_pair_mirrored(p), 3);
        add(s, turned, 4); // the same geometry of an isotropic sample
    }
    int fold[2000], count[5] = {0};
    assert_int_equal(gonio_samples_folds(s, 5, 1, fold, NULL), GONIO_OK);
    for (int i = 0; i < 2000; i++) {
        assert_in_range(fold[i], 0, 4);
        assert_int_equal(fold[i], fold[i / 4 * 4]);
        count[fold[i]]++;
    }
    for (int k = 0; k < 5; k++) {
        assert_int_equal(count[k], 400); // 100 geometries each
    }
    // Anisotropic: turning makes another geometry, mirroring still does not.
    s->isotropic = false;
    assert_int_equal(gonio_samples_folds(s, 5, 1, fold, NULL), GONIO_OK);
    int apart = 0;
    for (int i = 0; i < 2000; i += 4) {
        assert_true(fold[i] == fold[i + 1] && fold[i] == fold[i + 2]);
        apart += fold[i] != fold[i + 3];
    }
    assert_in_range(apart, 300, 490); // 4/5 of 500 are expected to differ
    gonio_samples_free(s);
}

static void a_split_ignores_order_and_follows_the_seed(void **state) {
    (void)state;
    enum { N = 300 };
    gonio_samples *a = make(1, false), *b = make(1, false);
    gonio_pair p[N];
    for (int i = 0; i < N; i++) {
        p[i] = (gonio_pair){1.5 * uniform(), 0, 1.5 * uniform(), 3 * uniform()};
        add(a, p[i], i);
    }
    for (int i = N; i-- > 0;) {
        add(b, p[i], i);
    }
    bool held_a[N], held_b[N], other[N];
    assert_int_equal(gonio_samples_hold_out(a, 0.2, 1, held_a, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_hold_out(b, 0.2, 1, held_b, NULL), GONIO_OK);
    assert_int_equal(gonio_samples_hold_out(a, 0.2, 2, other, NULL), GONIO_OK);
    int held = 0, differ = 0;
    for (int i = 0; i < N; i++) {
        assert_int_equal(held_a[i], held_b[N - 1 - i]);
        held += held_a[i];
        differ += held_a[i] != other[i];
    }
    assert_int_equal(held, 60);
    assert_true(differ > 30);
    gonio_error error = {0};
    assert_int_equal(gonio_samples_hold_out(a, 1, 1, held_a, &error), GONIO_E_USAGE);
    assert_int_equal(gonio_samples_hold_out(a, -0.1, 1, held_a, &error), GONIO_E_USAGE);
    assert_int_equal(gonio_samples_hold_out(a, NAN, 1, held_a, &error), GONIO_E_USAGE);
    int fold[N];
    assert_int_equal(gonio_samples_folds(a, 1, 1, fold, &error), GONIO_E_USAGE);
    gonio_samples_free(a);
    gonio_samples_free(b);
}

// At the pole an azimuth means nothing: the same geometry.
static void the_pole_has_no_azimuth(void **state) {
    (void)state;
    gonio_samples *s = make(1, false);
    for (int i = 0; i < 10; i++) {
        add(s, (gonio_pair){0, i, 0.5, 2 * i}, 1);
        add(s, (gonio_pair){0.5, i, 0, 3 * i}, 1);
    }
    int fold[20];
    assert_int_equal(gonio_samples_folds(s, 2, 1, fold, NULL), GONIO_OK);
    for (int i = 2; i < 20; i++) {
        assert_int_equal(fold[i], fold[i % 2]);
    }
    gonio_samples_free(s);
}

static void names_tell_wavelengths(void **state) {
    (void)state;
    static const struct {
        const char *name;
        double nm; // 0: none
    } known[] = {{"550nm", 550}, {"550.5nm", 550.5}, {"1000000nm", 1e6}, {".5nm", 0.5},  {"r", 0},
                 {"", 0},        {"nm", 0},          {"0nm", 0},         {"-5nm", 0},    {"+5nm", 0},
                 {" 5nm", 0},    {"5 nm", 0},        {"550", 0},         {"550nmx", 0},  {"0x10nm", 0},
                 {"infnm", 0},   {"1e3nm", 0},       {"5.5.5nm", 0},     {"550,5nm", 0}, {".nm", 0}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        const double nm = gonio_channel_wavelength_nm(known[k].name);
        if (known[k].nm > 0 ? nm != known[k].nm : !isnan(nm)) {
            fail_msg("'%s' gives %g", known[k].name, nm);
        }
    }
    gonio_samples *s = make(2, false);
    strcpy(s->channel_names[1], "650.25nm");
    assert_true(gonio_samples_wavelength_nm(s, 1) == 650.25);
    assert_true(isnan(gonio_samples_wavelength_nm(s, 0)));
    gonio_samples_free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_tell_wavelengths),
        cmocka_unit_test(what_is_added_is_there),
        cmocka_unit_test(groups_stay_with_their_samples),
        cmocka_unit_test(unusable_samples_are_named),
        cmocka_unit_test(halves_are_mirrored),
        cmocka_unit_test(halves_of_a_set),
        cmocka_unit_test(impossible_sets),
        cmocka_unit_test(folds_keep_equal_geometries_together),
        cmocka_unit_test(a_split_ignores_order_and_follows_the_seed),
        cmocka_unit_test(the_pole_has_no_azimuth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
