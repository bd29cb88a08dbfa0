// SPDX-License-Identifier: BSD-3-Clause
// Hierarchical B-splines, Forsey and Bartels, "Hierarchical B-spline refinement" (1988), as DeYoung (1996),
// section 3.2.4, proposes them for BRDFs: "areas of the surface that are very smooth are represented with a coarse
// control mesh, while the control mesh is denser in areas of greater detail". The value is the coarse spline's plus
// that of every overlay, a spline of twice as many cells a side whose control points are zero but where detail is; each
// overlay is an offset from those below it. Control points of overlays come in bricks of 4 a side, and where there are
// none a look at the table tells.
#include "brdf/kind/hierarchical.h"

#include <stdlib.h>
#include <string.h>

#include "brdf/channels.h"
#include "brdf/kind.h"

typedef struct hierarchical_model {
    gonio_channels channels;
    gonio_lattice coarse;
    int overlays;
    gonio_overlay overlay[GONIO_OVERLAYS_MAX];
    gonio_coordinates coordinates;
} hierarchical_model;

typedef struct description {
    uint32_t dims, level, coordinates, transform, overlays, bricks[GONIO_OVERLAYS_MAX], reserved[3];
} description;
_Static_assert(sizeof(description) == 64, "the description is one block");

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const hierarchical_model *m = (const hierarchical_model *)model;
    double x[4], sums[model->channels];
    if (m->coarse.dims == 4) {
        gonio_coordinates_anisotropic(m->coordinates, wi, wo, x);
    } else {
        gonio_coordinates_isotropic(m->coordinates, wi, wo, x);
    }
    gonio_lattice_eval(&m->coarse, x, sums);
    for (int k = 0; k < m->overlays; k++) {
        gonio_overlay_add(&m->overlay[k], x, sums);
    }
    for (int c = 0; c < model->channels; c++) {
        values[c] = gonio_transform_invert(m->channels.kind, &m->channels.transforms[c], sums[c]);
    }
}

static void release(gonio_model *model) {
    hierarchical_model *m = (hierarchical_model *)model;
    for (int k = 0; m->channels.mapped.base == NULL && k < m->overlays; k++) {
        free((void *)(uintptr_t)m->overlay[k].table);
        free((void *)(uintptr_t)m->overlay[k].data);
    }
    if (m->channels.mapped.base == NULL) {
        gonio_lattice_release(&m->coarse);
    }
    gonio_channels_free(&m->channels);
}

static size_t table_bytes(const gonio_overlay *o) { return gonio_overlay_places(o->dims, o->level) * sizeof *o->table; }

static size_t data_bytes(const gonio_overlay *o) {
    return o->bricks * gonio_overlay_brick_points(o->dims) * o->channels * sizeof *o->data;
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const hierarchical_model *m = (const hierarchical_model *)model;
    const size_t channels = (size_t)model->channels;
    description about = {.dims = (uint32_t)m->coarse.dims,
                         .level = (uint32_t)m->coarse.level,
                         .coordinates = (uint32_t)m->coordinates,
                         .transform = (uint32_t)m->channels.kind,
                         .overlays = (uint32_t)m->overlays};
    gonio_file_part parts[3 + 2 * GONIO_OVERLAYS_MAX] = {
        {&about, sizeof about},
        {m->channels.transforms, channels * sizeof(gonio_transform)},
        {m->coarse.points, m->coarse.count * channels * sizeof(float)},
    };
    int n = 3;
    for (int k = 0; k < m->overlays; k++) {
        about.bricks[k] = (uint32_t)m->overlay[k].bricks;
        parts[n++] = (gonio_file_part){m->overlay[k].table, table_bytes(&m->overlay[k])};
        parts[n++] = (gonio_file_part){m->overlay[k].data, data_bytes(&m->overlay[k])};
    }
    return gonio_model_file_write(model, stream, parts, n, error);
}

static const gonio_model_ops ops = {.kind = "hierarchical", .eval = eval, .save = save, .free = release};

