// SPDX-License-Identifier: BSD-3-Clause
// The journal's tables <-> HDF5, whatever tables and columns there are: a group a table, an array a column.
//
// Integers and numbers are such arrays (a NULL number is NaN, as SQLite holds it), texts have the longest one's length.
// The bytes of blobs stand one behind the other in COLUMN, and COLUMN_end tells where each ends. Where texts or
// integers are NULL, COLUMN_null has a 1.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/session/hdf5.h"

#define JOURNAL "/entry/journal"

enum { COLUMNS_MAX = 32, NAME_MAX_BYTES = 64 };

typedef struct column {
    char name[NAME_MAX_BYTES];
    h5_type kind;  // H5_U8: a blob
    bool nullable; // COLUMN_null is there
    size_t width;  // of texts
    h5_array values, ends, nulls;
    void *buffer; // a piece of values (of ends, for blobs)
    unsigned char *null_buffer;
    unsigned char *blob; // reading: the row's
    size_t blob_capacity;
} column;

typedef struct table {
    const h5_file *file;
    gonio_session *session;
    const char *name;
    int n;
    column columns[COLUMNS_MAX];
    int64_t rows;
    size_t piece;
} table;

static void release(table *t) {
    for (int k = 0; k < t->n; k++) {
        column *c = &t->columns[k];
        gonio_h5_array_close(&c->values);
        gonio_h5_array_close(&c->ends);
        gonio_h5_array_close(&c->nulls);
        free(c->buffer);
        free(c->null_buffer);
        free(c->blob);
    }
}

static void path_of(const table *t, const column *c, const char *end, char path[160]) {
    snprintf(path, 160, JOURNAL "/%s/%s%s", t->name, c->name, end);
}

static bool kind_of(const char *declared, h5_type *kind) {
    static const struct {
        const char *name;
        h5_type kind;
    } kinds[] = {{"INTEGER", H5_I64}, {"REAL", H5_F64}, {"TEXT", H5_TEXT}, {"BLOB", H5_U8}};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        if (declared != NULL && strcmp(declared, kinds[k].name) == 0) {
            *kind = kinds[k].kind;
            return true;
        }
    }
    return false;
}

// The columns that the database has.
static gonio_status list_columns(table *t, gonio_error *error) {
    char sql[128];
    sqlite3_stmt *rows;
    snprintf(sql, sizeof sql, "PRAGMA table_info(%s)", t->name);
    gonio_status status = gonio_session_prepare(t->session, sql, &rows, error);
    while (status == GONIO_OK && sqlite3_step(rows) == SQLITE_ROW) {
        const char *name = (const char *)sqlite3_column_text(rows, 1);
        h5_type kind = H5_I64;
        if (name == NULL || strlen(name) >= NAME_MAX_BYTES || t->n == COLUMNS_MAX ||
            !kind_of((const char *)sqlite3_column_text(rows, 2), &kind)) {
            status = gonio_fail_line(error, GONIO_E_INPUT, t->session->db_path, -1,
                                     "table %s has a column that no session has", t->name);
            break;
        }
        column *c = &t->columns[t->n++];
        *c = (column){.kind = kind};
        memcpy(c->name, name, strlen(name) + 1);
    }
    sqlite3_finalize(rows);
    return status == GONIO_OK && t->n == 0
               ? gonio_fail_line(error, GONIO_E_INPUT, t->session->db_path, -1, "there is no table %s", t->name)
               : status;
}

static gonio_status reserve(table *t, gonio_error *error) {
    size_t bytes = 0;
    for (int k = 0; k < t->n; k++) {
        bytes += t->columns[k].kind == H5_TEXT ? t->columns[k].width : 8;
    }
    t->piece = gonio_h5_piece(bytes);
    for (int k = 0; k < t->n; k++) {
        column *c = &t->columns[k];
        c->buffer = calloc(t->piece, c->kind == H5_TEXT ? c->width : 8);
        c->null_buffer = calloc(t->piece, 1);
        if (c->buffer == NULL || c->null_buffer == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for table %s", t->name);
        }
    }
    return GONIO_OK;
}

// ---- writing ----

