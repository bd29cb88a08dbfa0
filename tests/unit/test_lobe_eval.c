// SPDX-License-Identifier: BSD-3-Clause
// The fast evaluation of lobe-splines against the plain formula, and every way to ask against every other.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/unit/lobe_models.h"
#include "tests/unit/near.h"

#define PAIRS 83 // whole groups of four, whole batches of 16, and a rest

static gonio_pair pairs[PAIRS];
static gonio_vec3 wi[PAIRS], wo[PAIRS];

static void fill_pairs(void) {
    uint64_t seed = 5;
    for (int k = 0; k < PAIRS; k++) {
        pairs[k] = lobe_random_pair(k, &seed);
        wi[k] = gonio_direction(pairs[k].theta_i, pairs[k].phi_i);
        wo[k] = gonio_direction(pairs[k].theta_o, pairs[k].phi_o);
    }
}

// A position is rounded to 2^-32, once in 10^6 the other way: where a lattice of steep control points then moves the
// logarithm by 1e-8.
static void follows_the_formula(const lobe_make *make, const gonio_model *model) {
    const gonio_lobe_spline_parts *p = gonio_lobe_spline_about(model);
    double values[64];
    for (int k = 0; k < PAIRS; k++) {
        gonio_model_eval(model, wi[k], wo[k], values);
        for (int c = 0; c < make->channels; c++) {
            const double plain = lobe_plain_value(p, wi[k], wo[k], c);
            // Of a linear or signed quantity, the terms may cancel.
            const double unit = make->kind == GONIO_TRANSFORM_POSITIVE ? 0 : p->transforms[c].scale * (1 + make->rough);
            assert_near(values[c], plain, 1e-11 * (1 + make->rough) * (fabs(plain) + unit));
        }
    }
}

static void test_follows_the_formula(void **state) {
    (void)state;
    lobe_for_each_model(follows_the_formula);
}

static void asked_any_way(const lobe_make *make, const gonio_model *model) {
    static const size_t splits[] = {PAIRS, 1, 3, 4, 5, 16, 17, 50};
    const size_t c = (size_t)make->channels;
    double *one = lobe_allocated(PAIRS * c, sizeof *one), *many = lobe_allocated(PAIRS * c, sizeof *many);
    float narrow[64];
    for (size_t k = 0; k < PAIRS; k++) {
        gonio_model_eval(model, wi[k], wo[k], one + k * c);
        gonio_model_eval_f32(model, wi[k], wo[k], narrow);
        for (size_t j = 0; j < c; j++) {
            const double value = one[k * c + j], alone = gonio_model_eval_channel(model, wi[k], wo[k], (int)j);
            const float rounded = (float)value;
            assert_memory_equal(&value, &alone, sizeof value);
            assert_memory_equal(&rounded, &narrow[j], sizeof rounded);
        }
    }
    for (size_t s = 0; s < sizeof splits / sizeof *splits; s++) {
        memset(many, 0, PAIRS * c * sizeof *many);
        for (size_t k = 0; k < PAIRS; k += splits[s]) {
            const size_t n = PAIRS - k < splits[s] ? PAIRS - k : splits[s];
            gonio_model_eval_many(model, n, wi + k, wo + k, many + k * c);
        }
        assert_memory_equal(one, many, PAIRS * c * sizeof *one);
    }
    free(one);
    free(many);
}

static void test_any_way_of_asking_gives_the_same_bits(void **state) {
    (void)state;
    lobe_for_each_model(asked_any_way);
}

static double moved(const gonio_model *model, gonio_pair p, int angle, double by, int channel) {
    double *angles[4] = {&p.theta_i, &p.phi_i, &p.theta_o, &p.phi_o};
    *angles[angle] += by;
    return gonio_model_eval_channel(model, gonio_direction(p.theta_i, p.phi_i), gonio_direction(p.theta_o, p.phi_o),
                                    channel);
}

static int compared, skipped;

