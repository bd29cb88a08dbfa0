// SPDX-License-Identifier: BSD-3-Clause
// The bricks that a scene needs.
//
// The fine lattice's part of the value at a cell i that pictures ask for is the sum over its control points, w P; the
// part that stands in brick b, v_ib, is what the value loses without it. The variance of the pictures grows by about
// squares_i (v_ib d ln f / dv)^2, summed over the cells: that orders the bricks. Two bricks that only count together
// are thereby each counted as if the other were there, which a greedy search would do better at many times the cost;
// the pictures themselves are compared afterwards.
#include "fit/bilevel/needed.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/spline/overlay.h"
#include "fit/bilevel/bilevel.h"

#define SIGMA_LEVEL 2
#define LN_ABS_NORMAL 0.635 // E ln |x| of a standard normal is -0.635
#define EXACT 1e-5          // of the transform's unit: no residual is smaller

typedef struct unit {
    uint32_t number; // of the brick or control point
    double worth;
} unit;

struct gonio_needed {
    const gonio_samples *told;
    size_t n_cells;
    bool hashed;
    gonio_needed_form form;
    int threads;
    gonio_scatter scatter; // of told, in its order no more
    gonio_lattice diffuse, specular;
    size_t side; // bricks along an axis
    size_t units;
    unit *unit; // best first
};

// ---- the bricks' worth ----

static size_t unit_of(const gonio_needed *n, const size_t at[4]) {
    const gonio_lattice *l = &n->specular;
    if (n->hashed) {
        size_t point = 0;
        for (int d = 0; d < l->dims; d++) {
            point = point * l->size + at[d];
        }
        return point;
    }
    return (at[0] / 4 * n->side + at[1] / 4) * n->side + at[2] / 4;
}

// What each unit's control points make at x of one channel, up to 16 units apart (4-D: each point is its own).
typedef struct parts {
    int n;
    size_t unit[256];
    double value[256];
} parts;

static void split_value(const gonio_needed *n, const double *x, size_t channel, parts *p) {
    const gonio_lattice *l = &n->specular;
    double w[4][4];
    size_t first[4];
    p->n = 0;
    for (int d = 0; d < l->dims; d++) {
        first[d] = gonio_overlay_cell(x[d], l->level, w[d]);
    }
    for (size_t k = 0; k < (size_t)1 << 2 * l->dims; k++) {
        size_t at[4] = {0}, point = 0;
        double weight = 1;
        for (int d = 0; d < l->dims; d++) {
            const size_t step = k >> 2 * (l->dims - 1 - d) & 3;
            at[d] = first[d] + step;
            weight *= w[d][step];
            point = point * l->size + at[d];
        }
        const size_t u = unit_of(n, at);
        int i = 0;
        while (i < p->n && p->unit[i] != u) {
            i++;
        }
        if (i == p->n) {
            p->unit[p->n] = u;
            p->value[p->n++] = 0;
        }
        p->value[i] += weight * (double)l->points[point * (size_t)l->channels + channel];
    }
}

static double mean_value(const gonio_samples *s, size_t i) {
    double sum = 0;
    for (int c = 0; c < s->channels; c++) {
        sum += fabs(s->values[i * (size_t)s->channels + (size_t)c]);
    }
    return sum / s->channels;
}

static void add_worth(const gonio_needed *n, size_t i, const double *x, double squares, double *worth) {
    const gonio_scatter *s = &n->scatter;
    const size_t channels = (size_t)s->channels;
    const double mean = mean_value(n->told, i);
    parts p;
    for (size_t c = 0; c < channels && mean > 0; c++) {
        const double v = gonio_transform_apply(s->kind, &s->transforms[c], n->told->values[i * channels + c]),
                     slope = gonio_transform_slope(s->kind, &s->transforms[c], v) / mean;
        split_value(n, x, c, &p);
        for (int k = 0; k < p.n; k++) {
            worth[p.unit[k]] += squares * slope * slope * p.value[k] * p.value[k] / (double)channels;
        }
    }
}

static int by_worth(const void *left, const void *right) {
    const unit *a = left, *b = right;
    return a->worth != b->worth ? (a->worth < b->worth) - (a->worth > b->worth)
                                : (a->number > b->number) - (a->number < b->number);
}

