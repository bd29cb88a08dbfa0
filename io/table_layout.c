// SPDX-License-Identifier: BSD-3-Clause
#include "io/table_layout.h"
#include "io/fold.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/number.h"

// ---- lines ----

gonio_table_lines gonio_table_lines_begin(const gonio_source *source) {
    const bool marked = source->size >= 3 && memcmp(source->data, "\xef\xbb\xbf", 3) == 0;
    return (gonio_table_lines){.at = source->data + (marked ? 3 : 0), .end = source->data + source->size};
}

char *gonio_table_lines_next(gonio_table_lines *lines) {
    if (lines->at >= lines->end) {
        return NULL;
    }
    const char *last = memchr(lines->at, '\n', (size_t)(lines->end - lines->at));
    last = last != NULL ? last : lines->end;
    const size_t length = (size_t)(last - lines->at);
    if (length + 1 > lines->capacity) {
        char *larger = realloc(lines->buffer, 2 * length + 256);
        if (larger == NULL) {
            return NULL;
        }
        lines->buffer = larger;
        lines->capacity = 2 * length + 256;
    }
    memcpy(lines->buffer, lines->at, length);
    lines->buffer[length] = 0;
    lines->at = last + 1;
    lines->number++;
    return gonio_text_trim(lines->buffer);
}

bool gonio_table_is_blank(const char *line) { return line[0] == 0 || line[0] == '#' || line[0] == '%'; }

static char *unquoted(char *field) {
    size_t length = strlen(field);
    // Degrees by their sign: 30°.
    if (length > 2 && memcmp(field + length - 2, "\xc2\xb0", 2) == 0 &&
        strchr("0123456789.", field[length - 3]) != NULL) {
        length -= 2;
        field[length] = 0;
    }
    if (length >= 2 && (field[0] == '"' || field[0] == '\'') && field[length - 1] == field[0]) {
        field[length - 1] = 0;
        return gonio_text_trim(field + 1);
    }
    return field;
}

int gonio_table_split(char *line, char separator, int columns, char **fields, int maximum) {
    int n = 0;
    char *first = line;
    for (bool last = false; !last; n++) {
        if (separator == ' ') {
            first += strspn(first, " \t");
        }
        char *end = first;
        const char *closing = first[strspn(first, " \t")] == '"' ? strchr(first + strspn(first, " \t") + 1, '"') : NULL;
        if (closing != NULL && (closing[1] == 0 || closing[1] == separator || strchr(" \t", closing[1]) != NULL)) {
            end = first + (closing - first) + 1; // separators between quotes separate nothing
        }
        while (*end != 0 && (separator == ' ' ? *end != ' ' && *end != '\t' : *end != separator)) {
            end++;
        }
        if (separator == ' ' && end == first) {
            return n;
        }
        last = *end == 0;
        *end = 0;
        if (n < maximum) {
            fields[n] = unquoted(gonio_text_trim(first));
        }
        first = end + 1;
    }
    return n > 1 && (columns == 0 || n == columns + 1) && n <= maximum && fields[n - 1][0] == 0 ? n - 1 : n;
}

bool gonio_table_number(const char *field, char decimal, double *value) {
    char text[64];
    const size_t length = strlen(field);
    if (length == 0 || length >= sizeof text || !isdigit((unsigned char)field[length - 1])) {
        // "20." is a number too, but "20," between blanks is not
        if (length == 0 || length >= sizeof text || field[length - 1] != '.' || decimal != '.') {
            return false;
        }
    }
    for (size_t k = 0; k <= length; k++) {
        if ((field[k] == '.' || field[k] == ',') && field[k] != decimal) {
            return false;
        }
        text[k] = field[k] == decimal ? '.' : field[k];
    }
    char *end;
    *value = gonio_number_parse(text, &end);
    return text[strspn(text, "0123456789+-.eE")] == 0 && end != text && *end == 0 && isfinite(*value);
}