static gonio_status measure_column(const table *t, column *c, int64_t *blob_bytes, gonio_error *error) {
    char sql[400];
    int64_t nulls = 0, longest = 0;
    snprintf(sql, sizeof sql, "SELECT count(*) FROM %s WHERE \"%s\" IS NULL", t->name, c->name);
    gonio_status status = gonio_session_integer(t->session, sql, &nulls, error);
    c->nullable = nulls > 0 && c->kind != H5_F64;
    if (status == GONIO_OK && (c->kind == H5_TEXT || c->kind == H5_U8)) {
        snprintf(sql, sizeof sql, "SELECT ifnull(%s(length(CAST(\"%s\" AS BLOB))), 0) FROM %s",
                 c->kind == H5_TEXT ? "max" : "sum", c->name, t->name);
        status = gonio_session_integer(t->session, sql, c->kind == H5_TEXT ? &longest : blob_bytes, error);
    }
    c->width = longest > 0 ? (size_t)longest : 1;
    return status == GONIO_OK && c->width > H5_TEXT_MAX
               ? gonio_fail_line(error, GONIO_E_INPUT, t->session->db_path, -1,
                                 "table %s, column %s: a text of %zu bytes; at most %zu are possible", t->name, c->name,
                                 c->width, H5_TEXT_MAX)
               : status;
}

static const char *units_of(const char *name) {
    static const char *const units[][2] = {{"_deg", "deg"}, {"_s", "s"}, {"_db", "dB"}, {"_px", "pixel"}};
    const size_t length = strlen(name);
    for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
        const size_t n = strlen(units[k][0]);
        if (length > n && strcmp(name + length - n, units[k][0]) == 0) {
            return units[k][1];
        }
    }
    return NULL;
}

static gonio_status create_column(const table *t, column *c, int64_t blob_bytes, gonio_error *error) {
    char path[160];
    const hsize_t rows = (hsize_t)t->rows, bytes = (hsize_t)blob_bytes;
    path_of(t, c, "", path);
    gonio_status status =
        gonio_h5_array_create(t->file, path, c->kind, c->width, 1, c->kind == H5_U8 ? &bytes : &rows,
                              c->kind == H5_U8 ? H5_PIECE_BYTES : t->piece, units_of(c->name), &c->values, error);
    if (status == GONIO_OK && c->kind == H5_U8) {
        path_of(t, c, "_end", path);
        status = gonio_h5_array_create(t->file, path, H5_I64, 0, 1, &rows, t->piece, NULL, &c->ends, error);
    }
    if (status == GONIO_OK && c->nullable) {
        path_of(t, c, "_null", path);
        status = gonio_h5_array_create(t->file, path, H5_U8, 0, 1, &rows, t->piece, NULL, &c->nulls, error);
    }
    return status;
}

static gonio_status create_columns(table *t, gonio_error *error) {
    int64_t blob_bytes[COLUMNS_MAX] = {0};
    char sql[128], path[160], columns[COLUMNS_MAX * NAME_MAX_BYTES] = "";
    snprintf(sql, sizeof sql, "SELECT count(*) FROM %s", t->name);
    gonio_status status = gonio_session_integer(t->session, sql, &t->rows, error);
    for (int k = 0; status == GONIO_OK && k < t->n; k++) {
        status = measure_column(t, &t->columns[k], &blob_bytes[k], error);
        strcat(strcat(columns, k > 0 ? "," : ""), t->columns[k].name);
    }
    snprintf(path, sizeof path, JOURNAL "/%s", t->name);
    status = status == GONIO_OK ? reserve(t, error) : status;
    status = status == GONIO_OK ? gonio_h5_group(t->file, path, "NXcollection", error) : status;
    status = status == GONIO_OK ? gonio_h5_attribute(t->file, path, "columns", columns, error) : status;
    status = status == GONIO_OK ? gonio_h5_attribute_integer(t->file, path, "rows", t->rows, error) : status;
    for (int k = 0; status == GONIO_OK && k < t->n; k++) {
        status = create_column(t, &t->columns[k], blob_bytes[k], error);
    }
    return status;
}