static gonio_status rank(gonio_needed *n, const gonio_need *cells, gonio_error *error) {
    const size_t count = n->hashed ? n->specular.count : n->side * n->side * n->side;
    double *worth = calloc(count + 1, sizeof *worth);
    n->unit = malloc((count + 1) * sizeof *n->unit);
    if (worth == NULL || n->unit == NULL) {
        free(worth);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to rank %zu bricks", count);
    }
    for (size_t i = 0; i < n->n_cells; i++) {
        double x[GONIO_DIMS_MAX];
        gonio_scatter_locate(n->form.coordinates, n->specular.dims, &n->told->pairs[i], x);
        add_worth(n, i, x, cells[i].squares, worth);
        // Whoever renders asks for mirror images as well.
        for (int d = 0; d < n->specular.dims && n->scatter.mirror_axes != 0; d++) {
            x[d] = n->scatter.mirror_axes >> d & 1 ? 1 - x[d] : x[d];
        }
        if (n->scatter.mirror_axes != 0) {
            add_worth(n, i, x, cells[i].squares, worth);
        }
    }
    n->units = 0;
    for (size_t u = 0; u < count; u++) {
        if (worth[u] > 0) {
            n->unit[n->units++] = (unit){(uint32_t)u, worth[u]};
        }
    }
    qsort(n->unit, n->units, sizeof *n->unit, by_worth);
    free(worth);
    return GONIO_OK;
}

gonio_status gonio_needed_new(const gonio_samples *told, const gonio_need *cells, size_t n_cells, bool hashed,
                              const gonio_needed_form *form, int threads, gonio_needed **out, gonio_error *error) {
    const gonio_scatter_options how = {.coordinates = form->coordinates,
                                       .domain = form->domain,
                                       .symmetry = told->isotropic ? GONIO_SYMMETRY_MIRROR : 0,
                                       .weighted = true,
                                       .threads = threads};
    gonio_needed *n = calloc(1, sizeof *n);
    *out = NULL;
    if (n == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a fit");
    }
    n->told = told;
    n->n_cells = n_cells;
    n->hashed = hashed;
    n->form = *form;
    n->threads = threads;
    n->side = gonio_sparse_side(form->level);
    gonio_status status = gonio_scatter_init(&n->scatter, told, &how, error);
    if (status == GONIO_OK) {
        status = gonio_bilevel_split(&n->scatter, n->scatter.mean, form->diffuse, form->diffuse + 1, form->level,
                                     threads, &n->diffuse, &n->specular, error);
    }
    status = status == GONIO_OK ? rank(n, cells, error) : status;
    if (status != GONIO_OK) {
        gonio_needed_free(n);
        return status;
    }
    *out = n;
    return GONIO_OK;
}

void gonio_needed_free(gonio_needed *n) {
    if (n != NULL) {
        gonio_scatter_release(&n->scatter);
        gonio_lattice_release(&n->diffuse);
        gonio_lattice_release(&n->specular);
        free(n->unit);
        free(n);
    }
}

size_t gonio_needed_units(const gonio_needed *needed) { return needed->units; }

// ---- models ----

// keep[] of all control points; returns how many are kept.
static size_t choose(const gonio_needed *n, size_t units, bool *keep) {
    const gonio_lattice *l = &n->specular;
    size_t kept = 0;
    memset(keep, 0, l->count * sizeof *keep);
    for (size_t u = 0; u < units; u++) {
        if (n->hashed) {
            keep[n->unit[u].number] = true;
            kept++;
            continue;
        }
        const size_t k = n->unit[u].number % n->side * 4, j = n->unit[u].number / n->side % n->side * 4,
                     i = n->unit[u].number / n->side / n->side * 4;
        for (size_t p = 0; p < GONIO_BRICK_POINTS; p++) {
            const size_t a = i + p / 16, b = j + p / 4 % 4, c = k + p % 4;
            if (a < l->size && b < l->size && c < l->size) {
                keep[(a * l->size + b) * l->size + c] = true;
                kept++;
            }
        }
    }
    return kept;
}

static gonio_status pack(const gonio_needed *n, size_t units, gonio_storage storage, gonio_bilevel_parts *out,
                         gonio_error *error) {
    bool *keep = malloc(n->specular.count * sizeof *keep);
    if (keep == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to keep %zu bricks", units);
    }
    const size_t kept = choose(n, units < n->units ? units : n->units, keep);
    const gonio_status status = gonio_bilevel_pack_points(&n->diffuse, &n->specular, keep, kept, storage, out, error);
    free(keep);
    out->coordinates = n->form.coordinates;
    out->kind = n->scatter.kind;
    return status;
}

static gonio_status model_of(const gonio_needed *n, gonio_bilevel_parts *parts, gonio_model **out, gonio_error *error) {
    const gonio_status status =
        gonio_bilevel_model_new(parts, n->scatter.transforms, (const char(*)[32])n->told->channel_names, out, error);
    gonio_bilevel_parts_release(parts);
    return status;
}

gonio_status gonio_needed_model(const gonio_needed *n, size_t units, gonio_storage storage, gonio_model **out,
                                gonio_error *error) {
    gonio_bilevel_parts parts;
    *out = NULL;
    const gonio_status status = pack(n, units, storage, &parts, error);
    return status == GONIO_OK ? model_of(n, &parts, out, error) : status;
}