// ---- separator and decimal sign ----

enum { LOOKED_AT = 1000 };

static int numbers_in(char *const *fields, int n, char decimal) {
    int found = 0;
    for (int k = 0; k < n && k < GONIO_TABLE_COLUMNS_MAX; k++) {
        double value;
        found += gonio_table_number(fields[k], decimal, &value);
    }
    return found;
}

// A row: two numbers or more, and no more fields of other kinds than numbers.
static bool is_row(char *const *fields, int n, char decimal) {
    const int numbers = numbers_in(fields, n, decimal);
    return n <= GONIO_TABLE_COLUMNS_MAX && numbers >= 2 && 2 * numbers >= n;
}

// How many numbers the text holds if it is written so, in rows of the most usual number of columns.
static long score(const gonio_source *source, char separator, char decimal, char **fields, int *columns) {
    static const size_t size = GONIO_TABLE_COLUMNS_MAX + 1;
    long *numbers = calloc(size, sizeof *numbers), best = 0;
    gonio_table_lines lines = gonio_table_lines_begin(source);
    char *line;
    for (int rows = 0; numbers != NULL && rows < LOOKED_AT && (line = gonio_table_lines_next(&lines)) != NULL;) {
        if (gonio_table_is_blank(line)) {
            continue;
        }
        const int n = gonio_table_split(line, separator, 0, fields, GONIO_TABLE_COLUMNS_MAX);
        if (n >= 2 && is_row(fields, n, decimal)) {
            numbers[n] += numbers_in(fields, n, decimal);
            rows++;
        }
    }
    for (int n = 2; numbers != NULL && n < (int)size; n++) {
        if (numbers[n] > best) {
            best = numbers[n];
            *columns = n;
        }
    }
    free(numbers);
    free(lines.buffer);
    return best;
}

static bool find_signs(const gonio_source *source, const gonio_mapping *m, char **fields, gonio_table_layout *l) {
    static const char separators[] = {'\t', ';', ',', ' ', '|', ':'}, decimals[] = {'.', ','};
    long best = 0;
    for (size_t s = 0; s < sizeof separators; s++) {
        for (size_t d = 0; d < sizeof decimals; d++) {
            int columns = 0;
            if ((m->separator != 0 && m->separator != separators[s]) ||
                (m->decimal != 0 && m->decimal != decimals[d]) ||
                (separators[s] == ',' && decimals[d] == ',' && memchr(source->data, '"', source->size) == NULL)) {
                continue;
            }
            const long found = score(source, separators[s], decimals[d], fields, &columns);
            if (found > best) {
                best = found;
                l->separator = separators[s];
                l->decimal = decimals[d];
                l->columns = columns;
            }
        }
    }
    return best > 0;
}

// ---- header and rows ----

static void plain_name(const char *name, char *to, size_t size) {
    size_t n = 0;
    for (const char *c = name; *c != 0 && strchr("[(", *c) == NULL && n + 1 < size; c++) {
        if (*c != ' ' && *c != '_' && *c != '"') {
            to[n++] = (char)tolower((unsigned char)*c);
        }
    }
    to[n] = 0;
}

int gonio_table_find_name(char *const *names, int columns, const char *name) {
    for (int k = 0; k < columns; k++) {
        if (strcmp(names[k], name) == 0) {
            return k;
        }
    }
    char wanted[96], own[96];
    int found = -1;
    plain_name(name, wanted, sizeof wanted);
    for (int k = 0; k < columns && wanted[0] != 0; k++) {
        plain_name(names[k], own, sizeof own);
        if (strcmp(own, wanted) == 0) {
            if (found >= 0) {
                return -1; // two of them: the name must be given in full
            }
            found = k;
        }
    }
    return found;
}

// A header may stand behind a comment mark.
static char *without_mark(char *line) { return gonio_text_trim(line + strspn(line, "#%!")); }

