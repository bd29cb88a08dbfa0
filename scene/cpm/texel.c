// SPDX-License-Identifier: BSD-3-Clause
// A row of the matrix is a pair of directions, a column a point: f = V V f_r (n.wi) (n.wo) dA over the area that is
// seen from wo (Wu, Dorsey and Rushmeier 2009, eqs. 4 and 9; the area stands inside the matrix, where the paper leaves
// it out, so that what is fitted is what is rendered). Directions are shared by the pairs, each for several, once as wi
// and once as wo, since rays are what a texel costs.
#include "scene/cpm/texel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "base/vector.h"

#define SHARES 4    // pairs for each direction
#define MARGIN_DB 2 // above what is asked for: other directions than the matrix's are met less well
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

typedef struct making {
    const gonio_scene *scene;
    const cpm_texel_options *options;
    const cpm_point *points;
    size_t n;          // dense points used
    double area;       // that each stands for
    cpm_place *places; // [n]
    cpm_views views;
    size_t pairs;      // rows for each channel
    uint32_t *wi, *wo; // [pairs]: of the views' directions
    int channels;      // 1 where all three are alike
    float *a;          // columns of the matrix
    double *b, *whole; // what is wanted of a batch, and of all
    cpm_choice choice;
    uint64_t seed;
} making;

