// SPDX-License-Identifier: BSD-3-Clause
#include "fit/check/table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "fit/check/triangles.h"

#define TOLERANCE GONIO_TABLE_TOLERANCE
#define TURN (2 * GONIO_PI)

// ---- one side's directions ----

// The directions of one side, as (theta's number, azimuth's number) of ascending lists.
typedef struct side {
    double *theta, *phi;
    size_t thetas, phis;
} side;

static double azimuth(double phi) {
    const double a = phi - TURN * floor(phi / TURN);
    return a > TURN - TOLERANCE ? 0 : a;
}

// Both directions with azimuths in [0, 360) deg, those at the pole 0; isotropic: the incident one 0.
static gonio_pair canonical(const gonio_pair *p, bool isotropic, bool reflect) {
    gonio_pair q = *p;
    if (isotropic) {
        q.phi_o = q.theta_i < TOLERANCE ? 0 : q.phi_o - q.phi_i;
        q.phi_i = 0;
    }
    q.phi_i = q.theta_i < TOLERANCE ? 0 : azimuth(q.phi_i);
    q.phi_o = q.theta_o < TOLERANCE ? 0 : azimuth(reflect ? -q.phi_o : q.phi_o);
    return q;
}

// values[n] sorted, each once; returns how many there are.
static size_t distinct(double *values, size_t n) {
    size_t count = 0;
    gonio_sort(values, n);
    for (size_t i = 0; i < n; i++) {
        if (count == 0 || values[i] - values[count - 1] > TOLERANCE) {
            values[count++] = values[i];
        }
    }
    return count;
}

static size_t find(const double *values, size_t n, double value) {
    size_t low = 0, high = n;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        *(values[middle] <= value + TOLERANCE ? &low : &high) = middle;
    }
    return low;
}

static int by_number(const void *left, const void *right) {
    const uint64_t a = *(const uint64_t *)left, b = *(const uint64_t *)right;
    return (a > b) - (a < b);
}

static uint64_t key_of(const side *s, double theta, double phi) {
    return (uint64_t)find(s->theta, s->thetas, theta) << 32 | find(s->phi, s->phis, phi);
}

// The keys that occur, ascending, each once.
static size_t unique(uint64_t *keys, size_t n) {
    size_t count = 0;
    qsort(keys, n, sizeof *keys, by_number);
    for (size_t i = 0; i < n; i++) {
        if (count == 0 || keys[i] != keys[count - 1]) {
            keys[count++] = keys[i];
        }
    }
    return count;
}

static size_t position(const uint64_t *keys, size_t n, uint64_t key) {
    const uint64_t *at = bsearch(&key, keys, n, sizeof *keys, by_number);
    return at != NULL ? (size_t)(at - keys) : GONIO_TABLE_NONE;
}

// ---- all samples ----

typedef struct build {
    const gonio_samples *samples;
    bool isotropic, reflect;
    side side[2];
    uint64_t *keys[2]; // of the samples; then the directions that occur
    uint64_t *copy;
    size_t count[2];
    gonio_table *table;
} build;

static void release(build *b) {
    for (int k = 0; k < 2; k++) {
        free(b->side[k].theta);
        free(b->side[k].phi);
        free(b->keys[k]);
    }
    free(b->copy);
}

static bool allocate(build *b) {
    const size_t n = b->samples->n;
    b->copy = malloc((n + 1) * sizeof *b->copy);
    bool done = b->copy != NULL;
    for (int k = 0; k < 2; k++) {
        b->side[k].theta = malloc((n + 1) * sizeof(double));
        b->side[k].phi = malloc((n + 1) * sizeof(double));
        b->keys[k] = malloc((n + 1) * sizeof(uint64_t));
        done = done && b->side[k].theta != NULL && b->side[k].phi != NULL && b->keys[k] != NULL;
    }
    return done;
}

