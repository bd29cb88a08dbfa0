// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "lobe-spline": the base that fits work with, the model and its operations.
#include "brdf/kind/lobe_spline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/kind.h"
#include "brdf/kind/lobe_spline_model.h"

// The unit vector of the same azimuth whose cosine is at least z.
static gonio_vec3 lifted(gonio_vec3 w, double z) {
    if (w.z >= z) {
        return w;
    }
    const double shrink = sqrt((1 - z * z) / (w.x * w.x + w.y * w.y));
    return (gonio_vec3){w.x * shrink, w.y * shrink, z};
}

void gonio_lobe_base_units(const gonio_lobe_base *base, gonio_vec3 wi, gonio_vec3 wo, double out[1 + GONIO_LOBES_MAX]) {
    out[0] = 1;
    if (base->lobes == 0) {
        const double least = (double)base->cosine_min;
        out[0] = base->grazing > 0 ? -(double)base->grazing * log(fmax(wi.z, least) * fmax(wo.z, least)) : 0;
        return;
    }
    const gonio_lobe_geometry g = gonio_lobe_geometry_of(lifted(wi, base->cosine_min), lifted(wo, base->cosine_min));
    for (int j = 0; j < base->lobes; j++) {
        out[1 + j] = base->family == GONIO_LOBE_GGX ? gonio_lobe_ggx(&g, base->alpha[j], base->alpha[j], base->f0[j])
                                                    : gonio_lobe_cook_torrance(&g, base->alpha[j], base->f0[j]);
    }
}

const char *gonio_lobe_base_name(const gonio_lobe_base *base) {
#define NAME(id, number, name) [number] = name,
    static const char *const names[] = {GONIO_LOBE_FAMILY_TABLE(NAME)};
#undef NAME
    return base->lobes == 0 ? "none" : names[base->family];
}

void gonio_lobe_mean_strengths(const gonio_lobe_base *base, int channels, double mean[1 + GONIO_LOBES_MAX]) {
    for (int j = 0; j < 1 + GONIO_LOBES_MAX; j++) {
        mean[j] = 0;
        for (int c = 0; c < channels && j <= base->lobes; c++) {
            mean[j] += base->strength[c * (1 + GONIO_LOBES_MAX) + j] / channels;
        }
    }
}

void gonio_lobe_shares(const gonio_lobe_base *base, const double *mean, const double *units,
                       double share[1 + GONIO_LOBES_MAX]) {
    double sum = 0;
    for (int j = 0; j < 1 + GONIO_LOBES_MAX; j++) {
        share[j] = j <= base->lobes ? mean[j] * units[j] : 0;
        sum += share[j];
    }
    for (int j = 0; j < 1 + GONIO_LOBES_MAX; j++) {
        share[j] = sum > 0 ? share[j] / sum : 0;
    }
}

double gonio_lobe_base_transformed(const gonio_lobe_base *base, const double *strength, const double *units,
                                   gonio_transform_kind kind, const gonio_transform *transform) {
    if (base->lobes == 0) {
        return units[0];
    }
    double sum = strength[0];
    for (int j = 0; j < base->lobes; j++) {
        sum += strength[1 + j] * units[1 + j];
    }
    return gonio_transform_apply(kind, transform, fmin(sum, GONIO_LOBE_CEILING * transform->scale));
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    gonio_lobe_spline_eval((const gonio_lobe_spline *)model, &wi, &wo, 0, (size_t)model->channels, values, NULL, NULL);
}

static void eval_f32(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, float *values) {
    gonio_lobe_spline_eval((const gonio_lobe_spline *)model, &wi, &wo, 0, (size_t)model->channels, NULL, values, NULL);
}

static double eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    double value;
    gonio_lobe_spline_eval((const gonio_lobe_spline *)model, &wi, &wo, (size_t)channel, 1, &value, NULL, NULL);
    return value;
}

static void eval_many(const gonio_model *model, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo, double *values) {
    gonio_lobe_spline_eval_many((const gonio_lobe_spline *)model, n, wi, wo, values);
}

// A sigma_t of 100 is as good as infinite.
#define SIGMA_MAX 100.0

// sigma_z = dz/dt sigma_t.
static void sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *out) {
    const gonio_lobe_spline *m = (const gonio_lobe_spline *)model;
    gonio_lobe_spline_eval(m, &wi, &wo, 0, (size_t)model->channels, NULL, NULL, out);
    const double shape = gonio_lobe_spline_sigma_shape(m, &wi, &wo);
    for (int c = 0; c < model->channels; c++) {
        const double sigma_t = shape * m->parts.sigma_factor[c];
        out[c] *= m->parts.kind == GONIO_TRANSFORM_LINEAR ? sigma_t : fmin(sigma_t, SIGMA_MAX);
    }
}

