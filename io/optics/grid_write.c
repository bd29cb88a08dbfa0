// SPDX-License-Identifier: BSD-3-Clause
// What the writers of optics programs' tables share: a grid with a model's values.
#include <math.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "io/optics/grid.h"

static gonio_status axis_of(gonio_grid *grid, int axis, const double *deg, int n, gonio_error *error) {
    gonio_grid_axis *a = &grid->axis[axis];
    a->deg = malloc((size_t)n * sizeof *a->deg);
    if (a->deg == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d angles", n);
    }
    for (int k = 0; k < n; k++) {
        a->deg[k] = deg[k];
    }
    a->n = n;
    return GONIO_OK;
}

// 0 to last, `step` apart.
static gonio_status steps(gonio_grid *grid, int axis, double last, double step, gonio_error *error) {
    double deg[400];
    int n = 0;
    for (; n < 400 && n * step <= last + 1e-9; n++) {
        deg[n] = n * step;
    }
    return axis_of(grid, axis, deg, n, error);
}

// From the mirror direction on: closer where lobes are.
static gonio_status radial_steps(gonio_grid *grid, double step, gonio_error *error) {
    double deg[400];
    int n = 0;
    for (double at = 0; at <= 90 + GONIO_GRID_WRITE_MAX_DEG + 1e-9 && n < 400; at += at < 2 * step   ? step / 5
                                                                                     : at < 6 * step ? step / 2
                                                                                                     : step) {
        deg[n++] = round(at * 1e6) / 1e6;
    }
    return axis_of(grid, GONIO_GRID_OUT_THETA, deg, n, error);
}

static gonio_status set_axes(gonio_grid *grid, const gonio_model *model, double step, bool closed, gonio_error *error) {
    gonio_status status = steps(grid, GONIO_GRID_IN_PHI, model->isotropic ? 0 : 359.9, 3 * step, error);
    status = status == GONIO_OK ? steps(grid, GONIO_GRID_IN_THETA, GONIO_GRID_WRITE_MAX_DEG, step, error) : status;
    status = status == GONIO_OK ? steps(grid, GONIO_GRID_OUT_PHI, closed ? 360 : 359.9, 2 * step, error) : status;
    if (status == GONIO_OK) {
        status = grid->frame == GONIO_GRID_SPECULAR
                     ? radial_steps(grid, step, error)
                     : steps(grid, GONIO_GRID_OUT_THETA, GONIO_GRID_WRITE_MAX_DEG, step, error);
    }
    return status;
}

typedef struct job {
    gonio_grid *grid;
    const gonio_model *model;
} job;

static void fill_incidence(void *context, size_t incidence) {
    const job *j = context;
    gonio_grid *g = j->grid;
    const int n = g->axis[GONIO_GRID_IN_THETA].n;
    int at[GONIO_GRID_AXES] = {(int)incidence / n, (int)incidence % n, 0, 0};
    double values[GONIO_CHANNELS_MAX];
    for (at[2] = 0; at[2] < g->axis[2].n; at[2]++) {
        for (at[3] = 0; at[3] < g->axis[3].n; at[3]++) {
            gonio_pair pair;
            const bool lies = gonio_grid_pair(g, at, &pair);
            if (lies) {
                gonio_model_eval_pair(j->model, &pair, values);
            }
            for (int c = 0; c < g->channels; c++) {
                values[c] = lies ? fmax(values[c], 0) : NAN;
            }
            if (g->xyz && lies) {
                gonio_rgb_to_xyz((double[3]){values[0], values[1], values[2]}, values);
            }
            for (int c = 0; c < g->channels; c++) {
                *gonio_grid_at(g, c, at[0], at[1], at[2], at[3]) = values[c];
            }
        }
    }
}