// Of the mapping's names: how many the fields hold; *missing: one that they do not.
static int names_in(const gonio_mapping *m, char *const *fields, int n, const char **missing) {
    int found = 0;
    for (int k = 0; k < m->n; k++) {
        if (m->items[k].name[0] == 0) {
            continue;
        }
        if (gonio_table_find_name(fields, n, m->items[k].name) >= 0) {
            found++;
        } else {
            *missing = m->items[k].name;
        }
    }
    if (m->wavelength != NULL && m->wavelength[0] != '#') {
        const bool is = gonio_table_find_name(fields, n, m->wavelength) >= 0;
        found += is;
        *missing = is ? *missing : m->wavelength;
    }
    return found;
}

static gonio_status keep_header(gonio_table_layout *l, const char *line, gonio_error *error) {
    free(l->header);
    l->header = strdup(line);
    if (l->header == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the header");
    }
    gonio_table_split(l->header, l->separator, l->columns, l->names, l->columns);
    return GONIO_OK;
}

// Where the rows begin: the first of three in a row, or the first at all; behind the header where that is known.
static void find_rows(const gonio_source *source, char **fields, gonio_table_layout *l) {
    gonio_table_lines lines = gonio_table_lines_begin(source);
    long long first = 0, run = 0;
    int length = 0;
    for (char *line; length < 3 && (line = gonio_table_lines_next(&lines)) != NULL;) {
        if (gonio_table_is_blank(line) || lines.number <= l->header_line) {
            continue;
        }
        const int n = gonio_table_split(line, l->separator, l->columns, fields, GONIO_TABLE_COLUMNS_MAX);
        const bool row = n == l->columns && is_row(fields, n, l->decimal);
        length = row ? length + 1 : 0;
        run = length == 1 ? lines.number : run;
        first = row && first == 0 ? lines.number : first;
        if (l->header_line > 0 && row) {
            break; // behind the header every row counts
        }
    }
    l->first_row = length == 3 ? run : first;
    free(lines.buffer);
}

// Names of wavelengths are numbers, and a header that holds them looks like a row: it has names where the next row has
// numbers.
static gonio_status find_numeric_header(const gonio_source *source, char **fields, gonio_table_layout *l,
                                        gonio_error *error) {
    bool *named = calloc((size_t)l->columns, sizeof *named);
    char *whole = NULL;
    gonio_table_lines lines = gonio_table_lines_begin(source);
    gonio_status status = named != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for the header");
    for (char *line; status == GONIO_OK && (line = gonio_table_lines_next(&lines)) != NULL;) {
        if (lines.number < l->first_row || gonio_table_is_blank(line)) {
            continue;
        }
        whole = whole != NULL ? whole : strdup(line);
        const int n = gonio_table_split(line, l->separator, l->columns, fields, GONIO_TABLE_COLUMNS_MAX);
        bool header = false;
        for (int k = 0; k < n && k < l->columns; k++) {
            double value;
            const bool number = gonio_table_number(fields[k], l->decimal, &value);
            header = header || (lines.number > l->first_row && named[k] && number);
            named[k] = !number;
        }
        if (lines.number > l->first_row) {
            if (header && n == l->columns && whole != NULL) {
                l->header_line = l->first_row;
                l->first_row = lines.number;
                status = keep_header(l, whole, error);
            }
            break;
        }
    }
    free(whole);
    free(named);
    free(lines.buffer);
    return status;
}