// Differences of two step widths that disagree sit on a kink (a bound, the shadow term), where there is no gradient.
static void follows_the_differences(const lobe_make *make, const gonio_model *model) {
    for (int k = 0; k < PAIRS && make->rough < 10; k++) {
        const int channel = k % make->channels;
        double gradient[4];
        const gonio_pair *p = &pairs[k];
        gonio_model_gradient(model, p, channel, gradient);
        for (int a = 0; a < 4; a++) {
            const double theta = a == 0 ? p->theta_i : p->theta_o, step = 1e-4;
            assert_true(isfinite(gradient[a]));
            // Beyond the horizon there is no model; at the normal and in retro-reflection azimuths are undefined.
            if ((a % 2 == 0 && (theta < 2 * step || theta > GONIO_PI / 2 - 2 * step)) || p->theta_i < 2 * step ||
                (p->theta_i == p->theta_o && p->phi_i == p->phi_o)) {
                continue;
            }
            const double wide =
                (moved(model, *p, a, 2 * step, channel) - moved(model, *p, a, -2 * step, channel)) / (4 * step);
            const double close =
                (moved(model, *p, a, step, channel) - moved(model, *p, a, -step, channel)) / (2 * step);
            const double size = fabs(moved(model, *p, a, 0, channel)) + fabs(close);
            if (fabs(wide - close) > 1e-3 * size) {
                skipped++;
                continue;
            }
            compared++;
            // The error of second order cancels; left is the rounding of positions to 2^-32, over the step.
            assert_near(gradient[a], (4 * close - wide) / 3, 5e-4 * size);
        }
    }
}

static void test_gradient_is_exact(void **state) {
    (void)state;
    lobe_for_each_model(follows_the_differences);
    print_message("# %d derivatives compared, %d at kinks\n", compared, skipped);
    assert_true(compared > 50000 && skipped < compared / 20);
}

// sigma = df/dt sigma_t, with df/dt by differences: of a lattice moved by a constant.
static void test_sigma_is_the_slope(void **state) {
    (void)state;
    uint64_t seed = 9;
    for (int lobes = 0; lobes < 3; lobes++) {
        const lobe_make make = {.channels = 31,
                                .dims = 3,
                                .lobes = lobes,
                                .coordinates = GONIO_HALF_VECTOR,
                                .kind = GONIO_TRANSFORM_POSITIVE,
                                .lattice = true,
                                .rough = 0.1};
        gonio_model *model = lobe_random_model(&make, &seed);
        const gonio_lobe_spline_parts *p = gonio_lobe_spline_about(model);
        for (int k = 0; k < PAIRS; k++) {
            double sigma[31], x[4], ln_sigma, low[31], high[31];
            assert_true(gonio_model_sigma(model, wi[k], wo[k], sigma));
            gonio_coordinates_isotropic(GONIO_HALF_VECTOR, wi[k], wo[k], x);
            gonio_lattice_eval(&p->sigma, x, &ln_sigma);
            for (int side = -1; side < 2; side += 2) {
                for (size_t i = 0; i < p->lattice.count * 31; i++) {
                    p->lattice.points[i] += (float)side * 0x1p-10F;
                }
                gonio_model_eval(model, wi[k], wo[k], side < 0 ? low : high);
                for (size_t i = 0; i < p->lattice.count * 31; i++) {
                    p->lattice.points[i] -= (float)side * 0x1p-10F;
                }
            }
            for (int c = 0; c < 31; c++) {
                const double slope = (high[c] - low[c]) * 0x1p9, expected = slope * fmin(exp(ln_sigma) * 0.05, 2);
                // Where the answer is held by its ceiling it does not move, and sigma is the transform's all the same.
                if (slope > 0.9 * high[c] || lobes == 0) {
                    assert_near(sigma[c], expected, 2e-3 * expected);
                }
            }
        }
        gonio_model_free(model);
    }
}

int main(void) {
    fill_pairs();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_follows_the_formula),
        cmocka_unit_test(test_any_way_of_asking_gives_the_same_bits),
        cmocka_unit_test(test_gradient_is_exact),
        cmocka_unit_test(test_sigma_is_the_slope),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
