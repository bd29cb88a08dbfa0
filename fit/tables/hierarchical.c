// SPDX-License-Identifier: BSD-3-Clause
// Hierarchical B-splines, Forsey and Bartels (1988), fitted as Wong (1995; DeYoung 1996, section 3.2.4) does, refined
// where the residual asks; brdf/kind/hierarchical.c.
//
// The coarse lattice is that of multilevel B-splines. Level after level, the samples of the cells whose residuals are
// still large (by their root mean square, over the channels) get an overlay of twice as many cells: control points that
// are the means, with weights w^2, of what each sample would want of them by itself, w r / sum w^2 (Lee, Wolberg and
// Shin 1997, eq. 3 to 5), as in the dense fit, whose every cell would ask. Which level is the last, a fifth of the
// samples that the others predict says.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/kind/hierarchical.h"
#include "fit/deadline.h"
#include "fit/mba/mba.h"
#include "fit/memory.h"
#include "fit/method.h"

#define COARSE_USUAL 3
#define WORTH 0.9                          // of the squared error that is left by a level that is worth its bytes
static const int finest_usual[2] = {7, 5}; // in three and four dimensions
// A cell asks where its residuals exceed this: 1 % of the values in the log domain, 0.1 % of the largest in the linear
// one.
static const double asks[2] = {1e-3, 1e-2};

typedef struct work {
    const gonio_scatter *scatter;
    size_t channels;
    double *residuals; // [n][channels]
    bool *held;        // [n]: judges, and is not fitted
    gonio_hierarchical_parts parts;
} work;

static void place_of(const gonio_scatter *s, size_t sample, bool mirrored, double x[4]) {
    for (int d = 0; d < s->dims; d++) {
        x[d] = (double)s->positions[sample * (size_t)s->dims + (size_t)d] * 0x1p-32;
        x[d] = mirrored && (s->mirror_axes >> d & 1) ? 1 - x[d] : x[d];
    }
}

static double square_of(const work *w, size_t sample) {
    double sum = 0;
    for (size_t c = 0; c < w->channels; c++) {
        const double r = w->residuals[sample * w->channels + c];
        sum += r * r;
    }
    return sum / (double)w->channels;
}

// ---- which cells ask ----

static size_t cell_of(const gonio_scatter *s, size_t sample, int level) {
    size_t cell = 0;
    for (int d = 0; d < s->dims; d++) {
        cell = cell << level | gonio_bspline_cell(s->positions[sample * (size_t)s->dims + (size_t)d], level);
    }
    return cell;
}

typedef struct numbered {
    size_t cell, sample;
} numbered;

static int by_cell(const void *a, const void *b) {
    const numbered *x = a, *y = b;
    return x->cell != y->cell ? (x->cell > y->cell) - (x->cell < y->cell)
                              : (x->sample > y->sample) - (x->sample < y->sample);
}

// active[n]: samples of cells of the level that ask; how many there are, or -1 without memory.
static long mark_active(const work *w, int level, double limit, bool *active) {
    const gonio_scatter *s = w->scatter;
    numbered *order = malloc(s->n * sizeof *order);
    size_t n = 0;
    long count = 0;
    for (size_t i = 0; order != NULL && i < s->n; i++) {
        active[i] = false;
        if (!w->held[i]) {
            order[n++] = (numbered){cell_of(s, i, level), i};
        }
    }
    if (order == NULL) {
        return -1;
    }
    qsort(order, n, sizeof *order, by_cell);
    for (size_t begin = 0, end; begin < n; begin = end) {
        double sum = 0;
        for (end = begin; end < n && order[end].cell == order[begin].cell; end++) {
            sum += square_of(w, order[end].sample);
        }
        for (size_t k = begin; k < end && sqrt(sum / (double)(end - begin)) > limit; k++) {
            active[order[k].sample] = true;
            count++;
        }
    }
    free(order);
    return count;
}

// ---- an overlay ----

// Sums of numerators and denominators, in bricks that come into being as they are touched.
typedef struct growing {
    gonio_overlay overlay;
    uint32_t *table;
    double *sums; // [bricks][points][channels + 1]
    size_t room;
} growing;

