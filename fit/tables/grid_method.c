// SPDX-License-Identifier: BSD-3-Clause
#include "fit/tables/grid_method.h"

#include <stdlib.h>

#include "brdf/kind/table.h"

// 33 nodes a tilt: 2.8 deg. In four dimensions 9 and 16, 11 and 22 deg, are 20,736 nodes; one level more is 16 times
// that.
static const int level_usual[2] = {5, 3};

static gonio_status make(const gonio_fill *fill, const gonio_grid *grid, gonio_grid_degree degree, const double *values,
                         const char (*names)[32], gonio_model **out, gonio_error *error) {
    const size_t count = grid->count * (size_t)fill->data.channels;
    float *points = malloc(count * sizeof *points);
    if (points == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu values", count);
    }
    for (size_t k = 0; k < count; k++) {
        points[k] = (float)values[k];
    }
    const gonio_table_parts parts = {.grid = *grid,
                                     .degree = degree,
                                     .channels = fill->data.channels,
                                     .kind = fill->data.kind,
                                     .transforms = fill->data.transforms,
                                     .names = names,
                                     .points = points};
    const gonio_status status = gonio_table_new(&parts, out, error);
    if (status != GONIO_OK) {
        free(points);
    }
    return status;
}

gonio_status gonio_grid_fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_grid_degree degree,
                            gonio_status (*filter)(const gonio_grid *grid, int channels, double *values,
                                                   gonio_error *error),
                            gonio_model **out, gonio_fit_report *report, gonio_error *error) {
    *out = NULL;
    const gonio_grid grid = gonio_fill_grid_of(options, samples->isotropic, level_usual);
    gonio_fill fill;
    gonio_status status = gonio_fill_init(&fill, samples, options, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *values = NULL;
    status = gonio_fill_grid(&fill, &grid, &values, error);
    status = status == GONIO_OK && filter != NULL ? filter(&grid, samples->channels, values, error) : status;
    status = status == GONIO_OK
                 ? make(&fill, &grid, degree, values, (const char(*)[32])samples->channel_names, out, error)
                 : status;
    gonio_fill_describe(&fill, &grid, report);
    free(values);
    gonio_fill_release(&fill);
    return status;
}

const gonio_method_option gonio_grid_options[] = {GONIO_METHOD_OPTION(level, "of the grid (5; 3 in 4-D)"),
                                                  GONIO_METHOD_OPTION(domain, "log"),
                                                  GONIO_METHOD_OPTION(grid, NULL),
                                                  GONIO_METHOD_OPTION(fill, NULL),
                                                  {0}};

const gonio_method_form gonio_grid_forms[GONIO_GRID_FORMS] = {
    {4, 4, GONIO_COORDINATES_AUTO, GONIO_DOMAIN_AUTO, NULL},
    {GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_COORDINATES_AUTO, GONIO_DOMAIN_AUTO, NULL}};