// Row `at` of the piece takes a value; blobs go straight to the file. *end: where the column's blobs end so far.
static gonio_status take(const table *t, column *c, sqlite3_stmt *row, int k, int64_t number, size_t at, int64_t *end,
                         gonio_error *error) {
    static const int expected[] = {
        [H5_I64] = SQLITE_INTEGER, [H5_F64] = SQLITE_FLOAT, [H5_TEXT] = SQLITE_TEXT, [H5_U8] = SQLITE_BLOB};
    const int type = sqlite3_column_type(row, k);
    gonio_status status = GONIO_OK;
    c->null_buffer[at] = type == SQLITE_NULL;
    const char *text = type == SQLITE_TEXT ? (const char *)sqlite3_column_text(row, k) : NULL;
    const size_t bytes = type == SQLITE_TEXT || type == SQLITE_BLOB ? (size_t)sqlite3_column_bytes(row, k) : 0;
    if ((type != SQLITE_NULL && type != expected[c->kind]) || (text != NULL && strlen(text) != bytes)) {
        return gonio_fail_line(error, GONIO_E_INPUT, t->session->db_path, -1,
                               "table %s, row %lld, column %s: a value of another kind than the column's", t->name,
                               (long long)number, c->name);
    }
    if (c->kind == H5_I64) {
        ((int64_t *)c->buffer)[at] = sqlite3_column_int64(row, k);
    } else if (c->kind == H5_F64) {
        ((double *)c->buffer)[at] = type == SQLITE_NULL ? NAN : sqlite3_column_double(row, k);
    } else if (c->kind == H5_TEXT) {
        char *to = (char *)c->buffer + at * c->width;
        memset(to, 0, c->width);
        memcpy(to, text != NULL ? text : "", bytes);
    } else {
        status = gonio_h5_array_write(&c->values, (hsize_t)*end, bytes, sqlite3_column_blob(row, k), error);
        *end += (int64_t)bytes;
        ((int64_t *)c->buffer)[at] = *end;
    }
    return status;
}

static gonio_status flush_piece(table *t, int64_t first, size_t n, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < t->n; k++) {
        column *c = &t->columns[k];
        status = gonio_h5_array_write(c->kind == H5_U8 ? &c->ends : &c->values, (hsize_t)first, n, c->buffer, error);
        if (status == GONIO_OK && c->nullable) {
            status = gonio_h5_array_write(&c->nulls, (hsize_t)first, n, c->null_buffer, error);
        }
    }
    return status;
}

static gonio_status write_rows(table *t, sqlite3_stmt *rows, gonio_error *error) {
    int64_t ends[COLUMNS_MAX] = {0}, done = 0;
    size_t at = 0;
    int code = SQLITE_DONE;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && done + (int64_t)at < t->rows && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        for (int k = 0; status == GONIO_OK && k < t->n; k++) {
            status = take(t, &t->columns[k], rows, k, done + (int64_t)at, at, &ends[k], error);
        }
        if (++at == t->piece) {
            status = status == GONIO_OK ? flush_piece(t, done, at, error) : status;
            done += (int64_t)at;
            at = 0;
        }
    }
    if (status == GONIO_OK && done + (int64_t)at != t->rows) {
        return code == SQLITE_DONE ? gonio_fail_line(error, GONIO_E_INPUT, t->session->db_path, -1,
                                                     "table %s has fewer rows than it counts", t->name)
                                   : gonio_session_db_fail(t->session, error, "read a row");
    }
    return status == GONIO_OK ? flush_piece(t, done, at, error) : status;
}

// Of every table the rows in the order of their keys, which is that of the database.
static void select_all(const table *t, char *sql, size_t size) {
    size_t used = (size_t)snprintf(sql, size, "SELECT ");
    for (int k = 0; k < t->n; k++) {
        used += (size_t)snprintf(sql + used, size - used, "%s\"%s\"", k > 0 ? ", " : "", t->columns[k].name);
    }
    snprintf(sql + used, size - used, " FROM %s ORDER BY 1, 2", t->name);
}

gonio_status gonio_h5_put_table(const h5_file *file, gonio_session *session, const char *name, gonio_error *error) {
    table t = {.file = file, .session = session, .name = name};
    char sql[COLUMNS_MAX * NAME_MAX_BYTES];
    sqlite3_stmt *rows = NULL;
    gonio_status status = list_columns(&t, error);
    status = status == GONIO_OK ? create_columns(&t, error) : status;
    if (status == GONIO_OK) {
        select_all(&t, sql, sizeof sql);
        if (t.n == 1) {
            *strrchr(sql, ',') = 0;
        }
        status = gonio_session_prepare(session, sql, &rows, error);
    }
    status = status == GONIO_OK ? write_rows(&t, rows, error) : status;
    sqlite3_finalize(rows);
    release(&t);
    return status;
}

// ---- reading ----

static gonio_status fail_table(const table *t, gonio_error *error, const char *what) {
    return gonio_fail_line(error, GONIO_E_INPUT, t->file->path, -1, JOURNAL "/%s: %s", t->name, what);
}