static void take_angles(build *b) {
    const size_t n = b->samples->n;
    for (size_t i = 0; i < n; i++) {
        const gonio_pair p = canonical(&b->samples->pairs[i], b->isotropic, b->reflect);
        b->side[0].theta[i] = p.theta_i;
        b->side[0].phi[i] = p.phi_i;
        b->side[1].theta[i] = p.theta_o;
        b->side[1].phi[i] = p.phi_o;
    }
    for (int k = 0; k < 2; k++) {
        b->side[k].thetas = distinct(b->side[k].theta, n);
        b->side[k].phis = distinct(b->side[k].phi, n);
    }
}

static void take_keys(build *b) {
    const size_t n = b->samples->n;
    for (size_t i = 0; i < n; i++) {
        const gonio_pair p = canonical(&b->samples->pairs[i], b->isotropic, b->reflect);
        b->keys[0][i] = key_of(&b->side[0], p.theta_i, p.phi_i);
        b->keys[1][i] = key_of(&b->side[1], p.theta_o, p.phi_o);
    }
}

static bool list_directions(build *b, uint64_t *const keys[2]) {
    gonio_table *t = b->table;
    t->in = malloc((t->n_in + 1) * sizeof *t->in);
    t->out = malloc((t->n_out + 1) * sizeof *t->out);
    t->cell = malloc((t->n_in * t->n_out + 1) * sizeof *t->cell);
    if (t->in == NULL || t->out == NULL || t->cell == NULL) {
        return false;
    }
    for (int k = 0; k < 2; k++) {
        for (size_t j = 0; j < b->count[k]; j++) {
            (k == 0 ? t->in : t->out)[j] =
                (gonio_table_direction){b->side[k].theta[keys[k][j] >> 32], b->side[k].phi[keys[k][j] & UINT32_MAX]};
        }
    }
    for (size_t k = 0; k < t->n_in * t->n_out; k++) {
        t->cell[k] = GONIO_TABLE_NONE;
    }
    return true;
}

// Is every product there once? Light at the pole of an isotropic table has one azimuth for all.
static gonio_status take_cells(build *b, bool *whole, gonio_error *error) {
    const size_t n = b->samples->n;
    gonio_table *t = b->table;
    uint64_t *keys[2] = {b->copy, malloc((n + 1) * sizeof(uint64_t))};
    *whole = false;
    if (keys[1] == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to find the grid of %zu samples", n);
    }
    for (int k = 0; k < 2; k++) {
        memcpy(keys[k], b->keys[k], n * sizeof(uint64_t));
        b->count[k] = unique(keys[k], n);
    }
    t->n_in = b->count[0];
    t->n_out = b->count[1];
    // The pole of an isotropic table lacks azimuths: at most so many cells have no sample of their own.
    const bool possible = (double)t->n_in * (double)t->n_out <= 2.0 * (double)n + (double)t->n_out;
    *whole = possible && list_directions(b, keys);
    const bool memory = *whole || !possible;
    for (size_t i = 0; i < n && *whole; i++) {
        size_t *cell =
            &t->cell[position(keys[0], t->n_in, b->keys[0][i]) * t->n_out + position(keys[1], t->n_out, b->keys[1][i])];
        *whole = *cell == GONIO_TABLE_NONE;
        *cell = i;
    }
    free(keys[1]);
    return memory ? GONIO_OK
                  : gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu x %zu", t->n_in, t->n_out);
}

// The azimuth 0 of the same theta stands in where light is at the pole of an isotropic table.
static bool fill_pole(gonio_table *t) {
    for (size_t p = 0; p < t->n_in; p++) {
        for (size_t q = 0, first = 0; q < t->n_out; q++) {
            first = t->out[q].theta - t->out[first].theta > TOLERANCE ? q : first;
            size_t *cell = &t->cell[p * t->n_out + q];
            if (*cell == GONIO_TABLE_NONE && t->isotropic && t->in[p].theta < TOLERANCE) {
                *cell = t->cell[p * t->n_out + first];
            }
            if (*cell == GONIO_TABLE_NONE) {
                return false;
            }
        }
    }
    return true;
}

// ---- rings ----

