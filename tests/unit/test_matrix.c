// SPDX-License-Identifier: BSD-3-Clause
// Products, Cholesky factors, eigenvectors and singular values, held against what defines them.
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "fit/smooth/kernels.h"
#include "fit/smooth/matrix.h"

static double uniform(uint64_t *state) {
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-52 - 1;
}

static double *filled(size_t n, uint64_t seed) {
    double *x = malloc((n + 1) * sizeof *x);
    for (size_t i = 0; i < n; i++) {
        x[i] = uniform(&seed);
    }
    return x;
}

static double at(gonio_matrix m, size_t i, size_t j) { return m.at[i * m.row_step + j * m.column_step]; }

// Sizes that fill tiles, blocks and stretches of sums and that do not, each factor stored either way.
static void test_products(void **state) {
    (void)state;
    static const size_t sizes[][3] = {{1, 1, 1},    {8, 4, 3},   {33, 5, 257}, {7, 31, 40},
                                      {40, 1, 300}, {1, 40, 12}, {3, 3, 0}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        const size_t m = sizes[s][0], n = sizes[s][1], depth = sizes[s][2];
        double *x = filled(m * depth, 1 + s), *y = filled(n * depth, 2 + s), *z = filled(m * n, 3 + s);
        for (int way = 0; way < 8; way++) {
            const gonio_matrix a =
                (way & 1) != 0 ? gonio_matrix_transposed(gonio_matrix_of(x, depth, m)) : gonio_matrix_of(x, m, depth);
            const gonio_matrix b =
                (way & 2) != 0 ? gonio_matrix_transposed(gonio_matrix_of(y, n, depth)) : gonio_matrix_of(y, depth, n);
            double *out = malloc(m * n * sizeof *out);
            memcpy(out, z, m * n * sizeof *out);
            const gonio_matrix c =
                (way & 4) != 0 ? gonio_matrix_transposed(gonio_matrix_of(out, n, m)) : gonio_matrix_of(out, m, n);
            const double beta = way % 3 == 0 ? 0 : 0.5;
            gonio_multiply(-2, a, b, beta, c);
            const gonio_matrix before = {z, m, n, c.row_step, c.column_step};
            for (size_t i = 0; i < m; i++) {
                for (size_t j = 0; j < n; j++) {
                    double sum = 0;
                    for (size_t k = 0; k < depth; k++) {
                        sum += at(a, i, k) * at(b, k, j);
                    }
                    assert_true(fabs(at(c, i, j) - (beta * at(before, i, j) - 2 * sum)) <= 1e-13 * (double)(depth + 1));
                }
            }
            free(out);
        }
        free(x);
        free(y);
        free(z);
    }
}

// Beta 0 does not read what lies there; the lower triangle alone is written.
static void test_lower_product(void **state) {
    (void)state;
    const size_t n = 45, depth = 70;
    double *x = filled(n * depth, 5), *lower = malloc(n * n * sizeof *lower), *all = malloc(n * n * sizeof *all);
    for (size_t k = 0; k < n * n; k++) {
        lower[k] = all[k] = NAN;
    }
    const gonio_matrix a = gonio_matrix_of(x, n, depth);
    gonio_multiply(1, a, gonio_matrix_transposed(a), 0, gonio_matrix_of(all, n, n));
    gonio_multiply_lower(1, a, gonio_matrix_transposed(a), 0, gonio_matrix_of(lower, n, n));
    for (size_t j = 0; j < n; j++) {
        for (size_t i = 0; i < n; i++) {
            assert_true(i < j ? isnan(lower[j * n + i]) : lower[j * n + i] == all[j * n + i]);
        }
    }
    gonio_matrix_mirror(gonio_matrix_of(lower, n, n));
    assert_memory_equal(lower, all, n * n * sizeof *all); // the sums of a symmetric product are symmetric to the bit
    double *v = filled(n, 6), *y = malloc(n * sizeof *y);
    gonio_symmetric_times(n, lower, n, v, y);
    for (size_t i = 0; i < n; i++) {
        assert_true(fabs(y[i] - gonio_dot(n, lower + i * n, v)) <= 1e-12);
    }
    free(x);
    free(lower);
    free(all);
    free(v);
    free(y);
}

