// SPDX-License-Identifier: BSD-3-Clause
// The nearest of many points in up to six dimensions: a balanced k-d tree (Bentley 1975), exact.
#ifndef GONIO_FIT_CHECK_NEIGHBOURS_H
#define GONIO_FIT_CHECK_NEIGHBOURS_H

#include <stdbool.h>

#include "base/nearest.h"
#include "gonio/status.h"

#define GONIO_NEIGHBOURS_DIMS 6

typedef struct gonio_neighbours {
    size_t n;
    int dims;
    const double *at; // [n][dims], borrowed
    size_t *order;    // the points, each half's middle between its halves
    unsigned char *axis;
} gonio_neighbours;

gonio_status gonio_neighbours_new(const double *at, size_t n, int dims, gonio_neighbours *out, gonio_error *error);
void gonio_neighbours_free(gonio_neighbours *tree);
// nearest.distance: squared. Points for which skip[0] <= index < skip[1] are left out.
void gonio_neighbours_find(const gonio_neighbours *tree, const double *x, const size_t skip[2], gonio_nearest *nearest);

#endif
