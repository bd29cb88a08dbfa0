// SPDX-License-Identifier: BSD-3-Clause
// Settings and events of a session.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/session/internal.h"

gonio_status gonio_session_put(gonio_session *session, const char *key, const char *value, gonio_error *error) {
    return gonio_session_do(session, error, "INSERT OR REPLACE INTO settings(key, value) VALUES(?, ?)", "tt", key,
                            value);
}

gonio_status gonio_session_get(gonio_session *session, const char *key, char **value, gonio_error *error) {
    *value = NULL;
    sqlite3_stmt *statement;
    gonio_status status = gonio_session_prepare(session, "SELECT value FROM settings WHERE key = ?", &statement, error);
    if (status != GONIO_OK) {
        return status;
    }
    sqlite3_bind_text(statement, 1, key, -1, SQLITE_STATIC);
    const int code = sqlite3_step(statement);
    if (code == SQLITE_ROW) {
        *value = strdup((const char *)sqlite3_column_text(statement, 0));
        status = *value != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for setting %s", key);
    } else if (code == SQLITE_DONE) {
        status = gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1, "the session has no setting '%s'", key);
    } else {
        status = gonio_session_db_fail(session, error, "read a setting");
    }
    sqlite3_finalize(statement);
    return status;
}

gonio_status gonio_session_model_path(gonio_session *session, char **path, gonio_error *error) {
    const gonio_status status = gonio_session_get(session, "result.model_path", path, error);
    if (status != GONIO_OK || (*path)[0] == '/') {
        return status;
    }
    char *joined;
    if (asprintf(&joined, "%s/%s", session->path, *path) < 0) {
        joined = NULL;
    }
    free(*path);
    *path = joined;
    return joined != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
}

gonio_status gonio_session_event(gonio_session *session, const char *kind, const char *text, gonio_error *error) {
    return gonio_session_do(session, error,
                            "INSERT INTO events(utc, kind, text) VALUES(strftime('%Y-%m-%dT%H:%M:%fZ', 'now'), ?, ?)",
                            "tt", kind, text);
}

gonio_status gonio_session_events(gonio_session *session, char **text, gonio_error *error) {
    *text = NULL;
    sqlite3_stmt *statement;
    gonio_status status =
        gonio_session_prepare(session, "SELECT utc, kind, text FROM events ORDER BY event", &statement, error);
    if (status != GONIO_OK) {
        return status;
    }
    size_t size;
    FILE *stream = open_memstream(text, &size);
    if (stream == NULL) {
        sqlite3_finalize(statement);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the events");
    }
    int code;
    while ((code = sqlite3_step(statement)) == SQLITE_ROW) {
        fprintf(stream, "%s %s: %s\n", (const char *)sqlite3_column_text(statement, 0),
                (const char *)sqlite3_column_text(statement, 1), (const char *)sqlite3_column_text(statement, 2));
    }
    fclose(stream);
    if (code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "read the events");
        free(*text);
        *text = NULL;
    }
    sqlite3_finalize(statement);
    return status;
}
