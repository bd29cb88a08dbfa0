// SPDX-License-Identifier: BSD-3-Clause
// Where the knots of a pass stand.
//
// A knot is the mean of order - 1 neighbouring parameters out of `count` of them (eq. 12), so that the least squares
// have one solution (Schoenberg and Whitney 1953). The parameters are those of dominant columns: from the two ends on,
// the span of columns whose polylines leave their chords farthest is split where both parts are as long, over all
// polylines; what is found depends on the data alone and each set holds the smaller ones, so a search for the number
// needs them once. The paper's points are (i / m_r, j / m_c, |p|); along a polyline the first is constant, and heights
// are two-dimensional. |p| as it is makes the choice depend on the unit of f_r: where |p| is far above 1, chords are so
// steep that heights are differences of j / m_c. So |p| is taken over its largest value unless told otherwise. Lengths
// then tell nothing of a narrow peak, since all other polylines are flat beside it, and splits halve their way to it;
// where |p| is taken over its mean value, they go straight there. "adaptive" does the one for heights, the other for
// lengths.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/bvb/loft.h"
#include "fit/names.h"

#define CHUNK 256 // polylines at a time
#define TIE 1e-5  // heights and lengths this near are alike: what rounding tells apart is not to move knots
#define FLAT 1e-6 // heights below it are rounding of the table's values

#define KNOTS_NAME(id, name, summary) name,
static const char *const knots_names[] = {GONIO_KNOTS_TABLE(KNOTS_NAME) NULL};
#undef KNOTS_NAME
const char *const *gonio_knots_names(void) { return knots_names; }

void gonio_columns_release(gonio_columns *c) {
    free(c->height);
    free(c->length);
    free(c->chosen);
    free(c->spans);
    free(c->partial);
    *c = (gonio_columns){0};
}

static size_t chunks_of(const gonio_columns *c) { return (c->lines + CHUNK - 1) / CHUNK; }

typedef struct view {
    gonio_columns *columns;
    const float *values;
    size_t size, inner, channels;
    double unit;
} view;

static void take_heights(void *context, size_t line) {
    const view *v = context;
    const size_t per = v->inner / v->channels, a = line / per, b = line % per * v->channels;
    float *height = v->columns->height + line * v->size;
    for (size_t j = 0; j < v->size; j++) {
        const float *p = v->values + (a * v->size + j) * v->inner + b;
        double square = 0;
        for (size_t k = 0; k < v->channels; k++) {
            square += (double)p[k] * (double)p[k];
        }
        height[j] = (float)(sqrt(square) / v->unit);
    }
}

// Lengths of the step before column j, all polylines.
static void take_length(void *context, size_t j) {
    gonio_columns *c = context;
    const double step = 1 / (double)c->last;
    double sum = 0;
    for (size_t i = 0; j > 0 && i < c->lines; i++) {
        const float *z = c->height + i * (c->last + 1) + j;
        const double rise = c->stretch * ((double)z[0] - (double)z[-1]);
        sum += sqrt(step * step + rise * rise);
    }
    c->length[j] = sum;
}

// ---- deviations ----

typedef struct measuring {
    const gonio_columns *columns;
    size_t begin, end;
} measuring;

static void measure_chunk(void *context, size_t chunk) {
    const measuring *m = context;
    const gonio_columns *c = m->columns;
    const size_t first = chunk * CHUNK, stop = first + CHUNK < c->lines ? first + CHUNK : c->lines;
    const float run = (float)(m->end - m->begin), step = 1 / (float)c->last;
    double sum = 0;
    float most = 0;
    for (size_t i = first; i < stop; i++) {
        const float *z = c->height + i * (c->last + 1) + m->begin;
        const float rise = z[m->end - m->begin] - z[0], across = run * step;
        const float per_length = across / sqrtf(across * across + rise * rise), slope = rise / run;
        float line_sum = 0;
        for (size_t j = 1; j < m->end - m->begin; j++) {
            const float d = fabsf(z[j] - z[0] - slope * (float)j) * per_length;
            most = d > most ? d : most;
            line_sum += d;
        }
        sum += (double)line_sum;
    }
    c->partial[chunk] = c->mean ? sum : (double)most;
}

static gonio_column_span measure(gonio_columns *c, size_t begin, size_t end) {
    measuring m = {c, begin, end};
    const size_t chunks = chunks_of(c);
    // Waking threads costs as much as some 100,000 heights.
    gonio_pool_run((end - begin) * c->lines > 100000 ? c->pool : NULL, end - begin > 1 ? chunks : 0, measure_chunk, &m);
    double total = 0;
    for (size_t k = 0; k < chunks && end - begin > 1; k++) {
        total = c->mean ? total + c->partial[k] : fmax(total, c->partial[k]);
    }
    total /= c->mean ? (double)(c->lines * (end - begin + 1)) : 1;
    return (gonio_column_span){begin, end, total > FLAT ? total : 0};
}

