// SPDX-License-Identifier: BSD-3-Clause
// The best approximations of a matrix by sums of few products.
#ifndef GONIO_FIT_CHECK_PRODUCTS_H
#define GONIO_FIT_CHECK_PRODUCTS_H

#include <stddef.h>

#include "gonio/status.h"

// A matrix that is seen row by row; it need not fit in memory.
typedef struct gonio_row_source {
    size_t rows, columns;
    void (*row)(void *context, size_t row, double *values); // values[columns]
    void *context;
} gonio_row_source;

// The leading k triplets, values descending: A is about sum u value v^T.
typedef struct gonio_products {
    size_t rows, columns, k;
    double *value;  // [k]
    double *u, *v;  // [k][rows], [k][columns]
    double squares; // of all of A's elements
    double left;    // squares of A minus the range that was searched: what any value misses at most
} gonio_products;

// By subspace iteration from a random start (Halko, Martinsson & Tropp 2011, "Finding structure with randomness"), with
// `passes` (1 or more) times two passes over the rows. The caller frees with gonio_products_free.
gonio_status gonio_products_find(const gonio_row_source *a, size_t k, int passes, gonio_products *out,
                                 gonio_error *error);
void gonio_products_free(gonio_products *products);

#endif