// ---- the uncertainty ----

// ln of what the model is off told (in the transform's unit, mean over the channels, told's own sigma with it), at the
// cells into the first channel, elsewhere into the second.
static void residuals(const gonio_needed *n, const gonio_model *model, size_t i, double *ln) {
    const gonio_scatter *s = &n->scatter;
    const size_t channels = (size_t)s->channels;
    double values[channels], squares = 0, own = 0;
    gonio_model_eval_pair(model, &n->told->pairs[i], values);
    for (size_t c = 0; c < channels; c++) {
        const double truth = n->told->values[i * channels + c],
                     v = gonio_transform_apply(s->kind, &s->transforms[c], truth),
                     off = gonio_transform_apply(s->kind, &s->transforms[c], values[c]) - v,
                     sigma = n->told->sigma_systematic[i * channels + c] /
                             fabs(gonio_transform_slope(s->kind, &s->transforms[c], v));
        squares += off * off / (double)channels;
        own += isfinite(sigma) ? sigma * sigma / (double)channels : 0;
    }
    *ln = 0.5 * log(squares * exp(2 * LN_ABS_NORMAL) + own + EXACT * EXACT);
}

// A coarse lattice through ln of the residuals of one class of told.
static gonio_status fit_field(const gonio_needed *n, const gonio_model *model, bool at_cells, gonio_lattice *field,
                              gonio_error *error) {
    gonio_samples *set;
    gonio_scatter scatter = {0};
    gonio_status status = gonio_samples_new(1, false, &set, error);
    const size_t begin = at_cells ? 0 : n->n_cells, end = at_cells ? n->n_cells : n->told->n;
    for (size_t i = begin; i < end && status == GONIO_OK; i++) {
        double ln;
        residuals(n, model, i, &ln);
        status = gonio_samples_add(set, &n->told->pairs[i], &ln, NULL, NULL, error);
    }
    if (status == GONIO_OK) {
        set->isotropic = n->told->isotropic;
        const gonio_scatter_options how = {.coordinates = n->form.coordinates,
                                           .domain = GONIO_LINEAR,
                                           .symmetry = set->isotropic ? GONIO_SYMMETRY_MIRROR : 0,
                                           .threads = n->threads};
        status = gonio_scatter_init(&scatter, set, &how, error);
    }
    status = status == GONIO_OK ? gonio_mba_fit(&scatter, scatter.mean, SIGMA_LEVEL, n->threads, field, error) : status;
    for (size_t i = 0; i < field->count && status == GONIO_OK; i++) {
        field->points[i] *= (float)scatter.transforms[0].scale;
    }
    gonio_scatter_release(&scatter);
    gonio_samples_free(set);
    return status;
}

static gonio_status add_sigma(const gonio_needed *n, const gonio_model *model, const gonio_model *coarse,
                              gonio_bilevel_parts *parts, gonio_error *error) {
    gonio_lattice inside = {0}, outside = {0};
    gonio_status status = fit_field(n, model, true, &inside, error);
    status = status == GONIO_OK ? fit_field(n, coarse, false, &outside, error) : status;
    status = status == GONIO_OK ? gonio_lattice_init(&parts->sigma, n->specular.dims, SIGMA_LEVEL, 2, error) : status;
    for (size_t i = 0; i < inside.count && status == GONIO_OK; i++) {
        parts->sigma.points[2 * i] = inside.points[i];
        parts->sigma.points[2 * i + 1] = outside.points[i];
    }
    gonio_lattice_release(&inside);
    gonio_lattice_release(&outside);
    return status;
}

size_t gonio_needed_sigma_bytes(int dims) { return 2 * gonio_lattice_count(dims, SIGMA_LEVEL) * sizeof(float); }

gonio_status gonio_needed_finish(const gonio_needed *n, size_t units, gonio_storage storage, gonio_model **out,
                                 gonio_error *error) {
    gonio_model *model = NULL, *coarse = NULL;
    gonio_bilevel_parts parts = {0};
    *out = NULL;
    gonio_status status = gonio_needed_model(n, units, storage, &model, error);
    status = status == GONIO_OK ? gonio_needed_model(n, 0, storage, &coarse, error) : status;
    status = status == GONIO_OK ? pack(n, units, storage, &parts, error) : status;
    status = status == GONIO_OK ? add_sigma(n, model, coarse, &parts, error) : status;
    if (status == GONIO_OK) {
        status = model_of(n, &parts, out, error);
    } else {
        gonio_bilevel_parts_release(&parts);
    }
    gonio_model_free(model);
    gonio_model_free(coarse);
    return status;
}
