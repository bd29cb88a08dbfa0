// SPDX-License-Identifier: BSD-3-Clause
// Eigenvectors and singular values (fit/smooth/matrix.h).
//
// Householder reflections I - tau v v^T make the matrix tridiagonal, a panel of columns at a time so that half of the
// work is in products of matrices (Dongarra, Sorensen & Hammarling 1989, "Block reduction of matrices to condensed
// forms for eigenvalue computations"); the vectors of what remains (fit/smooth/tridiagonal.c) are then reflected back,
// again in blocks: H_1 .. H_b = I - V T V^T (Schreiber & Van Loan 1989, "A storage-efficient WY representation for
// products of Householder transformations").
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/smooth/matrix.h"
#include "fit/smooth/tridiagonal.h"

#define PANEL ((size_t)32)

// x[n] becomes v, v_0 = 1, so that (I - tau v v^T) x = (*left, 0 ..).
static double reflector(size_t n, double *x, double *left) {
    const double rest = gonio_dot(n - 1, x + 1, x + 1), first = x[0];
    x[0] = 1;
    if (rest == 0) {
        *left = first;
        return 0;
    }
    *left = -copysign(sqrt(first * first + rest), first);
    for (size_t i = 1; i < n; i++) {
        x[i] /= first - *left;
    }
    return (*left - first) / *left;
}

typedef struct reduction {
    size_t n;
    double *a, *diagonal, *side, *tau; // v of column k lies in a below its diagonal
    double *w;                         // n x PANEL
} reduction;

// What the panel's columns before k, which began at `first`, take from the n - from elements of `out`:
// V W[row]^T + W V[row]^T.
static void take_panel(const reduction *r, size_t first, size_t k, double *out) {
    const size_t n = r->n;
    for (size_t p = first; p < k; p++) {
        const double *v = r->a + p * n, *w = r->w + (p - first) * n;
        gonio_add_scaled(n - k, -w[k], v + k, out + k);
        gonio_add_scaled(n - k, -v[k], w + k, out + k);
    }
}

// w = tau (A v - V (W^T v) - W (V^T v)), then made such that A - v w^T - w v^T is the reflected matrix.
static void fill_w(const reduction *r, size_t first, size_t k) {
    const size_t n = r->n, from = k + 1, m = n - from;
    const double *v = r->a + k * n + from;
    double *w = r->w + (k - first) * n + from;
    gonio_symmetric_times(m, r->a + from * n + from, n, v, w);
    for (size_t p = first; p < k; p++) {
        const double *pv = r->a + p * n + from, *pw = r->w + (p - first) * n + from;
        const double on_w = gonio_dot(m, pw, v), on_v = gonio_dot(m, pv, v);
        gonio_add_scaled(m, -on_w, pv, w);
        gonio_add_scaled(m, -on_v, pw, w);
    }
    for (size_t i = 0; i < m; i++) {
        w[i] *= r->tau[k];
    }
    gonio_add_scaled(m, -0.5 * r->tau[k] * gonio_dot(m, w, v), v, w);
}

static void reduce(const reduction *r) {
    const size_t n = r->n;
    const gonio_matrix a = gonio_matrix_of(r->a, n, n);
    for (size_t first = 0; first + 1 < n; first += PANEL) {
        const size_t count = n - 1 - first < PANEL ? n - 1 - first : PANEL, end = first + count;
        for (size_t k = first; k < end; k++) {
            take_panel(r, first, k, r->a + k * n);
            r->diagonal[k] = r->a[k * n + k];
            r->tau[k] = reflector(n - k - 1, r->a + k * n + k + 1, &r->side[k]);
            fill_w(r, first, k);
        }
        const gonio_matrix v = gonio_matrix_part(a, end, first, n - end, count),
                           w = gonio_matrix_part(gonio_matrix_of(r->w, n, PANEL), end, 0, n - end, count),
                           trailing = gonio_matrix_part(a, end, end, n - end, n - end);
        gonio_multiply_lower(-1, v, gonio_matrix_transposed(w), 1, trailing);
        gonio_multiply_lower(-1, w, gonio_matrix_transposed(v), 1, trailing);
    }
    r->diagonal[n - 1] = r->a[n * n - 1];
}