static gonio_status open_column(table *t, column *c, gonio_error *error) {
    char path[160];
    path_of(t, c, "", path);
    gonio_status status = gonio_h5_array_open(t->file, path, c->kind, 1, &c->values, error);
    c->width = status == GONIO_OK && c->kind == H5_TEXT ? c->values.row_bytes : 8;
    if (status == GONIO_OK && c->kind == H5_U8) {
        path_of(t, c, "_end", path);
        status = gonio_h5_array_open(t->file, path, H5_I64, 1, &c->ends, error);
    }
    path_of(t, c, "_null", path);
    c->nullable = c->kind != H5_F64 && gonio_h5_exists(t->file, path);
    if (status == GONIO_OK && c->nullable) {
        status = gonio_h5_array_open(t->file, path, H5_U8, 1, &c->nulls, error);
    }
    const h5_array *by_row = c->kind == H5_U8 ? &c->ends : &c->values;
    if (status == GONIO_OK &&
        (by_row->dims[0] != (hsize_t)t->rows || (c->nullable && c->nulls.dims[0] != (hsize_t)t->rows))) {
        status = fail_table(t, error, "its columns are not of one length");
    }
    return status;
}

// The columns that the file has, of those that the session knows; older files have fewer.
static gonio_status open_columns(table *t, gonio_error *error) {
    char group[160], path[160];
    snprintf(group, sizeof group, JOURNAL "/%s", t->name);
    gonio_status status = gonio_h5_read_integer(t->file, group, "rows", &t->rows, error);
    if (status == GONIO_OK && t->rows < 0) {
        return fail_table(t, error, "it claims a negative number of rows");
    }
    int kept = 0;
    for (int k = 0; status == GONIO_OK && k < t->n; k++) {
        path_of(t, &t->columns[k], "", path);
        if (gonio_h5_exists(t->file, path)) {
            t->columns[kept] = t->columns[k];
            status = open_column(t, &t->columns[kept], error);
            kept++;
        }
    }
    t->n = kept;
    if (status != GONIO_OK) {
        return status;
    }
    char *columns;
    int named = 1;
    status = gonio_h5_read_text(t->file, group, "columns", &columns, error);
    for (const char *c = columns; status == GONIO_OK && *c != 0; c++) {
        named += *c == ',';
    }
    free(columns);
    return status == GONIO_OK && (kept == 0 || named != kept)
               ? fail_table(t, error, "it has other columns than this Gonio knows")
               : status;
}

static gonio_status bind_blob(const table *t, column *c, sqlite3_stmt *insert, int k, size_t at, int64_t *end,
                              gonio_error *error) {
    const int64_t next = ((const int64_t *)c->buffer)[at];
    if (next < *end || (hsize_t)next > c->values.dims[0] || next - *end > INT32_MAX) {
        return fail_table(t, error, "the ends of its blobs are not in order");
    }
    const size_t bytes = (size_t)(next - *end);
    if (bytes > c->blob_capacity || c->blob == NULL) {
        free(c->blob);
        c->blob = malloc(bytes + 1);
        c->blob_capacity = bytes;
        if (c->blob == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a row of %zu bytes", bytes);
        }
    }
    const gonio_status status = gonio_h5_array_read(&c->values, (hsize_t)*end, bytes, c->blob, error);
    sqlite3_bind_blob64(insert, k + 1, c->blob, bytes, SQLITE_STATIC);
    *end = next;
    return status;
}

static gonio_status give(const table *t, column *c, sqlite3_stmt *insert, int k, size_t at, int64_t *end,
                         gonio_error *error) {
    if (c->nullable && c->null_buffer[at] != 0 && c->kind != H5_U8) {
        sqlite3_bind_null(insert, k + 1);
    } else if (c->kind == H5_I64) {
        sqlite3_bind_int64(insert, k + 1, ((const int64_t *)c->buffer)[at]);
    } else if (c->kind == H5_F64) {
        sqlite3_bind_double(insert, k + 1, ((const double *)c->buffer)[at]); // NaN: NULL
    } else if (c->kind == H5_TEXT) {
        const char *text = (const char *)c->buffer + at * c->width;
        sqlite3_bind_text(insert, k + 1, text, (int)strnlen(text, c->width), SQLITE_STATIC);
    } else {
        const gonio_status status = bind_blob(t, c, insert, k, at, end, error);
        if (status == GONIO_OK && c->nullable && c->null_buffer[at] != 0) {
            sqlite3_bind_null(insert, k + 1);
        }
        return status;
    }
    return GONIO_OK;
}