static void release(making *m) {
    free(m->places);
    gonio_cpm_views_free(&m->views);
    free(m->wi);
    free(m->wo);
    free(m->a);
    free(m->b);
    free(m->whole);
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

// Every direction is wi of SHARES pairs and wo of as many; the partners are drawn.
static bool pair_up(making *m) {
    const size_t n = m->views.n;
    uint32_t *order = malloc((n + 1) * sizeof *order);
    m->pairs = n * SHARES;
    m->wi = malloc((m->pairs + 1) * sizeof *m->wi);
    m->wo = malloc((m->pairs + 1) * sizeof *m->wo);
    const bool good = order != NULL && m->wi != NULL && m->wo != NULL;
    for (size_t s = 0; good && s < SHARES; s++) {
        shuffle(order, n, gonio_random(m->seed + 100 + s));
        for (size_t k = 0; k < n; k++) {
            m->wi[s * n + k] = (uint32_t)k;
            m->wo[s * n + k] = order[k];
        }
    }
    free(order);
    return good;
}

static void fill_column(const making *m, size_t point, float *column) {
    const cpm_views *v = &m->views;
    for (size_t q = 0; q < m->pairs; q++) {
        const size_t i = m->wi[q], o = m->wo[q];
        double f[3] = {0};
        if (v->seen[i * v->points + point] != 0 && v->seen[o * v->points + point] != 0) {
            gonio_cpm_apparent(m->scene, &m->places[point], v->directions[i], v->directions[o], f);
        }
        for (int c = 0; c < m->channels; c++) {
            column[(size_t)c * m->pairs + q] = (float)(f[c] * m->area / v->area[o]);
        }
    }
}

static void add_column(const making *m, const float *column, double *sum) {
    for (size_t q = 0; q < m->pairs * (size_t)m->channels; q++) {
        sum[q] += (double)column[q];
    }
}

// ---- choosing ----

static bool choose(making *m, const cpm_matrix *matrix) {
    const cpm_texel_options *o = m->options;
    return o->paper ? gonio_cpm_select_sampled(matrix, o->snr_db + MARGIN_DB, o->most, o->energy, REPEATS, m->seed,
                                               &m->choice)
                    : gonio_cpm_select_greedy(matrix, o->snr_db + MARGIN_DB, o->most, &m->choice);
}

// The columns of these points; *wanted: their sum. Rows of one channel, or of all.
static void fill(making *m, const size_t *which, size_t n, double *wanted) {
    const size_t rows = m->pairs * (size_t)m->channels;
    memset(wanted, 0, rows * sizeof *wanted);
    for (size_t k = 0; k < n; k++) {
        fill_column(m, which[k], m->a + k * rows);
        add_column(m, m->a + k * rows, wanted);
    }
}

// In batches where there are many points: the points chosen of each, and of those together the ones for the whole.
// which: room for n; it becomes the candidates, whose number comes back. SIZE_MAX: no memory.
static size_t reduce(making *m, size_t *which) {
    const size_t rows = m->pairs * (size_t)m->channels, batch = m->options->batch;
    size_t kept = 0;
    memset(m->whole, 0, rows * sizeof *m->whole);
    for (size_t start = 0; start < m->n; start += batch) {
        // Every batch is spread over the whole texel.
        const size_t batches = (m->n + batch - 1) / batch;
        size_t own[batch], n = 0;
        for (size_t k = start / batch; k < m->n && n < batch; k += batches) {
            own[n++] = k;
        }
        fill(m, own, n, m->b);
        for (size_t q = 0; q < rows; q++) {
            m->whole[q] += m->b[q];
        }
        if (m->n <= batch) {
            memcpy(which, own, n * sizeof *own);
            return n;
        }
        if (!choose(m, &(cpm_matrix){rows, n, m->a, m->b})) {
            return SIZE_MAX;
        }
        for (size_t k = 0; k < m->choice.n && kept < batch; k++) {
            which[kept++] = own[m->choice.columns[k]];
        }
    }
    fill(m, which, kept, m->b);
    return kept;
}

typedef struct result {
    size_t n;
    cpm_record_point *points; // room for three times `most`
    double snr_db;
} result;

static void put(const making *m, const size_t *which, int channel, result *r) {
    for (size_t k = 0; k < m->choice.n; k++) {
        const cpm_point *from = &m->points[which[m->choice.columns[k]]];
        const float weight = (float)(m->choice.weights[k] * m->area);
        cpm_record_point *to = &r->points[r->n++];
        *to = (cpm_record_point){from->triangle, from->u, from->v, {weight, weight, weight}};
        for (int c = 0; c < 3 && channel >= 0; c++) {
            to->weight[c] = c == channel ? weight : 0;
        }
    }
    r->snr_db = fmin(r->snr_db, m->choice.snr_db);
}

// The rows of one channel alone, in place.
static void pack_channel(making *m, size_t columns, int channel, float *packed) {
    for (size_t k = 0; k < columns; k++) {
        memcpy(packed + k * m->pairs, m->a + k * m->pairs * 3 + (size_t)channel * m->pairs, m->pairs * sizeof *packed);
    }
}

static bool choose_separately(making *m, const size_t *which, size_t n, result *r) {
    float *packed = malloc(n * m->pairs * sizeof *packed + 1);
    bool good = packed != NULL;
    for (int c = 0; c < 3 && good; c++) {
        pack_channel(m, n, c, packed);
        good = choose(m, &(cpm_matrix){m->pairs, n, packed, m->whole + (size_t)c * m->pairs});
        if (good) {
            put(m, which, c, r);
        }
    }
    free(packed);
    return good;
}

// ---- the visible area ----

// Returns the number of coefficients; 0 is also what it is without memory.
static size_t describe_area(const making *m, cpm_coefficient *kept, cpm_record *record) {
    const int side = m->options->side;
    const size_t values = (size_t)(6 * side * side);
    float *area = malloc(values * sizeof *area);
    uint8_t *room = malloc(m->n);
    size_t n = 0;
    if (area != NULL && room != NULL) {
        float largest = 0;
        for (size_t i = 0; i < values; i++) {
            area[i] =
                (float)gonio_cpm_area_seen(m->scene, m->places, m->n, m->area, gonio_cpm_area_direction(side, i), room);
            largest = fmaxf(largest, area[i]);
        }
        record->floor = (float)AREA_FLOOR * largest;
        gonio_cpm_haar(area, side);
        n = gonio_cpm_area_keep(area, side, (size_t)ceil(m->options->keep * (double)values), kept, &record->scale);
    }
    free(area);
    free(room);
    return n;
}

// ---- all ----

static bool is_grey(const making *m) {
    for (size_t j = 0; j < m->n; j++) {
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
    for (size_t j = 0; j < m->n; j++) {
        const gonio_vec3 p = m->places[j].place.hit.point;
        centre[0] += p.x / (double)m->n;
        centre[1] += p.y / (double)m->n;
        centre[2] += p.z / (double)m->n;
    }
    for (size_t j = 0; j < m->n; j++) {
        const gonio_vec3 d = difference(m->places[j].place.hit.point, (gonio_vec3){centre[0], centre[1], centre[2]});
        radius = fmax(radius, sqrt(dot(d, d)));
    }
    for (int k = 0; k < 3; k++) {
        record->centre[k] = (float)centre[k];
    }
    record->radius = (float)radius;
}

static bool prepare(making *m, size_t given) {
    const cpm_texel_options *o = m->options;
    m->n = given < o->dense ? given : o->dense;
    m->area *= (double)given / (double)m->n;
    m->places = malloc(m->n * sizeof *m->places);
    if (m->places == NULL) {
        return false;
    }
    for (size_t j = 0; j < m->n; j++) {
        const cpm_point *p = &m->points[j];
        gonio_cpm_place(m->scene, p->triangle, (double)p->u, (double)p->v, &m->places[j]);
    }
    m->channels = is_grey(m) ? 1 : 3;
    const size_t directions = (size_t)o->pairs / SHARES;
    if (!gonio_cpm_views_new(m->scene, m->places, m->n, m->area, directions, m->seed, &m->views) || !pair_up(m)) {
        return false;
    }
    const size_t rows = m->pairs * (size_t)m->channels, columns = m->n < o->batch ? m->n : o->batch;
    m->a = malloc(rows * columns * sizeof *m->a + 1);
    m->b = malloc(rows * sizeof *m->b + 1);
    m->whole = malloc(rows * sizeof *m->whole + 1);
    m->choice.columns = malloc(o->most * sizeof *m->choice.columns);
    m->choice.weights = malloc(o->most * sizeof *m->choice.weights);
    return m->a != NULL && m->b != NULL && m->whole != NULL && m->choice.columns != NULL && m->choice.weights != NULL;
}

// false: no memory.
static bool choose_points(making *m, result *r) {
    size_t *which = malloc((m->n > m->options->batch ? m->n : m->options->batch) * sizeof *which);
    if (which == NULL || m->pairs == 0) { // of no pairs: it is seen from nowhere
        free(which);
        return which != NULL;
    }
    const size_t n = reduce(m, which);
    bool good = n != SIZE_MAX;
    if (good && m->options->separate && m->channels == 3) {
        good = choose_separately(m, which, n, r);
    } else if (good) {
        good = choose(m, &(cpm_matrix){m->pairs * (size_t)m->channels, n, m->a, m->whole});
        if (good) {
            put(m, which, -1, r);
        }
    }
    free(which);
    return good;
}

cpm_record *gonio_cpm_texel_make(const gonio_scene *scene, const cpm_point *points, size_t n, double area,
                                 const cpm_texel_options *options, uint64_t seed) {
    const size_t coefficients = (size_t)(6 * options->side * options->side);
    making m = {.scene = scene, .options = options, .area = area, .seed = seed};
    result r = {.points = malloc(3 * options->most * sizeof *r.points), .snr_db = INFINITY};
    cpm_coefficient *kept = malloc(coefficients * sizeof *kept);
    cpm_point *spread = malloc(n * sizeof *spread);
    cpm_record *record = NULL;
    if (r.points != NULL && kept != NULL && spread != NULL) {
        // Where not all are used, every so many-th.
        const size_t used = n < options->dense ? n : options->dense;
        for (size_t k = 0; k < used; k++) {
            spread[k] = points[k * n / used];
        }
        m.points = spread;
        cpm_record head = {.dense = (uint32_t)used};
        if (prepare(&m, n) && choose_points(&m, &r)) {
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
    release(&m);
    free(r.points);
    free(kept);
    free(spread);
    return record;
}