static bool equal_steps(const double *values, size_t n, double *step) {
    *step = n > 1 ? (values[n - 1] - values[0]) / (double)(n - 1) : 0;
    for (size_t k = 0; k + 1 < n; k++) {
        if (fabs(values[k + 1] - values[k] - *step) > TOLERANCE) {
            return false;
        }
    }
    return n > 1;
}

// Directions are sorted by theta, then azimuth. A ring of the side: equal azimuths from 0 (any start, all round; or 0
// to 180 deg, folded), the same in each. Returns the azimuths of a ring as they are stored; 0: no rings.
static size_t rings_of(const gonio_table_direction *d, size_t n, bool *folded, size_t *pole) {
    *pole = n > 0 && d[0].theta < TOLERANCE;
    size_t m = 0;
    while (*pole + m < n && d[*pole + m].theta - d[*pole].theta < TOLERANCE) {
        m++;
    }
    if (m == 0 || (n - *pole) % m != 0) {
        return 0;
    }
    const gonio_table_direction *first = d + *pole;
    const double span = first[m - 1].phi - first[0].phi;
    *folded = *folded && m > 2 && first[0].phi < TOLERANCE && fabs(span - GONIO_PI) < TOLERANCE;
    const double step = *folded ? GONIO_PI / (double)(m - 1) : TURN / (double)m;
    for (size_t k = 0; k < n - *pole; k++) {
        if (fabs(first[k].phi - first[0].phi - step * (double)(k % m)) > TOLERANCE ||
            fabs(first[k].theta - first[k - k % m].theta) > TOLERANCE) {
            return 0;
        }
    }
    return m > 2 ? m : 0;
}

static bool same_azimuths(const gonio_table *t, size_t pole_in, size_t pole_out) {
    return fabs(t->in[pole_in].phi - t->out[pole_out].phi) < TOLERANCE;
}

static bool uniform_thetas(const gonio_table_direction *d, size_t pole, size_t m, size_t rings) {
    double step = rings > 1 ? d[pole + m].theta - d[pole].theta : 0;
    for (size_t k = 0; k + 1 < rings; k++) {
        if (fabs(d[pole + (k + 1) * m].theta - d[pole + k * m].theta - step) > TOLERANCE) {
            return false;
        }
    }
    return rings > 1;
}

static gonio_status find_rings(gonio_table *t, gonio_error *error) {
    size_t pole_in = t->in[0].theta < TOLERANCE, pole_out;
    bool folded = t->isotropic, no = false;
    const size_t m = rings_of(t->out, t->n_out, &folded, &pole_out);
    const size_t m_in = t->isotropic ? 1 : rings_of(t->in, t->n_in, &no, &pole_in);
    t->folded = folded && m > 0;
    t->rows = t->n_in;
    t->columns = t->n_out;
    if (m == 0 || t->n_in == pole_in || (!t->isotropic && (m_in != m || !same_azimuths(t, pole_in, pole_out)))) {
        return GONIO_OK;
    }
    t->thetas_in = (t->n_in - pole_in) / m_in;
    t->thetas_out = (t->n_out - pole_out) / m;
    t->phis = t->folded ? 2 * (m - 1) : m;
    t->rows = t->thetas_in * t->phis;
    t->columns = t->thetas_out * t->phis;
    t->uniform =
        uniform_thetas(t->in, pole_in, m_in, t->thetas_in) && uniform_thetas(t->out, pole_out, m, t->thetas_out);
    t->ring_in = malloc(t->rows * sizeof *t->ring_in);
    t->ring_out = malloc(t->columns * sizeof *t->ring_out);
    if (t->ring_in == NULL || t->ring_out == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu x %zu directions", t->rows, t->columns);
    }
    for (size_t r = 0; r < t->rows; r++) {
        t->ring_in[r] = pole_in + (t->isotropic ? r / t->phis : r);
    }
    for (size_t c = 0; c < t->columns; c++) {
        const size_t phi = c % t->phis;
        t->ring_out[c] = pole_out + c / t->phis * m + (t->folded && phi >= m ? t->phis - phi : phi);
    }
    return GONIO_OK;
}

