// SPDX-License-Identifier: BSD-3-Clause
// A row of the matrix is a pair of directions, a column a point: f = V V f_r (n.wi) (n.wo) dA over the area that is
// seen from wo (Wu, Dorsey and Rushmeier 2009, eqs. 4 and 9; the area stands inside the matrix, where the paper leaves
// it out, so that what is fitted is what is rendered). Directions are shared by the pairs, each for several, once as wi
// and once as wo, since rays are what a texel costs.
#include "scene/cpm/texel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/random.h"
#include "base/vector.h"

#define SHARES 4      // pairs for each direction
#define HELD_SHARES 2 // of those held out, which are half as many
#define MARGIN_DB 0.5 // above what is asked for: the pairs held out are few, and the choice ends where it suits them
#define BATCH_DB 3 // that the points of a batch reach above what is asked for, since more are dropped of them together
#define AREA_FLOOR 0.02
#define REPEATS 5

size_t gonio_cpm_record_bytes(const cpm_record *r) {
    const size_t bytes = sizeof *r + r->points * sizeof(cpm_record_point) + r->coefficients * sizeof(cpm_coefficient);
    return (bytes + 7) / 8 * 8;
}

const cpm_record_point *gonio_cpm_record_points(const cpm_record *r) { return (const cpm_record_point *)(r + 1); }

const cpm_coefficient *gonio_cpm_record_coefficients(const cpm_record *r) {
    return (const cpm_coefficient *)(gonio_cpm_record_points(r) + r->points);
}

// ---- the matrix ----

// Pairs of directions, and the points' reflectances at them: what is fitted, or what is held out.
typedef struct sheet {
    cpm_views views;
    size_t pairs;      // rows for each channel
    uint32_t *wi, *wo; // [pairs]: of the views' directions
    float *a;          // columns of the matrix
    double *b, *whole; // what is wanted of a batch, and of all
} sheet;
enum { FIT, HELD, SHEETS };

typedef struct making {
    const gonio_scene *scene;
    const cpm_texel_options *options;
    const cpm_dense *dense;
    cpm_place *places; // of each
    sheet sheets[SHEETS];
    int channels; // 1 where all three are alike
    cpm_choice choice;
    uint64_t seed;
    cpm_seconds seconds;
} making;

static void release(making *m) {
    free(m->places);
    for (int k = 0; k < SHEETS; k++) {
        sheet *s = &m->sheets[k];
        gonio_cpm_views_free(&s->views);
        free(s->wi);
        free(s->wo);
        free(s->a);
        free(s->b);
        free(s->whole);
    }
    free(m->choice.columns);
    free(m->choice.weights);
}

static void shuffle(uint32_t *order, size_t n, uint64_t seed) {
    for (size_t k = 0; k < n; k++) {
        order[k] = (uint32_t)k;
    }
    for (size_t k = n; k > 1; k--) {
        const size_t j = (size_t)(gonio_random_uniform(seed + k) * (double)k);
        const uint32_t other = order[j];
        order[j] = order[k - 1];
        order[k - 1] = other;
    }
}

// Every direction is wi of that many pairs and wo of as many; the partners are drawn.
static bool pair_up(sheet *s, size_t shares, uint64_t seed) {
    const size_t n = s->views.n;
    uint32_t *order = malloc((n + 1) * sizeof *order);
    s->pairs = n * shares;
    s->wi = malloc((s->pairs + 1) * sizeof *s->wi);
    s->wo = malloc((s->pairs + 1) * sizeof *s->wo);
    const bool good = order != NULL && s->wi != NULL && s->wo != NULL;
    for (size_t k = 0; good && k < shares; k++) {
        shuffle(order, n, gonio_random(seed + 100 + k));
        for (size_t i = 0; i < n; i++) {
            s->wi[k * n + i] = (uint32_t)i;
            s->wo[k * n + i] = order[i];
        }
    }
    free(order);
    return good;
}

static size_t rows_of(const making *m, const sheet *s) { return s->pairs * (size_t)m->channels; }

static void fill_column(const making *m, const sheet *s, size_t point, float *column) {
    const cpm_views *v = &s->views;
    for (size_t q = 0; q < s->pairs; q++) {
        const size_t i = s->wi[q], o = s->wo[q];
        double f[3] = {0};
        if (v->seen[i * v->points + point] != 0 && v->seen[o * v->points + point] != 0) {
            gonio_cpm_apparent(m->scene, &m->places[point], v->directions[i], v->directions[o], f);
        }
        for (int c = 0; c < m->channels; c++) {
            column[(size_t)c * s->pairs + q] = (float)(f[c] * m->dense->areas[point] / v->area[o]);
        }
    }
}

// The columns of these points, and their sum.
static void fill(making *m, const size_t *which, size_t n) {
    const double started_s = gonio_clock_thread_s();
    for (int k = 0; k < SHEETS; k++) {
        sheet *s = &m->sheets[k];
        const size_t rows = rows_of(m, s);
        memset(s->b, 0, rows * sizeof *s->b);
        for (size_t j = 0; j < n; j++) {
            float *column = s->a + j * rows;
            fill_column(m, s, which[j], column);
            for (size_t q = 0; q < rows; q++) {
                s->b[q] += (double)column[q];
            }
        }
    }
    m->seconds.reflectance += gonio_clock_thread_s() - started_s;
}

