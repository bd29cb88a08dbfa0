// SPDX-License-Identifier: BSD-3-Clause
// Values wherever a representation wants them, from scattered samples: those of a fit of the samples by another method.
//
// DeYoung (1996), section 3.1: "when building other representations from the tabulated data ... a technique to
// interpolate between non-uniform samples is also needed". It is the best fit that we have, the default method's, or
// the one that --fill names; `kernel` is the direct average of the nearest samples.
#ifndef GONIO_FIT_TABLES_FILL_H
#define GONIO_FIT_TABLES_FILL_H

#include "brdf/grid/grid.h"
#include "fit/method.h"
#include "fit/prepare/dataset.h"

typedef struct gonio_fill {
    gonio_dataset data; // the samples, and the transforms of the channels
    const gonio_model *model;
    gonio_model *own; // NULL where the store has it
    const char *method;
    double seconds; // that the store saved
    int threads;
} gonio_fill;

// Fit what the options name, or take it from their store. Release with gonio_fill_release.
gonio_status gonio_fill_init(gonio_fill *fill, const gonio_samples *samples, const gonio_fit_options *options,
                             gonio_error *error);
void gonio_fill_release(gonio_fill *fill);
// values[n x channels]: transformed, at the pairs that `place` tells of the items 0 to n - 1.
gonio_status gonio_fill_values(const gonio_fill *fill, size_t n,
                               void (*place)(const void *context, size_t item, gonio_vec3 *wi, gonio_vec3 *wo),
                               const void *context, double *values, gonio_error *error);
// The same at the nodes of a grid; the caller frees *values.
gonio_status gonio_fill_grid(const gonio_fill *fill, const gonio_grid *grid, double **values, gonio_error *error);
// The grid that the options ask for; level_usual[dims - 3] where they leave it open.
gonio_grid gonio_fill_grid_of(const gonio_fit_options *options, bool isotropic, const int level_usual[2]);
// Bytes of the fill, and of `values` doubles and floats a channel over a grid of the size's level.
double gonio_fill_memory(const gonio_fit_size *size, double n);
double gonio_fill_grid_memory(const gonio_fit_size *size, double n);
// level, coordinates, domain and options of the report.
void gonio_fill_describe(const gonio_fill *fill, const gonio_grid *grid, gonio_fit_report *report);
// More of the report's options.
__attribute__((format(printf, 2, 3))) void gonio_fill_add(gonio_fit_report *report, const char *format, ...);

#endif
