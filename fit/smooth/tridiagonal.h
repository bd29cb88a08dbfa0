// SPDX-License-Identifier: BSD-3-Clause
// Eigenvalues and vectors of symmetric tridiagonal matrices, whose elements must lie well within the range whose squares
// are numbers: callers scale.
#ifndef GONIO_FIT_SMOOTH_TRIDIAGONAL_H
#define GONIO_FIT_SMOOTH_TRIDIAGONAL_H

#include <stdbool.h>
#include <stddef.h>

// By implicit QR steps. diagonal[n] becomes the values, in no order; side[n - 1]: below the diagonal, overwritten.
// vectors (NULL: none): n columns, `step` apart, of which `rows` elements are turned along. false: no convergence.
bool gonio_tridiagonal_steps(size_t n, double *diagonal, double *side, size_t rows, size_t step, double *vectors);

// By division. diagonal becomes the values, ascending, vectors (n x n, set here) one a column; side is overwritten.
// false: no convergence, or no memory for 2 n^2 numbers.
bool gonio_tridiagonal_eigen(size_t n, double *diagonal, double *side, double *vectors);

#endif
