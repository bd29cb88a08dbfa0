// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "lattice": evaluation, gradient, file section.
//
// Section: 64 bytes of description, the transforms, the control points, each part aligned (brdf/model_file.h).
#include "brdf/kind/lattice.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/channels.h"
#include "brdf/kind.h"
#include "brdf/locate.h"
#include "brdf/model_file.h"
#include "brdf/spline/lattice_eval.h"

typedef struct lattice_model {
    gonio_channels channels;
    gonio_lattice lattice;
    gonio_coordinates coordinates;
} lattice_model;

typedef struct description {
    uint32_t dims, level, coordinates, kind;
    uint32_t reserved[12];
} description;
_Static_assert(sizeof(description) == 64, "the description is one block");

static inline void locate(const lattice_model *m, gonio_vec3 wi, gonio_vec3 wo, double x[4]) {
    if (m->lattice.dims == 4) {
        gonio_coordinates_anisotropic(m->coordinates, wi, wo, x);
    } else {
        gonio_locate_isotropic(m->coordinates, wi, wo, x);
    }
}

static inline void position_of(const lattice_model *m, gonio_vec3 wi, gonio_vec3 wo, gonio_position *position) {
    double x[4] = {0};
    locate(m, wi, wo, x);
    gonio_position_set(position, x[0], x[1], x[2], x[3]);
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const lattice_model *m = (const lattice_model *)model;
    gonio_position position;
    position_of(m, wi, wo, &position);
    float v[model->channels];
    gonio_lattice_eval_positions(&m->lattice, 1, &position, v);
    for (int c = 0; c < model->channels; c++) {
        values[c] = gonio_transform_invert(m->channels.kind, &m->channels.transforms[c], (double)v[c]);
    }
}

static void eval_f32(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, float *values) {
    const lattice_model *m = (const lattice_model *)model;
    gonio_position position;
    position_of(m, wi, wo, &position);
    gonio_lattice_eval_positions(&m->lattice, 1, &position, values);
    for (int c = 0; c < model->channels; c++) {
        values[c] = (float)gonio_transform_invert(m->channels.kind, &m->channels.transforms[c], (double)values[c]);
    }
}

static double eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    const lattice_model *m = (const lattice_model *)model;
    double x[4];
    locate(m, wi, wo, x);
    return gonio_transform_invert(m->channels.kind, &m->channels.transforms[channel],
                                  gonio_lattice_eval_channel(&m->lattice, x, channel));
}

#define BATCH 128 // positions at a time: their values stay in the first-level cache

static void eval_many(const gonio_model *model, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo, double *values) {
    const lattice_model *m = (const lattice_model *)model;
    const size_t channels = (size_t)model->channels, batch = channels > BATCH ? 1 : BATCH / channels;
    gonio_position positions[BATCH];
    float v[channels > BATCH ? channels : BATCH];
    for (size_t begin = 0; begin < n; begin += batch) {
        const size_t count = n - begin < batch ? n - begin : batch;
        for (size_t i = 0; i < count; i++) {
            position_of(m, wi[begin + i], wo[begin + i], &positions[i]);
        }
        gonio_lattice_eval_positions(&m->lattice, count, positions, v);
        double *out = values + begin * channels;
        for (size_t i = 0; i < count; i++) {
            for (size_t c = 0; c < channels; c++) {
                *out++ =
                    gonio_transform_invert(m->channels.kind, &m->channels.transforms[c], (double)v[i * channels + c]);
            }
        }
    }
}

// Exact through the lattice; the coordinates' own derivatives are central differences in double (their maps are smooth
// and have no rounding to speak of, so a step of 1e-6 leaves 1e-10), one-sided at the edges of the hemisphere.
static void gradient(const gonio_model *model, const gonio_pair *pair, int channel, double out[4]) {
    const lattice_model *m = (const lattice_model *)model;
    const double angles[4] = {pair->theta_i, pair->phi_i, pair->theta_o, pair->phi_o}, step = 1e-6;
    double x[4], slope[4];
    locate(m, gonio_direction(angles[0], angles[1]), gonio_direction(angles[2], angles[3]), x);
    const double v = gonio_lattice_gradient(&m->lattice, x, channel, slope);
    const double outer = gonio_transform_slope(m->channels.kind, &m->channels.transforms[channel], v);
    for (int k = 0; k < 4; k++) {
        double low[4], high[4], a[4], b[4];
        memcpy(low, angles, sizeof low);
        memcpy(high, angles, sizeof high);
        low[k] = k % 2 == 0 ? fmax(angles[k] - step, 0) : angles[k] - step;
        high[k] = k % 2 == 0 ? fmin(angles[k] + step, GONIO_PI / 2) : angles[k] + step;
        locate(m, gonio_direction(low[0], low[1]), gonio_direction(low[2], low[3]), a);
        locate(m, gonio_direction(high[0], high[1]), gonio_direction(high[2], high[3]), b);
        double sum = 0;
        for (int d = 0; d < m->lattice.dims; d++) {
            sum += slope[d] * (b[d] - a[d]) / (high[k] - low[k]);
        }
        out[k] = outer * sum;
    }
}

