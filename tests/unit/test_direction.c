// SPDX-License-Identifier: BSD-3-Clause
// Directions and angles: exact at the pole and the horizon, degrees that come back.
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

static void angles_and_vectors_agree(void **state) {
    (void)state;
    const gonio_vec3 x = gonio_direction(GONIO_PI / 2, 0), y = gonio_direction(GONIO_PI / 2, GONIO_PI / 2);
    assert_near(x.x, 1, 0);
    assert_near(y.y, 1, 0);
    assert_near(gonio_direction(0, 1).z, 1, 0);
    for (double theta = 1e-12; theta < GONIO_PI / 2; theta *= 1.7) {
        for (double phi = -3.1; phi < 3.1; phi += 0.37) {
            const gonio_vec3 v = gonio_direction(theta, phi);
            assert_near(gonio_direction_theta(v), theta, 2e-15 * theta);
            assert_near(gonio_direction_phi(v), phi, 1e-15);
            assert_near(v.x * v.x + v.y * v.y + v.z * v.z, 1, 4e-16);
        }
    }
    assert_near(gonio_direction_phi((gonio_vec3){0, 0, 1}), 0, 0);
    assert_near(gonio_direction_theta((gonio_vec3){0, 0, -1}), GONIO_PI, 0);
}

static void mirroring_and_swapping_are_involutions(void **state) {
    (void)state;
    const gonio_pair p = {0.1, 0.2, 0.3, -0.4};
    const gonio_pair m = gonio_pair_mirrored(p), s = gonio_pair_swapped(p);
    assert_true(m.phi_i == -0.2 && m.phi_o == 0.4 && m.theta_i == 0.1);
    assert_true(s.theta_i == 0.3 && s.phi_i == -0.4 && s.theta_o == 0.1 && s.phi_o == 0.2);
    const gonio_pair mm = gonio_pair_mirrored(m), ss = gonio_pair_swapped(s);
    assert_memory_equal(&mm, &p, sizeof p);
    assert_memory_equal(&ss, &p, sizeof p);
}

static void degrees_come_back(void **state) {
    (void)state;
    uint64_t seed = 1;
    for (int i = 0; i < 200000; i++) {
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        const double u = (double)(seed >> 11) * 0x1p-53;
        const double deg = i % 2 == 0 ? 720 * u - 360 : round(1e4 * 90 * u) / 1e4; // any, and as people write them
        const double rad = gonio_radians(deg);
        assert_true(gonio_radians(gonio_degrees(rad)) == rad);
        // An angle from a file in radians: moved by at most an ulp, and then at rest.
        const double canonical = gonio_angle_canonical(2 * u * GONIO_PI);
        assert_near(canonical, 2 * u * GONIO_PI, 2 * 4.5e-16 * canonical);
        assert_true(gonio_angle_canonical(canonical) == canonical);
    }
    assert_true(gonio_degrees(gonio_radians(90)) == 90 && gonio_radians(180) == GONIO_PI);
    assert_true(gonio_degrees(0) == 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(angles_and_vectors_agree),
        cmocka_unit_test(mirroring_and_swapping_are_involutions),
        cmocka_unit_test(degrees_come_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