static void test_cholesky(void **state) {
    (void)state;
    static const size_t sizes[] = {1, 2, 5, 31, 32, 33, 64, 100};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        const size_t n = sizes[s], bytes = n * n * sizeof(double);
        double *x = filled(n * n, 7 + s), *a = malloc(bytes), *l = malloc(bytes), *work = malloc(bytes);
        const gonio_matrix m = gonio_matrix_of(x, n, n), whole = gonio_matrix_of(a, n, n);
        gonio_multiply(1, m, gonio_matrix_transposed(m), 0, whole);
        for (size_t k = 0; k < n; k++) {
            a[k * n + k] += 1;
        }
        memcpy(l, a, bytes);
        assert_true(gonio_cholesky(n, l));
        double *solved = filled(3 * n, 8), *right = malloc(3 * n * sizeof *right);
        gonio_multiply(1, whole, gonio_matrix_of(solved, n, 3), 0, gonio_matrix_of(right, n, 3));
        gonio_cholesky_solve(n, l, gonio_matrix_of(right, n, 3));
        for (size_t k = 0; k < 3 * n; k++) {
            assert_true(fabs(right[k] - solved[k]) <= 1e-11);
        }
        gonio_cholesky_invert(n, l, work);
        gonio_matrix_mirror(gonio_matrix_of(l, n, n));
        gonio_multiply(1, whole, gonio_matrix_of(l, n, n), 0, gonio_matrix_of(work, n, n));
        for (size_t k = 0; k < n * n; k++) {
            assert_true(fabs(work[k] - (k % (n + 1) == 0)) <= 1e-11);
        }
        memcpy(l, a, bytes);
        l[(n / 2) * n + n / 2] = -1;
        assert_false(gonio_cholesky(n, l));
        free(x);
        free(a);
        free(l);
        free(work);
        free(solved);
        free(right);
    }
}

// A symmetric matrix of a kind: random; a smooth kernel, whose values fall off over 16 decades; equal values; a mixture
// of one value and few others; second differences; zero.
static double *symmetric(int kind, size_t n) {
    double *a = calloc(n * n, sizeof *a), *x = filled(n * n, 20 + (uint64_t)kind);
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j; i < n; i++) {
            const double away = (double)(i - j) / (double)n;
            a[j * n + i] = kind == 0   ? x[j * n + i]
                           : kind == 1 ? exp(-8 * away * away)
                           : kind == 2 ? 3 * (i == j)
                           : kind == 3 ? (i == j) + (j < 3 ? x[j * n + i] : 0)
                           : kind == 4 ? (i == j       ? 2
                                          : i == j + 1 ? -1
                                                       : 0)
                                       : 0;
        }
    }
    free(x);
    gonio_matrix_mirror(gonio_matrix_of(a, n, n));
    return a;
}

// A V = V D and V^T V = 1 within n eps |A|: what a backward stable method owes. At scales whose squares are no numbers
// too, and every bit follows a scale of 2^k.
static void test_eigenvectors(void **state) {
    (void)state;
    static const size_t sizes[] = {1, 2, 3, 17, 24, 25, 33, 50, 100, 259};
    for (int kind = 0; kind < 6; kind++) {
        for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
            const size_t n = sizes[s], bytes = n * n * sizeof(double);
            double *a = symmetric(kind, n), *v = malloc(bytes), *w = malloc(bytes), *work = malloc(bytes);
            double *d = malloc(n * sizeof *d), *other = malloc(n * sizeof *d);
            memcpy(v, a, bytes);
            assert_true(gonio_eigen(n, v, d));
            for (size_t k = 0; k < n * n; k++) {
                w[k] = ldexp(a[k], -600);
            }
            assert_true(gonio_eigen(n, w, other));
            assert_memory_equal(v, w, bytes);
            double norm = 0, wrong = 0, skew = 0;
            for (size_t k = 0; k < n; k++) {
                assert_true(other[k] == ldexp(d[k], -600));
                assert_true(k == 0 || d[k] >= d[k - 1]);
                norm = fmax(norm, fabs(d[k]));
            }
            gonio_multiply(1, gonio_matrix_of(a, n, n), gonio_matrix_of(v, n, n), 0, gonio_matrix_of(w, n, n));
            gonio_multiply(1, gonio_matrix_transposed(gonio_matrix_of(v, n, n)), gonio_matrix_of(v, n, n), 0,
                           gonio_matrix_of(work, n, n));
            for (size_t k = 0; k < n * n; k++) {
                wrong = fmax(wrong, fabs(w[k] - v[k] * d[k / n]));
                skew = fmax(skew, fabs(work[k] - (k % (n + 1) == 0)));
            }
            const double bound = 4 * DBL_EPSILON * (double)(n + 10);
            assert_true(wrong <= bound * norm);
            assert_true(skew <= bound);
            free(a);
            free(v);
            free(w);
            free(work);
            free(d);
            free(other);
        }
    }
}

