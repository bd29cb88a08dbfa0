// SPDX-License-Identifier: BSD-3-Clause
// Integrals of several functions at once over a rectangle.
#ifndef GONIO_FIT_CHECK_CUBATURE_H
#define GONIO_FIT_CHECK_CUBATURE_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/status.h"

typedef struct gonio_cubature {
    void (*f)(void *context, double x, double y, double *values); // values[n]
    void *context;
    size_t n;
    const double *x, *y; // ascending borders of the panels that are begun with
    size_t nx, ny;       // how many borders
    double tolerance;    // of the sum of the panels' error estimates, relative to each integral
    size_t most;         // evaluations
} gonio_cubature;

// integral[n]; *error_left: the sum of the estimates, relative, each panel's of the function of which it is worst.
gonio_status gonio_cubature_run(const gonio_cubature *cubature, double *integral, double *error_left,
                                gonio_error *error);

#endif
