// SPDX-License-Identifier: BSD-3-Clause
// The journal's tables, and a row of theirs as bytes for a checksum, as JSON and back.
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/session/internal.h"

// Angles stand in degrees, for people with an SQL shell. step: the running number of gonio_stamp. rows are
// little-endian doubles, see docs/formats.md. What version 2 has beyond version 1 stands behind each table's other
// columns, where ALTER TABLE puts it too.
const char gonio_session_schema[] =
    "CREATE TABLE settings(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE steps(step INTEGER PRIMARY KEY, kind TEXT NOT NULL, theta_i_deg REAL NOT NULL,"
    " phi_i_deg REAL NOT NULL, theta_o_deg REAL NOT NULL, phi_o_deg REAL NOT NULL, done INTEGER NOT NULL DEFAULT 0,"
    " frames INTEGER NOT NULL DEFAULT 0, clock_end_s REAL, exposure_end_s REAL, utc TEXT);"
    "CREATE TABLE frames(step INTEGER NOT NULL REFERENCES steps(step), frame INTEGER NOT NULL, file TEXT NOT NULL,"
    " sha256 TEXT NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL,"
    " exposure_s REAL NOT NULL, gain_db REAL NOT NULL, clock_s REAL NOT NULL, monitor REAL, monitor_sigma REAL,"
    " utc TEXT, monotonic_s REAL, bytes INTEGER, PRIMARY KEY(step, frame)) WITHOUT ROWID;"
    "CREATE TABLE samples(step INTEGER PRIMARY KEY REFERENCES steps(step), n INTEGER NOT NULL,"
    " channels INTEGER NOT NULL, rows BLOB NOT NULL, sha256 TEXT NOT NULL);"
    "CREATE TABLE final_samples(step INTEGER PRIMARY KEY REFERENCES steps(step), n INTEGER NOT NULL,"
    " channels INTEGER NOT NULL, rows BLOB NOT NULL, sha256 TEXT NOT NULL);"
    "CREATE TABLE radiance(step INTEGER PRIMARY KEY REFERENCES steps(step), channels INTEGER NOT NULL,"
    " means BLOB NOT NULL, sha256 TEXT NOT NULL);"
    "CREATE TABLE files(key TEXT PRIMARY KEY, role TEXT NOT NULL, name TEXT NOT NULL, sha256 TEXT NOT NULL,"
    " size INTEGER NOT NULL, bytes BLOB) WITHOUT ROWID;"
    "CREATE TABLE flagged(step INTEGER PRIMARY KEY REFERENCES steps(step));"
    "CREATE TABLE events(event INTEGER PRIMARY KEY, utc TEXT NOT NULL, kind TEXT NOT NULL, text TEXT NOT NULL);"
    "CREATE TABLE hosts(host INTEGER PRIMARY KEY, version TEXT NOT NULL, commit_id TEXT, hostname TEXT, user TEXT,"
    " utc TEXT NOT NULL, command TEXT);"
    "CREATE TABLE chain(seq INTEGER PRIMARY KEY, tbl TEXT NOT NULL, key TEXT NOT NULL, op TEXT NOT NULL,"
    " content TEXT NOT NULL, hash TEXT NOT NULL);";

const session_table gonio_session_tables[SESSION_TABLES + 1] = {
    {"settings", {"key"}, {"key", "value"}},
    {"hosts", {"host"}, {"host", "version", "commit_id", "hostname", "user", "utc", "command"}},
    {"steps",
     {"step"},
     {"step", "kind", "theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg", "done", "frames", "clock_end_s",
      "exposure_end_s", "utc"}},
    {"frames",
     {"step", "frame"},
     {"step", "frame", "file", "sha256", "x", "y", "width", "height", "exposure_s", "gain_db", "clock_s", "monitor",
      "monitor_sigma", "utc", "monotonic_s", "bytes"}},
    {"samples", {"step"}, {"step", "n", "channels", "rows", "sha256"}},
    {"final_samples", {"step"}, {"step", "n", "channels", "rows", "sha256"}},
    {"radiance", {"step"}, {"step", "channels", "means", "sha256"}},
    {"files", {"key"}, {"key", "role", "name", "sha256", "size", "bytes"}},
    {"flagged", {"step"}, {"step"}},
    {"events", {"event"}, {"event", "utc", "kind", "text"}},
    {0},
};

