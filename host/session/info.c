// SPDX-License-Identifier: BSD-3-Clause
// What a session says of itself.
#include "host/session/info.h"

#include <ctype.h>
#include <string.h>

#include "host/session/internal.h"

static json_t *value_of(sqlite3_stmt *row, int column) {
    switch (sqlite3_column_type(row, column)) {
    case SQLITE_INTEGER:
        return json_integer(sqlite3_column_int64(row, column));
    case SQLITE_FLOAT:
        return json_real(sqlite3_column_double(row, column)); // NULL for an infinite one, which nobody stores
    case SQLITE_TEXT: {
        json_t *text =
            json_stringn((const char *)sqlite3_column_text(row, column), (size_t)sqlite3_column_bytes(row, column));
        return text != NULL ? text : json_string("(not UTF-8)");
    }
    default:
        return json_null();
    }
}

// Hold a value against a letter: i a number that counts, s a SHA-256, t a text; a large one: or NULL.
static void check_value(session_rows *rows, int column, char kind) {
    if (isupper((unsigned char)kind) && sqlite3_column_type(rows->statement, column) == SQLITE_NULL) {
        return;
    }
    switch (tolower((unsigned char)kind)) {
    case 'i':
        gonio_row_integer(rows, column, 0, INT64_MAX);
        return;
    case 's':
        gonio_row_sha256(rows, column);
        return;
    default:
        gonio_row_text(rows, column, SESSION_SETTING_MAX);
    }
}

// A part that needs columns or a table of version 2 is left out of a session of version 1.
// kinds: of the columns, for check_value; "": numbers of SQLite's own making.
static const struct part {
    const char *name, *sql;
    bool one;
    int version;
    const char *kinds;
} parts[] = {
    {"progress",
     "SELECT count(*) AS steps, sum(done) AS steps_done, sum(kind = 'sample') AS poses,"
     " sum(kind = 'sample' AND done) AS poses_done, (SELECT count(*) FROM frames) AS frames,"
     " (SELECT ifnull(sum(n), 0) FROM samples) AS samples,"
     " EXISTS(SELECT 1 FROM settings WHERE key = 'result.model_sha256') AS finished,"
     " (SELECT min(utc) FROM events) AS begun, (SELECT max(utc) FROM events) AS last_event FROM steps",
     true, 1, ""},
    {"kinds",
     "SELECT kind, count(*) AS steps, sum(done) AS done, sum(frames) AS frames FROM steps GROUP BY kind"
     " ORDER BY min(step)",
     false, 1, ""},
    {"frames",
     "SELECT min(exposure_s) AS exposure_min_s, max(exposure_s) AS exposure_max_s, min(gain_db) AS gain_min_db,"
     " max(gain_db) AS gain_max_db, max(clock_s) AS nominal_s FROM frames",
     true, 1, ""},
    {"times",
     "SELECT min(utc) AS first_frame, max(utc) AS last_frame, max(monotonic_s) - min(monotonic_s) AS monotonic_span_s,"
     " sum(bytes) AS bytes FROM frames",
     true, 2, ""},
    {"monitor",
     "SELECT count(monitor) AS readings, min(monitor) AS minimum, avg(monitor) AS mean, max(monitor) AS maximum,"
     " avg(monitor_sigma) AS mean_relative_sigma FROM frames",
     true, 1, ""},
    {"hosts", "SELECT host, version, commit_id, hostname, user, utc, command FROM hosts ORDER BY host", false, 2,
     "itTTTtT"},
    {"files", "SELECT role, name, sha256, size, bytes IS NOT NULL AS stored FROM files ORDER BY role, name", false, 2,
     "ttsii"},
    {"chain", "SELECT seq, hash FROM chain ORDER BY seq DESC LIMIT 1", true, 2, "is"},
    {"events", "SELECT utc, kind, text FROM events ORDER BY event", false, 1, "ttt"},
};

// Each row an object of the query's columns; one: the first row alone.
static gonio_status rows_of(gonio_session *session, const struct part *part, json_t **out, gonio_error *error) {
    session_rows rows;
    gonio_rows_open(&rows, session, part->name, part->kinds[0] != 0 ? 2 : 0, part->sql, error);
    json_t *list = json_array();
    while (gonio_rows_next(&rows)) {
        json_t *object = json_object();
        for (int k = 0; k < sqlite3_column_count(rows.statement); k++) {
            if (part->kinds[0] != 0) {
                check_value(&rows, k, part->kinds[k]);
            }
            json_object_set_new(object, sqlite3_column_name(rows.statement, k), value_of(rows.statement, k));
        }
        json_array_append_new(list, object);
    }
    const gonio_status status = gonio_rows_close(&rows);
    *out = status != GONIO_OK ? NULL : part->one ? json_incref(json_array_get(list, 0)) : json_incref(list);
    json_decref(list);
    return status;
}

// Settings that are JSON are given as such.
static gonio_status settings_of(gonio_session *session, json_t **out, gonio_error *error) {
    sqlite3_stmt *rows;
    gonio_status status = gonio_session_prepare(session, "SELECT key, value FROM settings ORDER BY key", &rows, error);
    *out = json_object();
    int code = SQLITE_DONE;
    while (status == GONIO_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        const char *key = (const char *)sqlite3_column_text(rows, 0);
        const char *value = (const char *)sqlite3_column_text(rows, 1);
        json_t *parsed = value != NULL && value[0] == '{' ? json_loads(value, 0, NULL) : NULL;
        if (key != NULL) {
            json_object_set_new(*out, key, parsed != NULL ? parsed : value_of(rows, 1));
        }
    }
    if (status == GONIO_OK && code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "read the settings");
    }
    sqlite3_finalize(rows);
    return status;
}

gonio_status gonio_session_info(gonio_session *session, json_t **out, gonio_error *error) {
    json_t *settings = NULL;
    *out = json_pack("{s:s,s:s,s:i}", "kind", "session", "path", session->path, "version", session->version);
    gonio_status status = *out != NULL ? settings_of(session, &settings, error)
                                       : gonio_fail(error, GONIO_E_INPUT, "the session's path is not UTF-8");
    for (size_t k = 0; status == GONIO_OK && k < sizeof parts / sizeof *parts; k++) {
        json_t *part;
        if (session->version >= parts[k].version) {
            status = rows_of(session, &parts[k], &part, error);
            json_object_set_new(*out, parts[k].name, part != NULL ? part : json_null());
        }
    }
    json_object_set_new(*out, "settings", settings);
    if (status != GONIO_OK) {
        json_decref(*out);
        *out = NULL;
    }
    return status;
}