static void release(gonio_model *model) {
    lattice_model *m = (lattice_model *)model;
    if (m->channels.mapped.base == NULL) {
        gonio_lattice_release(&m->lattice);
    }
    gonio_channels_free(&m->channels);
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const lattice_model *m = (const lattice_model *)model;
    const description about = {.dims = (uint32_t)m->lattice.dims,
                               .level = (uint32_t)m->lattice.level,
                               .coordinates = (uint32_t)m->coordinates,
                               .kind = (uint32_t)m->channels.kind};
    const size_t c = (size_t)model->channels;
    const gonio_file_part parts[] = {
        {&about, sizeof about},
        {m->channels.transforms, c * sizeof *m->channels.transforms},
        {m->lattice.points, m->lattice.count * c * sizeof(float)},
    };
    return gonio_model_file_write(model, stream, parts, 3, error);
}

static const gonio_model_ops lattice_ops = {
    .kind = "lattice",
    .eval = eval,
    .eval_f32 = eval_f32,
    .eval_channel = eval_channel,
    .eval_many = eval_many,
    .gradient = gradient,
    .save = save,
    .free = release,
};

static gonio_status new_model(const gonio_lattice *lattice, gonio_coordinates coordinates, gonio_transform_kind kind,
                              const gonio_transform *transforms, const char (*names)[32], lattice_model **out,
                              gonio_error *error) {
    void *model;
    const size_t c = (size_t)lattice->channels;
    const gonio_status status =
        gonio_channels_new(sizeof **out, lattice->channels, kind, transforms, names, &model, error);
    if (status != GONIO_OK) {
        return status;
    }
    lattice_model *m = *out = model;
    m->coordinates = coordinates;
    m->lattice = *lattice;
    gonio_model *head = &m->channels.head;
    head->ops = &lattice_ops;
    head->isotropic = lattice->dims == 3;
    head->control_points = lattice->count;
    head->bytes = (lattice->count * sizeof(float) + sizeof *transforms) * c + sizeof *m;
    return GONIO_OK;
}

gonio_status gonio_lattice_model_new(gonio_lattice *lattice, gonio_coordinates coordinates, gonio_transform_kind kind,
                                     const gonio_transform *transforms, const char (*channel_names)[32],
                                     gonio_model **out, gonio_error *error) {
    lattice_model *m;
    const gonio_status status = new_model(lattice, coordinates, kind, transforms, channel_names, &m, error);
    *out = status == GONIO_OK ? &m->channels.head : NULL;
    lattice->points = status == GONIO_OK ? NULL : lattice->points;
    return status;
}

static gonio_status check_description(const gonio_mapped *mapped, const description *about, gonio_error *error) {
    if (about == NULL) {
        return gonio_mapped_fail(mapped, 0, "the lattice's description is cut short", error);
    }
    if (about->dims != (mapped->isotropic ? 3u : 4u) || about->level > 9 || about->coordinates >= GONIO_COORDINATES ||
        about->kind > GONIO_TRANSFORM_ASINH) {
        return gonio_mapped_fail(mapped, 0, "a lattice of impossible dimensions, level, coordinates or domain", error);
    }
    return GONIO_OK;
}

static gonio_lattice lattice_in(const description *about, int channels, const float *points) {
    return (gonio_lattice){.dims = (int)about->dims,
                           .level = (int)about->level,
                           .channels = channels,
                           .size = gonio_bspline_size((int)about->level),
                           .count = gonio_lattice_count((int)about->dims, (int)about->level),
                           .points = (float *)(uintptr_t)points}; // never written: models are immutable
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    gonio_status status = check_description(mapped, about, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t c = (size_t)mapped->channels, transforms_at = at;
    const gonio_transform *transforms = gonio_mapped_take(mapped, &at, c * sizeof *transforms);
    const size_t points_at = at, count = gonio_lattice_count((int)about->dims, (int)about->level);
    const float *points = transforms != NULL && count <= SIZE_MAX / sizeof(float) / c
                              ? gonio_mapped_take(mapped, &at, count * c * sizeof(float))
                              : NULL;
    if (points == NULL) {
        return gonio_mapped_fail(mapped, transforms == NULL ? transforms_at : points_at,
                                 "fewer control points than its level and channels need", error);
    }
    if (!gonio_scales_possible(&transforms->scale, c, about->kind != GONIO_TRANSFORM_LINEAR)) {
        return gonio_mapped_fail(mapped, transforms_at, "a channel's scale or eps that no fit makes", error);
    }
    const gonio_lattice lattice = lattice_in(about, mapped->channels, points);
    lattice_model *m;
    status = new_model(&lattice, (gonio_coordinates)about->coordinates, (gonio_transform_kind)about->kind, transforms,
                       NULL, &m, error);
    if (status == GONIO_OK) {
        gonio_channels_adopt(&m->channels, mapped);
        *out = &m->channels.head;
    }
    return status;
}

const gonio_lattice *gonio_lattice_model_lattice(const gonio_model *model) {
    return model->ops == &lattice_ops ? &((const lattice_model *)model)->lattice : NULL;
}

void gonio_lattice_model_about(const gonio_model *model, gonio_coordinates *coordinates, gonio_transform_kind *kind,
                               const gonio_transform **transforms) {
    const lattice_model *m = (const lattice_model *)model;
    if (coordinates != NULL) {
        *coordinates = m->coordinates;
    }
    if (kind != NULL) {
        *kind = m->channels.kind;
    }
    if (transforms != NULL) {
        *transforms = m->channels.transforms;
    }
}

const gonio_kind gonio_kind_lattice = {
    .name = "lattice",
    .summary = "a tensor-product cubic B-spline over the coordinates of a direction pair",
    .ops = &lattice_ops,
    .read = read_model,
};
