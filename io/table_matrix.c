// SPDX-License-Identifier: BSD-3-Clause
#include "io/table_matrix.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/number.h"

enum { KEYS_MAX = 3 };

// A text as a matrix, line by line.
typedef struct matrix {
    const gonio_source *source;
    char separator, decimal;
    const char *block_key;  // NULL: headings tell nothing
    char **fields, **names; // of a line; of the columns, in `header`
    char *header;
    int n, pending; // columns; fields of a header that is not settled yet, 0: none
    double block;   // of the last heading
    bool has_block;
    long long block_line, second_block; // of the last heading with a number; of the first one between two blocks
    size_t rows, footers;
    char heading[80];
} matrix;

static bool is_number(const matrix *m, const char *field, double *value) {
    double own;
    return gonio_table_number(field, m->decimal, value != NULL ? value : &own);
}

static int leading_numbers(const matrix *m, int from, int n) {
    int k = from;
    while (k < n && is_number(m, m->fields[k], NULL)) {
        k++;
    }
    return k - from;
}

// The number behind the key's name, else the last one of the line.
static bool number_in(const char *line, const char *key, double *value) {
    const char *from = key != NULL ? strcasestr(line, key) : NULL;
    const bool named = from != NULL;
    bool found = false;
    for (const char *c = named ? from + strlen(key) : line; *c != 0;) {
        char *end;
        const bool begins =
            isdigit((unsigned char)*c) || ((*c == '-' || *c == '+' || *c == '.') && isdigit((unsigned char)c[1]));
        const bool inside = c > line && (isalnum((unsigned char)c[-1]) || c[-1] == '_');
        if (begins && !inside) {
            *value = gonio_number_parse(c, &end);
            found = end > c;
            if (found && named) {
                return true;
            }
            c = end > c ? end : c + 1;
        } else {
            c++;
        }
    }
    return found;
}

// Does the line repeat the header that is there?
static bool is_same_header(const matrix *m, int n) {
    bool same = m->n > 0 && n >= m->n;
    for (int k = 0; same && k < m->n; k++) {
        same = strcmp(m->names[k], m->fields[n - m->n + k]) == 0;
    }
    return same;
}

static void keep_header(matrix *m, const char *line, int n) {
    free(m->header);
    m->header = strdup(line);
    m->n = 0;
    m->pending = m->header != NULL ? n : 0;
}

// With the first row it is known whether the header has a corner.
static void settle_header(matrix *m, int row) {
    const int n = gonio_table_split(m->header, m->separator, 0, m->names, GONIO_TABLE_COLUMNS_MAX);
    const bool corner = row <= n;
    m->n = corner ? n - 1 : n;
    memmove(m->names, m->names + corner, (size_t)m->n * sizeof *m->names);
    m->pending = 0;
}

static void take_heading(matrix *m, const char *text, long long line) {
    double value;
    if (number_in(text, m->block_key, &value)) {
        m->second_block = m->rows > 0 && m->second_block == 0 ? line : m->second_block;
        m->block = value;
        m->has_block = true;
        m->block_line = line;
        snprintf(m->heading, sizeof m->heading, "%s", text);
    } else {
        m->footers += m->rows > 0;
    }
}

// A row: its fields are in m->fields. Else false; a header or a heading is taken in.
static bool take_line(matrix *m, char *line, long long number) {
    char *mark = line + strspn(line, "#%! \t"), *whole = strdup(mark);
    const bool comment = mark != line;
    const int n = comment ? 0 : gonio_table_split(line, m->separator, 0, m->fields, GONIO_TABLE_COLUMNS_MAX);
    bool row = false;
    if (whole == NULL || n > GONIO_TABLE_COLUMNS_MAX) {
        free(whole);
        return false;
    }
    const bool first = n > 0 && is_number(m, m->fields[0], NULL);
    const bool rest = n >= 3 && leading_numbers(m, 1, n) == n - 1;
    if (n >= 3 && m->pending > 0 && first && (n == m->pending || n == m->pending + 1)) {
        settle_header(m, n);
        row = true;
    } else if (n >= 3 && rest && (!first || is_same_header(m, n) || m->n == 0)) {
        keep_header(m, whole, n);
    } else if (m->n > 0 && first && n == m->n + 1) {
        row = true;
    } else if (m->n == 0 && n >= 2 && first && leading_numbers(m, 0, n) == n) {
        keep_header(m, whole, n); // two columns without a corner
    } else if (whole[0] != 0) {
        take_heading(m, whole, number);
    }
    m->rows += row;
    free(whole);
    return row;
}

