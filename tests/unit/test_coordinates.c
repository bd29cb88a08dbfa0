// SPDX-License-Identifier: BSD-3-Clause
// The coordinate systems: in range everywhere, the symmetries that fits rely on, values by hand.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gonio/direction.h"
#include "tests/unit/near.h"

static uint64_t seed = 42;
static double uniform(void) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(seed >> 11) * 0x1p-53;
}

// Ordinary directions, and now and then the pole or the horizon.
static gonio_vec3 any_direction(void) {
    const double kind = uniform(), phi = 2 * GONIO_PI * uniform();
    const double theta = kind < 0.05 ? 0 : kind < 0.1 ? GONIO_PI / 2 : kind < 0.15 ? 1e-9 : acos(uniform());
    gonio_vec3 v = gonio_direction(theta, phi);
    v.z = fmax(v.z, 0);
    return v;
}

static gonio_vec3 turned(gonio_vec3 v, double angle) {
    const double c = cos(angle), s = sin(angle);
    return (gonio_vec3){c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

static void always_in_the_unit_cube(void **state) {
    (void)state;
    for (int i = 0; i < 100000; i++) {
        const gonio_vec3 wi = any_direction(), wo = any_direction();
        for (int system = 0; system < GONIO_COORDINATES; system++) {
            double x[4];
            gonio_coordinates_isotropic((gonio_coordinates)system, wi, wo, x);
            for (int k = 0; k < 3; k++) {
                assert_true(x[k] >= 0 && x[k] <= 1);
            }
            gonio_coordinates_anisotropic((gonio_coordinates)system, wi, wo, x);
            for (int k = 0; k < 4; k++) {
                assert_true(x[k] >= 0 && x[k] <= 1);
            }
        }
    }
}

// Isotropic coordinates must not change when the sample turns, nor anything but their last axis when it is mirrored.
static void isotropic_symmetries(void **state) {
    (void)state;
    for (int i = 0; i < 20000; i++) {
        const gonio_vec3 wi = gonio_direction(0.01 + 1.5 * uniform(), 6 * uniform());
        const gonio_vec3 wo = gonio_direction(0.01 + 1.5 * uniform(), 6 * uniform());
        const double angle = 6 * uniform();
        const gonio_vec3 mi = {wi.x, -wi.y, wi.z}, mo = {wo.x, -wo.y, wo.z};
        for (int system = 0; system < GONIO_COORDINATES; system++) {
            const gonio_coordinates s = (gonio_coordinates)system;
            double a[3], b[3], m[3], r[3];
            gonio_coordinates_isotropic(s, wi, wo, a);
            gonio_coordinates_isotropic(s, turned(wi, angle), turned(wo, angle), b);
            gonio_coordinates_isotropic(s, mi, mo, m);
            gonio_coordinates_isotropic(s, wo, wi, r);
            const int flipped = gonio_coordinates_are_half_vector(s) ? 1 : 2;
            for (int k = 0; k < 3; k++) {
                assert_near(b[k], a[k], 1e-9);
                assert_near(m[k], k == flipped ? 1 - a[k] : a[k], 1e-9);
            }
            if (gonio_coordinates_are_half_vector(s)) {
                assert_near(r[0], 1 - a[0], 1e-9);
                assert_near(r[1], 1 - a[1], 1e-9);
                assert_near(r[2], a[2], 1e-9);
            }
        }
    }
}

static void values_by_hand(void **state) {
    (void)state;
    double x[4];
    // 30 deg in, 60 deg out at phi = 90: kappa_i = (0.5 + 1)/2; (kappa_o, lambda_o) = (0.5, (sin 60 + 1)/2).
    const gonio_vec3 wi = gonio_direction(GONIO_PI / 6, 0), wo = gonio_direction(GONIO_PI / 3, GONIO_PI / 2);
    gonio_coordinates_isotropic(GONIO_NUSSELT, wi, wo, x);
    assert_near(x[0], 0.75, 1e-15);
    assert_near(x[1], 0.5, 1e-15);
    assert_near(x[2], 0.5 + sqrt(3) / 4, 1e-15);
    gonio_coordinates_anisotropic(GONIO_NUSSELT, wi, wo, x);
    assert_near(x[1], 0.5, 1e-15);
    assert_near(x[3], 0.5 + sqrt(3) / 4, 1e-15);
    // Mirror direction: the half vector is the normal, theta_d = theta_i; the reflected offset is 0.
    const gonio_vec3 mirror = gonio_direction(GONIO_PI / 6, GONIO_PI);
    gonio_coordinates_isotropic(GONIO_HALF_VECTOR, wi, mirror, x);
    assert_near(x[0], 0.5, 1e-9);
    assert_near(x[1], 0.5, 1e-9);
    assert_near(x[2], 1.0 / 3, 1e-12);
    gonio_coordinates_isotropic(GONIO_REFLECTED, wi, mirror, x);
    assert_near(x[1], 0.5, 1e-9);
    assert_near(x[2], 0.5, 1e-9);
    // Retro-reflection at 45 deg: theta_h = 45, theta_d = 0: r = asinh(1/0.1), of at most asinh(20/0.1).
    const gonio_vec3 back = gonio_direction(GONIO_PI / 4, 1);
    gonio_coordinates_isotropic(GONIO_HALF_VECTOR, back, back, x);
    assert_near(hypot(x[0] - 0.5, x[1] - 0.5), asinh(10) / (2 * asinh(200)), 1e-12);
    assert_near(x[2], 0, 1e-8);
}

static void names_come_back(void **state) {
    (void)state;
    for (int system = 0; system < GONIO_COORDINATES; system++) {
        gonio_coordinates parsed;
        assert_true(gonio_coordinates_parse(gonio_coordinates_name((gonio_coordinates)system), &parsed));
        assert_int_equal(parsed, system);
    }
    gonio_coordinates parsed;
    assert_false(gonio_coordinates_parse("polar", &parsed));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(always_in_the_unit_cube),
        cmocka_unit_test(isotropic_symmetries),
        cmocka_unit_test(values_by_hand),
        cmocka_unit_test(names_come_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