// ---- the matrix ----

gonio_table_direction gonio_table_row(const gonio_table *t, size_t row) {
    if (t->phis == 0) {
        return t->in[row];
    }
    const gonio_table_direction d = t->in[t->ring_in[row]];
    return (gonio_table_direction){d.theta,
                                   d.phi + (t->isotropic ? TURN * (double)(row % t->phis) / (double)t->phis : 0)};
}

gonio_table_direction gonio_table_column(const gonio_table *t, size_t column) {
    if (t->phis == 0) {
        return t->out[column];
    }
    const gonio_table_direction d = t->out[t->ring_out[column]];
    const double first = t->out[t->ring_out[column - column % t->phis]].phi;
    return (gonio_table_direction){d.theta, first + TURN * (double)(column % t->phis) / (double)t->phis};
}

size_t gonio_table_at(const gonio_table *t, size_t row, size_t column) {
    if (t->phis == 0) {
        return t->cell[row * t->n_out + column];
    }
    if (t->isotropic) {
        const size_t turn = (column % t->phis + t->phis - row % t->phis) % t->phis;
        column = column - column % t->phis + turn;
    }
    return t->cell[t->ring_in[row] * t->n_out + t->ring_out[column]];
}

gonio_pair gonio_table_pair(const gonio_table *t, size_t row, size_t column) {
    const gonio_table_direction i = gonio_table_row(t, row), o = gonio_table_column(t, column);
    return (gonio_pair){i.theta, i.phi, o.theta, o.phi};
}

size_t gonio_table_row_step(const gonio_table *t) { return t->isotropic && t->phis > 0 ? t->phis : 1; }

static bool same(gonio_table_direction a, gonio_table_direction b) {
    const gonio_vec3 u = gonio_direction(a.theta, a.phi), v = gonio_direction(b.theta, b.phi);
    return hypot(hypot(u.x - v.x, u.y - v.y), u.z - v.z) < 2 * TOLERANCE;
}

// Both lists are sorted by theta: the candidates of a row stand together.
static gonio_status find_twins(gonio_table *t, gonio_error *error) {
    t->column_of_row = malloc((t->rows + 1) * sizeof *t->column_of_row);
    t->row_of_column = malloc((t->columns + 1) * sizeof *t->row_of_column);
    if (t->column_of_row == NULL || t->row_of_column == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu x %zu directions", t->rows, t->columns);
    }
    for (size_t c = 0; c < t->columns; c++) {
        t->row_of_column[c] = GONIO_TABLE_NONE;
    }
    // Without rings an isotropic table has no other azimuth of its incidences than 0.
    const bool apart = t->isotropic && t->phis == 0;
    for (size_t r = 0, from = 0; r < t->rows; r++) {
        const gonio_table_direction d = gonio_table_row(t, r);
        t->column_of_row[r] = GONIO_TABLE_NONE;
        while (from < t->columns && gonio_table_column(t, from).theta < d.theta - 2 * TOLERANCE) {
            from++;
        }
        for (size_t c = from; c < t->columns && !apart && gonio_table_column(t, c).theta < d.theta + 2 * TOLERANCE;
             c++) {
            if (same(d, gonio_table_column(t, c))) {
                t->column_of_row[r] = c;
                t->row_of_column[c] = r;
                break;
            }
        }
    }
    return GONIO_OK;
}

// ---- weights ----

static double cap(double theta) { return gonio_direction(theta, 0).x * gonio_direction(theta, 0).x; }

