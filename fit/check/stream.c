// SPDX-License-Identifier: BSD-3-Clause
// Measures and transforms of a table in a text file, row by row: a row is an incidence, whose lines stand together. One
// scan finds where each begins and holds the directions against those of the first; after that a row is one seek.
//
// What has to be held: for isotropy the rows of one ring of incidences, for reciprocity as many rows as memory allows,
// held against the columns of all others in one pass a block, for separability the few vectors of the search.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/text.h"
#include "fit/check/change.h"
#include "fit/check/measures.h"
#include "fit/check/products.h"
#include "fit/check/significance.h"
#include "gonio/output.h"

enum { LINE = 512, PASSES = 3 };
static const size_t memory_default = (size_t)256 << 20;

typedef struct stream {
    const char *path;
    FILE *file;
    char head[LINE]; // the header line
    gonio_table *table;
    off_t *offset; // [n_in]
    size_t memory;
    bool failed; // a line that was read before is none any more
} stream;

// ---- the file ----

static void strip(char *line) { line[strcspn(line, "\r\n")] = 0; }

// Angles in rad and the value of a line; false: it is none.
static bool parse(const char *line, double *number) {
    for (int k = 0; k < 5; k++) {
        char *end;
        number[k] = gonio_number_parse(line, &end);
        if (end == line || (k < 4 && *end != ',') || (k == 4 && *end != 0 && *end != '\r' && *end != '\n') ||
            !isfinite(number[k])) {
            return false;
        }
        number[k] = k < 4 ? gonio_radians(number[k]) : number[k];
        line = end + 1;
    }
    return true;
}

static gonio_table_direction direction(double theta, double phi) {
    const double turn = 2 * GONIO_PI, a = phi - turn * floor(phi / turn);
    return (gonio_table_direction){theta, theta < GONIO_TABLE_TOLERANCE || a > turn - GONIO_TABLE_TOLERANCE ? 0 : a};
}

static bool same(gonio_table_direction a, gonio_table_direction b) {
    return fabs(a.theta - b.theta) < GONIO_TABLE_TOLERANCE && fabs(a.phi - b.phi) < GONIO_TABLE_TOLERANCE;
}

static bool ascends(gonio_table_direction a, gonio_table_direction b) {
    const bool ring = fabs(a.theta - b.theta) < GONIO_TABLE_TOLERANCE;
    return ring ? b.phi > a.phi : b.theta > a.theta;
}

typedef struct scan {
    gonio_table_direction *in, *out;
    size_t n_in, n_out, room_in, room_out, at; // at: outgoing directions of the row so far
} scan;

static bool grow(void **array, size_t n, size_t *room, size_t size) {
    if (n < *room) {
        return true;
    }
    const size_t more = 2 * *room + 256;
    void *larger = realloc(*array, more * size);
    *array = larger != NULL ? larger : *array;
    *room = larger != NULL ? more : *room;
    return larger != NULL;
}

// One more line; *what: what was expected where it does not fit.
static bool take_line(stream *s, scan *c, const double *number, off_t offset, const char **what) {
    const gonio_table_direction i = direction(number[0], number[1]), o = direction(number[2], number[3]);
    if (c->n_in == 0 || !same(i, c->in[c->n_in - 1])) {
        const size_t room = c->room_in;
        *what = c->n_in > 1 && c->at != c->n_out ? "the outgoing directions of every incidence to be as many"
                : c->n_in > 0 && !ascends(c->in[c->n_in - 1], i) ? "incidences ascending by theta_i, then phi_i"
                                                                 : NULL;
        if (*what != NULL || !grow((void **)&c->in, c->n_in, &c->room_in, sizeof *c->in) ||
            (c->room_in > room && (s->offset = realloc(s->offset, c->room_in * sizeof *s->offset)) == NULL)) {
            return false;
        }
        s->offset[c->n_in] = offset;
        c->in[c->n_in++] = i;
        c->at = 0;
    }
    if (c->n_in == 1) {
        *what = c->n_out > 0 && !ascends(c->out[c->n_out - 1], o)
                    ? "outgoing directions ascending by theta_o, then phi_o"
                    : NULL;
        if (*what != NULL || !grow((void **)&c->out, c->n_out, &c->room_out, sizeof *c->out)) {
            return false;
        }
        c->out[c->n_out++] = o;
    } else {
        *what = c->at >= c->n_out || !same(o, c->out[c->at]) ? "the outgoing directions of the first incidence" : NULL;
    }
    c->at++;
    return *what == NULL;
}

