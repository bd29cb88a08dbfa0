// SPDX-License-Identifier: BSD-3-Clause
// Cholesky factors (fit/smooth/matrix.h), in blocks of columns so that nearly all work is in products of matrices.
#include <math.h>
#include <string.h>

#include "fit/smooth/matrix.h"

#define BLOCK ((size_t)32)

static size_t block_at(size_t n, size_t k) { return n - k < BLOCK ? n - k : BLOCK; }

bool gonio_cholesky(size_t n, double *a) {
    const gonio_matrix m = gonio_matrix_of(a, n, n);
    for (size_t k = 0; k < n; k += BLOCK) {
        const size_t b = block_at(n, k);
        if (k > 0) { // what the columns before take from these
            const gonio_matrix top = gonio_matrix_part(m, k, 0, b, k);
            gonio_multiply_lower(-1, top, gonio_matrix_transposed(top), 1, gonio_matrix_part(m, k, k, b, b));
            gonio_multiply(-1, gonio_matrix_part(m, k + b, 0, n - k - b, k), gonio_matrix_transposed(top), 1,
                           gonio_matrix_part(m, k + b, k, n - k - b, b));
        }
        for (size_t j = k; j < k + b; j++) {
            double *column = a + j * n;
            for (size_t i = k; i < j; i++) {
                gonio_add_scaled(n - j, -a[i * n + j], a + i * n + j, column + j);
            }
            if (!(column[j] > 0)) {
                return false;
            }
            const double root = sqrt(column[j]);
            for (size_t i = j; i < n; i++) {
                column[i] /= root;
            }
        }
    }
    return true;
}

// x = L^-1 x; rows of x below `first` alone are other than zero.
static void solve_lower(size_t n, const double *l, size_t first, gonio_matrix x) {
    const gonio_matrix m = gonio_matrix_of(l, n, n);
    for (size_t k = first; k < n; k += BLOCK) {
        const size_t b = block_at(n, k);
        for (size_t c = 0; c < x.columns; c++) {
            double *v = x.at + c * x.column_step;
            for (size_t j = k; j < k + b; j++) {
                v[j] /= l[j * n + j];
                for (size_t i = j + 1; i < k + b; i++) {
                    v[i] -= v[j] * l[j * n + i];
                }
            }
        }
        gonio_multiply(-1, gonio_matrix_part(m, k + b, k, n - k - b, b), gonio_matrix_part(x, k, 0, b, x.columns), 1,
                       gonio_matrix_part(x, k + b, 0, n - k - b, x.columns));
    }
}

// x = L^-T x.
static void solve_upper(size_t n, const double *l, gonio_matrix x) {
    const gonio_matrix m = gonio_matrix_of(l, n, n);
    for (size_t k = (n - 1) / BLOCK * BLOCK + BLOCK; k > 0;) {
        k -= BLOCK;
        const size_t b = block_at(n, k);
        gonio_multiply(-1, gonio_matrix_transposed(gonio_matrix_part(m, k + b, k, n - k - b, b)),
                       gonio_matrix_part(x, k + b, 0, n - k - b, x.columns), 1,
                       gonio_matrix_part(x, k, 0, b, x.columns));
        for (size_t c = 0; c < x.columns; c++) {
            double *v = x.at + c * x.column_step;
            for (size_t j = k + b; j-- > k;) {
                for (size_t i = j + 1; i < k + b; i++) {
                    v[j] -= v[i] * l[j * n + i];
                }
                v[j] /= l[j * n + j];
            }
        }
    }
}

void gonio_cholesky_solve(size_t n, const double *l, gonio_matrix x) {
    if (n > 0) {
        solve_lower(n, l, 0, x);
        solve_upper(n, l, x);
    }
}

void gonio_cholesky_invert(size_t n, double *l, double *work) {
    const gonio_matrix inverse = gonio_matrix_of(work, n, n);
    memset(work, 0, n * n * sizeof *work);
    for (size_t j = 0; j < n; j++) {
        work[j * n + j] = 1;
    }
    for (size_t k = 0; k < n; k += BLOCK) {
        solve_lower(n, l, k, gonio_matrix_part(inverse, 0, k, n, block_at(n, k)));
    }
    gonio_multiply_lower(1, gonio_matrix_transposed(inverse), inverse, 0, gonio_matrix_of(l, n, n));
}