gonio_status gonio_hierarchical_new(const gonio_hierarchical_parts *p, gonio_model **out, gonio_error *error) {
    void *model;
    *out = NULL;
    const gonio_status status = gonio_channels_new(sizeof(hierarchical_model), p->coarse.channels, p->kind,
                                                   p->transforms, p->names, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    hierarchical_model *m = model;
    gonio_model *head = &m->channels.head;
    m->coarse = p->coarse;
    m->overlays = p->overlays;
    memcpy(m->overlay, p->overlay, sizeof m->overlay);
    m->coordinates = p->coordinates;
    head->ops = &ops;
    head->isotropic = p->coarse.dims == 3;
    head->control_points = p->coarse.count;
    head->bytes = sizeof *m + (size_t)head->channels * (sizeof *p->transforms + p->coarse.count * sizeof(float));
    for (int k = 0; k < p->overlays; k++) {
        head->control_points += p->overlay[k].bricks * gonio_overlay_brick_points(p->coarse.dims);
        head->bytes += table_bytes(&p->overlay[k]) + data_bytes(&p->overlay[k]);
    }
    *out = head;
    return GONIO_OK;
}

// ---- reading ----

static bool possible(const description *d, bool isotropic) {
    return d != NULL && d->dims == (isotropic ? 3U : 4U) && d->level <= 9 && d->overlays <= GONIO_OVERLAYS_MAX &&
           d->level + d->overlays <= 9 && d->coordinates < GONIO_COORDINATES &&
           d->transform <= GONIO_TRANSFORM_POSITIVE;
}

static gonio_status take_overlay(const gonio_mapped *mapped, size_t *at, const description *d, int index,
                                 gonio_overlay *o, gonio_error *error) {
    const size_t begin = *at;
    *o = (gonio_overlay){.dims = (int)d->dims,
                         .level = (int)d->level + 1 + index,
                         .channels = (size_t)mapped->channels,
                         .bricks = d->bricks[index]};
    o->side = gonio_overlay_side(o->level);
    o->table = gonio_mapped_take(mapped, at, table_bytes(o));
    o->data = o->table != NULL ? gonio_mapped_take(mapped, at, data_bytes(o)) : NULL;
    if (o->data == NULL) {
        return gonio_mapped_fail(mapped, begin, "an overlay with fewer bricks than it says", error);
    }
    const size_t places = gonio_overlay_places(o->dims, o->level);
    for (size_t k = 0; k < places; k++) {
        if (o->table[k] > o->bricks) {
            return gonio_mapped_fail(mapped, begin, "a brick that is not there", error);
        }
    }
    return GONIO_OK;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0;
    const description *d = gonio_mapped_take(mapped, &at, sizeof *d);
    if (!possible(d, mapped->isotropic)) {
        return gonio_mapped_fail(mapped, 0, "impossible dimensions, levels, coordinates or domain", error);
    }
    const size_t channels = (size_t)mapped->channels, transforms_at = at;
    const gonio_transform *transforms = gonio_mapped_take(mapped, &at, channels * sizeof *transforms);
    if (transforms == NULL ||
        !gonio_scales_possible(&transforms->scale, channels, d->transform != GONIO_TRANSFORM_LINEAR)) {
        return gonio_mapped_fail(mapped, transforms_at, "a channel's scale or eps that no fit makes", error);
    }
    gonio_hierarchical_parts p = {
        .coarse = {.dims = (int)d->dims, .level = (int)d->level, .channels = mapped->channels},
        .overlays = (int)d->overlays,
        .coordinates = (gonio_coordinates)d->coordinates,
        .kind = (gonio_transform_kind)d->transform,
        .transforms = transforms};
    p.coarse.size = gonio_bspline_size(p.coarse.level);
    p.coarse.count = gonio_lattice_count(p.coarse.dims, p.coarse.level);
    const size_t points_at = at;
    p.coarse.points = (float *)(uintptr_t)gonio_mapped_take(mapped, &at, p.coarse.count * channels * sizeof(float));
    gonio_status status =
        p.coarse.points != NULL
            ? GONIO_OK
            : gonio_mapped_fail(mapped, points_at, "fewer control points than its level needs", error);
    for (int k = 0; k < p.overlays && status == GONIO_OK; k++) {
        status = take_overlay(mapped, &at, d, k, &p.overlay[k], error);
    }
    status = status == GONIO_OK ? gonio_hierarchical_new(&p, out, error) : status;
    if (status == GONIO_OK) {
        gonio_channels_adopt(&((hierarchical_model *)*out)->channels, mapped);
    }
    return status;
}

const gonio_kind gonio_kind_hierarchical = {
    .name = "hierarchical",
    .summary = "a coarse B-spline and overlays of finer ones where there is detail",
    .ops = &ops,
    .read = read_model,
};