static double support(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    return fmin(fmax(gonio_lobe_spline_support((const gonio_lobe_spline *)model, &wi, &wo), 0), 1);
}

static void release(gonio_model *model) {
    gonio_lobe_spline *m = (gonio_lobe_spline *)model;
    if (m->mapped.base == NULL) {
        gonio_lobe_spline_parts_release(&m->parts);
    }
    gonio_mapped_release(&m->mapped);
    free(m->tables);
    free(m->names);
    free(m);
}

// The base's lobes, as GGX's, whose tails are the heavier; without any, what stands in for them.
static int propose(const gonio_lobe_spline *m, gonio_proposal *out) {
    const gonio_lobe_base *base = &m->parts.base;
    if (base->lobes == 0) {
        return gonio_proposals_standard(out);
    }
    out[0] = (gonio_proposal){.shape = GONIO_PROPOSE_COSINE, .strength = GONIO_PI * m->mean_strength[0], .f0 = 1};
    const double ceiling = GONIO_LOBE_CEILING * m->parts.transforms[0].scale;
    for (int j = 0; j < base->lobes; j++) {
        // A lobe that towers over the ceiling is cut there, and reaches as far as it is above it.
        const double alpha = base->alpha[j], strength = m->mean_strength[1 + j];
        const double over = strength / (4 * GONIO_PI * alpha * alpha * ceiling), wide = over > 1 ? 1 + log(over) : 1;
        out[1 + j] = (gonio_proposal){GONIO_PROPOSE_GGX, alpha * sqrt(wide), alpha * sqrt(wide),
                                      over > 1 ? strength * wide / over : strength, base->f0[j]};
    }
    return 1 + base->lobes;
}

static double sample(const gonio_model *model, gonio_vec3 wi, const double u[2], gonio_vec3 *wo) {
    gonio_proposal proposals[1 + GONIO_LOBES_MAX];
    return gonio_proposals_sample(proposals, propose((const gonio_lobe_spline *)model, proposals), wi, u, wo);
}

static double pdf(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    gonio_proposal proposals[1 + GONIO_LOBES_MAX];
    return gonio_proposals_pdf(proposals, propose((const gonio_lobe_spline *)model, proposals), wi, wo);
}

#define OPS                                                                                                            \
    .kind = "lobe-spline", .eval = eval, .eval_f32 = eval_f32, .eval_channel = eval_channel, .eval_many = eval_many,   \
    .gradient = gonio_lobe_spline_gradient, .sample = sample, .pdf = pdf, .save = gonio_lobe_spline_save,              \
    .free = release
static const gonio_model_ops ops = {OPS};
static const gonio_model_ops ops_sigma = {OPS, .sigma = sigma};
static const gonio_model_ops ops_support = {OPS, .sigma = sigma, .support = support};

static void fill_tables(gonio_lobe_spline *m) {
    const gonio_lobe_spline_parts *p = &m->parts;
    for (int c = 0; c < p->channels; c++) {
        const gonio_transform *transform = &p->transforms[c];
        double *t = m->tables + c;
        for (int j = 0; j <= p->base.lobes; j++) {
            const ptrdiff_t at = c * (1 + GONIO_LOBES_MAX) + j;
            t[(size_t)(GONIO_LOBE_STRENGTH + j) * m->stride] =
                p->base.lobes > 0 ? p->base.strength[at] / transform->scale : 0;
            t[(size_t)(GONIO_LOBE_SHARE + j) * m->stride] = p->shares != NULL ? p->shares[at] : 0;
        }
        const double top = gonio_transform_apply(p->kind, transform, transform->scale);
        t[GONIO_LOBE_LOW * m->stride] = p->range != NULL ? p->range[2 * c] : -INFINITY;
        t[GONIO_LOBE_HIGH * m->stride] = p->range != NULL ? p->range[2 * c + 1] : INFINITY;
        t[GONIO_LOBE_EPS * m->stride] = transform->eps;
        t[GONIO_LOBE_HALF_PER * m->stride] = 1 / (2 * transform->eps);
        t[GONIO_LOBE_TOP * m->stride] = p->kind == GONIO_TRANSFORM_POSITIVE ? exp(top) : top;
        t[GONIO_LOBE_SCALE * m->stride] = transform->scale;
    }
}

