// SPDX-License-Identifier: BSD-3-Clause
// A model of any kind, brought nearer to being reciprocal, isotropic, passive or separable: DeYoung 1996, 5.1 to 5.15.
//
// Most forms have no control points for "the mean of f and its exchanged value": a lattice in half-vector coordinates
// has them, one in isotropic Nusselt coordinates has not. Fitting again would change f where the property asks for
// nothing. So the model is kept as it is, the transformation beside it, and both are evaluated: the property then holds
// to rounding. A transformed model may be transformed again.
#include "brdf/kind/transformed.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/kind.h"
#include "gonio/sample.h"

#define TURN (2 * GONIO_PI)

typedef struct transformed {
    gonio_model head;
    gonio_transformed_parts parts; // its arrays are owned
    gonio_model *inner;
    char (*names)[32];
    gonio_mapped mapped; // what the inner model was read from
} transformed;

// As it stands in a file, before the factors, the tables and the inner model's file.
typedef struct description {
    uint32_t what, geometric;
    double delta;
    uint64_t knots, products, thetas, phis, inner;
} description;
_Static_assert(sizeof(description) == 56, "the description is written as it stands");

// ---- evaluation ----

// v turned by the angle of this cosine and sine.
static gonio_vec3 turned(gonio_vec3 v, double c, double s) {
    return (gonio_vec3){c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

static double factor(const transformed *m, gonio_vec3 v) {
    const double at = gonio_direction_theta(v) / (GONIO_PI / 2) * (double)(m->parts.knots - 1);
    const size_t k = (size_t)fmin(fmax(at, 0), (double)(m->parts.knots - 2));
    const double t = fmin(fmax(at - (double)k, 0), 1);
    return m->parts.factors[k] * (1 - t) + m->parts.factors[k + 1] * t;
}

// Four places of a table and their weights.
typedef struct spot {
    size_t at[4];
    double weight[4];
} spot;

static spot spot_of(const gonio_transformed_parts *p, gonio_vec3 v) {
    const double row =
        fmin(fmax(gonio_direction_theta(v) / (GONIO_PI / 2) * (double)p->thetas - 0.5, 0), (double)(p->thetas - 1));
    const double phi = gonio_direction_phi(v), column = (phi < 0 ? phi + TURN : phi) / TURN * (double)p->phis;
    const size_t i = (size_t)row, j = (size_t)column % p->phis, down = i + 1 < p->thetas ? i + 1 : i;
    const size_t right = (j + 1) % p->phis;
    const double s = row - (double)i, t = column - floor(column);
    return (spot){{i * p->phis + j, i * p->phis + right, down * p->phis + j, down * p->phis + right},
                  {(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t}};
}

static double looked_up(const double *table, const spot *s) {
    return table[s->at[0]] * s->weight[0] + table[s->at[1]] * s->weight[1] + table[s->at[2]] * s->weight[2] +
           table[s->at[3]] * s->weight[3];
}

static void separated(const transformed *m, gonio_vec3 wi, gonio_vec3 wo, double *target) {
    const gonio_transformed_parts *p = &m->parts;
    const size_t c = (size_t)m->head.channels, side = p->thetas * p->phis;
    const spot in = spot_of(p, wi), out = spot_of(p, wo);
    memset(target, 0, c * sizeof *target);
    for (size_t k = 0; k < p->products * c; k++) {
        target[k % c] += looked_up(p->tables + 2 * k * side, &in) * looked_up(p->tables + (2 * k + 1) * side, &out);
    }
}

static void averaged(const transformed *m, gonio_vec3 wi, gonio_vec3 wo, double *target) {
    const size_t c = (size_t)m->head.channels;
    double values[GONIO_CHANNELS_MAX];
    // From the light's azimuth on, so that turning both directions changes rounding alone.
    const double s = hypot(wi.x, wi.y), x = s > 0 ? wi.x / s : 1, y = s > 0 ? wi.y / s : 0;
    gonio_vec3 i = {s, 0, wi.z}, o = {wo.x * x + wo.y * y, wo.y * x - wo.x * y, wo.z};
    const double step_c = cos(TURN / GONIO_TRANSFORMED_TURNS), step_s = sin(TURN / GONIO_TRANSFORMED_TURNS);
    memset(target, 0, c * sizeof *target);
    for (int k = 0; k < GONIO_TRANSFORMED_TURNS; k++) {
        gonio_model_eval(m->inner, i, o, values);
        i = turned(i, step_c, step_s);
        o = turned(o, step_c, step_s);
        for (size_t j = 0; j < c; j++) {
            target[j] += values[j] / GONIO_TRANSFORMED_TURNS;
        }
    }
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const transformed *m = (const transformed *)model;
    const gonio_transformed_parts *p = &m->parts;
    double target[GONIO_CHANNELS_MAX];
    const size_t c = (size_t)model->channels;
    gonio_model_eval(m->inner, wi, wo, values);
    if (p->what == GONIO_MADE_SCALED || p->what == GONIO_MADE_PASSIVE) {
        const double by = factor(m, wi) * (p->what == GONIO_MADE_PASSIVE ? factor(m, wo) : 1);
        for (size_t k = 0; k < c; k++) {
            values[k] *= by;
        }
        return;
    }
    if (p->what == GONIO_MADE_RECIPROCAL) {
        gonio_model_eval(m->inner, wo, wi, target);
        for (size_t k = 0; k < c; k++) {
            target[k] = (values[k] + target[k]) / 2;
        }
    } else if (p->what == GONIO_MADE_ISOTROPIC) {
        averaged(m, wi, wo, target);
    } else {
        separated(m, wi, wo, target);
    }
    for (size_t k = 0; k < c; k++) {
        const bool powers = p->geometric && values[k] > 0 && target[k] > 0;
        values[k] = p->delta == 1 ? target[k]
                    : powers      ? pow(values[k], 1 - p->delta) * pow(target[k], p->delta)
                                  : (1 - p->delta) * values[k] + p->delta * target[k];
    }
}

// A model's errors at neighbouring directions are alike, so a mean of them has no smaller sigma.
static void sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *out) {
    const transformed *m = (const transformed *)model;
    const gonio_transformed_parts *p = &m->parts;
    double other[GONIO_CHANNELS_MAX], by = 1;
    gonio_model_sigma(m->inner, wi, wo, out);
    if (p->what == GONIO_MADE_RECIPROCAL) {
        gonio_model_sigma(m->inner, wo, wi, other);
        for (int k = 0; k < model->channels; k++) {
            out[k] = (1 - p->delta / 2) * out[k] + p->delta / 2 * other[k];
        }
    }
    if (p->what == GONIO_MADE_SCALED || p->what == GONIO_MADE_PASSIVE) {
        by = factor(m, wi) * (p->what == GONIO_MADE_PASSIVE ? factor(m, wo) : 1);
    }
    for (int k = 0; k < model->channels; k++) {
        out[k] *= by;
    }
}

// The change is the same for all materials: what the samples say of the inner model they say of this one.
static double support(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    return gonio_model_support(((const transformed *)model)->inner, wi, wo);
}

// ---- the model file's section: the description, factors, tables, then the inner model's own file ----

static size_t table_count(const gonio_transformed_parts *p, size_t channels) {
    return p->products * channels * 2 * p->thetas * p->phis;
}

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const transformed *m = (const transformed *)model;
    const gonio_transformed_parts *p = &m->parts;
    gonio_file_part inner;
    gonio_status status = gonio_model_file_bytes(m->inner, &inner, error);
    if (status != GONIO_OK) {
        return status;
    }
    const description about = {(uint32_t)p->what, p->geometric, p->delta, p->knots,
                               p->products,       p->thetas,    p->phis,  inner.length};
    const gonio_file_part parts[4] = {{&about, sizeof about},
                                      {p->factors, p->knots * sizeof(double)},
                                      {p->tables, table_count(p, (size_t)model->channels) * sizeof(double)},
                                      inner};
    status = gonio_model_file_write(model, stream, parts, 4, error);
    free((void *)(uintptr_t)inner.data);
    return status;
}

static bool finite_all(const double *values, size_t n) {
    for (size_t k = 0; k < n; k++) {
        if (!isfinite(values[k])) {
            return false;
        }
    }
    return true;
}

static bool possible(const gonio_transformed_parts *p) {
    const bool factors = p->what == GONIO_MADE_SCALED || p->what == GONIO_MADE_PASSIVE;
    const bool tables = p->what == GONIO_MADE_SEPARABLE;
    return (int)p->what >= 0 && p->what < GONIO_TRANSFORMATIONS && p->delta >= 0 && p->delta <= 1 &&
           (factors ? p->knots >= 2 && p->knots <= 4096 : p->knots == 0) &&
           (tables ? p->products >= 1 && p->products <= GONIO_TRANSFORMED_PRODUCTS_MAX && p->thetas >= 1 &&
                         p->thetas <= 1024 && p->phis >= 1 && p->phis <= 4096
                   : p->products == 0 && p->thetas == 0 && p->phis == 0);
}

static gonio_transformed_parts parts_of(const description *about) {
    return (gonio_transformed_parts){.what = (gonio_transformation)about->what,
                                     .delta = about->delta,
                                     .geometric = about->geometric == 1,
                                     .knots = about->knots,
                                     .products = about->products,
                                     .thetas = about->thetas,
                                     .phis = about->phis};
}

static bool is_sound(const description *about, const gonio_transformed_parts *p) {
    return about->what < GONIO_TRANSFORMATIONS && about->geometric <= 1 && possible(p);
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    const gonio_transformed_parts none = {0};
    gonio_transformed_parts p = about != NULL ? parts_of(about) : none;
    if (about == NULL || !is_sound(about, &p)) {
        return gonio_mapped_fail(mapped, 0, "no transformation that this program knows", error);
    }
    const size_t tables = table_count(&p, (size_t)mapped->channels), factors_at = at;
    p.factors = gonio_mapped_take(mapped, &at, p.knots * sizeof(double));
    p.tables = gonio_mapped_take(mapped, &at, tables * sizeof(double));
    const size_t inner_at = at;
    if (p.factors == NULL || p.tables == NULL || !finite_all(p.factors, p.knots) || !finite_all(p.tables, tables)) {
        return gonio_mapped_fail(mapped, factors_at, "its tables are short or not finite", error);
    }
    gonio_model *inner;
    gonio_status status = mapped->open_part(mapped, inner_at, (size_t)about->inner, &inner, error);
    if (status != GONIO_OK) {
        return status;
    }
    const bool same = inner->channels == mapped->channels &&
                      memcmp(inner->channel_names, mapped->names, 32 * (size_t)mapped->channels) == 0;
    if (!same) {
        gonio_model_free(inner);
        return gonio_mapped_fail(mapped, inner_at, "the model inside has other channels", error);
    }
    status = gonio_transformed_new(inner, &p, out, error);
    if (status != GONIO_OK) {
        gonio_model_free(inner);
        return status;
    }
    ((transformed *)*out)->mapped = *mapped; // the inner model reads from it
    *mapped = (gonio_mapped){0};
    return GONIO_OK;
}

// ---- the model ----

static void release(gonio_model *model) {
    transformed *m = (transformed *)model;
    gonio_model_free(m->inner);
    gonio_mapped_release(&m->mapped);
    free((double *)m->parts.factors);
    free((double *)m->parts.tables);
    free(m->names);
    free(m);
}

void gonio_transformed_abandon(gonio_model *model) {
    transformed *m = (transformed *)model;
    m->inner = NULL;
    gonio_model_free(model);
}

#define OPS .kind = "transformed", .eval = eval, .save = save, .free = release
static const gonio_model_ops ops_support = {OPS, .sigma = sigma, .support = support};
static const gonio_model_ops ops_sigma = {OPS, .sigma = sigma};
static const gonio_model_ops ops_plain = {OPS};

static double *copied(const double *from, size_t n) {
    double *to = malloc((n + 1) * sizeof *to);
    if (to != NULL && n > 0) {
        memcpy(to, from, n * sizeof *to);
    }
    return to;
}

gonio_status gonio_transformed_new(gonio_model *inner, const gonio_transformed_parts *parts, gonio_model **out,
                                   gonio_error *error) {
    *out = NULL;
    const size_t c = (size_t)inner->channels;
    if (!possible(parts)) {
        return gonio_fail(error, GONIO_E_RANGE, "no transformation: delta %g; expected 0 to 1", parts->delta);
    }
    if (inner->ops->both_sides) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "a model of halves, of which reflection and transmission would each need its own change");
    }
    transformed *m = calloc(1, sizeof *m);
    if (m != NULL) {
        m->parts = *parts;
        m->parts.factors = copied(parts->factors, parts->knots);
        m->parts.tables = copied(parts->tables, table_count(parts, c));
        m->names = malloc(c * sizeof *m->names);
    }
    if (m == NULL || m->parts.factors == NULL || m->parts.tables == NULL || m->names == NULL) {
        if (m != NULL) {
            release(&m->head);
        }
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a transformed model");
    }
    memcpy(m->names, inner->channel_names, c * sizeof *m->names);
    m->inner = inner;
    m->head = *inner;
    m->head.sampler = NULL;
    m->head.about = NULL; // of the inner one; whoever makes this one says what it is made of
    m->head.ops = inner->ops->support != NULL ? &ops_support : inner->ops->sigma != NULL ? &ops_sigma : &ops_plain;
    m->head.channel_names = (const char(*)[32])m->names;
    m->head.isotropic = (inner->isotropic && parts->what != GONIO_MADE_SEPARABLE) ||
                        (parts->what == GONIO_MADE_ISOTROPIC && parts->delta == 1);
    m->head.bytes += (parts->knots + table_count(parts, c)) * sizeof(double);
    *out = &m->head;
    return GONIO_OK;
}

const gonio_kind gonio_kind_transformed = {
    .name = "transformed",
    .summary = "another model brought nearer to reciprocity, isotropy, energy conservation or separability",
    .ops = &ops_support,
    .read = read_model,
};