static double *point_at(growing *g, const size_t *at) {
    const gonio_overlay *o = &g->overlay;
    const size_t points = gonio_overlay_brick_points(o->dims), size = points * (o->channels + 1);
    size_t place = 0, inner = 0;
    for (int d = 0; d < o->dims; d++) {
        place = place * o->side + at[d] / 4;
        inner = inner * 4 + at[d] % 4;
    }
    if (g->table[place] == 0) {
        if (g->overlay.bricks == g->room) {
            const size_t room = g->room > 0 ? 2 * g->room : 64;
            double *sums = realloc(g->sums, room * size * sizeof *sums);
            if (sums == NULL) {
                return NULL;
            }
            memset(sums + g->room * size, 0, (room - g->room) * size * sizeof *sums);
            g->sums = sums;
            g->room = room;
        }
        g->table[place] = (uint32_t)++g->overlay.bricks;
    }
    return g->sums + (g->table[place] - 1) * size + inner * (o->channels + 1);
}

static bool add_sample(growing *g, const double *x, double weight, const double *residual) {
    const gonio_overlay *o = &g->overlay;
    double w[4][4], squares = 1;
    size_t first[4];
    for (int d = 0; d < o->dims; d++) {
        first[d] = gonio_overlay_cell(x[d], o->level, w[d]);
        squares *= w[d][0] * w[d][0] + w[d][1] * w[d][1] + w[d][2] * w[d][2] + w[d][3] * w[d][3];
    }
    for (size_t k = 0; k < (size_t)1 << (2 * o->dims); k++) {
        size_t at[4];
        double product = 1;
        for (int d = 0; d < o->dims; d++) {
            at[d] = first[d] + (k >> (2 * d) & 3);
            product *= w[d][k >> (2 * d) & 3];
        }
        double *point = product > 0 ? point_at(g, at) : NULL;
        if (product > 0 && point == NULL) {
            return false;
        }
        for (size_t c = 0; product > 0 && c < o->channels; c++) {
            point[c] += weight * product * product * (product * residual[c] / squares);
        }
        if (product > 0) {
            point[o->channels] += weight * product * product;
        }
    }
    return true;
}

// A brick's control points in place of its sums; the largest of them.
static double divide(const gonio_overlay *o, const double *sums, float *points) {
    double largest = 0;
    for (size_t k = 0; k < gonio_overlay_brick_points(o->dims); k++, sums += o->channels + 1) {
        for (size_t c = 0; c < o->channels; c++) {
            const double value = sums[o->channels] > 0 ? sums[c] / sums[o->channels] : 0;
            points[k * o->channels + c] = (float)value;
            largest = fmax(largest, fabs(value));
        }
    }
    return largest;
}

// The overlay's control points; bricks that add nothing of matter go, and so do the sums.
static bool finish(growing *g, double limit) {
    gonio_overlay *o = &g->overlay;
    const size_t points = gonio_overlay_brick_points(o->dims), places = gonio_overlay_places(o->dims, o->level);
    float *data = malloc((o->bricks * points * o->channels + 1) * sizeof *data);
    size_t kept = 0;
    for (size_t k = 0; data != NULL && k < places; k++) {
        if (g->table[k] != 0) {
            const double *sums = g->sums + (g->table[k] - 1) * points * (o->channels + 1);
            const double largest = divide(o, sums, data + kept * points * o->channels);
            g->table[k] = largest >= limit ? (uint32_t)++kept : 0;
        }
    }
    o->bricks = kept;
    o->table = g->table;
    float *smaller = data != NULL ? realloc(data, (kept * points * o->channels + 1) * sizeof *data) : NULL;
    o->data = smaller != NULL ? smaller : data;
    free(g->sums);
    return data != NULL;
}