// ---- choosing ----

// Of a batch, or (whole) of all; of one channel, or (-1) of all.
static cpm_rows part_of(const making *m, const sheet *s, bool whole, int channel) {
    const size_t rows = rows_of(m, s), first = channel > 0 ? (size_t)channel * s->pairs : 0;
    return (cpm_rows){channel < 0 ? rows : s->pairs, rows, s->a + first, (whole ? s->whole : s->b) + first};
}

static bool choose(making *m, size_t columns, bool whole, int channel, double snr_db) {
    const cpm_texel_options *o = m->options;
    cpm_matrix matrix = {columns, part_of(m, &m->sheets[FIT], whole, channel),
                         part_of(m, &m->sheets[HELD], whole, channel)};
    bool any = false;
    for (size_t q = 0; q < matrix.held.n; q++) {
        any = any || matrix.held.b[q] > 0;
    }
    matrix.held.n = any ? matrix.held.n : 0; // of nothing there is no ratio
    const double started_s = gonio_clock_thread_s();
    const bool good = o->paper
                          ? gonio_cpm_select_sampled(&matrix, snr_db, o->most, o->energy, REPEATS, m->seed, &m->choice)
                          : gonio_cpm_select_greedy(&matrix, snr_db, o->most, &m->choice);
    m->seconds.choice += gonio_clock_thread_s() - started_s;
    return good;
}

static void add_to_whole(making *m) {
    for (int k = 0; k < SHEETS; k++) {
        sheet *s = &m->sheets[k];
        for (size_t q = 0; q < rows_of(m, s); q++) {
            s->whole[q] += s->b[q];
        }
    }
}

// In batches where there are many points: the points chosen of each, and of those together the ones for the whole.
// which: room for n; it becomes the candidates, whose number comes back. SIZE_MAX: no memory.
static size_t reduce(making *m, size_t *which) {
    const size_t n = m->dense->n, batch = m->options->batch, batches = (n + batch - 1) / batch;
    size_t kept = 0;
    for (size_t start = 0; start < batches; start++) {
        // Every batch is spread over the whole texel.
        size_t own[batch], few = 0;
        for (size_t k = start; k < n && few < batch; k += batches) {
            own[few++] = k;
        }
        fill(m, own, few);
        add_to_whole(m);
        if (batches == 1) {
            memcpy(which, own, few * sizeof *own);
            return few;
        }
        if (!choose(m, few, false, -1, m->options->snr_db + BATCH_DB)) {
            return SIZE_MAX;
        }
        for (size_t k = 0; k < m->choice.n && kept < batch; k++) {
            which[kept++] = own[m->choice.columns[k]];
        }
    }
    fill(m, which, kept);
    return kept;
}

typedef struct result {
    size_t n;
    cpm_record_point *points; // room for three times `most`
    double snr_db;
} result;

static void put(const making *m, const size_t *which, int channel, result *r) {
    for (size_t k = 0; k < m->choice.n; k++) {
        const size_t j = which[m->choice.columns[k]];
        const cpm_point *from = &m->dense->points[j];
        const float weight = (float)(m->choice.weights[k] * m->dense->areas[j]);
        cpm_record_point *to = &r->points[r->n++];
        *to = (cpm_record_point){from->triangle, from->u, from->v, {weight, weight, weight}};
        for (int c = 0; c < 3 && channel >= 0; c++) {
            to->weight[c] = c == channel ? weight : 0;
        }
    }
    r->snr_db = fmin(r->snr_db, m->choice.snr_db);
}

// ---- the visible area ----

// Returns the number of coefficients; 0 is also what it is without memory.
static size_t describe_area(making *m, cpm_coefficient *kept, cpm_record *record) {
    const double started_s = gonio_clock_thread_s();
    const int side = m->options->side;
    const size_t values = (size_t)(6 * side * side);
    float *area = malloc(values * sizeof *area);
    uint8_t *room = malloc(m->dense->n + 1);
    size_t n = 0;
    if (area != NULL && room != NULL) {
        float largest = 0;
        for (size_t i = 0; i < values; i++) {
            area[i] = (float)gonio_cpm_area_seen(m->scene, m->places, m->dense->n, m->dense->areas,
                                                 gonio_cpm_area_direction(side, i), room);
            largest = fmaxf(largest, area[i]);
        }
        record->floor = (float)AREA_FLOOR * largest;
        gonio_cpm_haar(area, side);
        n = gonio_cpm_area_keep(area, side, (size_t)ceil(m->options->keep * (double)values), kept, &record->scale);
    }
    free(area);
    free(room);
    m->seconds.area += gonio_clock_thread_s() - started_s;
    return n;
}

// ---- all ----

