// SPDX-License-Identifier: BSD-3-Clause
// The chain: each row that a transaction puts, changes or deletes gives a record, and the hash of a record is over the
// one before it too. So whoever has the last hash can tell whether any row is not what was written.
//
// No caller has to know: triggers of the writing connection collect what is touched, and just before COMMIT the touched
// rows are read as they stand then.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/session/internal.h"

static gonio_status watch(gonio_session *session, const session_table *table, gonio_error *error) {
    char old[SESSION_KEY_SQL], new[SESSION_KEY_SQL], sql[1024];
    gonio_session_key_sql(table, "OLD.", old);
    gonio_session_key_sql(table, "NEW.", new);
    snprintf(sql, sizeof sql,
             "CREATE TEMP TRIGGER put_%s AFTER INSERT ON main.%s BEGIN INSERT INTO touched VALUES('%s', %s); END;"
             "CREATE TEMP TRIGGER change_%s AFTER UPDATE ON main.%s BEGIN INSERT INTO touched VALUES('%s', %s),"
             " ('%s', %s); END;"
             "CREATE TEMP TRIGGER drop_%s AFTER DELETE ON main.%s BEGIN INSERT INTO touched VALUES('%s', %s); END;",
             table->name, table->name, table->name, new, table->name, table->name, table->name, old, table->name, new,
             table->name, table->name, table->name, old);
    return gonio_session_exec(session, sql, error);
}

gonio_status gonio_session_chain_all(gonio_session *session, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (const session_table *t = gonio_session_tables; status == GONIO_OK && t->name != NULL; t++) {
        char key[SESSION_KEY_SQL], sql[256];
        gonio_session_key_sql(t, "", key);
        snprintf(sql, sizeof sql, "INSERT INTO touched SELECT '%s', %s FROM %s", t->name, key, t->name);
        status = gonio_session_exec(session, sql, error);
    }
    return status;
}

// ---- a transaction's records ----

typedef struct head {
    int64_t seq;
    char hash[GONIO_SHA256_HEX];
    sqlite3_stmt *insert;
} head;

static gonio_status read_head(gonio_session *session, head *h, gonio_error *error) {
    sqlite3_stmt *last;
    gonio_status status =
        gonio_session_prepare(session, "SELECT seq, hash FROM chain ORDER BY seq DESC LIMIT 1", &last, error);
    if (status != GONIO_OK) {
        return status;
    }
    const int code = sqlite3_step(last);
    if (code == SQLITE_ROW) {
        const char *hash = (const char *)sqlite3_column_text(last, 1);
        h->seq = sqlite3_column_int64(last, 0);
        snprintf(h->hash, sizeof h->hash, "%s", hash != NULL ? hash : "");
    } else if (code == SQLITE_DONE) {
        snprintf(h->hash, sizeof h->hash, "%s", SESSION_CHAIN_START);
    } else {
        status = gonio_session_db_fail(session, error, "read the chain");
    }
    sqlite3_finalize(last);
    return status == GONIO_OK
               ? gonio_session_prepare(session, "INSERT INTO chain VALUES(?, ?, ?, ?, ?, ?)", &h->insert, error)
               : status;
}

static gonio_status append(gonio_session *session, head *h, session_record record, gonio_error *error) {
    char hash[GONIO_SHA256_HEX];
    record.seq = h->seq + 1;
    gonio_status status = gonio_session_record_hash(h->hash, &record, hash, error);
    if (status != GONIO_OK) {
        return status;
    }
    sqlite3_reset(h->insert);
    sqlite3_bind_int64(h->insert, 1, record.seq);
    const char *const texts[] = {record.tbl, record.key, record.op, record.content, hash};
    for (int i = 0; i < 5; i++) {
        sqlite3_bind_text(h->insert, i + 2, texts[i], -1, SQLITE_TRANSIENT);
    }
    if (sqlite3_step(h->insert) != SQLITE_DONE) {
        return gonio_session_db_fail(session, error, "enter the chain");
    }
    h->seq++;
    memcpy(h->hash, hash, sizeof hash);
    return GONIO_OK;
}

static gonio_status append_row(gonio_session *session, head *h, const char *tbl, const char *key, gonio_error *error) {
    const session_table *table = gonio_session_table(tbl);
    session_record record = {.tbl = tbl, .key = key, .op = "delete", .content = ""};
    char content[GONIO_SHA256_HEX];
    sqlite3_stmt *row;
    gonio_status status = gonio_session_row(session, table, key, &row, error);
    if (status == GONIO_OK && row != NULL) {
        status = gonio_session_row_hash(table, row, 0, content, error);
        sqlite3_reset(row);
        record.op = "put";
        record.content = content;
    }
    return status == GONIO_OK ? append(session, h, record, error) : status;
}

static gonio_status append_all(gonio_session *session, head *h, gonio_error *error) {
    sqlite3_stmt *touched;
    gonio_status status = gonio_session_prepare(
        session, "SELECT tbl, key FROM touched GROUP BY tbl, key ORDER BY min(rowid)", &touched, error);
    if (status != GONIO_OK) {
        return status;
    }
    int code = SQLITE_DONE;
    while (status == GONIO_OK && (code = sqlite3_step(touched)) == SQLITE_ROW) {
        status = append_row(session, h, (const char *)sqlite3_column_text(touched, 0),
                            (const char *)sqlite3_column_text(touched, 1), error);
    }
    if (status == GONIO_OK && code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "list what was changed");
    }
    sqlite3_finalize(touched);
    return status == GONIO_OK
               ? append(session, h, (session_record){.tbl = "", .key = "", .op = "commit", .content = ""}, error)
               : status;
}

static gonio_status before_commit(gonio_session *session, gonio_error *error) {
    int64_t any;
    gonio_status status = gonio_session_integer(session, "SELECT EXISTS(SELECT 1 FROM touched)", &any, error);
    if (status != GONIO_OK || any == 0) {
        return status;
    }
    if (!session->host_known) {
        status = gonio_session_enter_host(session, error);
    }
    head h = {0};
    status = status == GONIO_OK ? read_head(session, &h, error) : status;
    status = status == GONIO_OK ? append_all(session, &h, error) : status;
    sqlite3_finalize(h.insert);
    status = status == GONIO_OK ? gonio_session_exec(session, "DELETE FROM touched", error) : status;
    session->log.lags = session->log.lags || status == GONIO_OK;
    return status;
}

// ---- a connection's transactions ----

// The log lags by one transaction at most: what it could not take the last time comes first.
static gonio_status before_begin(gonio_session *session, gonio_error *error) {
    return session->log.lags ? gonio_session_log_catch_up(session, error) : GONIO_OK;
}

// The transaction stands, whatever becomes of the log; the next one tries again and tells why not.
static void after_commit(gonio_session *session) {
    if (session->log.lags) {
        session->host_known = true;
        gonio_session_log_catch_up(session, NULL);
    }
}

static const session_hooks hooks = {before_begin, before_commit, after_commit};

gonio_status gonio_session_chain_begin(gonio_session *session, gonio_error *error) {
    gonio_status status =
        gonio_session_exec(session, "CREATE TEMP TABLE touched(tbl TEXT NOT NULL, key TEXT NOT NULL)", error);
    for (const session_table *t = gonio_session_tables; status == GONIO_OK && t->name != NULL; t++) {
        status = watch(session, t, error);
    }
    session->hooks = status == GONIO_OK ? &hooks : NULL;
    return status;
}