gonio_status gonio_grid_of_model(gonio_grid *grid, const gonio_model *model, size_t step, bool closed, int threads,
                                 gonio_error *error) {
    if (step < 1 || step > 15) {
        return gonio_fail(error, GONIO_E_USAGE, "grid-step: expected 1 to 15 deg, found %zu", step);
    }
    gonio_status status = set_axes(grid, model, (double)step, closed, error);
    status = status == GONIO_OK ? gonio_grid_channels(grid, model->channels, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    size_t count = (size_t)grid->channels;
    for (int k = 0; k < GONIO_GRID_AXES; k++) {
        count *= (size_t)grid->axis[k].n;
    }
    grid->values = malloc(count * sizeof *grid->values);
    if (grid->values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu values", count);
    }
    gonio_pool_for(threads, (size_t)grid->axis[0].n * (size_t)grid->axis[1].n, fill_incidence, &(job){grid, model});
    return GONIO_OK;
}

void gonio_grid_free(gonio_grid *grid) {
    for (int k = 0; k < GONIO_GRID_AXES; k++) {
        free(grid->axis[k].deg);
    }
    free(grid->values);
    free(grid->names);
    *grid = (gonio_grid){0};
}

void gonio_grid_albedo(const gonio_grid *grid, const gonio_model *model, int in_phi, int in_theta, double *albedo) {
    enum { RINGS = 48, TURNS = 96 };
    double values[GONIO_CHANNELS_MAX];
    const gonio_vec3 wi = gonio_direction(gonio_radians(grid->axis[GONIO_GRID_IN_THETA].deg[in_theta]),
                                          gonio_radians(grid->axis[GONIO_GRID_IN_PHI].deg[in_phi]));
    for (int c = 0; c < grid->channels; c++) {
        albedo[c] = 0;
    }
    for (int k = 0; k < RINGS * TURNS; k++) {
        const double theta = asin(sqrt((k / TURNS + 0.5) / RINGS)); // NOLINT(bugprone-integer-division)
        gonio_model_eval(model, wi, gonio_direction(theta, 2 * GONIO_PI * (k % TURNS + 0.5) / TURNS), values);
        for (int c = 0; c < grid->channels; c++) {
            albedo[c] += fmax(values[c], 0) * GONIO_PI / (RINGS * TURNS);
        }
    }
    if (grid->xyz) {
        gonio_rgb_to_xyz((double[3]){albedo[0], albedo[1], albedo[2]}, albedo);
    }
}

void gonio_grid_put_axis(const gonio_grid *grid, int axis, const char *name, FILE *stream) {
    fprintf(stream, "%s %d\n", name, grid->axis[axis].n);
    for (int k = 0; k < grid->axis[axis].n; k++) {
        fprintf(stream, "%s%.9g", k > 0 ? " " : "", grid->axis[axis].deg[k]);
    }
    fputc('\n', stream);
}

double gonio_grid_written(gonio_grid *grid, int channel, int in_phi, int in_theta, int out_phi, int out_theta) {
    const double value = *gonio_grid_at(grid, channel, in_phi, in_theta, out_phi, out_theta);
    return isnan(value) ? 0 : value;
}

void gonio_grid_tell(const gonio_grid *grid, const gonio_model *model, gonio_write_report *told) {
    snprintf(told->about, sizeof told->about, "%d incident azimuths x %d angles, %d outgoing azimuths x %d angles",
             grid->axis[0].n, grid->axis[1].n, grid->axis[2].n, grid->axis[3].n);
    gonio_write_lost_channels(model, grid->channels, told);
    gonio_write_lost(told, "what lies between the nodes, and beyond 85 deg");
}

static gonio_status write_half(gonio_grid *grid, const gonio_model *model, const gonio_format_values *values,
                               bool closed, gonio_grid_put_fn *put, FILE *stream, gonio_write_report *told,
                               gonio_error *error) {
    gonio_model *seen = (gonio_model *)(uintptr_t)model;
    gonio_status status = model->channels == 1 ? GONIO_OK : gonio_model_as_rgb(model, &seen, error);
    if (status != GONIO_OK) {
        return status;
    }
    grid->xyz = seen->channels == 3;
    status = gonio_grid_of_model(grid, seen, values->at[0].count, closed, values->threads, error);
    if (status == GONIO_OK) {
        put(grid, seen, stream);
        if (grid->first) {
            gonio_grid_tell(grid, model, told);
        }
    }
    gonio_grid_free(grid);
    if (seen != model) {
        gonio_model_free(seen);
    }
    return status;
}

gonio_status gonio_grid_write_colours(const gonio_grid *head, const gonio_model *model,
                                      const gonio_format_values *values, bool closed, gonio_grid_put_fn *put,
                                      FILE *stream, gonio_write_report *told, gonio_error *error) {
    gonio_status status = GONIO_OK;
    int left = 0;
    for (int h = 0; h < GONIO_HALVES; h++) {
        left += gonio_written_half(model, values, (gonio_half)h) != NULL;
    }
    bool first = true;
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        const gonio_model *half = gonio_written_half(model, values, (gonio_half)h);
        if (half != NULL) {
            gonio_grid grid = *head;
            grid.half = (gonio_half)h;
            grid.first = first;
            grid.last = --left == 0;
            first = false;
            status = write_half(&grid, half, values, closed, put, stream, told, error);
        }
    }
    return status;
}
