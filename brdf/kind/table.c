// SPDX-License-Identifier: BSD-3-Clause
// A table of samples over a grid of angles (brdf/grid/grid.h), after DeYoung, "Properties of tabulated bidirectional
// reflectance distribution functions" (1996), sections 3.2.1 to 3.2.3. What stands at the nodes is transformed values,
// and between them
//   linear  lies their multilinear interpolant: in four dimensions the 16 corners about the place;
//   cubic   lies the uniform cubic B-spline of which they are the control points: the samples themselves (his control
//           mesh, which does not pass through them), or those of the spline that does (fit/tables/).
// Where it carries uncertainties, they are of the transformed values, at the nodes, with straight lines between them.
// At the poles and across the azimuth where it begins nothing has an edge: the grid goes on beyond them.
#include "brdf/kind/table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/grid/grid_model.h"

typedef struct table_model {
    gonio_grid_model base;
    gonio_grid_degree degree;
    const float *points;
    const float *spread; // NULL: no uncertainty
} table_model;

// The transformed values of all channels at the place x of the pair, which is told too.
static void look_up(const table_model *m, gonio_vec3 wi, gonio_vec3 wo, double x[4], double *sums) {
    size_t nodes[GONIO_GRID_POINTS_MAX];
    double weights[GONIO_GRID_POINTS_MAX];
    gonio_grid_locate(&m->base.grid, wi, wo, x);
    const int n = gonio_grid_points(&m->base.grid, m->degree, x, nodes, weights);
    gonio_grid_sum(m->points, (size_t)m->base.channels.head.channels, n, nodes, weights, sums);
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const table_model *m = (const table_model *)model;
    double x[4], sums[model->channels];
    look_up(m, wi, wo, x, sums);
    gonio_grid_invert(&m->base, sums, values);
}

static double eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    const table_model *m = (const table_model *)model;
    size_t nodes[GONIO_GRID_POINTS_MAX];
    double weights[GONIO_GRID_POINTS_MAX], x[4], sum = 0;
    gonio_grid_locate(&m->base.grid, wi, wo, x);
    const int n = gonio_grid_points(&m->base.grid, m->degree, x, nodes, weights);
    for (int k = 0; k < n; k++) {
        sum += weights[k] * (double)m->points[nodes[k] * (size_t)model->channels + (size_t)channel];
    }
    return gonio_transform_invert(m->base.channels.kind, &m->base.channels.transforms[channel], sum);
}

static void sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *out) {
    const table_model *m = (const table_model *)model;
    const size_t channels = (size_t)model->channels;
    size_t nodes[GONIO_GRID_POINTS_MAX];
    double weights[GONIO_GRID_POINTS_MAX], x[4], sums[channels];
    look_up(m, wi, wo, x, sums);
    const int corners = gonio_grid_points(&m->base.grid, GONIO_GRID_LINEAR, x, nodes, weights);
    gonio_grid_sum(m->spread, channels, corners, nodes, weights, out);
    for (size_t c = 0; c < channels; c++) {
        out[c] *= fabs(gonio_transform_slope(m->base.channels.kind, &m->base.channels.transforms[c], sums[c]));
    }
}

static void release(gonio_model *model) {
    table_model *m = (table_model *)model;
    if (m->base.channels.mapped.base == NULL) {
        free((void *)(uintptr_t)m->points);
        free((void *)(uintptr_t)m->spread);
    }
    gonio_channels_free(&m->base.channels);
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const table_model *m = (const table_model *)model;
    const size_t channels = (size_t)model->channels;
    gonio_grid_description about = gonio_grid_describe(&m->base);
    about.own[0] = (uint32_t)m->degree;
    about.own[1] = m->spread != NULL;
    const size_t bytes = m->base.grid.count * channels * sizeof(float);
    const gonio_file_part parts[] = {{&about, sizeof about},
                                     {m->base.channels.transforms, channels * sizeof(gonio_transform)},
                                     {m->points, bytes},
                                     {m->spread, bytes}};
    return gonio_model_file_write(model, stream, parts, m->spread != NULL ? 4 : 3, error);
}

static const gonio_model_ops ops = {
    .kind = "table",
    .eval = eval,
    .eval_channel = eval_channel,
    .sigma = sigma,
    .save = save,
    .free = release,
};
static const gonio_model_ops ops_without = {
    .kind = "table",
    .eval = eval,
    .eval_channel = eval_channel,
    .save = save,
    .free = release,
};

static void finish(table_model *m, gonio_grid_degree degree, const float *points, const float *spread) {
    gonio_model *head = &m->base.channels.head;
    m->degree = degree;
    m->points = points;
    m->spread = spread;
    head->ops = spread != NULL ? &ops : &ops_without;
    head->control_points = m->base.grid.count;
    head->bytes += (spread != NULL ? 2 : 1) * m->base.grid.count * (size_t)head->channels * sizeof(float);
}

gonio_status gonio_table_new(const gonio_table_parts *p, gonio_model **out, gonio_error *error) {
    void *model;
    const gonio_status status = gonio_grid_model_new(sizeof(table_model), &ops, &p->grid, p->channels, p->kind,
                                                     p->transforms, p->names, &model, error);
    *out = NULL;
    if (status == GONIO_OK) {
        finish(model, p->degree, p->points, p->spread);
        *out = model;
    }
    return status;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    const gonio_grid_description *about;
    void *model;
    size_t at = 0;
    const gonio_status status = gonio_grid_model_read(mapped, sizeof(table_model), &ops, &at, &about, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    table_model *m = model;
    const size_t points_at = at, bytes = m->base.grid.count * (size_t)mapped->channels * sizeof(float);
    const float *points = gonio_mapped_take(mapped, &at, bytes);
    const float *spread = points != NULL && about->own[1] == 1 ? gonio_mapped_take(mapped, &at, bytes) : NULL;
    const bool nodes = points != NULL && (about->own[1] == 0 || spread != NULL);
    if (about->own[0] >= GONIO_GRID_DEGREES || about->own[1] > 1 || !nodes) {
        gonio_channels_free(&m->base.channels);
        return gonio_mapped_fail(mapped, nodes ? 0 : points_at,
                                 !nodes ? "fewer nodes than its level and channels need"
                                        : "a way between nodes that is neither linear nor cubic, or no kind of sigma",
                                 error);
    }
    finish(m, (gonio_grid_degree)about->own[0], points, spread);
    gonio_channels_adopt(&m->base.channels, mapped);
    *out = &m->base.channels.head;
    return GONIO_OK;
}

const gonio_kind gonio_kind_table = {
    .name = "table",
    .summary = "values, or a cubic spline's control points, at the nodes of a grid of angles",
    .ops = &ops,
    .read = read_model,
};