static bool is_grey(const making *m) {
    for (size_t j = 0; j < m->dense->n; j++) {
        const world_place *p = &m->places[j].place;
        const world_material *material = &m->scene->materials[p->material];
        const bool alike = material->constant ? material->f[0] == material->f[1] && material->f[1] == material->f[2]
                                              : material->model->channels == 1;
        if (!alike || p->albedo[0] != p->albedo[1] || p->albedo[1] != p->albedo[2]) {
            return false;
        }
    }
    return true;
}

static void find_extent(const making *m, cpm_record *record) {
    double centre[3] = {0}, radius = 0;
    for (size_t j = 0; j < m->dense->n; j++) {
        const gonio_vec3 p = m->places[j].place.hit.point;
        centre[0] += p.x / (double)m->dense->n;
        centre[1] += p.y / (double)m->dense->n;
        centre[2] += p.z / (double)m->dense->n;
    }
    for (size_t j = 0; j < m->dense->n; j++) {
        const gonio_vec3 d = difference(m->places[j].place.hit.point, (gonio_vec3){centre[0], centre[1], centre[2]});
        radius = fmax(radius, sqrt(dot(d, d)));
    }
    for (int k = 0; k < 3; k++) {
        record->centre[k] = (float)centre[k];
    }
    record->radius = (float)radius;
}

static bool prepare_sheet(making *m, int k) {
    const cpm_texel_options *o = m->options;
    sheet *s = &m->sheets[k];
    const size_t directions = (size_t)(o->pairs / SHARES / (k == HELD ? 2 : 1)), n = m->dense->n;
    const uint64_t seed = gonio_random(m->seed + (uint64_t)k);
    if (!gonio_cpm_views_new(m->scene, m->places, n, m->dense->areas, directions, seed, &s->views) ||
        !pair_up(s, k == HELD ? HELD_SHARES : SHARES, seed)) {
        return false;
    }
    const size_t rows = rows_of(m, s), columns = n < o->batch ? n : o->batch;
    s->a = malloc(rows * columns * sizeof *s->a + 1);
    s->b = malloc(rows * sizeof *s->b + 1);
    s->whole = calloc(rows + 1, sizeof *s->whole);
    return s->a != NULL && s->b != NULL && s->whole != NULL;
}

static bool prepare(making *m) {
    m->places = malloc(m->dense->n * sizeof *m->places + 1);
    m->choice.columns = malloc(m->options->most * sizeof *m->choice.columns);
    m->choice.weights = malloc(m->options->most * sizeof *m->choice.weights);
    if (m->places == NULL || m->choice.columns == NULL || m->choice.weights == NULL) {
        return false;
    }
    for (size_t j = 0; j < m->dense->n; j++) {
        const cpm_point *p = &m->dense->points[j];
        gonio_cpm_place(m->scene, p->triangle, (double)p->u, (double)p->v, &m->places[j]);
    }
    m->channels = is_grey(m) ? 1 : 3;
    const double started_s = gonio_clock_thread_s();
    const bool good = prepare_sheet(m, FIT) && prepare_sheet(m, HELD);
    m->seconds.reflectance += gonio_clock_thread_s() - started_s;
    return good;
}

// false: no memory.
static bool choose_points(making *m, result *r) {
    const size_t dense = m->dense->n, batch = m->options->batch;
    size_t *which = malloc((dense > batch ? dense : batch) * sizeof *which);
    if (which == NULL || m->sheets[FIT].pairs == 0) { // of no pairs: it is seen from nowhere
        free(which);
        return which != NULL;
    }
    const size_t n = reduce(m, which);
    const int first = m->options->separate && m->channels == 3 ? 0 : -1, last = first == 0 ? 2 : -1;
    bool good = n != SIZE_MAX;
    for (int channel = first; channel <= last && good; channel++) {
        good = choose(m, n, true, channel, m->options->snr_db + MARGIN_DB);
        if (good) {
            put(m, which, channel, r);
        }
    }
    free(which);
    return good;
}

cpm_record *gonio_cpm_texel_make(const gonio_scene *scene, const cpm_dense *dense, const cpm_texel_options *options,
                                 uint64_t seed, cpm_seconds *seconds) {
    const size_t coefficients = (size_t)(6 * options->side * options->side);
    making m = {.scene = scene, .options = options, .dense = dense, .seed = seed};
    result r = {.points = malloc(3 * options->most * sizeof *r.points), .snr_db = INFINITY};
    cpm_coefficient *kept = malloc(coefficients * sizeof *kept);
    cpm_record *record = NULL;
    if (r.points != NULL && kept != NULL) {
        cpm_record head = {.dense = (uint32_t)dense->n};
        if (prepare(&m) && choose_points(&m, &r)) {
            find_extent(&m, &head);
            head.coefficients = (uint32_t)describe_area(&m, kept, &head);
            head.points = (uint32_t)r.n;
            head.snr_db = (float)fmin(r.snr_db, 200);
            record = calloc(1, gonio_cpm_record_bytes(&head));
        }
        if (record != NULL) {
            *record = head;
            memcpy(record + 1, r.points, r.n * sizeof *r.points);
            memcpy((char *)(record + 1) + r.n * sizeof *r.points, kept, head.coefficients * sizeof *kept);
        }
    }
    *seconds = m.seconds;
    release(&m);
    free(r.points);
    free(kept);
    return record;
}
