// SPDX-License-Identifier: BSD-3-Clause
// Lattices: what refinement, evaluation and gradient must satisfy whatever the control points are.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "brdf/spline/lattice.h"
#include "brdf/spline/lattice_eval.h"
#include "tests/simulate.h"
#include "tests/unit/near.h"

static gonio_lattice random_lattice(int dims, int level, int channels, uint64_t seed) {
    gonio_lattice lattice;
    assert_int_equal(gonio_lattice_init(&lattice, dims, level, channels, NULL), GONIO_OK);
    for (size_t i = 0; i < lattice.count * (size_t)channels; i++) {
        lattice.points[i] = (float)(2 * simulate_uniform(&seed) - 1);
    }
    return lattice;
}

// Interior, borders, corners and one ulp around them.
static void random_x(uint64_t *seed, double x[4]) {
    static const double special[] = {0, 1, 0.5, 0x1p-60, 1 - 0x1p-53, 0.25, 0.75, 1.0 / 3};
    for (int d = 0; d < 4; d++) {
        const double u = simulate_uniform(seed);
        x[d] = simulate_uniform(seed) < 0.3 ? special[(size_t)(u * 8)] : u;
    }
}

static void basis_is_a_partition_of_unity(void **state) {
    (void)state;
    for (double t = 0; t <= 1; t += 1.0 / 64) {
        double w[4], slopes[4];
        gonio_bspline_weights(t, w);
        gonio_bspline_slopes(t, slopes);
        assert_near(w[0] + w[1] + w[2] + w[3], 1, 1e-15);
        assert_near(slopes[0] + slopes[1] + slopes[2] + slopes[3], 0, 1e-15);
        // Linear precision: a spline through the integers is the identity.
        assert_near(-w[0] + w[2] + 2 * w[3], t, 1e-15);
        assert_true(w[0] >= 0 && w[1] >= 0 && w[2] >= 0 && w[3] >= 0);
    }
}

static void positions_reach_the_right_cell(void **state) {
    (void)state;
    assert_int_equal(gonio_bspline_fix(-0.1), 0);
    assert_int_equal(gonio_bspline_fix(NAN), 0);
    assert_int_equal(gonio_bspline_fix(1), UINT32_MAX);
    assert_int_equal(gonio_bspline_fix(INFINITY), UINT32_MAX);
    for (int level = 0; level <= 9; level++) {
        assert_int_equal(gonio_bspline_cell(UINT32_MAX, level), (1 << level) - 1);
        assert_int_equal(gonio_bspline_cell(0, level), 0);
        const uint32_t fixed = gonio_bspline_fix(1.0 / 3);
        const double scaled = ldexp(1.0 / 3, level);
        assert_near(gonio_bspline_cell(fixed, level) + gonio_bspline_place(fixed, level), scaled, 1e-6);
    }
}

static void refinement_keeps_the_function(void **state) {
    (void)state;
    for (int dims = 3; dims <= 4; dims++) {
        gonio_lattice coarse = random_lattice(dims, 2, 2, 5), fine = random_lattice(dims, 2, 2, 5);
        assert_int_equal(gonio_lattice_refine(&fine, NULL), GONIO_OK);
        assert_int_equal(gonio_lattice_refine(&fine, NULL), GONIO_OK);
        assert_int_equal(fine.level, 4);
        uint64_t seed = 11;
        for (int i = 0; i < 500; i++) {
            double x[4], a[2], b[2];
            random_x(&seed, x);
            gonio_lattice_eval(&coarse, x, a);
            gonio_lattice_eval(&fine, x, b);
            assert_near(a[0], b[0], 1e-6);
            assert_near(a[1], b[1], 1e-6);
        }
        gonio_lattice_release(&coarse);
        gonio_lattice_release(&fine);
    }
}

static void fast_evaluation_equals_the_plain_one(void **state) {
    (void)state;
    static const int channels[] = {1, 2, 3, 4, 5, 7, 16, 31};
    uint64_t seed = 3;
    for (int dims = 3; dims <= 4; dims++) {
        for (size_t k = 0; k < sizeof channels / sizeof *channels; k++) {
            gonio_lattice l = random_lattice(dims, 3, channels[k], 7 + k);
            gonio_position positions[50];
            double x[50][4], expected[31];
            float values[50 * 31];
            for (int i = 0; i < 50; i++) {
                random_x(&seed, x[i]);
                positions[i] = gonio_position_of(x[i], dims);
            }
            gonio_lattice_eval_positions(&l, 50, positions, values);
            for (int i = 0; i < 50; i++) {
                gonio_lattice_eval(&l, x[i], expected);
                for (int c = 0; c < channels[k]; c++) {
                    assert_near(values[i * channels[k] + c], expected[c], 2e-6);
                }
            }
            gonio_lattice_release(&l);
        }
    }
}

static void gradient_is_the_slope(void **state) {
    (void)state;
    const double step = 1e-6;
    for (int dims = 3; dims <= 4; dims++) {
        gonio_lattice l = random_lattice(dims, 4, 1, 9);
        uint64_t seed = 21;
        for (int i = 0; i < 200; i++) {
            double x[4], slope[4], low, high;
            for (int d = 0; d < 4; d++) {
                x[d] = 0.01 + 0.98 * simulate_uniform(&seed);
            }
            gonio_lattice_gradient(&l, x, 0, slope);
            for (int d = 0; d < dims; d++) {
                const double at = x[d];
                x[d] = at - step;
                gonio_lattice_eval(&l, x, &low);
                x[d] = at + step;
                gonio_lattice_eval(&l, x, &high);
                x[d] = at;
                // Positions have 32 bits: 2.3e-10 / 2e-6 of a slope up to 16 cells.
                assert_near((high - low) / (2 * step), slope[d], 5e-3);
            }
        }
        gonio_lattice_release(&l);
    }
}

static void impossible_lattices_are_refused(void **state) {
    (void)state;
    gonio_lattice l;
    gonio_error error = {0};
    assert_int_equal(gonio_lattice_init(&l, 1, 3, 1, &error), GONIO_E_RANGE);
    assert_int_equal(gonio_lattice_init(&l, 3, 10, 1, &error), GONIO_E_RANGE);
    assert_int_equal(gonio_lattice_init(&l, 3, -1, 1, &error), GONIO_E_RANGE);
    assert_int_equal(gonio_lattice_init(&l, 3, 1, 0, &error), GONIO_E_RANGE);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(basis_is_a_partition_of_unity), cmocka_unit_test(positions_reach_the_right_cell),
        cmocka_unit_test(refinement_keeps_the_function), cmocka_unit_test(fast_evaluation_equals_the_plain_one),
        cmocka_unit_test(gradient_is_the_slope),         cmocka_unit_test(impossible_lattices_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