// The line that holds every name that the mapping has; *nearest: how many the best one has.
static gonio_status find_named(const gonio_source *source, const gonio_mapping *m, char **fields, gonio_table_layout *l,
                               gonio_error *error) {
    gonio_table_lines lines = gonio_table_lines_begin(source);
    const char *missing = "";
    char wanted[96] = "";
    int most = -1;
    long long at = 0;
    gonio_status status = GONIO_OK;
    names_in(m, fields, 0, &missing); // the last of them
    for (char *line; (line = gonio_table_lines_next(&lines)) != NULL && lines.number <= LOOKED_AT;) {
        char *text = without_mark(line), *whole = strdup(text);
        const int n = gonio_table_split(text, l->separator, l->columns, fields, GONIO_TABLE_COLUMNS_MAX);
        const char *lacks = NULL;
        const int found = n == l->columns ? names_in(m, fields, n, &lacks) : -1;
        if (found > most) {
            most = found;
            at = lines.number;
            snprintf(wanted, sizeof wanted, "%s", lacks != NULL ? lacks : "");
        }
        if (found >= 0 && lacks == NULL) {
            l->header_line = lines.number;
            status = whole != NULL ? keep_header(l, whole, error) : GONIO_OK;
            free(whole);
            break;
        }
        free(whole);
    }
    free(lines.buffer);
    return l->header_line > 0 || status != GONIO_OK
               ? status
               : gonio_fail_line(error, GONIO_E_INPUT, source->path, at > 0 ? at : -1,
                                 "no column '%s' here, nor in any other line of %d columns that could be the header",
                                 most >= 0 ? wanted : missing, l->columns);
}

// The topmost of the lines of as many fields that stand right above the rows and hold names.
static gonio_status find_any(const gonio_source *source, char **fields, gonio_table_layout *l, gonio_error *error) {
    gonio_table_lines lines = gonio_table_lines_begin(source);
    char *whole = NULL;
    long long at = 0;
    for (char *line; (line = gonio_table_lines_next(&lines)) != NULL && lines.number < l->first_row;) {
        char *text = without_mark(line), *copy = strdup(text);
        const int n = gonio_table_split(text, l->separator, l->columns, fields, GONIO_TABLE_COLUMNS_MAX);
        if (n == l->columns && copy != NULL && 2 * numbers_in(fields, n, l->decimal) <= n) {
            if (whole == NULL) {
                whole = copy;
                at = lines.number;
                continue;
            }
        } else if (line[0] != 0) {
            free(whole);
            whole = NULL;
        }
        free(copy);
    }
    gonio_status status = GONIO_OK;
    if (whole != NULL) {
        l->header_line = at;
        status = keep_header(l, whole, error);
    }
    free(whole);
    free(lines.buffer);
    return status;
}

// "deg;deg;1/sr" between the header and the rows: as many fields, none a number.
static gonio_status find_units(const gonio_source *source, char **fields, gonio_table_layout *l, gonio_error *error) {
    gonio_table_lines lines = gonio_table_lines_begin(source);
    gonio_status status = GONIO_OK;
    for (char *line; status == GONIO_OK && l->header_line > 0 && (line = gonio_table_lines_next(&lines)) != NULL &&
                     lines.number < l->first_row;) {
        if (lines.number <= l->header_line || line[0] == 0) {
            continue;
        }
        char *text = without_mark(line), *copy = strdup(text);
        const int n = gonio_table_split(text, l->separator, l->columns, fields, GONIO_TABLE_COLUMNS_MAX);
        if (copy == NULL) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the units");
        } else if (n == l->columns && numbers_in(fields, n, l->decimal) == 0 && l->unit_line == NULL) {
            l->unit_line = copy;
            copy = NULL;
            gonio_table_split(l->unit_line, l->separator, l->columns, l->units, l->columns);
        }
        free(copy);
    }
    free(lines.buffer);
    return status;
}

void gonio_table_unit(const gonio_table_layout *l, int column, char *unit, size_t size) {
    const char *told = l->units[column];
    char part[64];
    if (told[0] == 0) {
        const char *bracket = strpbrk(l->names[column], "[(,");
        const char *stroke = strchr(l->names[column], '/');
        told = bracket != NULL ? bracket + 1 : stroke != NULL ? stroke + 1 : "";
    }
    told += strspn(told, " [(");
    snprintf(part, sizeof part, "%.*s", (int)strcspn(told, "])"), told);
    gonio_fold(gonio_text_trim(part), false, unit, size);
}