static gonio_status begin(const gonio_source *source, const gonio_mapping *mapping, const char *block_key, matrix *m,
                          gonio_error *error) {
    gonio_mapping bare = {.separator = mapping->separator, .decimal = mapping->decimal};
    gonio_table_layout layout;
    *m = (matrix){.source = source, .block_key = block_key};
    const gonio_status status = gonio_table_layout_find(source, &bare, &layout, error);
    m->separator = layout.separator;
    m->decimal = layout.decimal;
    gonio_table_layout_free(&layout);
    m->fields = malloc((GONIO_TABLE_COLUMNS_MAX + 1) * sizeof *m->fields);
    m->names = malloc((GONIO_TABLE_COLUMNS_MAX + 1) * sizeof *m->names);
    return status != GONIO_OK || (m->fields != NULL && m->names != NULL)
               ? status
               : gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
}

static void end(matrix *m) {
    free(m->fields);
    free(m->names);
    free(m->header);
}

// ---- unfolding ----

typedef struct flattener {
    FILE *stream;
    char *text;
    size_t size;
    long long *lines;
    size_t n, capacity; // lines so far
} flattener;

static gonio_status note_line(flattener *f, long long line, gonio_error *error) {
    if (f->n + 2 > f->capacity) {
        const size_t larger = 2 * f->capacity + 1024;
        long long *lines = realloc(f->lines, larger * sizeof *lines);
        if (lines == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for the cells of a matrix");
        }
        f->lines = lines;
        f->capacity = larger;
    }
    f->lines[++f->n] = line;
    return GONIO_OK;
}

static gonio_status put_cells(const matrix *m, flattener *f, long long line, gonio_error *error) {
    char block[32] = "";
    gonio_status status = GONIO_OK;
    if (m->block_key != NULL) {
        gonio_number_format(block, sizeof block, "%.15g", m->block);
        for (char *point = strchr(block, '.'); point != NULL; point = NULL) {
            *point = m->decimal;
        }
    }
    for (int k = 0; k < m->n && status == GONIO_OK; k++) {
        if (m->fields[k + 1][0] != 0) { // an empty cell was not measured
            fprintf(f->stream, "%s\t%s\t%s%s%s\n", m->fields[0], m->names[k], block, block[0] != 0 ? "\t" : "",
                    m->fields[k + 1]);
            status = note_line(f, line, error);
        }
    }
    return status;
}

static gonio_status put_header(char *const *keys, int n, flattener *f, gonio_error *error) {
    for (int k = 0; k < n; k++) {
        fprintf(f->stream, "%s\t", keys[k]);
    }
    fputs("value\n", f->stream);
    return note_line(f, 0, error);
}

static gonio_status check_blocks(const matrix *m, gonio_error *error) {
    if (m->rows == 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, m->source->path, 1,
                               "no matrix in it: a row of numbers over rows that begin with one");
    }
    if (m->block_key == NULL && m->second_block > 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, m->source->path, m->second_block,
                               "'%.60s' begins another block; the third of --matrix says what its number is",
                               m->heading);
    }
    return GONIO_OK;
}

static gonio_status put_all(matrix *m, char *const *keys, int n, flattener *f, gonio_error *error) {
    gonio_table_lines lines = gonio_table_lines_begin(m->source);
    gonio_status status = put_header(keys, n, f, error);
    for (char *line; status == GONIO_OK && (line = gonio_table_lines_next(&lines)) != NULL;) {
        if (line[0] == '#') { // it may declare something
            fprintf(f->stream, "%s\n", line);
            status = note_line(f, lines.number, error);
        }
        if (status != GONIO_OK || line[0] == 0 || !take_line(m, line, lines.number)) {
            continue;
        }
        if (m->block_key != NULL && !m->has_block) {
            status = gonio_fail_line(error, GONIO_E_INPUT, m->source->path, lines.number,
                                     "no heading before it tells %s", m->block_key);
        }
        status = status == GONIO_OK ? put_cells(m, f, lines.number, error) : status;
    }
    free(lines.buffer);
    return status == GONIO_OK ? check_blocks(m, error) : status;
}