gonio_status gonio_columns_init(gonio_columns *c, const float *values, size_t outer, size_t size, size_t inner,
                                int channels, double unit, double stretch, bool mean, gonio_pool *pool,
                                gonio_error *error) {
    *c = (gonio_columns){
        .lines = outer * (inner / (size_t)channels), .last = size - 1, .mean = mean, .stretch = stretch, .pool = pool};
    c->height = malloc(c->lines * size * sizeof *c->height);
    c->length = malloc(size * sizeof *c->length);
    c->chosen = malloc(size * sizeof *c->chosen);
    c->spans = malloc(size * sizeof *c->spans);
    c->partial = malloc(chunks_of(c) * sizeof *c->partial);
    if (c->height == NULL || c->length == NULL || c->chosen == NULL || c->spans == NULL || c->partial == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu polylines of %zu points", c->lines, size);
    }
    view v = {c, values, size, inner, (size_t)channels, unit > 0 ? unit : 1};
    gonio_pool_run(pool, c->lines, take_heights, &v);
    gonio_pool_run(pool, size, take_length, c);
    for (size_t j = 1; j < size; j++) {
        c->length[j] += c->length[j - 1];
    }
    c->chosen[0] = 0;
    c->chosen[1] = c->last;
    c->found = 2;
    c->spans[0] = measure(c, 0, c->last);
    return GONIO_OK;
}

// ---- dominant columns ----

// The wider of two like spans, then the first.
static bool before(const gonio_column_span *a, const gonio_column_span *b) {
    if (fabs(a->deviation - b->deviation) > TIE * fmax(a->deviation, b->deviation)) {
        return a->deviation > b->deviation;
    }
    const size_t wide = a->end - a->begin, other = b->end - b->begin;
    return wide != other ? wide > other : a->begin < b->begin;
}

static size_t middle(const gonio_columns *c, const gonio_column_span *s) {
    const double whole = c->length[s->end] - c->length[s->begin];
    double least = INFINITY;
    size_t best = s->begin + 1;
    for (size_t w = s->begin + 1; w < s->end; w++) {
        const double off = fabs(2 * c->length[w] - c->length[s->begin] - c->length[s->end]);
        if (off < least - TIE * whole) {
            least = off;
            best = w;
        }
    }
    return best;
}

static void find(gonio_columns *c, size_t count) {
    while (c->found < count) {
        size_t best = c->found;
        for (size_t k = 0; k + 1 < c->found; k++) {
            const bool splits = c->spans[k].end - c->spans[k].begin > 1;
            best = splits && (best == c->found || before(&c->spans[k], &c->spans[best])) ? k : best;
        }
        const gonio_column_span s = c->spans[best];
        const size_t w = middle(c, &s);
        c->spans[best] = measure(c, s.begin, w);
        c->spans[c->found - 1] = measure(c, w, s.end);
        c->chosen[c->found++] = w;
    }
}

// ---- knots ----

static void clamp_ends(size_t count, size_t order, double *knots) {
    for (size_t k = 0; k < order; k++) {
        knots[k] = 0;
        knots[count + k] = 1;
    }
}

// Means of order - 1 neighbours of parameters[count].
static void average(const double *parameters, size_t count, int order, double *knots) {
    const size_t p = (size_t)order;
    clamp_ends(count, p, knots);
    for (size_t i = 1; i + p <= count; i++) {
        double sum = 0;
        for (size_t k = i; k + 1 < i + p; k++) {
            sum += parameters[k];
        }
        knots[p + i - 1] = sum / (double)(p - 1);
    }
}

void gonio_columns_knots(gonio_columns *c, size_t count, int order, double *knots) {
    find(c, count);
    double parameters[count];
    bool taken[c->last + 1];
    memset(taken, 0, sizeof taken);
    for (size_t k = 0; k < count; k++) {
        taken[c->chosen[k]] = true;
    }
    size_t n = 0;
    for (size_t j = 0; j <= c->last; j++) {
        if (taken[j]) {
            parameters[n++] = (double)j / (double)c->last;
        }
    }
    average(parameters, count, order, knots);
}

// KTP: the j-th of n - p + 1 inner knots lies where j d points are behind it, d = (m + 1)/(n - p + 2).
static void place_ktp(size_t size, size_t count, int order, double *knots) {
    const size_t p = (size_t)order, inner = count - p;
    const double d = (double)size / (double)(inner + 1), last = (double)(size - 1);
    clamp_ends(count, p, knots);
    for (size_t j = 1; j <= inner; j++) {
        const double at = (double)j * d, whole = floor(at);
        knots[p - 1 + j] = (whole - 1 + (at - whole)) / last;
    }
}

// NKTP: the parameters in `count` groups as equal as can be, one mean each, and knots from the means as from dominant
// columns.
static void place_nktp(size_t size, size_t count, int order, double *knots) {
    const double per = (double)size / (double)count, last = (double)(size - 1);
    double parameters[count];
    size_t low = 0;
    for (size_t k = 0; k < count; k++) {
        const size_t end = k + 1 == count ? size : (size_t)floor((double)(k + 1) * per + 0.5);
        parameters[k] = ((double)low + (double)(end - 1)) / 2 / last;
        low = end;
    }
    average(parameters, count, order, knots);
}

void gonio_knots_place(gonio_knots how, size_t size, size_t count, int order, double *knots) {
    (how == GONIO_KNOTS_KTP && count < size ? place_ktp : place_nktp)(size, count, order, knots);
}
