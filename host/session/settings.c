// SPDX-License-Identifier: BSD-3-Clause
// Settings and events of a session.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/text.h"
#include "host/session/internal.h"

gonio_status gonio_session_put(gonio_session *session, const char *key, const char *value, gonio_error *error) {
    return gonio_session_do(session, error, "INSERT OR REPLACE INTO settings(key, value) VALUES(?, ?)", "tt", key,
                            value);
}

gonio_status gonio_session_find(gonio_session *session, const char *key, char **value, gonio_error *error) {
    *value = NULL;
    session_rows rows;
    if (gonio_rows_open(&rows, session, "settings", 1, "SELECT key, value FROM settings WHERE key = ?", error) ==
        GONIO_OK) {
        sqlite3_bind_text(rows.statement, 1, key, -1, SQLITE_STATIC);
    }
    const char *text = gonio_rows_next(&rows) ? gonio_row_text(&rows, 1, SESSION_SETTING_MAX) : NULL;
    if (text != NULL && (*value = strdup(text)) == NULL) {
        rows.status = gonio_fail(error, GONIO_E_MEMORY, "no memory for setting %s", key);
    }
    return gonio_rows_close(&rows);
}

gonio_status gonio_session_get(gonio_session *session, const char *key, char **value, gonio_error *error) {
    const gonio_status status = gonio_session_find(session, key, value, error);
    return status != GONIO_OK || *value != NULL
               ? status
               : gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1, "the session has no setting '%s'", key);
}

gonio_status gonio_session_model_path(gonio_session *session, char **path, gonio_error *error) {
    static const char own[] = "model.gonio";
    const gonio_status status = gonio_session_get(session, "result.model_path", path, error);
    const bool elsewhere = status == GONIO_OK && (*path)[0] == '/';
    // A session that came from elsewhere as one file brings its model along.
    if (status != GONIO_OK ||
        (elsewhere && (access(*path, F_OK) == 0 || faccessat(session->folder_fd, own, F_OK, 0) != 0))) {
        return status;
    }
    char *joined;
    if (asprintf(&joined, "%s/%s", session->path, elsewhere ? own : *path) < 0) {
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

// A line an event, whatever its text holds.
static void print_event(session_rows *rows, FILE *stream) {
    char line[SESSION_EVENT_MAX];
    for (int column = 1; column < 4; column++) {
        const char *text = gonio_row_text(rows, column, SESSION_SETTING_MAX);
        gonio_text_printable(text != NULL ? text : "", line, sizeof line);
        fprintf(stream, "%s%s", line, column == 1 ? " " : column == 2 ? ": " : "\n");
    }
}

gonio_status gonio_session_events(gonio_session *session, char **text, gonio_error *error) {
    *text = NULL;
    session_rows rows;
    gonio_rows_open(&rows, session, "events", 1, "SELECT event, utc, kind, text FROM events ORDER BY event", error);
    size_t size;
    FILE *stream = open_memstream(text, &size);
    if (stream == NULL) {
        gonio_rows_close(&rows);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the events");
    }
    while (gonio_rows_next(&rows)) {
        print_event(&rows, stream);
    }
    const bool whole = fclose(stream) == 0;
    gonio_status status = gonio_rows_close(&rows);
    if (status == GONIO_OK && !whole) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the events");
    }
    if (status != GONIO_OK) {
        free(*text);
        *text = NULL;
    }
    return status;
}
