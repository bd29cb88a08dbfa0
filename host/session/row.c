// SPDX-License-Identifier: BSD-3-Clause
// Rows of the journal, value by value, each held against the type and the bounds that it must have: sessions come from
// elsewhere, and SQLite gives a value of any type for any column of a damaged file.
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/number.h"
#include "base/text.h"
#include "host/session/internal.h"

gonio_status gonio_rows_open(session_rows *rows, gonio_session *session, const char *table, int keys, const char *sql,
                             gonio_error *error) {
    *rows = (session_rows){.session = session, .table = table, .keys = keys, .error = error};
    rows->status = gonio_session_prepare(session, sql, &rows->statement, error);
    return rows->status;
}

// ---- what is wrong, and where ----

static void append_value(sqlite3_stmt *row, int column, char *text, size_t size) {
    char value[48], number[32];
    switch (sqlite3_column_type(row, column)) {
    case SQLITE_INTEGER:
        gonio_text_append(text, size, "%lld", (long long)sqlite3_column_int64(row, column));
        return;
    case SQLITE_FLOAT:
        gonio_number_format(number, sizeof number, "%.17g", sqlite3_column_double(row, column));
        gonio_text_append(text, size, "%s", number);
        return;
    case SQLITE_TEXT:
        gonio_text_printable((const char *)sqlite3_column_text(row, column), value, sizeof value);
        gonio_text_append(text, size, "'%s'", value);
        return;
    case SQLITE_BLOB:
        gonio_text_append(text, size, "a blob of %d bytes", sqlite3_column_bytes(row, column));
        return;
    default:
        gonio_text_append(text, size, "NULL");
    }
}

// "table frames, row step = 3, frame = 1"
static void append_row(const session_rows *rows, char *text, size_t size) {
    gonio_text_append(text, size, "table %s, row", rows->table);
    for (int k = 0; k < rows->keys; k++) {
        gonio_text_append(text, size, "%s %s = ", k > 0 ? "," : "", sqlite3_column_name(rows->statement, k));
        append_value(rows->statement, k, text, size);
    }
}

gonio_status gonio_row_fail(session_rows *rows, int column, const char *format, ...) {
    if (rows->status != GONIO_OK) {
        return rows->status; // the first failure counts
    }
    char found[160] = "", where[200] = "", expected[160];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(expected, sizeof expected, format, arguments);
    va_end(arguments);
    append_row(rows, where, sizeof where);
    append_value(rows->statement, column, found, sizeof found);
    rows->status = gonio_fail_line(rows->error, GONIO_E_INPUT, rows->session->db_path, -1,
                                   "the journal is damaged: %s, column %s: found %s, expected %s", where,
                                   sqlite3_column_name(rows->statement, column), found, expected);
    return rows->status;
}

// ---- from row to row ----

// Keys of whole numbers rise from row to row: SQLite's own order breaks only where pages are damaged or doubled.
static void check_order(session_rows *rows) {
    int64_t key[SESSION_KEYS] = {0};
    for (int k = 0; k < rows->keys; k++) {
        if (sqlite3_column_type(rows->statement, k) != SQLITE_INTEGER) {
            return; // the reader of this column tells, where it is to be a number
        }
        key[k] = sqlite3_column_int64(rows->statement, k);
    }
    int k = 0;
    while (k < rows->keys && key[k] == rows->last[k]) {
        k++;
    }
    if (rows->n > 0 && rows->ordered && rows->keys > 0 && (k == rows->keys || key[k] < rows->last[k])) {
        gonio_row_fail(rows, k == rows->keys ? k - 1 : k, "a number above %lld",
                       (long long)rows->last[k < rows->keys ? k : k - 1]);
    }
    rows->ordered = true;
    memcpy(rows->last, key, sizeof key);
}

bool gonio_rows_next(session_rows *rows) {
    if (rows->status != GONIO_OK) {
        return false;
    }
    const int code = sqlite3_step(rows->statement);
    if (code == SQLITE_ROW) {
        check_order(rows);
        rows->n++;
    } else if (code != SQLITE_DONE) {
        char what[64];
        snprintf(what, sizeof what, "read the table %s", rows->table);
        rows->status = gonio_session_db_fail(rows->session, rows->error, what);
    }
    return code == SQLITE_ROW && rows->status == GONIO_OK;
}

gonio_status gonio_rows_close(session_rows *rows) {
    sqlite3_finalize(rows->statement);
    rows->statement = NULL;
    return rows->status;
}

// ---- values ----

int64_t gonio_row_integer(session_rows *rows, int column, int64_t low, int64_t high) {
    const int64_t value = sqlite3_column_int64(rows->statement, column);
    if (rows->status == GONIO_OK && sqlite3_column_type(rows->statement, column) == SQLITE_INTEGER && value >= low &&
        value <= high) {
        return value;
    }
    gonio_row_fail(rows, column, "a whole number from %lld to %lld", (long long)low, (long long)high);
    return 0;
}

static bool is_number(const session_rows *rows, int column) {
    const int type = sqlite3_column_type(rows->statement, column);
    return type == SQLITE_INTEGER || type == SQLITE_FLOAT;
}

double gonio_row_real(session_rows *rows, int column, double low, double high) {
    const double value = sqlite3_column_double(rows->statement, column);
    if (rows->status == GONIO_OK && is_number(rows, column) && value >= low && value <= high) {
        return value;
    }
    gonio_row_fail(rows, column, "a number from %g to %g", low, high);
    return NAN;
}

double gonio_row_real_or(session_rows *rows, int column, double low, double high, double null) {
    return sqlite3_column_type(rows->statement, column) == SQLITE_NULL ? null : gonio_row_real(rows, column, low, high);
}

const char *gonio_row_text(session_rows *rows, int column, size_t limit) {
    if (rows->status == GONIO_OK && sqlite3_column_type(rows->statement, column) == SQLITE_TEXT) {
        const char *text = (const char *)sqlite3_column_text(rows->statement, column);
        const size_t size = (size_t)sqlite3_column_bytes(rows->statement, column);
        if (text == NULL) {
            rows->status = gonio_fail(rows->error, GONIO_E_MEMORY, "no memory for a text of the table %s", rows->table);
            return NULL;
        }
        if (size <= limit && strlen(text) == size) {
            return text;
        }
    }
    gonio_row_fail(rows, column, "a text of at most %zu bytes, none of them 0", limit);
    return NULL;
}

const char *gonio_row_sha256(session_rows *rows, int column) {
    const char *text = gonio_row_text(rows, column, GONIO_SHA256_HEX - 1);
    if (text != NULL && strspn(text, "0123456789abcdef") != GONIO_SHA256_HEX - 1) {
        gonio_row_fail(rows, column, "64 hexadecimal digits");
        return NULL;
    }
    return text;
}

const unsigned char *gonio_row_blob(session_rows *rows, int column, size_t size) {
    if (rows->status == GONIO_OK && sqlite3_column_type(rows->statement, column) == SQLITE_BLOB &&
        (size_t)sqlite3_column_bytes(rows->statement, column) == size) {
        const unsigned char *blob = sqlite3_column_blob(rows->statement, column);
        if (blob != NULL || size == 0) {
            return blob;
        }
        rows->status = gonio_fail(rows->error, GONIO_E_MEMORY, "no memory for a row of the table %s", rows->table);
        return NULL;
    }
    gonio_row_fail(rows, column, "a blob of %zu bytes", size);
    return NULL;
}