const session_table *gonio_session_table(const char *name) {
    for (const session_table *t = gonio_session_tables; name != NULL && t->name != NULL; t++) {
        if (strcmp(t->name, name) == 0) {
            return t;
        }
    }
    return NULL;
}

int gonio_session_columns(const session_table *table) {
    int n = 0;
    while (n < SESSION_COLUMNS && table->columns[n] != NULL) {
        n++;
    }
    return n;
}

void gonio_session_key_sql(const session_table *table, const char *row, char sql[SESSION_KEY_SQL]) {
    if (table->keys[1] == NULL) {
        snprintf(sql, SESSION_KEY_SQL, "CAST(%s%s AS TEXT)", row, table->keys[0]);
    } else {
        snprintf(sql, SESSION_KEY_SQL, "%s%s || '/' || %s%s", row, table->keys[0], row, table->keys[1]);
    }
}

void gonio_session_list_columns(const session_table *table, const char *before, char sql[SESSION_COLUMNS_SQL]) {
    int at = 0;
    for (int i = 0; i < gonio_session_columns(table); i++) {
        at += snprintf(sql + at, SESSION_COLUMNS_SQL - (size_t)at, "%s%s%s", i > 0 ? ", " : "", before,
                       table->columns[i]);
    }
}

void gonio_session_bind_key(const session_table *table, sqlite3_stmt *statement, int first, const char *key) {
    // A number as a text meets a column of integers as a number: SQLite gives it the column's affinity.
    const char *slash = table->keys[1] != NULL ? strchr(key, '/') : NULL;
    sqlite3_bind_text(statement, first, key, slash != NULL ? (int)(slash - key) : -1, SQLITE_TRANSIENT);
    if (table->keys[1] != NULL) {
        sqlite3_bind_text(statement, first + 1, slash != NULL ? slash + 1 : "", -1, SQLITE_TRANSIENT);
    }
}

// ---- a row's bytes ----

static void hash_bytes(EVP_MD_CTX *hash, const void *bytes, size_t n) {
    const uint64_t size = n;
    EVP_DigestUpdate(hash, &size, sizeof size);
    EVP_DigestUpdate(hash, bytes, n);
}

// Each column that is not NULL: its name, a letter for the type, the value; names, texts and blobs after their length.
// So a column that a later version adds leaves the rows before it as they were.
static void hash_column(EVP_MD_CTX *hash, const char *name, sqlite3_stmt *row, int column) {
    const int type = sqlite3_column_type(row, column);
    if (type == SQLITE_NULL) {
        return;
    }
    hash_bytes(hash, name, strlen(name));
    EVP_DigestUpdate(hash,
                     type == SQLITE_INTEGER ? "i"
                     : type == SQLITE_FLOAT ? "r"
                     : type == SQLITE_TEXT  ? "t"
                                            : "b",
                     1);
    if (type == SQLITE_INTEGER) {
        const int64_t value = sqlite3_column_int64(row, column);
        EVP_DigestUpdate(hash, &value, sizeof value);
    } else if (type == SQLITE_FLOAT) {
        const double value = sqlite3_column_double(row, column);
        EVP_DigestUpdate(hash, &value, sizeof value);
    } else {
        const void *bytes =
            type == SQLITE_TEXT ? (const void *)sqlite3_column_text(row, column) : sqlite3_column_blob(row, column);
        hash_bytes(hash, bytes, (size_t)sqlite3_column_bytes(row, column));
    }
}

gonio_status gonio_session_row_hash(const session_table *table, sqlite3_stmt *row, int first,
                                    char hex[GONIO_SHA256_HEX], gonio_error *error) {
    EVP_MD_CTX *hash;
    const gonio_status status = gonio_session_hash_begin(&hash, error);
    if (status == GONIO_OK) {
        for (int i = 0; i < gonio_session_columns(table); i++) {
            hash_column(hash, table->columns[i], row, first + i);
        }
        gonio_session_hash_end(hash, hex);
    }
    return status;
}

// ---- JSON ----

static json_t *as_hex(const char *type, const void *bytes, size_t n) {
    static const char digits[] = "0123456789abcdef";
    char *hex = malloc(2 * n + 1);
    for (size_t i = 0; hex != NULL && i < n; i++) {
        const unsigned char byte = ((const unsigned char *)bytes)[i];
        hex[2 * i] = digits[byte >> 4];
        hex[2 * i + 1] = digits[byte & 15];
    }
    json_t *object = hex != NULL ? json_pack("{s:s#}", type, hex, (int)(2 * n)) : NULL;
    free(hex);
    return object;
}

