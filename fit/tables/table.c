// SPDX-License-Identifier: BSD-3-Clause
// The plain table with multilinear interpolation, DeYoung (1996), section 3.2.1; brdf/kind/table.c.
#include "fit/tables/grid_method.h"

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    return gonio_grid_fit(samples, options, GONIO_GRID_LINEAR, NULL, out, report, error);
}

const gonio_method gonio_method_table = {
    .name = "table",
    .summary = "a table over a grid of angles, straight lines between its nodes",
    .kind = "table",
    .options = gonio_grid_options,
    .fit = fit,
    .memory = gonio_fill_grid_memory,
    .forms = gonio_grid_forms,
    .forms_n = GONIO_GRID_FORMS,
};
