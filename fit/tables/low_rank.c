// SPDX-License-Identifier: BSD-3-Clause
// The singular value decomposition of a table, its largest terms alone.
//
// With A A' = U diag(s^2) U' the factors are u_k and A' u_k; an eigenproblem of the shorter side, here the rows, gives
// them. Squares lose half of the digits, which leaves those of the floats that the factors are stored as. Where both
// sides are long, n^3 is too much: Halko, Martinsson and Tropp, "Finding structure with randomness" (2011),
// algorithm 4.4. Columns that span nearly what the largest terms span are A (A' A)^q times random ones, a few more than
// terms, here with q = 2; made orthonormal (Q), the small Q' A is decomposed as above.
#include "fit/tables/low_rank.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "fit/smooth/matrix.h"

#define WHOLE 192 // rows up to which the whole eigenproblem is solved
#define SPARE 8   // random columns beyond the terms
#define POWERS 2

// The k-th largest eigenvector, of ascending ones, is column n - 1 - k of g.
static bool decompose(size_t n, size_t columns, const double *a, double *g, double *values) {
    const gonio_matrix m = gonio_matrix_transposed(gonio_matrix_of(a, columns, n)); // n x columns
    gonio_multiply_lower(1, m, gonio_matrix_transposed(m), 0, gonio_matrix_of(g, n, n));
    return gonio_eigen(n, g, values);
}

// Columns of q (rows x count, one after another) made orthonormal, twice over; dependent ones become zeros.
static void orthonormalise(size_t rows, size_t count, double *q) {
    for (size_t k = 0; k < count; k++) {
        double *column = q + k * rows;
        const double before = sqrt(gonio_dot(rows, column, column));
        for (int round = 0; round < 2; round++) {
            for (size_t j = 0; j < k; j++) {
                gonio_add_scaled(rows, -gonio_dot(rows, q + j * rows, column), q + j * rows, column);
            }
        }
        const double length = sqrt(gonio_dot(rows, column, column));
        for (size_t i = 0; i < rows; i++) {
            column[i] = length > 1e-12 * before && length > 0 ? column[i] / length : 0;
        }
    }
}

static double *random_range(size_t rows, size_t columns, const double *a, size_t count) {
    double *q = malloc(rows * count * sizeof *q), *z = malloc(columns * count * sizeof *z);
    const gonio_matrix m = gonio_matrix_transposed(gonio_matrix_of(a, columns, rows));
    uint64_t state = 1;
    for (size_t k = 0; q != NULL && z != NULL && k < columns * count; k++) {
        z[k] = gonio_random_next(&state) + gonio_random_next(&state) + gonio_random_next(&state) - 1.5;
    }
    for (int power = 0; q != NULL && z != NULL && power <= POWERS; power++) {
        gonio_multiply(1, m, gonio_matrix_of(z, columns, count), 0, gonio_matrix_of(q, rows, count));
        orthonormalise(rows, count, q);
        if (power < POWERS) {
            gonio_multiply(1, gonio_matrix_transposed(m), gonio_matrix_of(q, rows, count), 0,
                           gonio_matrix_of(z, columns, count));
            orthonormalise(columns, count, z);
        }
    }
    free(z);
    return q;
}

static double rest_of(size_t rows, size_t columns, const double *a, size_t terms, const double *left,
                      const double *right) {
    double sum = 0;
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            double value = a[i * columns + j];
            for (size_t k = 0; k < terms; k++) {
                value -= left[k * rows + i] * right[k * columns + j];
            }
            sum += value * value;
        }
    }
    return sqrt(sum / (double)(rows * columns));
}

// From the eigenvectors of b b', b n x columns, times q (rows x n; NULL: the identity).
static void take_factors(size_t rows, size_t n, size_t columns, const double *b, const double *g, const double *q,
                         size_t terms, double *left, double *right) {
    memset(left, 0, terms * rows * sizeof *left);
    memset(right, 0, terms * columns * sizeof *right);
    for (size_t k = 0; k < terms && k < n; k++) {
        const double *vector = g + (n - 1 - k) * n;
        for (size_t i = 0; i < n; i++) {
            gonio_add_scaled(columns, vector[i], b + i * columns, right + k * columns);
            if (q != NULL) {
                gonio_add_scaled(rows, vector[i], q + i * rows, left + k * rows);
            } else {
                left[k * rows + i] = vector[i];
            }
        }
    }
}

gonio_status gonio_low_rank(size_t rows, size_t columns, const double *a, size_t terms, double *left, double *right,
                            double *rest, gonio_error *error) {
    const size_t n = rows <= WHOLE || rows <= terms + SPARE ? rows : terms + SPARE;
    double *q = n < rows ? random_range(rows, columns, a, n) : NULL;
    double *b = n < rows ? malloc(n * columns * sizeof *b) : NULL, *g = malloc(n * n * sizeof *g);
    double *values = malloc(n * sizeof *values);
    gonio_status status = g != NULL && values != NULL && (n == rows || (q != NULL && b != NULL))
                              ? GONIO_OK
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory to decompose %zu x %zu", rows, columns);
    if (status == GONIO_OK && n < rows) { // b = Q' A, a row after the other
        gonio_multiply(1, gonio_matrix_of(a, columns, rows), gonio_matrix_of(q, rows, n), 0,
                       gonio_matrix_of(b, columns, n));
    }
    const double *used = n < rows ? b : a;
    if (status == GONIO_OK && !decompose(n, columns, used, g, values)) {
        status = gonio_fail(error, GONIO_E_CONVERGENCE, "a matrix of %zu x %zu has no singular values", rows, columns);
    }
    if (status == GONIO_OK) {
        take_factors(rows, n, columns, used, g, q, terms, left, right);
        *rest = rest_of(rows, columns, a, terms, left, right);
    }
    free(q);
    free(b);
    free(g);
    free(values);
    return status;
}
