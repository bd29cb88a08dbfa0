// SPDX-License-Identifier: BSD-3-Clause
// Dense linear algebra whose bits depend on its input alone.
//
// A BLAS picks its kernels by the processor and splits its sums by the number of threads, so that the same fit gives
// other bits on another machine, under another affinity or another environment; setting its threads for the time of a
// call changes the process for every other thread of it. Here every element of a result is a sum in an order that the
// shapes alone fix, on one thread (callers run several solvers side by side), in vectors of eight doubles that narrower
// machines split, without FMA. What remains is IEEE arithmetic, which is the same everywhere.
//
// The price: where a BLAS knows the processor, its multiplications take about half the time, for want of FMA here.
#ifndef GONIO_FIT_SMOOTH_MATRIX_H
#define GONIO_FIT_SMOOTH_MATRIX_H

#include <stdbool.h>
#include <stddef.h>

// A borrowed view: the element (i, j) is at[i * row_step + j * column_step].
typedef struct gonio_matrix {
    double *at;
    size_t rows, columns, row_step, column_step;
} gonio_matrix;

// Columns one after another, as all matrices here are stored. What is only read may be const.
static inline gonio_matrix gonio_matrix_of(const double *at, size_t rows, size_t columns) {
    return (gonio_matrix){(double *)at, rows, columns, 1, rows};
}

static inline gonio_matrix gonio_matrix_transposed(gonio_matrix m) {
    return (gonio_matrix){m.at, m.columns, m.rows, m.column_step, m.row_step};
}

// The part of `rows` x `columns` elements that begins at (i, j).
static inline gonio_matrix gonio_matrix_part(gonio_matrix m, size_t i, size_t j, size_t rows, size_t columns) {
    return (gonio_matrix){m.at + i * m.row_step + j * m.column_step, rows, columns, m.row_step, m.column_step};
}

// c = alpha a b + beta c. With beta 0 c need not be set before; c overlaps neither a nor b.
void gonio_multiply(double alpha, gonio_matrix a, gonio_matrix b, double beta, gonio_matrix c);
// The same for the lower triangle of c alone, which is square; the rest of c stays as it is.
void gonio_multiply_lower(double alpha, gonio_matrix a, gonio_matrix b, double beta, gonio_matrix c);
// Copy the lower triangle to the upper.
void gonio_matrix_mirror(gonio_matrix m);

// sum x_i y_i, and y += alpha x.
double gonio_dot(size_t n, const double *x, const double *y);
void gonio_add_scaled(size_t n, double alpha, const double *x, double *y);
// y = A x; A is symmetric, its lower triangle is read, columns `step` apart.
void gonio_symmetric_times(size_t n, const double *a, size_t step, const double *x, double *y);

// ---- symmetric positive definite: the lower triangle is read and written, columns one after another ----

// L of A = L L^T in its place; false: not positive definite within rounding.
bool gonio_cholesky(size_t n, double *a);
// x (n x columns) = (L L^T)^-1 x.
void gonio_cholesky_solve(size_t n, const double *l, gonio_matrix x);
// (L L^T)^-1, lower triangle, in L's place; work: n x n.
void gonio_cholesky_invert(size_t n, double *l, double *work);

// ---- eigenvalues ----

// Eigenvectors of the symmetric A (lower triangle read) in its place, one a column, and their values, ascending.
// false: no memory, or no convergence.
bool gonio_eigen(size_t n, double *a, double *values);
// Singular values of A (n x n, overwritten), descending. false: no memory, or no convergence.
bool gonio_singular_values(size_t n, double *a, double *values);

#endif
