// SPDX-License-Identifier: BSD-3-Clause
// The cubic B-spline that goes through the samples of a grid, DeYoung (1996), section 3.2.2.
//
// Along one axis the spline's value at a node is (c_{k-1} + 4 c_k + c_{k+1}) / 6, so the control points c solve a
// tridiagonal system, and in several dimensions one axis after the other. What lies beyond an axis' ends is the grid's
// (brdf/grid/grid.h): an azimuth closes on itself; a tilt's line goes on over the pole along the opposite azimuth to
// the other horizon, 2 size - 1 nodes, at whose ends the control points go on straight, so that c = value there.
// Turning half around and filtering along an azimuth may be exchanged, so the order of the axes does not matter.
#include "fit/tables/grid_method.h"

#include <stdlib.h>

// c of 4 c_k + c_{k-1} + c_{k+1} = 6 v_k in v's place, c_{-1} and c_n being `left` and `right` (already known); work:
// n.
static void solve_line(size_t n, double left, double right, double *v, double *work) {
    double before = left, factor = 0; // c_k = v_k - work_k c_{k+1}
    for (size_t k = 0; k < n; k++) {
        const double divide = 1 / (4 - factor);
        v[k] = (6 * v[k] - before) * divide;
        work[k] = factor = divide;
        before = v[k];
    }
    double next = right;
    for (size_t k = n; k-- > 0;) {
        next = v[k] -= work[k] * next;
    }
}

// The same on a circle: with the unknown c_0 as both ends' neighbour, c is linear in it.
static void solve_circle(size_t n, double *v, double *work) {
    if (n == 2) { // both neighbours are the same
        const double sum = v[0] + v[1], difference = 3 * (v[0] - v[1]);
        v[0] = (sum + difference) / 2;
        v[1] = (sum - difference) / 2;
        return;
    }
    double *unit = work + n, first = v[0];
    for (size_t k = 1; k < n; k++) {
        unit[k] = 0;
    }
    solve_line(n - 1, 0, 0, v + 1, work);
    solve_line(n - 1, 1, 1, unit + 1, work);
    // 4 c_0 + c_1 + c_{n-1} = 6 v_0, c_k = v_k + c_0 unit_k.
    v[0] = (6 * first - v[1] - v[n - 1]) / (4 + unit[1] + unit[n - 1]);
    for (size_t k = 1; k < n; k++) {
        v[k] += v[0] * unit[k];
    }
}

typedef struct filter {
    const gonio_grid *grid;
    size_t channels;
    double *values;
    double *line, *work; // 2 x the longest line each
} filter;

static double *value_at(const filter *f, size_t node, size_t channel) {
    return f->values + node * f->channels + channel;
}

// The line of an azimuth through `node`, its first; in grids of three dimensions it is the half of a circle.
static void along_azimuth(const filter *f, size_t node, size_t step, size_t size, size_t channel) {
    const bool folded = f->grid->dims == 3;
    const size_t around = folded ? 2 * (size - 1) : size;
    for (size_t k = 0; k < around; k++) {
        f->line[k] = *value_at(f, node + (k < size ? k : around - k) * step, channel);
    }
    solve_circle(around, f->line, f->work);
    for (size_t k = 0; k < size; k++) {
        *value_at(f, node + k * step, channel) = f->line[k];
    }
}

// The line from the horizon over the pole to the horizon; `node` is its pole's on the one side, `beyond` on the other.
static void along_tilt(const filter *f, size_t node, size_t beyond, size_t step, size_t size, size_t channel) {
    const size_t pole = size - 1;
    for (size_t k = 0; k < size; k++) {
        f->line[pole + k] = *value_at(f, node + k * step, channel);
        f->line[pole - k] = k > 0 ? *value_at(f, beyond + k * step, channel) : f->line[pole];
    }
    solve_line(2 * size - 3, f->line[0], f->line[2 * pole], f->line + 1, f->work);
    for (size_t k = 0; k < size; k++) {
        *value_at(f, node + k * step, channel) = f->line[pole + k];
        *value_at(f, beyond + k * step, channel) = f->line[pole - k];
    }
}

static void along_axis(const filter *f, int axis) {
    const gonio_grid *grid = f->grid;
    size_t step = 1;
    for (int d = axis + 1; d < grid->dims; d++) {
        step *= grid->size[d];
    }
    for (size_t node = 0; node < grid->count; node++) {
        if (node / step % grid->size[axis] != 0) {
            continue; // not the first of its line
        }
        const bool azimuth = gonio_grid_is_azimuth(grid, axis);
        const size_t beyond = azimuth ? node : gonio_grid_beyond(grid, axis, node);
        if (beyond < node) {
            continue; // done from there
        }
        for (size_t c = 0; c < f->channels; c++) {
            if (azimuth) {
                along_azimuth(f, node, step, grid->size[axis], c);
            } else {
                along_tilt(f, node, beyond, step, grid->size[axis], c);
            }
        }
    }
}

gonio_status gonio_grid_interpolate(const gonio_grid *grid, int channels, double *values, gonio_error *error) {
    const size_t longest = ((size_t)4 << grid->level) + 2;
    filter f = {grid, (size_t)channels, values, malloc(2 * longest * sizeof(double)),
                malloc(2 * longest * sizeof(double))};
    const bool enough = f.line != NULL && f.work != NULL;
    for (int axis = 0; enough && axis < grid->dims; axis++) {
        along_axis(&f, axis);
    }
    free(f.line);
    free(f.work);
    return enough ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a line of a grid");
}

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    return gonio_grid_fit(samples, options, GONIO_GRID_CUBIC, gonio_grid_interpolate, out, report, error);
}

const gonio_method gonio_method_interpolating_spline = {
    .name = "interpolating-spline",
    .summary = "the cubic B-spline through a table over a grid of angles",
    .kind = "table",
    .options = gonio_grid_options,
    .fit = fit,
    .memory = gonio_fill_grid_memory,
    .forms = gonio_grid_forms,
    .forms_n = GONIO_GRID_FORMS,
};