static gonio_status add_overlay(work *w, int level, double limit, const bool *active, gonio_error *error) {
    const gonio_scatter *s = w->scatter;
    growing g = {
        .overlay = {.dims = s->dims, .level = level, .channels = w->channels, .side = gonio_overlay_side(level)}};
    g.table = calloc(gonio_overlay_places(s->dims, level), sizeof *g.table);
    bool enough = g.table != NULL;
    for (size_t i = 0; i < s->n && enough; i++) {
        for (int side = 0; side < (s->mirror_axes != 0 ? 2 : 1) && active[i] && enough; side++) {
            double x[4];
            place_of(s, i, side == 1, x);
            enough = add_sample(&g, x, s->weights != NULL ? (double)s->weights[i] : 1, w->residuals + i * w->channels);
        }
    }
    if (!enough || !finish(&g, limit)) {
        free(g.table);
        free(enough ? NULL : g.sums);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for an overlay of level %d", level);
    }
    w->parts.overlay[w->parts.overlays++] = g.overlay;
    double sums[w->channels];
    for (size_t i = 0; i < s->n; i++) {
        double x[4];
        place_of(s, i, false, x);
        memset(sums, 0, sizeof sums);
        gonio_overlay_add(&g.overlay, x, sums);
        for (size_t c = 0; c < w->channels; c++) {
            w->residuals[i * w->channels + c] -= sums[c];
        }
    }
    return GONIO_OK;
}

// ---- the hierarchy ----

static void release(work *w) {
    gonio_lattice_release(&w->parts.coarse);
    for (int k = 0; k < w->parts.overlays; k++) {
        free((void *)(uintptr_t)w->parts.overlay[k].table);
        free((void *)(uintptr_t)w->parts.overlay[k].data);
    }
    w->parts.overlays = 0;
}

// The coarse lattice, of the samples that are not held; what it leaves in the residuals.
static gonio_status fit_coarse(work *w, int level, int threads, gonio_error *error) {
    const gonio_scatter *s = w->scatter;
    gonio_scatter part = *s;
    float *weights = malloc(s->n * sizeof *weights);
    if (weights == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu weights", s->n);
    }
    for (size_t i = 0; i < s->n; i++) {
        weights[i] = w->held[i] ? 0 : s->weights != NULL ? s->weights[i] : 1;
    }
    part.weights = weights;
    const gonio_status status = gonio_mba_fit(&part, s->mean, level, threads, &w->parts.coarse, error);
    free(weights);
    double sums[w->channels];
    for (size_t i = 0; i < s->n && status == GONIO_OK; i++) {
        double x[4];
        place_of(s, i, false, x);
        gonio_lattice_eval(&w->parts.coarse, x, sums);
        for (size_t c = 0; c < w->channels; c++) {
            w->residuals[i * w->channels + c] = (double)s->values[i * w->channels + c] - sums[c];
        }
    }
    return status;
}

static double held_error(const work *w) {
    double sum = 0;
    for (size_t i = 0; i < w->scatter->n; i++) {
        sum += w->held[i] ? square_of(w, i) : 0;
    }
    return sum;
}

// Overlays up to `finest`; *best: the level that predicts what is held best.
static gonio_status refine(work *w, int coarse, int finest, double limit, gonio_deadline *watch, int *best,
                           gonio_error *error) {
    bool *active = malloc(w->scatter->n * sizeof *active);
    gonio_status status = active != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to refine");
    double least = held_error(w);
    *best = coarse;
    for (int level = coarse + 1; level <= finest && status == GONIO_OK; level++) {
        status = gonio_deadline_report(watch, (double)(level - coarse) / (finest - coarse + 1), "refining", error);
        // A cell of the level below asks for a finer one.
        const long count = status == GONIO_OK ? mark_active(w, level - 1, limit, active) : 0;
        if (count < 0) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory to refine");
        }
        if (status != GONIO_OK || count == 0) {
            break;
        }
        status = add_overlay(w, level, limit, active, error);
        const double now = held_error(w);
        if (now < least * WORTH) {
            least = now;
            *best = level;
        }
    }
    free(active);
    return status;
}

static void hold(work *w, bool any) {
    for (size_t i = 0; i < w->scatter->n; i++) {
        w->held[i] = any && w->scatter->n >= 20 && i % 5 == 2;
    }
}

