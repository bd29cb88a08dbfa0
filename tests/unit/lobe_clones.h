// SPDX-License-Identifier: BSD-3-Clause
// One clone of the lobe-spline's kernels, compiled for GONIO_TEST_TARGET, against those of the library (under
// sanitizers, which allow no dispatch, the plain ones; otherwise what the loader picked): the same bits.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "brdf/kind/lobe_spline_model.h"
#include "brdf/spline/rows.h"
#include "brdf/spline/rows_double.h"
#include "tests/unit/lobe_models.h"

#if defined(__x86_64__)

#undef GONIO_CLONES
#define GONIO_CLONES
#ifndef GONIO_TEST_WIDE
#undef GONIO_WIDE
#endif
#define gonio_lattice_eval_double clone_lattice_eval_double
#define gonio_lobe_spline_eval clone_eval
#define gonio_lobe_spline_eval_many clone_eval_many
#define gonio_lobe_spline_sigma_shape clone_sigma_shape
#define gonio_lobe_spline_support clone_support
void clone_lattice_eval_double(const gonio_lattice *lattice, const gonio_position *position, size_t first, size_t count,
                               double *values);
void clone_eval(const gonio_lobe_spline *m, const gonio_vec3 *wi, const gonio_vec3 *wo, size_t first, size_t count,
                double *values, float *narrow, double *slopes);
void clone_eval_many(const gonio_lobe_spline *m, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo, double *values);
double clone_sigma_shape(const gonio_lobe_spline *m, const gonio_vec3 *wi, const gonio_vec3 *wo);
double clone_support(const gonio_lobe_spline *m, const gonio_vec3 *wi,
                     const gonio_vec3 *wo); // by the same lattice walk

// GCC expands no macros in a written #pragma.
#define PRAGMA_OF(text) _Pragma(#text)
#define TARGET_PRAGMA(text) PRAGMA_OF(text)
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target(GONIO_TEST_TARGET))), apply_to = function)
#else
#pragma GCC push_options
TARGET_PRAGMA(GCC target(GONIO_TEST_TARGET))
#endif
#include "brdf/kind/lobe_spline_eval.c"
#include "brdf/spline/rows_double.c"
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#undef gonio_lobe_spline_eval
#undef gonio_lobe_spline_eval_many
#undef gonio_lobe_spline_sigma_shape
#undef gonio_lobe_spline_support

#define PAIRS 37

static void compare(const lobe_make *make, const gonio_model *model) {
    const gonio_lobe_spline *m = (const gonio_lobe_spline *)model;
    const size_t c = (size_t)make->channels;
    gonio_vec3 wi[PAIRS], wo[PAIRS];
    double *here = lobe_allocated(PAIRS * c, sizeof *here), *there = lobe_allocated(PAIRS * c, sizeof *there);
    uint64_t seed = 3;
    for (int k = 0; k < PAIRS; k++) {
        const gonio_pair p = lobe_random_pair(k, &seed);
        wi[k] = gonio_direction(p.theta_i, p.phi_i);
        wo[k] = gonio_direction(p.theta_o, p.phi_o);
        double a[64], b[64];
        gonio_model_eval(model, wi[k], wo[k], a);
        clone_eval(m, &wi[k], &wo[k], 0, c, b, NULL, NULL);
        assert_memory_equal(a, b, c * sizeof *a);
        a[0] = gonio_lobe_spline_sigma_shape(m, &wi[k], &wo[k]);
        b[0] = clone_sigma_shape(m, &wi[k], &wo[k]);
        assert_memory_equal(a, b, sizeof *a);
    }
    gonio_model_eval_many(model, PAIRS, wi, wo, there);
    clone_eval_many(m, PAIRS, wi, wo, here);
    assert_memory_equal(here, there, PAIRS * c * sizeof *here);
    free(here);
    free(there);
}

static void test_clone_gives_the_same_bits(void **state) {
    (void)state;
    if (!__builtin_cpu_supports(GONIO_TEST_TARGET)) {
        print_message("no %s here\n", GONIO_TEST_TARGET);
        skip();
    }
    lobe_for_each_model(compare);
}

#else

static void test_clone_gives_the_same_bits(void **state) {
    (void)state;
    skip(); // one clone only
}

#endif

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_clone_gives_the_same_bits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