static gonio_status scan_lines(stream *s, scan *c, gonio_error *error) {
    char line[LINE];
    long long number = 0;
    off_t offset = 0;
    bool header = false;
    for (; fgets(line, sizeof line, s->file) != NULL; offset = ftello(s->file)) {
        double values[5];
        const char *what = "numbers theta_i,phi_i,theta_o,phi_o and one value";
        number++;
        if (line[0] == '#' || line[0] == '\n' || line[0] == '\r') {
            continue;
        }
        if (!header) {
            header = strncmp(line, GONIO_PAIR_HEADER ",", sizeof GONIO_PAIR_HEADER) == 0;
            strip(line);
            memcpy(s->head, line, sizeof line);
            if (!header || strchr(line + sizeof GONIO_PAIR_HEADER, ',') != NULL) {
                return gonio_fail_line(error, GONIO_E_INPUT, s->path, number,
                                       "expected the header %s and one channel, to read a table in passes",
                                       GONIO_PAIR_HEADER);
            }
            continue;
        }
        if (!parse(line, values) || !take_line(s, c, values, offset, &what)) {
            return what == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for the table's directions")
                                : gonio_fail_line(error, GONIO_E_INPUT, s->path, number,
                                                  "expected %s, to read a table in passes", what);
        }
    }
    return c->n_in > 0 && c->at == c->n_out
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_INPUT, s->path, number, "expected a whole table, to read it in passes");
}

static void close_stream(stream *s) {
    gonio_table_free(s->table);
    free(s->offset);
    if (s->file != NULL) {
        fclose(s->file);
    }
}

static gonio_status open_stream(const char *path, size_t memory, stream *s, gonio_error *error) {
    scan c = {0};
    *s = (stream){.path = path, .file = fopen(path, "r"), .memory = memory > 0 ? memory : memory_default};
    if (s->file == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot open it");
    }
    gonio_status status = scan_lines(s, &c, error);
    status = status == GONIO_OK ? gonio_table_of_directions(c.in, c.n_in, c.out, c.n_out, &s->table, error) : status;
    if (status == GONIO_OK && s->table->phis == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                 "expected rings of equal azimuths on both sides, to read a table in passes");
    }
    free(c.in);
    free(c.out);
    if (status != GONIO_OK) {
        close_stream(s);
    }
    return status;
}

// The row of stored incidence p, values[n_out].
static void read_stored(stream *s, size_t p, double *values) {
    char line[LINE];
    double number[5];
    s->failed = fseeko(s->file, s->offset[p], SEEK_SET) != 0 || s->failed;
    for (size_t q = 0; q < s->table->n_out; q++) {
        do {
            s->failed = s->failed || fgets(line, sizeof line, s->file) == NULL;
        } while (!s->failed && (line[0] == '#' || line[0] == '\n'));
        s->failed = s->failed || !parse(line, number);
        values[q] = s->failed ? 0 : number[4];
    }
}

static void read_row(void *context, size_t row, double *values) {
    stream *s = context;
    double *all = malloc(s->table->n_out * sizeof *all);
    if (all == NULL) {
        s->failed = true;
        return;
    }
    read_stored(s, s->table->ring_in[row], all);
    for (size_t c = 0; c < s->table->columns; c++) {
        values[c] = all[s->table->ring_out[c]];
    }
    free(all);
}

static gonio_status sound(const stream *s, gonio_error *error) {
    return s->failed ? gonio_fail_line(error, GONIO_E_IO, s->path, -1, "it changed, or cannot be read again")
                     : GONIO_OK;
}

// ---- measures ----

// Rows [from, from + n) of the matrix.
static gonio_status read_block(stream *s, size_t from, size_t n, double *block, gonio_error *error) {
    for (size_t j = 0; j < n; j++) {
        read_row(s, from + j, block + j * s->table->columns);
    }
    return sound(s, error);
}

static size_t block_rows(const stream *s) {
    const size_t fit = s->memory / (s->table->columns * sizeof(double));
    return fit < 1 ? 1 : fit < s->table->rows ? fit : s->table->rows;
}