// Could the line be a row, or what is left of one?
static bool is_near_row(char *line, char **fields, const gonio_table_layout *l) {
    double value;
    const int n = gonio_table_split(line, l->separator, l->columns, fields, GONIO_TABLE_COLUMNS_MAX);
    return n == l->columns || n > GONIO_TABLE_COLUMNS_MAX || gonio_table_number(fields[0], l->decimal, &value);
}

// Footers are lines at the end that could be no row; right behind the table, without an empty line, they hold no digit.
static void find_last(const gonio_source *source, char **fields, gonio_table_layout *l) {
    gonio_table_lines lines = gonio_table_lines_begin(source);
    bool apart = false;
    l->last_row = l->first_row;
    for (char *line; (line = gonio_table_lines_next(&lines)) != NULL;) {
        if (lines.number <= l->first_row || gonio_table_is_blank(line)) {
            apart = apart || line[0] == 0;
            continue;
        }
        const bool digits = strpbrk(line, "0123456789") != NULL;
        if (is_near_row(line, fields, l) || (digits && !apart && l->footers == 0)) {
            l->last_row = lines.number;
            l->footers = 0;
            apart = false;
        } else {
            l->first_footer = l->footers == 0 ? lines.number : l->first_footer;
            l->footers++;
        }
    }
    free(lines.buffer);
}

static bool has_names(const gonio_mapping *m) {
    bool has = m->wavelength != NULL && m->wavelength[0] != '#';
    for (int k = 0; k < m->n; k++) {
        has = has || m->items[k].name[0] != 0;
    }
    return has;
}

static gonio_status find(const gonio_source *source, const gonio_mapping *m, char **fields, gonio_table_layout *l,
                         gonio_error *error) {
    if (m->separator == ',' && m->decimal == ',' && memchr(source->data, '"', source->size) == NULL) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "a comma is either the separator or the decimal sign, unless numbers stand between quotes");
    }
    if (!find_signs(source, m, fields, l)) {
        return gonio_fail_line(error, GONIO_E_INPUT, source->path, 1,
                               "no table in it: no rows of two numbers or more%s",
                               m->separator != 0 || m->decimal != 0 ? " with this separator and decimal sign" : "");
    }
    l->names = malloc(2 * (size_t)l->columns * sizeof *l->names);
    if (l->names == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d columns", l->columns);
    }
    l->units = l->names + l->columns;
    for (int k = 0; k < 2 * l->columns; k++) {
        l->names[k] = (char *)"";
    }
    gonio_status status = GONIO_OK;
    if (has_names(m)) {
        status = find_named(source, m, fields, l, error);
        find_rows(source, fields, l);
    } else {
        find_rows(source, fields, l);
        status = find_numeric_header(source, fields, l, error);
        status = status == GONIO_OK && l->header_line == 0 ? find_any(source, fields, l, error) : status;
    }
    find_last(source, fields, l);
    status = status == GONIO_OK ? find_units(source, fields, l, error) : status;
    return status == GONIO_OK && l->first_row == 0
               ? gonio_fail_line(error, GONIO_E_INPUT, source->path, l->header_line > 0 ? l->header_line : 1,
                                 "no rows of numbers behind the header")
               : status;
}

gonio_status gonio_table_layout_find(const gonio_source *source, const gonio_mapping *mapping,
                                     gonio_table_layout *layout, gonio_error *error) {
    *layout = (gonio_table_layout){0};
    char **fields = malloc(GONIO_TABLE_COLUMNS_MAX * sizeof *fields);
    const gonio_status status = fields != NULL ? find(source, mapping, fields, layout, error)
                                               : gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
    free(fields);
    return status;
}

void gonio_table_layout_free(gonio_table_layout *layout) {
    free(layout->header);
    free(layout->unit_line);
    free(layout->names);
    *layout = (gonio_table_layout){0};
}