// Make the tables and the head of a model whose parts are there; the tables are the model's to free.
static gonio_status prepare(gonio_lobe_spline *m, gonio_error *error) {
    const gonio_lobe_spline_parts *p = &m->parts;
    const size_t c = (size_t)p->channels;
    m->stride = c + GONIO_LANES_MAX - 1;
    m->tables = calloc(GONIO_LOBE_TABLES * m->stride, sizeof *m->tables);
    if (m->tables == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", c);
    }
    fill_tables(m);
    m->locator = gonio_locator_of(p->coordinates, p->dims);
    m->sigma_locator = gonio_locator_of(p->sigma_half_vector ? GONIO_HALF_VECTOR : p->coordinates, p->dims);
    gonio_lobe_mean_strengths(&p->base, p->base.lobes > 0 ? p->channels : 0, m->mean_strength);
    for (int j = 0; j < p->base.lobes; j++) {
        m->per_alpha2[j] = 1 / (p->base.alpha[j] * p->base.alpha[j]);
    }
    m->head.ops = p->support.points != NULL ? &ops_support : p->sigma.points != NULL ? &ops_sigma : &ops;
    m->head.channels = p->channels;
    m->head.isotropic = p->dims == 3;
    m->head.control_points =
        (p->lattice.points != NULL ? p->lattice.count : 0) + (p->profile.points != NULL ? p->profile.count : 0);
    m->head.bytes = sizeof *m + c * sizeof *p->transforms + (p->base.lobes > 0 ? c * 3 * sizeof(double) : 0) +
                    GONIO_LOBE_TABLES * m->stride * sizeof *m->tables + m->head.control_points * c * sizeof(float);
    return GONIO_OK;
}

void gonio_lobe_spline_parts_release(gonio_lobe_spline_parts *parts) {
    free(parts->transforms);
    free(parts->base.strength);
    free(parts->sigma_factor);
    free(parts->range);
    free(parts->shares);
    gonio_lattice_release(&parts->lattice);
    gonio_lattice_release(&parts->sigma);
    gonio_lattice_release(&parts->support);
    gonio_lattice_release(&parts->profile);
    *parts = (gonio_lobe_spline_parts){0};
}

gonio_status gonio_lobe_spline_new(gonio_lobe_spline_parts *parts, gonio_model **out, gonio_error *error) {
    *out = NULL;
    const size_t c = (size_t)parts->channels;
    gonio_lobe_spline *m = calloc(1, sizeof *m);
    if (m == NULL || (m->names = malloc(c * sizeof *m->names)) == NULL) {
        free(m);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", c);
    }
    memcpy(m->names, parts->channel_names, c * sizeof *m->names);
    m->head.channel_names = (const char(*)[32])m->names;
    m->parts = *parts;
    m->parts.channel_names = m->head.channel_names;
    const gonio_status status = prepare(m, error);
    if (status != GONIO_OK) {
        free(m->names);
        free(m);
        return status;
    }
    *parts = (gonio_lobe_spline_parts){0};
    *out = &m->head;
    return GONIO_OK;
}

void gonio_lobe_spline_take(gonio_model *model, gonio_lobe_spline_parts *parts) {
    gonio_lobe_spline *m = (gonio_lobe_spline *)model;
    *parts = m->parts;
    m->parts = (gonio_lobe_spline_parts){0};
    gonio_model_free(model);
}

const gonio_lobe_spline_parts *gonio_lobe_spline_about(const gonio_model *model) {
    const bool ours = model->ops == &ops || model->ops == &ops_sigma || model->ops == &ops_support;
    return ours ? &((const gonio_lobe_spline *)model)->parts : NULL;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    gonio_lobe_spline_parts parts;
    gonio_status status = gonio_lobe_spline_read_parts(mapped, &parts, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_lobe_spline *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %d channels", mapped->channels);
    }
    m->parts = parts;
    m->head.channel_names = mapped->names;
    status = prepare(m, error);
    if (status != GONIO_OK) {
        free(m);
        return status;
    }
    m->mapped = *mapped;
    *mapped = (gonio_mapped){0};
    *out = &m->head;
    return GONIO_OK;
}

const gonio_kind gonio_kind_lobe_spline = {
    .name = "lobe-spline",
    .summary = "analytic lobes times what a B-spline says about their error, with an uncertainty; either may be absent",
    .ops = &ops_support,
    .read = read_model,
};
