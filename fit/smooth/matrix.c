// SPDX-License-Identifier: BSD-3-Clause
// Products of matrices (fit/smooth/matrix.h), in the manner of Goto & van de Geijn 2008, "Anatomy of high-performance
// matrix multiplication": tiles of the result stay in registers while packed panels of both factors stream by. Each
// element is summed over stretches of DEPTH products, and these sums are added in turn: neither the tiles nor the blocks
// of rows change that order.
#include "fit/smooth/matrix.h"

#include <string.h>

#include "fit/smooth/kernels.h"

enum {
    TILE_ROWS = GONIO_TILE_ROWS,
    TILE_COLUMNS = GONIO_TILE_COLUMNS,
    ROWS = 64,   // of a block of `a`: packed, with DEPTH columns it takes 128 kB, in the second cache
    DEPTH = 256, // a tile's panel of `b` takes 8 kB, in the first
};

// packed[k x width] = m's rows from `first`, columns from..from + depth; zero beyond m's rows.
static void pack(gonio_matrix m, size_t first, size_t width, size_t from, size_t depth, double *packed) {
    const size_t rows = m.rows - first < width ? m.rows - first : width;
    const double *in = m.at + first * m.row_step + from * m.column_step;
    if (rows < width) {
        memset(packed, 0, depth * width * sizeof *packed);
    }
    if (m.column_step == 1) { // along memory
        for (size_t i = 0; i < rows; i++) {
            for (size_t k = 0; k < depth; k++) {
                packed[k * width + i] = in[i * m.row_step + k];
            }
        }
        return;
    }
    for (size_t k = 0; k < depth; k++, in += m.column_step, packed += width) {
        if (m.row_step == 1 && rows == TILE_ROWS) {
            memcpy(packed, in, TILE_ROWS * sizeof *packed);
        } else if (m.row_step == 1 && rows == TILE_COLUMNS) {
            memcpy(packed, in, TILE_COLUMNS * sizeof *packed);
        } else {
            for (size_t i = 0; i < rows; i++) {
                packed[i] = in[i * m.row_step];
            }
        }
    }
}

// c's tile at (i, j) = beta c + alpha sum.
static void add_tile(double alpha, const double *sum, double beta, gonio_matrix c, size_t i, size_t j, bool lower) {
    if (c.row_step == 1 && i + TILE_ROWS <= c.rows && j + TILE_COLUMNS <= c.columns && beta == 1 &&
        (!lower || i >= j + TILE_COLUMNS)) { // most tiles
        for (size_t q = 0; q < TILE_COLUMNS; q++) {
            double *out = c.at + (j + q) * c.column_step + i;
            for (size_t p = 0; p < TILE_ROWS; p++) {
                out[p] += alpha * sum[q * TILE_ROWS + p];
            }
        }
        return;
    }
    for (size_t q = j; q < j + TILE_COLUMNS && q < c.columns; q++) {
        double *out = c.at + q * c.column_step;
        for (size_t p = i; p < i + TILE_ROWS && p < c.rows; p++) {
            if (!lower || p >= q) {
                const double before = beta == 0 ? 0 : beta * out[p * c.row_step];
                out[p * c.row_step] = before + alpha * sum[(q - j) * TILE_ROWS + p - i];
            }
        }
    }
}

