// SPDX-License-Identifier: BSD-3-Clause
// What the methods share whose model is a table (brdf/kind/table.c).
#ifndef GONIO_FIT_TABLES_GRID_METHOD_H
#define GONIO_FIT_TABLES_GRID_METHOD_H

#include "fit/tables/fill.h"

// Fill a grid; `filter` (NULL: none) makes of the values at its nodes, [nodes][channels], what the model holds of them.
gonio_status gonio_grid_fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_grid_degree degree,
                            gonio_status (*filter)(const gonio_grid *grid, int channels, double *values,
                                                   gonio_error *error),
                            gonio_model **out, gonio_fit_report *report, gonio_error *error);
// Values at the nodes -> the control points, in their place, of the cubic spline that goes through them; [nodes][channels].
gonio_status gonio_grid_interpolate(const gonio_grid *grid, int channels, double *values, gonio_error *error);
extern const gonio_method_option gonio_grid_options[];
extern const gonio_method_form gonio_grid_forms[];
enum { GONIO_GRID_FORMS = 2 };

#endif