static gonio_status fetch_piece(table *t, int64_t first, size_t n, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < t->n; k++) {
        column *c = &t->columns[k];
        status = gonio_h5_array_read(c->kind == H5_U8 ? &c->ends : &c->values, (hsize_t)first, n, c->buffer, error);
        if (status == GONIO_OK && c->nullable) {
            status = gonio_h5_array_read(&c->nulls, (hsize_t)first, n, c->null_buffer, error);
        }
    }
    return status;
}

static gonio_status enter_row(table *t, sqlite3_stmt *insert, size_t at, int64_t *ends, int64_t number,
                              gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < t->n; k++) {
        status = give(t, &t->columns[k], insert, k, at, &ends[k], error);
    }
    if (status == GONIO_OK && sqlite3_step(insert) != SQLITE_DONE) {
        const int code = sqlite3_errcode(t->session->db) & 0xff;
        char what[300];
        snprintf(what, sizeof what, "row %lld cannot be entered: %s", (long long)number,
                 sqlite3_errmsg(t->session->db));
        status = code == SQLITE_CONSTRAINT || code == SQLITE_MISMATCH
                     ? fail_table(t, error, what)
                     : gonio_session_db_fail(t->session, error, "enter a row");
    }
    sqlite3_reset(insert);
    return status;
}

static gonio_status read_rows(table *t, sqlite3_stmt *insert, gonio_error *error) {
    int64_t ends[COLUMNS_MAX] = {0};
    gonio_status status = GONIO_OK;
    for (int64_t first = 0; status == GONIO_OK && first < t->rows; first += (int64_t)t->piece) {
        const size_t n = t->rows - first < (int64_t)t->piece ? (size_t)(t->rows - first) : t->piece;
        status = fetch_piece(t, first, n, error);
        for (size_t at = 0; status == GONIO_OK && at < n; at++) {
            status = enter_row(t, insert, at, ends, first + (int64_t)at, error);
        }
    }
    return status;
}

static void insert_all(const table *t, char *sql, size_t size) {
    size_t used = (size_t)snprintf(sql, size, "INSERT INTO %s(", t->name);
    for (int k = 0; k < t->n; k++) {
        used += (size_t)snprintf(sql + used, size - used, "%s\"%s\"", k > 0 ? ", " : "", t->columns[k].name);
    }
    used += (size_t)snprintf(sql + used, size - used, ") VALUES(");
    for (int k = 0; k < t->n; k++) {
        used += (size_t)snprintf(sql + used, size - used, "%s?", k > 0 ? ", " : "");
    }
    snprintf(sql + used, size - used, ")");
}

gonio_status gonio_h5_get_table(const h5_file *file, gonio_session *session, const char *name, gonio_error *error) {
    table t = {.file = file, .session = session, .name = name};
    char sql[COLUMNS_MAX * (NAME_MAX_BYTES + 8)];
    sqlite3_stmt *insert = NULL;
    gonio_status status = list_columns(&t, error);
    status = status == GONIO_OK ? open_columns(&t, error) : status;
    status = status == GONIO_OK ? reserve(&t, error) : status;
    if (status == GONIO_OK) {
        insert_all(&t, sql, sizeof sql);
        status = gonio_session_prepare(session, sql, &insert, error);
    }
    status = status == GONIO_OK ? read_rows(&t, insert, error) : status;
    sqlite3_finalize(insert);
    release(&t);
    return status;
}

gonio_status gonio_h5_for_tables(gonio_session *session, h5_name_fn call, void *context, gonio_error *error) {
    sqlite3_stmt *rows;
    // In the order of their making: what others refer to comes first.
    gonio_status status = gonio_session_prepare(
        session, "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%' ORDER BY rowid",
        &rows, error);
    int code = SQLITE_DONE;
    while (status == GONIO_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        char name[NAME_MAX_BYTES];
        snprintf(name, sizeof name, "%s", (const char *)sqlite3_column_text(rows, 0));
        if (name[strspn(name, "abcdefghijklmnopqrstuvwxyz_0123456789")] != 0 || name[0] == 0) {
            status = gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1, "a table that no session has");
        }
        status = status == GONIO_OK ? call(context, name, error) : status;
    }
    sqlite3_finalize(rows);
    return status == GONIO_OK && code != SQLITE_DONE ? gonio_session_db_fail(session, error, "list the tables")
                                                     : status;
}
