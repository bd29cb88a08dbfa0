// SPDX-License-Identifier: BSD-3-Clause
// The best sum of a few products of a matrix.
#ifndef GONIO_FIT_TABLES_LOW_RANK_H
#define GONIO_FIT_TABLES_LOW_RANK_H

#include <stddef.h>

#include "gonio/status.h"

// a (rows x columns, a row after the other) ~ sum over k of left[k][row] right[k][column], for the `terms` largest
// singular values, ascending k by descending value; what the matrix has not is zeros. *rest: the root mean square of
// what is left.
gonio_status gonio_low_rank(size_t rows, size_t columns, const double *a, size_t terms, double *left, double *right,
                            double *rest, gonio_error *error);

#endif