static gonio_status fit_scatter(work *w, const gonio_samples *samples, const gonio_fit_options *options,
                                gonio_model **out, gonio_fit_report *report, gonio_error *error) {
    const gonio_scatter *s = w->scatter;
    gonio_deadline watch = gonio_deadline_begin(options);
    const double limit = asks[s->kind != GONIO_TRANSFORM_LINEAR];
    int last = options->level != GONIO_LEVEL_AUTO ? options->level : finest_usual[s->dims - 3], best;
    int coarse = options->diffuse_level >= 0 ? options->diffuse_level : COARSE_USUAL - (s->dims == 4);
    coarse = coarse < last ? coarse : last;
    if (last - coarse > GONIO_OVERLAYS_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "levels %d to %d; at most %d overlays are possible", coarse, last,
                          GONIO_OVERLAYS_MAX);
    }
    gonio_status status = GONIO_OK;
    if (options->level == GONIO_LEVEL_AUTO) {
        hold(w, true);
        status = fit_coarse(w, coarse, options->threads, error);
        status = status == GONIO_OK ? refine(w, coarse, last, limit, &watch, &best, error) : status;
        last = status == GONIO_OK ? best : last;
        release(w);
    }
    hold(w, false);
    status = status == GONIO_OK ? fit_coarse(w, coarse, options->threads, error) : status;
    status = status == GONIO_OK ? refine(w, coarse, last, limit, &watch, &best, error) : status;
    w->parts.coordinates = s->coordinates;
    w->parts.kind = s->kind;
    w->parts.transforms = s->transforms;
    w->parts.names = (const char(*)[32])samples->channel_names;
    report->level = last;
    report->coordinates = s->coordinates;
    report->domain = s->kind == GONIO_TRANSFORM_LINEAR ? GONIO_LINEAR : GONIO_LOG;
    snprintf(report->options, sizeof report->options, "coarse=%d overlays=%d", coarse, w->parts.overlays);
    status = status == GONIO_OK ? gonio_hierarchical_new(&w->parts, out, error) : status;
    if (status != GONIO_OK) {
        release(w);
    }
    return status;
}

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    const gonio_scatter_options how = {
        .coordinates = options->coordinates != GONIO_COORDINATES_AUTO ? options->coordinates : GONIO_HALF_VECTOR,
        .domain = options->domain != GONIO_DOMAIN_AUTO ? options->domain : GONIO_LOG,
        .symmetry = samples->isotropic ? GONIO_SYMMETRY_MIRROR : 0,
        .weighted = true,
        .threads = options->threads};
    gonio_scatter scatter;
    *out = NULL;
    gonio_status status = gonio_scatter_init(&scatter, samples, &how, error);
    if (status != GONIO_OK) {
        return status;
    }
    work w = {.scatter = &scatter, .channels = (size_t)scatter.channels};
    w.residuals = malloc(scatter.n * w.channels * sizeof *w.residuals);
    w.held = malloc(scatter.n * sizeof *w.held);
    status = w.residuals != NULL && w.held != NULL
                 ? fit_scatter(&w, samples, options, out, report, error)
                 : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu residuals", scatter.n);
    free(w.residuals);
    free(w.held);
    gonio_scatter_release(&scatter);
    return status;
}

// Every sample touches 2^dims bricks a level, of which there are no more than the lattice has.
static double memory(const gonio_fit_size *size, double n) {
    const double brick = (size->dims == 4 ? 256 : 64) * (12.0 * size->channels + 8),
                 touched = n * (size->dims == 4 ? 32 : 16);
    double bytes = gonio_lattice_fit_memory(size, n) + n * (8.0 * size->channels + 32);
    for (int level = COARSE_USUAL; level <= (size->level > 0 ? size->level : finest_usual[size->dims - 3]); level++) {
        const double places = (double)gonio_overlay_places(size->dims, level);
        bytes += places * 4 + fmin(places, touched) * brick;
    }
    return bytes;
}

static const gonio_method_option options_of_hierarchical[] = {
    GONIO_METHOD_OPTION(level, "of the finest overlay"),
    GONIO_METHOD_OPTION(coordinates, "half-vector"),
    GONIO_METHOD_OPTION(domain, "log"),
    GONIO_METHOD_OPTION(diffuse_level, "of the coarse lattice (3; 2 in 4-D)"),
    {0}};

static const gonio_method_form forms[] = {{GONIO_LEVEL_AUTO, GONIO_LEVEL_AUTO, GONIO_NUSSELT, GONIO_LOG, NULL},
                                          GONIO_METHOD_FORM_AUTO};

const gonio_method gonio_method_hierarchical = {
    .name = "hierarchical",
    .summary = "a coarse B-spline with overlays of finer ones where the residual asks",
    .kind = "hierarchical",
    .options = options_of_hierarchical,
    .fit = fit,
    .memory = memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
