// SPDX-License-Identifier: BSD-3-Clause
// SQLite with Gonio's errors.
#include "host/session/internal.h"

#include <stdarg.h>

gonio_status gonio_session_db_fail(gonio_session *session, gonio_error *error, const char *what) {
    const int code = sqlite3_errcode(session->db);
    const char *text = sqlite3_errmsg(session->db);
    switch (code & 0xff) {
    case SQLITE_FULL:
        return gonio_fail_line(error, GONIO_E_IO, session->db_path, -1, "the disk is full (%s); make room and resume",
                               what);
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
        return gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                               "the journal is damaged (%s: %s); `gonio doctor --repair` salvages what is intact", what,
                               text);
    case SQLITE_INTERRUPT:
        return gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                               "the journal is damaged: reading it finds no end (%s)", what);
    case SQLITE_NOMEM:
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the journal (%s)", what);
    default:
        return gonio_fail_line(error, GONIO_E_IO, session->db_path, -1, "%s: %s", what, text);
    }
}

static gonio_status exec(gonio_session *session, const char *sql, gonio_error *error) {
    session->budget.looks = 0;
    return sqlite3_exec(session->db, sql, NULL, NULL, NULL) == SQLITE_OK ? GONIO_OK
                                                                         : gonio_session_db_fail(session, error, sql);
}

// What is changed outside a transaction is one of its own: the chain knows no other changes.
static gonio_status begin_for_chain(gonio_session *session, bool changes, bool *own, gonio_error *error) {
    *own = false;
    return session->hooks != NULL && changes ? gonio_session_begin_own(session, own, error) : GONIO_OK;
}

gonio_status gonio_session_exec(gonio_session *session, const char *sql, gonio_error *error) {
    bool own;
    const gonio_status status = begin_for_chain(session, true, &own, error);
    return status == GONIO_OK ? gonio_session_end_own(session, own, exec(session, sql, error), error) : status;
}

gonio_status gonio_session_prepare(gonio_session *session, const char *sql, sqlite3_stmt **out, gonio_error *error) {
    session->budget.looks = 0;
    return sqlite3_prepare_v2(session->db, sql, -1, out, NULL) == SQLITE_OK
               ? GONIO_OK
               : gonio_session_db_fail(session, error, sql);
}

gonio_status gonio_session_run(gonio_session *session, sqlite3_stmt *statement, gonio_error *error) {
    bool own;
    gonio_status status = begin_for_chain(session, sqlite3_stmt_readonly(statement) == 0, &own, error);
    if (status == GONIO_OK) {
        const int code = sqlite3_step(statement);
        if (code != SQLITE_DONE && code != SQLITE_ROW) {
            status = gonio_session_db_fail(session, error, sqlite3_sql(statement));
        }
    }
    sqlite3_finalize(statement);
    return gonio_session_end_own(session, own, status, error);
}

gonio_status gonio_session_do(gonio_session *session, gonio_error *error, const char *sql, const char *kinds, ...) {
    sqlite3_stmt *statement;
    const gonio_status status = gonio_session_prepare(session, sql, &statement, error);
    if (status != GONIO_OK) {
        return status;
    }
    va_list values;
    va_start(values, kinds);
    for (int k = 0; kinds[k] != 0; k++) {
        if (kinds[k] == 't') {
            sqlite3_bind_text(statement, k + 1, va_arg(values, const char *), -1, SQLITE_STATIC);
        } else if (kinds[k] == 'r') {
            sqlite3_bind_double(statement, k + 1, va_arg(values, double));
        } else {
            sqlite3_bind_int64(statement, k + 1, kinds[k] == 'l' ? va_arg(values, int64_t) : va_arg(values, int));
        }
    }
    va_end(values);
    return gonio_session_run(session, statement, error);
}

gonio_status gonio_session_integer(gonio_session *session, const char *sql, int64_t *value, gonio_error *error) {
    sqlite3_stmt *statement;
    gonio_status status = gonio_session_prepare(session, sql, &statement, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (sqlite3_step(statement) == SQLITE_ROW) {
        *value = sqlite3_column_int64(statement, 0);
    } else {
        status = gonio_session_db_fail(session, error, sql);
    }
    sqlite3_finalize(statement);
    return status;
}

gonio_status gonio_session_begin(gonio_session *session, gonio_error *error) {
    gonio_status status = session->hooks != NULL ? session->hooks->before_begin(session, error) : GONIO_OK;
    status = status == GONIO_OK ? exec(session, "BEGIN IMMEDIATE", error) : status;
    session->in_transaction = status == GONIO_OK;
    return status;
}

gonio_status gonio_session_commit(gonio_session *session, gonio_error *error) {
    gonio_status status = session->hooks != NULL ? session->hooks->before_commit(session, error) : GONIO_OK;
    status = status == GONIO_OK ? exec(session, "COMMIT", error) : status;
    if (status != GONIO_OK) {
        gonio_session_rollback(session);
        return status;
    }
    session->in_transaction = false;
    if (session->hooks != NULL) {
        session->hooks->after_commit(session);
    }
    return GONIO_OK;
}

void gonio_session_rollback(gonio_session *session) {
    // SQLite has rolled back by itself after some failures (a full disk); a second rollback then fails harmlessly.
    sqlite3_exec(session->db, "ROLLBACK", NULL, NULL, NULL);
    session->in_transaction = false;
}

gonio_status gonio_session_end(gonio_session *session, gonio_status status, gonio_error *error) {
    if (status == GONIO_OK) {
        return gonio_session_commit(session, error);
    }
    gonio_session_rollback(session);
    return status;
}

gonio_status gonio_session_begin_own(gonio_session *session, bool *own, gonio_error *error) {
    *own = !session->in_transaction;
    return *own ? gonio_session_begin(session, error) : GONIO_OK;
}

gonio_status gonio_session_end_own(gonio_session *session, bool own, gonio_status status, gonio_error *error) {
    return own ? gonio_session_end(session, status, error) : status;
}