// What JSON has no word for is an object with the bytes in hex: a blob, a text that is not UTF-8, an infinite number.
static json_t *column_json(sqlite3_stmt *row, int column) {
    switch (sqlite3_column_type(row, column)) {
    case SQLITE_INTEGER:
        return json_integer(sqlite3_column_int64(row, column));
    case SQLITE_FLOAT: {
        const double value = sqlite3_column_double(row, column);
        return isfinite(value) ? json_real(value) : as_hex("real", &value, sizeof value);
    }
    case SQLITE_TEXT: {
        const char *text = (const char *)sqlite3_column_text(row, column);
        const size_t n = (size_t)sqlite3_column_bytes(row, column);
        json_t *value = memchr(text, 0, n) == NULL ? json_stringn(text, n) : NULL;
        return value != NULL ? value : as_hex("text", text, n);
    }
    default: {
        const void *bytes = sqlite3_column_blob(row, column);
        return as_hex("blob", bytes, (size_t)sqlite3_column_bytes(row, column));
    }
    }
}

json_t *gonio_session_row_json(const session_table *table, sqlite3_stmt *row, int first) {
    json_t *object = json_object();
    bool good = object != NULL;
    for (int i = 0; good && i < gonio_session_columns(table); i++) {
        if (sqlite3_column_type(row, first + i) != SQLITE_NULL) {
            good = json_object_set_new(object, table->columns[i], column_json(row, first + i)) == 0;
        }
    }
    if (!good) {
        json_decref(object);
        object = NULL;
    }
    return object;
}

static int nibble(char c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1; }

static unsigned char *from_hex(const char *hex, size_t n) {
    unsigned char *bytes = n % 2 == 0 ? malloc(n / 2 + 1) : NULL;
    for (size_t i = 0; bytes != NULL && i < n / 2; i++) {
        const int high = nibble(hex[2 * i]), low = nibble(hex[2 * i + 1]);
        if (high < 0 || low < 0) {
            free(bytes);
            return NULL;
        }
        bytes[i] = (unsigned char)(high << 4 | low);
    }
    return bytes;
}

static bool bind_hex(sqlite3_stmt *statement, int at, const char *type, const json_t *value) {
    const size_t n = json_string_length(value);
    unsigned char *bytes = json_is_string(value) ? from_hex(json_string_value(value), n) : NULL;
    if (bytes == NULL) {
        return false;
    }
    double real;
    bool good = true;
    if (strcmp(type, "blob") == 0) {
        return sqlite3_bind_blob64(statement, at, bytes, n / 2, free) == SQLITE_OK;
    }
    if (strcmp(type, "text") == 0) {
        return sqlite3_bind_text64(statement, at, (char *)bytes, n / 2, free, SQLITE_UTF8) == SQLITE_OK;
    }
    if (strcmp(type, "real") == 0 && n == 2 * sizeof real) {
        memcpy(&real, bytes, sizeof real);
        sqlite3_bind_double(statement, at, real);
    } else {
        good = false;
    }
    free(bytes);
    return good;
}

static bool bind_value(sqlite3_stmt *statement, int at, json_t *value) {
    switch (json_typeof(value)) {
    case JSON_INTEGER:
        return sqlite3_bind_int64(statement, at, json_integer_value(value)) == SQLITE_OK;
    case JSON_REAL:
        return sqlite3_bind_double(statement, at, json_real_value(value)) == SQLITE_OK;
    case JSON_STRING:
        return sqlite3_bind_text(statement, at, json_string_value(value), (int)json_string_length(value),
                                 SQLITE_TRANSIENT) == SQLITE_OK;
    case JSON_OBJECT: {
        void *member = json_object_iter(value);
        return json_object_size(value) == 1 &&
               bind_hex(statement, at, json_object_iter_key(member), json_object_iter_value(member));
    }
    default:
        return false;
    }
}

bool gonio_session_row_bind(const session_table *table, sqlite3_stmt *statement, json_t *row) {
    size_t bound = 0;
    sqlite3_clear_bindings(statement);
    for (int i = 0; i < gonio_session_columns(table); i++) {
        json_t *value = json_object_get(row, table->columns[i]);
        if (value != NULL && !bind_value(statement, i + 1, value)) {
            return false;
        }
        bound += value != NULL;
    }
    return bound == json_object_size(row);
}