static gonio_status take_keys(char *text, char *keys[KEYS_MAX], int *n, gonio_mapping *mapping, gonio_error *error) {
    char *rest = text;
    *n = 0;
    for (char *one; (one = strsep(&rest, ",")) != NULL;) {
        int role = 0;
        while (role < GONIO_MAPPED_SIGMA && strcmp(gonio_mapped_role_name((gonio_mapped_role)role), one) != 0) {
            role++;
        }
        for (int k = 0; k < mapping->n; k++) {
            role = mapping->items[k].role == (gonio_mapped_role)role ? GONIO_MAPPED_SIGMA : role; // told twice
        }
        if (role == GONIO_MAPPED_SIGMA || *n == KEYS_MAX || mapping->n + 1 >= GONIO_MAPPED_ITEMS) {
            return gonio_fail(
                error, GONIO_E_USAGE,
                "matrix: expected what rows, columns and, with several blocks, headings tell, each once of "
                "theta_i, phi_i, theta_o, phi_o, phi, wavelength; found '%.40s'",
                one);
        }
        gonio_mapped_item *item = &mapping->items[mapping->n++];
        *item = (gonio_mapped_item){.role = (gonio_mapped_role)role, .constant = NAN};
        snprintf(item->key, sizeof item->key, "%s", one);
        snprintf(item->name, sizeof item->name, "%s", one);
        keys[(*n)++] = one;
    }
    gonio_mapped_item *value = &mapping->items[mapping->n++];
    *value = (gonio_mapped_item){.role = GONIO_MAPPED_VALUE, .key = "value", .name = "value", .constant = NAN};
    return *n >= 2 ? GONIO_OK : gonio_fail(error, GONIO_E_USAGE, "matrix: expected ROWS,COLUMNS, found '%s'", text);
}

gonio_status gonio_table_unfold(const gonio_source *source, const char *text, gonio_mapping *mapping,
                                gonio_table_flat *flat, gonio_error *error) {
    char *copy = strdup(text), *keys[KEYS_MAX];
    int n = 0;
    matrix m = {0};
    flattener f = {0};
    *flat = (gonio_table_flat){0};
    f.stream = open_memstream(&f.text, &f.size);
    gonio_status status = copy != NULL && f.stream != NULL
                              ? take_keys(copy, keys, &n, mapping, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for a matrix");
    if (status == GONIO_OK) {
        status = begin(source, mapping, n > 2 ? keys[2] : NULL, &m, error);
        status = status == GONIO_OK ? put_all(&m, keys, n, &f, error) : status;
        mapping->separator = '\t';
        mapping->decimal = m.decimal;
        end(&m);
    }
    if (f.stream != NULL) {
        fclose(f.stream);
    }
    free(copy);
    *flat = (gonio_table_flat){{.path = source->path, .data = f.text, .size = f.size}, f.lines};
    return status;
}

void gonio_table_flat_free(gonio_table_flat *flat) {
    free(flat->source.data);
    free(flat->lines);
    *flat = (gonio_table_flat){0};
}

// ---- is it one? ----

static void widen(double range[2], double value) {
    range[0] = fmin(range[0], value);
    range[1] = fmax(range[1], value);
}

// Rising or falling throughout, and angles or wavelengths?
static bool are_coordinates(const matrix *m, double range[2]) {
    double last = NAN, step = 0;
    for (int k = 0; k < m->n; k++) {
        double value;
        if (!is_number(m, m->names[k], &value) ||
            (k > 0 && !((value - last) * (step != 0 ? step : value - last) > 0))) {
            return false;
        }
        step = k > 0 ? value - last : 0;
        last = value;
        widen(range, value);
    }
    return m->n >= 2 && range[0] >= -360 && range[1] <= 360;
}

bool gonio_table_is_matrix(const gonio_source *source, int *blocks, double columns[2], double rows[2],
                           char heading[80]) {
    static const gonio_mapping nothing = {0};
    matrix m;
    gonio_table_lines lines = gonio_table_lines_begin(source);
    bool is = begin(source, &nothing, NULL, &m, NULL) == GONIO_OK;
    double last = NAN, step = 0;
    long long block = -1;
    *blocks = 0;
    columns[0] = rows[0] = INFINITY;
    columns[1] = rows[1] = -INFINITY;
    for (char *line; is && (line = gonio_table_lines_next(&lines)) != NULL;) {
        double value = 0;
        if (line[0] == 0 || !take_line(&m, line, lines.number)) {
            continue;
        }
        if (m.block_line != block) {
            *blocks += m.block_line > 0;
            block = m.block_line;
            last = NAN;
            step = 0;
            is = are_coordinates(&m, columns);
        }
        is = is && is_number(&m, m.fields[0], &value) &&
             (isnan(last) || (value - last) * (step != 0 ? step : value - last) > 0);
        step = isnan(last) ? 0 : value - last;
        last = value;
        widen(rows, value);
    }
    // Without a corner's word the first row of plain numbers would pass for a header: a matrix is wider than that.
    is = is && m.rows >= 2 && (m.n >= 3 || *blocks > 1) && m.header != NULL;
    is = is && !isdigit((unsigned char)m.header[strspn(m.header, "-+.")])
             ? is
             : is && (columns[1] > 2 && columns[1] == floor(columns[1]));
    snprintf(heading, 80, "%s", *blocks > 0 ? m.heading : "");
    *blocks = *blocks > 1 || *blocks == 1 ? *blocks : 0;
    free(lines.buffer);
    end(&m);
    return is;
}
