// SPDX-License-Identifier: BSD-3-Clause
// The samples of a grid as the control mesh of a uniform cubic B-spline, DeYoung (1996), section 3.2.3: "the values
// between the sample points are interpolated smoothly", and those at a node are not its own any more but a mean over it
// and its neighbours, 1/6, 2/3, 1/6 along each axis.
#include "fit/tables/grid_method.h"

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    return gonio_grid_fit(samples, options, GONIO_GRID_CUBIC, NULL, out, report, error);
}

const gonio_method gonio_method_control_mesh = {
    .name = "control-mesh",
    .summary = "a table over a grid of angles as the control points of a cubic B-spline",
    .kind = "table",
    .options = gonio_grid_options,
    .fit = fit,
    .memory = gonio_fill_grid_memory,
    .forms = gonio_grid_forms,
    .forms_n = GONIO_GRID_FORMS,
};
