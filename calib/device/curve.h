// SPDX-License-Identifier: BSD-3-Clause
// Inside of the response fit: a family of curves and the least squares over it.
#ifndef GONIO_CALIB_DEVICE_CURVE_H
#define GONIO_CALIB_DEVICE_CURVE_H

#include "gonio/characterise.h"

#define CURVE_PARAMETERS_MAX 48
#define CURVE_POINTS GONIO_RESPONSE_POINTS

// A family of curves: parameters -> ln relative exposure of CURVE_POINTS even values.
typedef struct curve_family {
    int parameters;
    const double *basis; // EMoR: (1 + parameters) x samples: f0 and h; NULL: spline
    int samples;
    double low; // spline: lowest value with data
} curve_family;

// The start and the curve of parameters p; *penalty gets what makes a curve less plausible (parameters + 64 terms).
void gonio_curve_start(const curve_family *family, double *p);
void gonio_curve_make(const curve_family *family, const double *p, double ln_exposure[CURVE_POINTS], double *penalty);
#define CURVE_PENALTIES (CURVE_PARAMETERS_MAX + 64)

// Read emor.txt: the first `terms` functions. The caller frees *basis.
gonio_status gonio_emor_read(const char *path, int terms, double **basis, int *samples, gonio_error *error);

#endif