// vectors = H_0 H_1 .. vectors; work: n x PANEL and PANEL x n.
static void reflect_back(const reduction *r, double *vectors, double *panel, double *work) {
    const size_t n = r->n;
    double t[PANEL * PANEL], column[PANEL];
    for (size_t first = n < 2 ? 0 : (n - 2) / PANEL * PANEL + PANEL; first > 0;) {
        first -= PANEL;
        const size_t count = n - 1 - first < PANEL ? n - 1 - first : PANEL, from = first + 1, m = n - from;
        memset(panel, 0, m * count * sizeof *panel);
        memset(t, 0, sizeof t);
        for (size_t p = 0; p < count; p++) {
            memcpy(panel + p * m + p, r->a + (first + p) * n + from + p, (m - p) * sizeof *panel);
            for (size_t q = 0; q < p; q++) {
                column[q] = -r->tau[first + p] * gonio_dot(m, panel + q * m, panel + p * m);
            }
            for (size_t i = 0; i < p; i++) {
                for (size_t q = i; q < p; q++) {
                    t[p * PANEL + i] += t[q * PANEL + i] * column[q];
                }
            }
            t[p * PANEL + p] = r->tau[first + p];
        }
        const gonio_matrix v = gonio_matrix_of(panel, m, count), part = {vectors + from, m, n, 1, n},
                           upper = {t, count, count, 1, PANEL}, on = gonio_matrix_of(work, count, n),
                           turned = gonio_matrix_of(work + count * n, count, n);
        gonio_multiply(1, gonio_matrix_transposed(v), part, 0, on);
        gonio_multiply(1, upper, on, 0, turned);
        gonio_multiply(-1, v, turned, 1, part);
    }
}

// The power of two that brings the largest element into [1, 2); 1 for zeros. Only with `lower` is the upper triangle
// not looked at.
static double scale_of(size_t n, const double *a, bool lower) {
    double largest = 0;
    for (size_t j = 0; j < n; j++) {
        for (size_t i = lower ? j : 0; i < n; i++) {
            largest = fmax(largest, fabs(a[j * n + i]));
        }
    }
    return largest > 0 && isfinite(largest) ? ldexp(1, ilogb(largest)) : 1;
}

bool gonio_eigen(size_t n, double *a, double *values) {
    if (n == 0) {
        return true;
    }
    double *vectors = malloc(n * n * sizeof *vectors), *small = malloc((2 + 3 * PANEL) * n * sizeof *small);
    bool done = vectors != NULL && small != NULL;
    if (done) {
        double *w = small + 2 * n;
        const reduction r = {n, a, values, small, small + n, w};
        const double scale = scale_of(n, a, true);
        for (size_t k = 0; k < n * n; k++) {
            a[k] /= scale;
        }
        reduce(&r);
        done = gonio_tridiagonal_eigen(n, values, r.side, vectors);
        if (done) {
            reflect_back(&r, vectors, w, w + PANEL * n);
            memcpy(a, vectors, n * n * sizeof *a);
        }
        for (size_t k = 0; k < n; k++) {
            values[k] *= scale;
        }
    }
    free(vectors);
    free(small);
    return done;
}

// x (rows x columns) = (I - tau v v^T) x, in steps of memory that suit columns and rows alike.
static void reflect(double tau, size_t v_step, const double *v, gonio_matrix x) {
    for (size_t j = 0; j < x.columns; j++) {
        double *column = x.at + j * x.column_step, sum = 0;
        for (size_t i = 0; i < x.rows; i++) {
            sum += v[i * v_step] * column[i * x.row_step];
        }
        for (size_t i = 0; i < x.rows; i++) {
            column[i * x.row_step] -= tau * sum * v[i * v_step];
        }
    }
}

static int by_size(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a < b) - (a > b);
}

// Reflections from both sides make A bidiagonal, B. The values of [0 B^T; B 0] are plus and minus those singular values,
// and with its rows and columns shuffled it is tridiagonal with nothing on the diagonal (Golub & Kahan 1965,
// "Calculating the singular values and pseudo-inverse of a matrix"): no square is lost, as it would be in A^T A.
bool gonio_singular_values(size_t n, double *a, double *values) {
    double *diagonal = calloc(5 * n + 1, sizeof *diagonal);
    if (diagonal == NULL || n == 0) {
        free(diagonal);
        return n == 0;
    }
    double *side = diagonal + 2 * n, *row = side + 2 * n;
    const double scale = scale_of(n, a, false);
    const gonio_matrix m = gonio_matrix_of(a, n, n);
    for (size_t k = 0; k < n * n; k++) {
        a[k] /= scale;
    }
    for (size_t k = 0; k < n; k++) {
        const size_t right = n - k - 1;
        const double tau = reflector(n - k, a + k * n + k, &side[2 * k]);
        reflect(tau, 1, a + k * n + k, gonio_matrix_part(m, k, k + 1, n - k, right));
        if (right > 0) {
            for (size_t j = 0; j < right; j++) {
                row[j] = a[(k + 1 + j) * n + k];
            }
            const double turn = reflector(right, row, &side[2 * k + 1]);
            reflect(turn, 1, row, gonio_matrix_transposed(gonio_matrix_part(m, k + 1, k + 1, right, right)));
        }
    }
    const bool done = gonio_tridiagonal_steps(2 * n, diagonal, side, 0, 0, NULL);
    qsort(diagonal, 2 * n, sizeof *diagonal, by_size);
    for (size_t k = 0; k < n; k++) {
        values[k] = fabs(diagonal[k]) * scale;
    }
    free(diagonal);
    return done;
}