static void multiply(double alpha, gonio_matrix a, gonio_matrix b, double beta, gonio_matrix c, bool lower) {
    double rows[ROWS * DEPTH], columns[TILE_COLUMNS * DEPTH], sum[TILE_COLUMNS * TILE_ROWS] = {0};
    const gonio_matrix turned = gonio_matrix_transposed(b);
    const gonio_kernels *const kernels = gonio_kernels_best();
    size_t from = 0;
    do { // at least once: without products c is beta c
        const size_t depth = a.columns - from < DEPTH ? a.columns - from : DEPTH;
        for (size_t i0 = 0; i0 < c.rows; i0 += ROWS) {
            const size_t end = c.rows - i0 < ROWS ? c.rows : i0 + ROWS, last = lower ? end : c.columns;
            for (size_t i = i0; i < end; i += TILE_ROWS) {
                pack(a, i, TILE_ROWS, from, depth, rows + (i - i0) * DEPTH);
            }
            for (size_t j = 0; j < last; j += TILE_COLUMNS) {
                pack(turned, j, TILE_COLUMNS, from, depth, columns);
                for (size_t i = i0; i < end; i += TILE_ROWS) {
                    if (!lower || i + TILE_ROWS > j) {
                        kernels->tile(depth, rows + (i - i0) * DEPTH, columns, sum);
                        add_tile(alpha, sum, from == 0 ? beta : 1, c, i, j, lower);
                    }
                }
            }
        }
        from += DEPTH;
    } while (from < a.columns);
}

// c = alpha a b + beta c of one column: nothing is read twice, so nothing is packed.
static void multiply_vector(double alpha, gonio_matrix a, const double *b, double beta, double *c) {
    const gonio_kernels *const kernels = gonio_kernels_best();
    for (size_t i = 0; i < a.rows; i++) {
        const double before = beta == 0 ? 0 : beta * c[i];
        c[i] = a.row_step == 1 ? before : before + alpha * kernels->dot(a.columns, a.at + i * a.row_step, b);
    }
    for (size_t j = 0; a.row_step == 1 && j < a.columns; j++) {
        kernels->add_scaled(a.rows, alpha * b[j], a.at + j * a.column_step, c);
    }
}

void gonio_multiply(double alpha, gonio_matrix a, gonio_matrix b, double beta, gonio_matrix c) {
    if (c.columns == 1 && b.row_step == 1 && c.row_step == 1 && (a.row_step == 1 || a.column_step == 1)) {
        multiply_vector(alpha, a, b.at, beta, c.at);
    } else if (c.rows < c.columns && c.rows < TILE_ROWS) { // fewer empty rows in the tiles the other way
        multiply(alpha, gonio_matrix_transposed(b), gonio_matrix_transposed(a), beta, gonio_matrix_transposed(c),
                 false);
    } else {
        multiply(alpha, a, b, beta, c, false);
    }
}

void gonio_multiply_lower(double alpha, gonio_matrix a, gonio_matrix b, double beta, gonio_matrix c) {
    multiply(alpha, a, b, beta, c, true);
}

void gonio_matrix_mirror(gonio_matrix m) {
    for (size_t j = 0; j < m.columns; j++) {
        for (size_t i = j + 1; i < m.rows; i++) {
            m.at[i * m.column_step + j * m.row_step] = m.at[i * m.row_step + j * m.column_step];
        }
    }
}

double gonio_dot(size_t n, const double *x, const double *y) { return gonio_kernels_best()->dot(n, x, y); }

void gonio_add_scaled(size_t n, double alpha, const double *x, double *y) {
    gonio_kernels_best()->add_scaled(n, alpha, x, y);
}

// Four columns at a time: each element of them is read once, for A x and for A^T x.
void gonio_symmetric_times(size_t n, const double *a, size_t step, const double *x, double *y) {
    const gonio_kernels *const kernels = gonio_kernels_best();
    memset(y, 0, n * sizeof *y);
    for (size_t j = 0; j < n; j += 4) {
        const size_t wide = n - j < 4 ? n - j : 4;
        for (size_t q = j; q < j + wide; q++) { // the block on the diagonal
            y[q] += a[q * step + q] * x[q];
            for (size_t p = q + 1; p < j + wide; p++) {
                y[p] += a[q * step + p] * x[q];
                y[q] += a[q * step + p] * x[p];
            }
        }
        if (j + 4 < n) {
            double along[4];
            kernels->four(n - j - 4, a + j * step + j + 4, step, x + j, x + j + 4, y + j + 4, along);
            for (size_t q = 0; q < 4; q++) {
                y[j + q] += along[q];
            }
        }
    }
}
