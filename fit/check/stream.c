// SPDX-License-Identifier: BSD-3-Clause
#include "fit/check/stream.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"

static const size_t memory_default = (size_t)256 << 20;

// ---- lines ----

// False at the end of the file; or where memory ends, which counts as a failure.
static bool next_line(gonio_stream *s) {
    const ssize_t n = getline(&s->line, &s->room, s->file);
    if (n < 0) {
        return false;
    }
    s->line[strcspn(s->line, "\r\n")] = 0;
    return true;
}

static bool is_row(const char *line) { return line[0] != '#' && line[strspn(line, " \t")] != 0; }

// The line's numbers, angles in rad; false: it has others.
static bool parse(gonio_stream *s) {
    const char *at = s->line;
    for (int k = 0; k < s->columns->columns; k++) {
        char *end;
        const bool last = k + 1 == s->columns->columns;
        s->numbers[k] = gonio_number_parse(at, &end);
        if (end == at || *end != (last ? 0 : ',') || !isfinite(s->numbers[k])) {
            return false;
        }
        s->numbers[k] = k < 4 ? gonio_radians(s->numbers[k]) : s->numbers[k];
        at = end + 1;
    }
    return true;
}

// ---- what stands in the file ----

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
static bool take_line(gonio_stream *s, scan *c, const double *number, off_t offset, const char **what) {
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

static gonio_status keep_head(gonio_stream *s, gonio_error *error) {
    const size_t n = strlen(s->line) + 1;
    char *head = realloc(s->head, s->head_size + n + 1);
    if (head == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the file's head");
    }
    s->head = head;
    memcpy(head + s->head_size, s->line, n - 1);
    s->head_size += n;
    head[s->head_size - 1] = '\n';
    head[s->head_size] = 0;
    return GONIO_OK;
}

// What the comments declare holds for a table in passes as for any other; but values are taken as they stand.
static gonio_status check_head(const gonio_stream *s, gonio_declared *declared, gonio_error *error) {
    static const gonio_declaration own[] = {{"angle_units", "deg|degree|degrees", GONIO_DECLARED_NOTHING}, {0}};
    const gonio_source source = {.path = s->path, .data = s->head, .size = s->head_size};
    const gonio_status status = gonio_declarations_read(&source, own, declared, error);
    const bool other = declared->cosine || declared->factor != 1 || declared->transmission || declared->has_missing ||
                       declared->isotropic;
    return status != GONIO_OK || !other
               ? status
               : gonio_fail_line(error, GONIO_E_INPUT, s->path, -1,
                                 "it declares more than an anisotropic table of f_r in reflection, which is what is "
                                 "read in passes; `gonio convert` makes one of it");
}

static gonio_status read_header(gonio_stream *s, long long line, gonio_error *error) {
    gonio_declared declared = {0};
    gonio_status status = check_head(s, &declared, error);
    char *copy = strdup(s->line), **fields = malloc(GONIO_COLUMNS_MAX * sizeof *fields);
    s->columns = malloc(sizeof *s->columns);
    if (status == GONIO_OK && (copy == NULL || fields == NULL || s->columns == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the header");
    }
    gonio_text text = gonio_text_begin(s->path, copy != NULL ? copy : s->line, 0);
    text.line = line;
    const int n = status == GONIO_OK ? gonio_text_split(copy, ',', fields, GONIO_COLUMNS_MAX) : 0;
    if (status == GONIO_OK && (n > GONIO_COLUMNS_MAX || !gonio_text_is_pair_header(fields, n))) {
        status = gonio_fail_line(error, GONIO_E_INPUT, s->path, line,
                                 "expected the header %s and channels, to read a table in passes", GONIO_PAIR_HEADER);
    }
    status = status == GONIO_OK ? gonio_columns_read(&text, fields, n, declared.channels, s->columns, error) : status;
    if (status == GONIO_OK && (s->columns->aside[0] != 0 || s->columns->wavelength >= 0 || s->columns->group >= 0)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, s->path, line,
                                 "expected channels and their sigmas alone, to read a table in passes");
    }
    if (status == GONIO_OK) {
        s->channels = (size_t)s->columns->channels;
        s->numbers = malloc((size_t)n * sizeof *s->numbers);
        status = s->numbers != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a line");
    }
    free(declared.head);
    free(declared.channels);
    free(fields);
    free(copy);
    return status;
}

static gonio_status scan_line(gonio_stream *s, scan *c, off_t offset, long long number, gonio_error *error) {
    const char *what = "numbers, as many as the header has columns";
    if (s->columns == NULL) {
        const gonio_status status = read_header(s, number, error);
        return status == GONIO_OK ? keep_head(s, error) : status;
    }
    if (parse(s) && take_line(s, c, s->numbers, offset, &what)) {
        return GONIO_OK;
    }
    return what == NULL
               ? gonio_fail(error, GONIO_E_MEMORY, "no memory for the table's directions")
               : gonio_fail_line(error, GONIO_E_INPUT, s->path, number, "expected %s, to read a table in passes", what);
}

static gonio_status scan_lines(gonio_stream *s, scan *c, gonio_error *error) {
    gonio_status status = GONIO_OK;
    long long number = 0;
    off_t offset = 0;
    for (; status == GONIO_OK && next_line(s); offset = ftello(s->file)) {
        number++;
        if (number == 1 && strncmp(s->line, "\xef\xbb\xbf", 3) == 0) {
            memmove(s->line, s->line + 3, strlen(s->line + 3) + 1);
        }
        if (is_row(s->line)) {
            status = scan_line(s, c, offset, number, error);
        } else if (s->columns == NULL && s->line[0] == '#') {
            status = keep_head(s, error);
        }
    }
    return status != GONIO_OK || (c->n_in > 0 && c->at == c->n_out)
               ? status
               : gonio_fail_line(error, GONIO_E_INPUT, s->path, number, "expected a whole table, to read it in passes");
}

void gonio_stream_close(gonio_stream *s) {
    gonio_table_free(s->table);
    free(s->offset);
    free(s->numbers);
    free(s->columns);
    free(s->head);
    free(s->line);
    if (s->file != NULL) {
        fclose(s->file);
    }
    *s = (gonio_stream){0};
}

gonio_status gonio_stream_open(const char *path, size_t memory, gonio_stream *s, gonio_error *error) {
    scan c = {0};
    *s = (gonio_stream){.path = path, .file = fopen(path, "re"), .memory = memory > 0 ? memory : memory_default};
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
    return status;
}

gonio_status gonio_stream_sound(const gonio_stream *s, gonio_error *error) {
    return s->failed ? gonio_fail_line(error, GONIO_E_IO, s->path, -1, "it changed, or cannot be read again")
                     : GONIO_OK;
}

// ---- rows ----

size_t gonio_stream_entry_bytes(const gonio_stream *s) {
    return s->channels * sizeof(double) * (s->columns->with_sigma ? 3 : 1);
}

gonio_samples *gonio_stream_entries(const gonio_stream *s, size_t n) {
    gonio_samples *e = calloc(1, sizeof *e);
    const size_t numbers = n * s->channels;
    if (e == NULL) {
        return NULL;
    }
    e->channels = (int)s->channels;
    e->n = n;
    e->values = malloc((n + 1) * gonio_stream_entry_bytes(s));
    if (e->values != NULL && s->columns->with_sigma) {
        e->sigma_random = e->values + numbers;
        e->sigma_systematic = e->sigma_random + numbers;
    }
    if (e->values == NULL) {
        free(e);
        return NULL;
    }
    return e;
}

void gonio_stream_entries_free(gonio_samples *e) {
    if (e != NULL) {
        free(e->values);
        free(e);
    }
}

static void take_entry(const gonio_stream *s, gonio_samples *e, size_t i) {
    const gonio_columns *l = s->columns;
    for (size_t c = 0; c < s->channels; c++) {
        const size_t at = i * s->channels + c;
        e->values[at] = s->failed ? 0 : s->numbers[l->value[c]];
        if (l->with_sigma) {
            e->sigma_random[at] = s->failed ? 0 : s->numbers[l->with_parts ? l->random[c] : l->sigma[c]];
            e->sigma_systematic[at] = s->failed || !l->with_parts ? 0 : s->numbers[l->systematic[c]];
        }
    }
}

void gonio_stream_read(gonio_stream *s, size_t p, gonio_samples *e, size_t at) {
    s->failed = fseeko(s->file, s->offset[p], SEEK_SET) != 0 || s->failed;
    for (size_t q = 0; q < s->table->n_out; q++) {
        bool read = false;
        while (!s->failed && !read) {
            s->failed = !next_line(s);
            read = !s->failed && is_row(s->line);
        }
        s->failed = s->failed || !parse(s);
        take_entry(s, e, at + q);
    }
}

static void read_ring_row(gonio_stream *s, size_t row, bool sigma, double *values) {
    gonio_samples *all = gonio_stream_entries(s, s->table->n_out);
    if (all == NULL) {
        s->failed = true;
        return;
    }
    gonio_stream_read(s, s->table->ring_in[row], all, 0);
    for (size_t c = 0; c < s->table->columns; c++) {
        values[c] = (sigma ? all->sigma_random : all->values)[s->table->ring_out[c] * s->channels + s->channel];
    }
    gonio_stream_entries_free(all);
}

void gonio_stream_channel_row(void *stream, size_t row, double *values) { read_ring_row(stream, row, false, values); }
void gonio_stream_sigma_row(void *stream, size_t row, double *values) { read_ring_row(stream, row, true, values); }