static gonio_status reciprocity(stream *s, double *block, gonio_check_report *r, gonio_error *error) {
    const gonio_table *t = s->table;
    const size_t n = block_rows(s);
    double *row = malloc(t->columns * sizeof *row), sum = 0;
    gonio_differences d;
    gonio_status status = GONIO_OK;
    if (row == NULL || !gonio_differences_begin(&d, t->rows * t->columns / 2)) {
        free(row);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to compare %zu rows", t->rows);
    }
    size_t pairs = 0;
    for (size_t from = 0; from < t->rows && status == GONIO_OK; from += n) {
        const size_t held = t->rows - from < n ? t->rows - from : n;
        status = read_block(s, from, held, block, error);
        for (size_t p = from; p < t->rows && status == GONIO_OK; p++) {
            if (p >= from + held) {
                read_row(s, p, row);
            }
            const double *values = p < from + held ? block + (p - from) * t->columns : row;
            for (size_t q = from; q < from + held && q <= p; q++) {
                const size_t there = t->column_of_row[q], back = t->column_of_row[p];
                if (there == GONIO_TABLE_NONE || back == GONIO_TABLE_NONE) {
                    continue;
                }
                const double a = values[there], b = block[(q - from) * t->columns + back];
                const gonio_pair where = gonio_table_pair(t, p, there);
                const size_t times = p == q ? 1 : 2;
                sum += (double)times * (a - b) * (a - b) / 2;
                pairs += times;
                gonio_differences_add(&d, a, b, &where, 0);
            }
        }
        status = status == GONIO_OK ? sound(s, error) : status;
    }
    r->reciprocity = pairs > 0 ? sum / (double)pairs : NAN;
    r->reciprocity_range = gonio_differences_end(&d, &r->reciprocity_median);
    free(row);
    return status;
}

// One ring of incidences in `block`: the deviations of (4.9) are added up, or the means taken in place of the values.
static double ring_deviation(const gonio_table *t, double *block, const gonio_change *change) {
    const size_t n = t->phis;
    double total = 0;
    for (size_t column = 0; column < t->columns; column++) {
        const size_t base = column - column % n;
        double mean = 0, squares = 0;
        for (size_t j = 0; j < n; j++) {
            mean += block[j * t->columns + base + (column % n + j) % n] / (double)n;
        }
        for (size_t j = 0; j < n; j++) {
            double *z = &block[j * t->columns + base + (column % n + j) % n];
            squares += (*z - mean) * (*z - mean);
            *z = change != NULL ? gonio_change_between(change, *z, mean) : *z;
        }
        total += sqrt(squares / (double)n);
    }
    return total;
}

static gonio_status isotropy(stream *s, double *block, gonio_check_report *r, gonio_error *error) {
    const gonio_table *t = s->table;
    gonio_status status = GONIO_OK;
    double sum = 0;
    for (size_t row = 0; row < t->rows && status == GONIO_OK; row += t->phis) {
        status = read_block(s, row, t->phis, block, error);
        sum += ring_deviation(t, block, NULL);
    }
    r->isotropy = sum / (double)(t->thetas_in * t->columns);
    r->isotropy_median = NAN;
    return status;
}

static double albedo_of(const gonio_table *t, const double *values, const double *weight) {
    double sum = 0;
    for (size_t q = 0; q < t->n_out; q++) {
        sum += weight[q] * values[q];
    }
    return sum;
}

static gonio_status energy(stream *s, gonio_check_report *r, gonio_error *error) {
    const gonio_table *t = s->table;
    double *values = malloc(t->n_out * sizeof *values);
    r->albedos = calloc(t->n_in, sizeof *r->albedos);
    if (values == NULL || r->albedos == NULL) {
        free(values);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu albedos", t->n_in);
    }
    r->incidences = t->n_in;
    for (size_t p = 0; p < t->n_in; p++) {
        read_stored(s, p, values);
        const double sum = albedo_of(t, values, t->weight), cells = albedo_of(t, values, t->weight_cells);
        r->albedos[p] = (gonio_check_albedo_point){.theta_i = t->in[p].theta,
                                                   .phi_i = t->in[p].phi,
                                                   .value = sum,
                                                   .largest = sum,
                                                   .integration = fabs(sum - cells),
                                                   .covered = t->covered};
        for (size_t q = 0; q < t->n_out; q++) {
            r->negative += values[q] < 0;
        }
    }
    gonio_check_sum_up_albedos(r);
    free(values);
    return sound(s, error);
}

static gonio_status ranks(stream *s, gonio_check_report *r, gonio_error *error) {
    const gonio_table *t = s->table;
    const gonio_row_source a = {t->rows, t->columns, read_row, s};
    const double entries = (double)t->rows * (double)t->columns;
    gonio_products p;
    gonio_status status = gonio_products_find(&a, GONIO_CHECK_RANKS, PASSES, &p, error);
    if (status != GONIO_OK) {
        return status;
    }
    double left = p.squares;
    r->mean_square = p.squares / entries;
    r->mean_square_seen = 1;
    r->ranks = (int)p.k;
    r->directions[0] = t->rows;
    r->directions[1] = t->columns;
    for (size_t k = 0; k < p.k; k++) {
        left = fmax(left - p.value[k] * p.value[k], 0);
        r->separability[k] = sqrt(left / entries);
        r->separability_range[k] = p.squares > 0 ? sqrt(left / p.squares) : 0;
        r->separability_test[k] = gonio_check_no_test;
        r->separability_error =
            fmax(r->separability_error, r->separability[k] - sqrt(fmax(left - p.left, 0) / entries));
    }
    gonio_products_free(&p);
    return sound(s, error);
}