// Borders of rings at ascending thetas: as cells that end at the horizon where those centre on the thetas; else midway.
static void borders(const double *theta, size_t n, double *border) {
    border[n] = GONIO_PI / 2;
    bool centred = true;
    for (size_t k = n; k-- > 0;) {
        border[k] = k == 0 && theta[0] < TOLERANCE ? 0 : 2 * theta[k] - border[k + 1];
        centred = centred && border[k] < theta[k] + TOLERANCE && border[k] > -TOLERANCE &&
                  (k == 0 || border[k] > theta[k - 1] - TOLERANCE);
    }
    centred = centred && border[0] < TOLERANCE;
    for (size_t k = 0; !centred && k <= n; k++) {
        const double after = n > 1 ? (theta[n - 1] - theta[n - 2]) / 2 : GONIO_PI / 4;
        const double before = n > 1 ? (theta[1] - theta[0]) / 2 : GONIO_PI / 4;
        border[k] = k == 0   ? fmax(theta[0] - before, 0)
                    : k == n ? fmin(theta[n - 1] + after, GONIO_PI / 2)
                             : (theta[k - 1] + theta[k]) / 2;
    }
    border[0] = fmax(border[0], 0);
}

// Weights of rings: `m` azimuths stored in each, a pole before them. plain: (4.4).
static void weigh_rings(const gonio_table *t, size_t first, size_t n, const double *theta, const double *border,
                        bool plain, double *weight) {
    const double step = n > 1 ? theta[n - 1] - theta[n - 2] : 0;
    for (size_t k = 0, at = first; k < n; k++) {
        size_t m = 0;
        while (at + m < t->n_out && fabs(t->out[at + m].theta - theta[k]) < TOLERANCE) {
            m++;
        }
        const double ring =
            plain ? sin(theta[k]) * cos(theta[k]) * step * TURN : GONIO_PI * (cap(border[k + 1]) - cap(border[k]));
        const size_t around = t->folded && m > 1 ? 2 * (m - 1) : m;
        for (size_t j = 0; j < m; j++) {
            const bool inside = t->folded && j > 0 && j + 1 < m;
            weight[at + j] = ring / (double)around * (inside ? 2 : 1);
        }
        at += m;
    }
}

// Does each ring have azimuths at equal steps?
static bool ringed(const gonio_table *t) {
    if (t->phis > 0) {
        return true;
    }
    for (size_t k = 0; k < t->n_out;) {
        size_t m = 1;
        while (k + m < t->n_out && t->out[k + m].theta - t->out[k].theta < TOLERANCE) {
            m++;
        }
        for (size_t j = 0; j < m; j++) {
            if (fabs(t->out[k + j].phi - t->out[k].phi - TURN * (double)j / (double)m) > TOLERANCE ||
                (m < 3 && t->out[k].theta > TOLERANCE)) {
                return false;
            }
        }
        k += m;
    }
    return !t->folded;
}

static gonio_status weigh_triangles(gonio_table *t, gonio_error *error) {
    gonio_vec3 *directions = malloc((t->n_out + 1) * sizeof *directions);
    if (directions == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to triangulate %zu directions", t->n_out);
    }
    for (size_t q = 0; q < t->n_out; q++) {
        directions[q] = gonio_direction(t->out[q].theta, t->out[q].phi);
    }
    const gonio_status status =
        gonio_triangles_weigh(directions, t->n_out, t->isotropic, t->weight_cells, &t->covered, error);
    memcpy(t->weight, t->weight_cells, t->n_out * sizeof *t->weight);
    free(directions);
    return status;
}

static gonio_status weigh(gonio_table *t, gonio_error *error) {
    double *theta = malloc((t->n_out + 1) * sizeof *theta), *border = malloc((t->n_out + 2) * sizeof *border);
    t->weight = calloc(t->n_out + 1, sizeof *t->weight);
    t->weight_cells = calloc(t->n_out + 1, sizeof *t->weight_cells);
    gonio_status status = GONIO_OK;
    if (theta == NULL || border == NULL || t->weight == NULL || t->weight_cells == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the weights of %zu directions", t->n_out);
    } else if (!ringed(t)) {
        status = weigh_triangles(t, error);
    } else {
        for (size_t q = 0; q < t->n_out; q++) {
            theta[q] = t->out[q].theta;
        }
        const size_t n = distinct(theta, t->n_out), pole = theta[0] < TOLERANCE;
        double step;
        borders(theta, n, border);
        weigh_rings(t, 0, n, theta, border, false, t->weight_cells);
        weigh_rings(t, 0, n, theta, border, equal_steps(theta + pole, n - pole, &step) && t->phis > 0, t->weight);
        t->covered = cap(border[n]) - cap(border[0]);
    }
    free(border);
    free(theta);
    return status;
}

