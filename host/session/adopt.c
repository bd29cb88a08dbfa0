// SPDX-License-Identifier: BSD-3-Clause
// A session of version 1 becomes one of this version when it is opened to be written: its tables get the columns that
// they lack, and all its rows enter the chain as they are. One transaction: it is of one version or of the other.
#include <stdio.h>
#include <string.h>

#include "host/session/internal.h"

static const struct added {
    const char *table, *column, *type;
} added[] = {
    {"steps", "utc", "TEXT"},
    {"frames", "utc", "TEXT"},
    {"frames", "monotonic_s", "REAL"},
    {"frames", "bytes", "INTEGER"},
};

static gonio_status has(gonio_session *session, const char *table, const char *column, bool *yes, gonio_error *error) {
    char sql[160];
    int64_t count;
    snprintf(sql, sizeof sql, "SELECT count(*) FROM pragma_table_info('%s') WHERE '%s' IN (name, '')", table, column);
    const gonio_status status = gonio_session_integer(session, sql, &count, error);
    *yes = count > 0;
    return status;
}

static gonio_status add_columns(gonio_session *session, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < sizeof added / sizeof *added; i++) {
        bool there = false;
        char sql[96];
        snprintf(sql, sizeof sql, "ALTER TABLE %s ADD COLUMN %s %s", added[i].table, added[i].column, added[i].type);
        status = has(session, added[i].table, added[i].column, &there, error);
        status = status == GONIO_OK && !there ? gonio_session_exec(session, sql, error) : status;
    }
    return status;
}

static gonio_status add_tables(gonio_session *session, gonio_error *error) {
    gonio_status status = GONIO_OK;
    const char *end;
    for (const char *at = gonio_session_schema; status == GONIO_OK && (end = strchr(at, ';')) != NULL; at = end + 1) {
        char sql[1024], name[32] = "";
        bool there = false;
        snprintf(sql, sizeof sql, "%.*s", (int)(end - at), at);
        sscanf(sql, "CREATE TABLE %31[a-z_]", name);
        status = has(session, name, "", &there, error);
        status = status == GONIO_OK && !there ? gonio_session_exec(session, sql, error) : status;
    }
    return status;
}

static gonio_status adopt_all(gonio_session *session, gonio_error *error) {
    char version[48];
    snprintf(version, sizeof version, "PRAGMA user_version = %d", GONIO_SESSION_VERSION);
    gonio_status status = add_tables(session, error);
    status = status == GONIO_OK ? add_columns(session, error) : status;
    status = status == GONIO_OK ? gonio_session_exec(session, version, error) : status;
    status = status == GONIO_OK ? gonio_session_exec(session, "DELETE FROM chain", error) : status;
    status = status == GONIO_OK ? gonio_session_chain_begin(session, error) : status;
    status = status == GONIO_OK ? gonio_session_chain_all(session, error) : status;
    return status == GONIO_OK
               ? gonio_session_event(session, "adopted",
                                     "a session of version 1; its rows, as they are, begin the chain", error)
               : status;
}

gonio_status gonio_session_adopt(gonio_session *session, gonio_error *error) {
    gonio_status status = gonio_session_begin(session, error);
    if (status == GONIO_OK) {
        status = gonio_session_end(session, adopt_all(session, error), error);
    }
    session->version = status == GONIO_OK ? GONIO_SESSION_VERSION : session->version;
    return status;
}