static double *new_block(const stream *s) {
    const size_t rows = block_rows(s) > s->table->phis ? block_rows(s) : s->table->phis;
    return malloc(rows * s->table->columns * sizeof(double));
}

gonio_status gonio_check_stream(const char *path, size_t memory, gonio_check_report *report, gonio_error *error) {
    stream s;
    *report = (gonio_check_report){.reciprocity_expected = NAN};
    report->reciprocity_test = report->isotropy_test = report->energy_test = gonio_check_no_test;
    gonio_status status = open_stream(path, memory, &s, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *block = new_block(&s);
    report->form = s.table->uniform ? GONIO_CHECK_UNIFORM : GONIO_CHECK_SEMI_UNIFORM;
    status = block != NULL ? reciprocity(&s, block, report, error)
                           : gonio_fail(error, GONIO_E_MEMORY, "no memory for a block of the table's rows");
    status = status == GONIO_OK ? isotropy(&s, block, report, error) : status;
    status = status == GONIO_OK ? energy(&s, report, error) : status;
    status = status == GONIO_OK ? ranks(&s, report, error) : status;
    free(block);
    close_stream(&s);
    if (status != GONIO_OK) {
        gonio_check_report_free(report);
    }
    return status;
}

// ---- transforms: rows come out in the order in which they stand ----

static void put_row(const stream *s, FILE *out, size_t p, const double *values) {
    char angle[4][32], value[32];
    const gonio_table *t = s->table;
    gonio_text_shortest(gonio_degrees(t->in[p].theta), angle[0]);
    gonio_text_shortest(gonio_degrees(t->in[p].phi), angle[1]);
    for (size_t q = 0; q < t->n_out; q++) {
        gonio_text_shortest(gonio_degrees(t->out[q].theta), angle[2]);
        gonio_text_shortest(gonio_degrees(t->out[q].phi), angle[3]);
        gonio_text_shortest(values[q], value);
        fprintf(out, "%s,%s,%s,%s,%s\n", angle[0], angle[1], angle[2], angle[3], value);
    }
}

// Rows from `from` on: those values, and the values of the exchanged directions. Stored incidences and outgoing
// directions are the same list.
static void exchange(stream *s, const gonio_change *change, size_t n, double *block, double *back, FILE *out) {
    const size_t width = s->table->n_out;
    double *row = back + n * width;
    for (size_t from = 0; from < s->table->n_in && !s->failed; from += n) {
        const size_t held = s->table->n_in - from < n ? s->table->n_in - from : n;
        for (size_t q = 0; q < s->table->n_in; q++) {
            read_stored(s, q, row);
            for (size_t j = 0; j < held; j++) {
                back[j * width + q] = row[from + j];
            }
            if (q >= from && q < from + held) {
                memcpy(block + (q - from) * width, row, width * sizeof *row);
            }
        }
        for (size_t j = 0; j < held; j++) {
            for (size_t q = 0; q < width; q++) {
                double *z = &block[j * width + q];
                *z = gonio_change_between(change, *z, (*z + back[j * width + q]) / 2);
            }
            put_row(s, out, from + j, block + j * width);
        }
    }
}

static gonio_status make_reciprocal(stream *s, const gonio_change *change, FILE *out, gonio_error *error) {
    const gonio_table *t = s->table;
    bool equal = t->n_in == t->n_out;
    for (size_t k = 0; equal && k < t->n_in; k++) {
        equal = same(t->in[k], t->out[k]);
    }
    if (!equal) {
        return gonio_fail_line(error, GONIO_E_UNSUPPORTED, s->path, -1,
                               "reciprocity in passes needs the same directions on both sides");
    }
    const size_t fit = s->memory / (2 * t->n_out * sizeof(double)), n = fit < 1 ? 1 : fit < t->n_in ? fit : t->n_in;
    double *block = malloc((2 * n + 1) * t->n_out * sizeof *block);
    if (block == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for blocks of %zu rows", n);
    }
    exchange(s, change, n, block, block + n * t->n_out, out);
    free(block);
    return sound(s, error);
}

static void mean_over(const gonio_change *change, double *values, size_t n, size_t step) {
    double mean = 0;
    for (size_t j = 0; j < n; j++) {
        mean += values[j * step] / (double)n;
    }
    for (size_t j = 0; j < n; j++) {
        values[j * step] = gonio_change_between(change, values[j * step], mean);
    }
}

static gonio_status make_isotropic(stream *s, const gonio_change *change, FILE *out, gonio_error *error) {
    const gonio_table *t = s->table;
    const size_t n = t->phis, width = t->n_out, pole = t->ring_in[0], pole_out = t->ring_out[0];
    double *block = malloc(n * width * sizeof *block), *ring = malloc(n * t->columns * sizeof *ring);
    if (block == NULL || ring == NULL) {
        free(ring);
        free(block);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a ring of %zu rows", n);
    }
    if (pole > 0) {
        read_stored(s, 0, block);
        for (size_t column = 0; column < t->columns; column += n) {
            mean_over(change, block + pole_out + column, n, 1);
        }
        put_row(s, out, 0, block);
    }
    for (size_t row = 0; row < t->rows; row += n) {
        for (size_t j = 0; j < n; j++) {
            read_stored(s, pole + row + j, block + j * width);
            memcpy(ring + j * t->columns, block + j * width + pole_out, t->columns * sizeof *ring);
        }
        ring_deviation(t, ring, change);
        if (pole_out > 0) {
            mean_over(change, block, n, width);
        }
        for (size_t j = 0; j < n; j++) {
            memcpy(block + j * width + pole_out, ring + j * t->columns, t->columns * sizeof *ring);
            put_row(s, out, pole + row + j, block + j * width);
        }
    }
    free(ring);
    free(block);
    return sound(s, error);
}

// Energy: each row by its factor; separability: ring rows towards their products.
static gonio_status change_rows(stream *s, const gonio_change *change, FILE *out, gonio_error *error) {
    const gonio_table *t = s->table;
    const gonio_row_source a = {t->rows, t->columns, read_row, s};
    double *values = malloc(t->n_out * sizeof *values), worst = -INFINITY;
    gonio_products p = {0};
    gonio_status status = values != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
    if (status == GONIO_OK && change->kind == GONIO_CHANGE_SEPARABLE) {
        status = gonio_products_find(&a, (size_t)change->products, 2 * PASSES, &p, error);
    }
    for (size_t k = 0; status == GONIO_OK && change->kind == GONIO_CHANGE_ENERGY && k < t->n_in; k++) {
        read_stored(s, k, values);
        worst = fmax(worst, albedo_of(t, values, t->weight));
    }
    for (size_t k = 0; status == GONIO_OK && k < t->n_in; k++) {
        read_stored(s, k, values);
        if (change->kind == GONIO_CHANGE_ENERGY) {
            const double by = gonio_change_factor(change, change->one_scalar ? worst : albedo_of(t, values, t->weight));
            for (size_t q = 0; q < t->n_out; q++) {
                values[q] *= by;
            }
        }
        for (size_t c = 0; c < t->columns && p.k > 0 && k >= t->ring_in[0]; c++) {
            double target = 0, *z = &values[t->ring_out[c]];
            for (size_t j = 0; j < p.k; j++) {
                target += p.value[j] * p.u[j * t->rows + k - t->ring_in[0]] * p.v[j * t->columns + c];
            }
            *z = gonio_change_between(change, *z, target);
        }
        put_row(s, out, k, values);
    }
    gonio_products_free(&p);
    free(values);
    return status == GONIO_OK ? sound(s, error) : status;
}

gonio_status gonio_check_stream_change(const char *path, const gonio_change *change, size_t memory, const char *out,
                                       gonio_error *error) {
    stream s;
    gonio_output *output = NULL;
    gonio_status status = gonio_change_check(change, error);
    if (status == GONIO_OK && (change->kind == GONIO_CHANGE_MIRROR || change->kind == GONIO_CHANGE_CLAMP)) {
        status = gonio_fail(error, GONIO_E_USAGE, "%s is not done in passes", gonio_change_name(change->kind));
    }
    status = status == GONIO_OK ? open_stream(path, memory, &s, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_output_open(out, &output, error);
    if (status == GONIO_OK) {
        FILE *file = gonio_output_stream(output);
        fprintf(file, "%s\n", s.head);
        status = change->kind == GONIO_CHANGE_RECIPROCITY ? make_reciprocal(&s, change, file, error)
                 : change->kind == GONIO_CHANGE_ISOTROPY  ? make_isotropic(&s, change, file, error)
                                                          : change_rows(&s, change, file, error);
        if (status == GONIO_OK) {
            status = gonio_output_commit(output, error);
        } else {
            gonio_output_abandon(output);
        }
    }
    close_stream(&s);
    return status;
}