// ---- the table ----

void gonio_table_free(gonio_table *t) {
    if (t != NULL) {
        free(t->in);
        free(t->out);
        free(t->cell);
        free(t->ring_in);
        free(t->ring_out);
        free(t->row_of_column);
        free(t->column_of_row);
        free(t->weight);
        free(t->weight_cells);
        free(t);
    }
}

// Half a turn may be stored as 180 to 360 deg; its mirror image is the same table.
static bool lies_beyond(const build *b) {
    const side *s = &b->side[1];
    return b->isotropic && s->phis > 2 && s->phi[s->phis - 1] > GONIO_PI + TOLERANCE &&
           s->phi[1] > GONIO_PI - TOLERANCE;
}

static gonio_status make(build *b, bool *whole, gonio_error *error) {
    take_angles(b);
    if (lies_beyond(b)) {
        b->reflect = true;
        take_angles(b);
    }
    take_keys(b);
    gonio_status status = take_cells(b, whole, error);
    if (status != GONIO_OK || !*whole) {
        return status;
    }
    *whole = fill_pole(b->table) && b->table->n_in * b->table->n_out > 1;
    status = *whole ? find_rings(b->table, error) : GONIO_OK;
    status = *whole && status == GONIO_OK ? find_twins(b->table, error) : status;
    return *whole && status == GONIO_OK ? weigh(b->table, error) : status;
}

static gonio_status try_table(const gonio_samples *samples, bool isotropic, gonio_table **out, gonio_error *error) {
    build b = {.samples = samples, .isotropic = isotropic};
    bool whole = false;
    b.table = calloc(1, sizeof *b.table);
    gonio_status status;
    if (b.table == NULL || !allocate(&b)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to find the grid of %zu samples", samples->n);
    } else {
        b.table->samples = samples;
        b.table->isotropic = isotropic;
        status = samples->n > 0 ? make(&b, &whole, error) : GONIO_OK;
    }
    release(&b);
    if (status != GONIO_OK || !whole) {
        gonio_table_free(b.table);
        return status;
    }
    *out = b.table;
    return GONIO_OK;
}

gonio_status gonio_table_of_directions(const gonio_table_direction *in, size_t n_in, const gonio_table_direction *out,
                                       size_t n_out, gonio_table **table, gonio_error *error) {
    gonio_table *t = calloc(1, sizeof *t);
    *table = NULL;
    gonio_status status = GONIO_OK;
    if (t != NULL) {
        *t = (gonio_table){.n_in = n_in,
                           .n_out = n_out,
                           .in = malloc((n_in + 1) * sizeof *t->in),
                           .out = malloc((n_out + 1) * sizeof *t->out)};
    }
    if (t == NULL || t->in == NULL || t->out == NULL) {
        gonio_table_free(t);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu x %zu", n_in, n_out);
    }
    memcpy(t->in, in, n_in * sizeof *in);
    memcpy(t->out, out, n_out * sizeof *out);
    status = find_rings(t, error);
    status = status == GONIO_OK ? find_twins(t, error) : status;
    status = status == GONIO_OK ? weigh(t, error) : status;
    if (status != GONIO_OK) {
        gonio_table_free(t);
        return status;
    }
    *table = t;
    return GONIO_OK;
}

gonio_status gonio_table_of(const gonio_samples *samples, gonio_table **out, gonio_error *error) {
    *out = NULL;
    const gonio_status status = try_table(samples, samples->isotropic, out, error);
    // An isotropic set may have been sampled at every azimuth of the light all the same.
    return status == GONIO_OK && *out == NULL && samples->isotropic ? try_table(samples, false, out, error) : status;
}