// A = U S V^T with orthogonal U and V from eigenvectors; small values come back within eps of the largest.
static void test_singular_values(void **state) {
    (void)state;
    static const size_t sizes[] = {1, 2, 9, 40, 192};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        const size_t n = sizes[s], bytes = n * n * sizeof(double);
        double *u = symmetric(0, n), *v = symmetric(1, n), *a = malloc(bytes), *d = malloc(n * sizeof *d);
        assert_true(gonio_eigen(n, u, d));
        assert_true(gonio_eigen(n, v, d));
        for (size_t k = 0; k < n * n; k++) {
            u[k] *= k / n == 0 ? 1 : ldexp(1, -(int)(4 * (k / n)));
        }
        gonio_multiply(1, gonio_matrix_of(u, n, n), gonio_matrix_transposed(gonio_matrix_of(v, n, n)), 0,
                       gonio_matrix_of(a, n, n));
        assert_true(gonio_singular_values(n, a, d));
        for (size_t k = 0; k < n; k++) {
            assert_true(fabs(d[k] - ldexp(1, -(int)(4 * k))) <= 4 * DBL_EPSILON * (double)(n + 10));
        }
        free(u);
        free(v);
        free(a);
        free(d);
    }
}

// Every instruction set that the processor has gives the bits of the plain one.
static void test_instruction_sets_agree(void **state) {
    (void)state;
    size_t count;
    const gonio_kernels *const *all = gonio_kernels_all(&count);
    print_message("# %zu sets, the best is %s\n", count, gonio_kernels_best()->name);
    for (size_t n = 1; n < 60; n++) {
        double *x = filled(8 * n, n), *y = filled(4 * n, n + 1), sums[3][32], dots[3], outs[3][6], *z[3], *w[3];
        for (size_t k = 0; k < count; k++) {
            z[k] = filled(n, 9);
            w[k] = filled(n, 10);
            all[k]->tile(n, x, y, sums[k]);
            dots[k] = all[k]->dot(n, x, y);
            all[k]->add_scaled(n, 0.3, x, z[k]);
            all[k]->turn(n, 0.6, 0.8, z[k], w[k]);
            all[k]->four(n, x, n, y, y, z[k], outs[k]);
            all[k]->secular(n, x, y, 1.5, outs[k] + 4);
            assert_memory_equal(sums[k], sums[0], sizeof sums[0]);
            assert_memory_equal(&dots[k], &dots[0], sizeof dots[0]);
            assert_memory_equal(outs[k], outs[0], sizeof outs[0]);
            assert_memory_equal(z[k], z[0], n * sizeof **z);
            assert_memory_equal(w[k], w[0], n * sizeof **w);
        }
        for (size_t k = 0; k < count; k++) {
            free(z[k]);
            free(w[k]);
        }
        free(x);
        free(y);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_products),        cmocka_unit_test(test_lower_product),
        cmocka_unit_test(test_cholesky),        cmocka_unit_test(test_eigenvectors),
        cmocka_unit_test(test_singular_values), cmocka_unit_test(test_instruction_sets_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
