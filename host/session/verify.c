// SPDX-License-Identifier: BSD-3-Clause
// Does the journal prove itself? Its chain is recomputed, each row held against its newest record and each record
// against its row, and session.log against the chain.
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "host/session/internal.h"

typedef struct verification {
    gonio_session *session;
    session_proof *proof;
    int64_t log_size; // before the database was looked at: all of this is of transactions that it has
    int64_t log_last; // look at so many bytes of it; 0: at all
} verification;

static void found(session_proof *proof, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void found(session_proof *proof, const char *format, ...) {
    if (proof->what[0] != 0) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(proof->what, sizeof proof->what, format, arguments);
    va_end(arguments);
}

// The end of a query: damage is a finding, anything else is why nothing can be told.
static gonio_status finish(verification *v, sqlite3_stmt *rows, int code, const char *table, gonio_error *error) {
    gonio_status status = GONIO_OK;
    if (code != SQLITE_DONE && code != SQLITE_ROW) {
        gonio_error why = {0};
        status = gonio_session_db_fail(v->session, &why, table);
        found(v->proof, "table %s: %s", table, why.message);
        if (status != GONIO_E_INPUT && error != NULL) {
            *error = why;
        }
    }
    sqlite3_finalize(rows);
    return status == GONIO_E_INPUT ? GONIO_OK : status;
}

static gonio_status prepare(verification *v, const char *sql, sqlite3_stmt **rows, const char *table,
                            gonio_error *error) {
    const int code = sqlite3_prepare_v2(v->session->db, sql, -1, rows, NULL);
    return code == SQLITE_OK ? GONIO_OK : finish(v, NULL, code, table, error);
}

static const char *text_of(sqlite3_stmt *row, int column) {
    const char *text = (const char *)sqlite3_column_text(row, column);
    return text != NULL ? text : "";
}

// ---- pages ----

static gonio_status check_pages(verification *v, gonio_error *error) {
    sqlite3_stmt *rows = NULL;
    gonio_status status = prepare(v, "PRAGMA integrity_check(1)", &rows, "sqlite_master", error);
    if (rows == NULL) {
        return status;
    }
    const int code = sqlite3_step(rows);
    if (code == SQLITE_ROW && strcmp(text_of(rows, 0), "ok") != 0) {
        found(v->proof, "SQLite's integrity check: %s", text_of(rows, 0));
    }
    return finish(v, rows, code, "sqlite_master", error);
}

// ---- what the log says of a row or a record, to name the column ----

typedef struct lookup {
    const char *tbl, *key, *content; // of a row
    int64_t seq;                     // or of a record, from 1
    json_t *row;
    char record[5][GONIO_SHA256_HEX + SESSION_KEY];
    bool found;
} lookup;

static gonio_status look(const session_line *line, void *context, gonio_error *error) {
    (void)error;
    lookup *l = context;
    const session_record *r = &line->record;
    if (!line->proven || l->found) {
        return GONIO_OK;
    }
    if (l->seq == 0 && line->row != NULL && strcmp(r->tbl, l->tbl) == 0 && strcmp(r->key, l->key) == 0 &&
        strcmp(r->content, l->content) == 0) {
        l->row = json_incref(line->row);
        l->found = true;
    } else if (l->seq > 0 && r->seq == l->seq) {
        const char *const texts[] = {r->tbl, r->key, r->op, r->content, line->hash};
        for (int i = 0; i < 5; i++) {
            snprintf(l->record[i], sizeof l->record[i], "%s", texts[i]);
        }
        l->found = true;
    }
    return GONIO_OK;
}

static void shorten(json_t *value, char text[64]) {
    char *whole = value != NULL ? json_dumps(value, JSON_ENCODE_ANY | JSON_COMPACT | JSON_REAL_PRECISION(17)) : NULL;
    snprintf(text, 64, whole != NULL && strlen(whole) > 60 ? "%.57s..." : "%.63s", whole != NULL ? whole : "NULL");
    free(whole);
}

static void name_column(verification *v, const session_table *table, sqlite3_stmt *row, int first, const char *key,
                        const char *content) {
    lookup l = {.tbl = table->name, .key = key, .content = content};
    gonio_session_log_for(v->session->folder_fd, v->session->path, 0, look, &l, NULL);
    json_t *live = l.row != NULL ? gonio_session_row_json(table, row, first) : NULL;
    for (int i = 0; live != NULL && i < gonio_session_columns(table); i++) {
        json_t *is = json_object_get(live, table->columns[i]), *was = json_object_get(l.row, table->columns[i]);
        if (is == NULL ? was != NULL : !json_equal(is, was)) {
            char now[64], then[64];
            shorten(is, now);
            shorten(was, then);
            found(v->proof, "table %s, row %s, column %s: found %s, %s was journalled", table->name, key,
                  table->columns[i], now, then);
        }
    }
    found(v->proof, "table %s, row %s: it is not the row that was journalled", table->name, key);
    json_decref(live);
    json_decref(l.row);
}

static const char *const record_columns[] = {"tbl", "key", "op", "content", "hash"};

static void name_record(verification *v, sqlite3_stmt *row, int64_t seq) {
    lookup l = {.seq = seq};
    gonio_session_log_for(v->session->folder_fd, v->session->path, 0, look, &l, NULL);
    for (int i = 0; l.found && i < 5; i++) {
        if (strcmp(text_of(row, i + 1), l.record[i]) != 0) {
            found(v->proof, "table chain, row %lld, column %s: found %.60s, %.60s was journalled", (long long)seq,
                  record_columns[i], text_of(row, i + 1), l.record[i]);
        }
    }
    found(v->proof, "table chain, row %lld, column hash: it does not follow from the row before it", (long long)seq);
}

// ---- the chain ----

// SQLite keeps a type with each value, and reads an empty blob, or a text up to its first 0, as the text that was
// hashed.
static bool texts_as_stored(verification *v, sqlite3_stmt *row) {
    for (int i = 1; i <= 5; i++) {
        if (sqlite3_column_type(row, i) != SQLITE_TEXT ||
            strlen(text_of(row, i)) != (size_t)sqlite3_column_bytes(row, i)) {
            found(v->proof, "table chain, row %lld, column %s: found what is no text",
                  (long long)sqlite3_column_int64(row, 0), record_columns[i - 1]);
            return false;
        }
    }
    return true;
}

static gonio_status check_record(verification *v, sqlite3_stmt *row, char prev[GONIO_SHA256_HEX], gonio_error *error) {
    if (!texts_as_stored(v, row)) {
        return GONIO_OK;
    }
    const session_record record = {sqlite3_column_int64(row, 0), text_of(row, 1), text_of(row, 2), text_of(row, 3),
                                   text_of(row, 4)};
    char hash[GONIO_SHA256_HEX];
    if (record.seq != v->proof->seq + 1) {
        found(v->proof, "table chain, row %lld: it is missing", (long long)v->proof->seq + 1);
        return GONIO_OK;
    }
    const gonio_status status = gonio_session_record_hash(prev, &record, hash, error);
    if (status == GONIO_E_INPUT || (status == GONIO_OK && strcmp(hash, text_of(row, 5)) != 0)) {
        name_record(v, row, record.seq);
        return GONIO_OK;
    }
    memcpy(prev, hash, sizeof hash);
    v->proof->seq = record.seq;
    return status;
}

static gonio_status check_chain(verification *v, gonio_error *error) {
    sqlite3_stmt *rows = NULL;
    char prev[GONIO_SHA256_HEX] = SESSION_CHAIN_START;
    gonio_status status =
        prepare(v, "SELECT seq, tbl, key, op, content, hash FROM chain ORDER BY seq", &rows, "chain", error);
    int code = SQLITE_DONE;
    bool ended = true;
    while (rows != NULL && status == GONIO_OK && v->proof->what[0] == 0 && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        status = check_record(v, rows, prev, error);
        ended = strcmp(text_of(rows, 3), "commit") == 0;
    }
    if (rows != NULL && status == GONIO_OK) {
        status = finish(v, rows, code, "chain", error);
    } else {
        sqlite3_finalize(rows);
    }
    if (!ended) {
        found(v->proof, "table chain, row %lld: the record that ends its transaction is missing",
              (long long)v->proof->seq + 1);
    }
    return status;
}

// ---- the rows ----

static void join_sql(const session_table *table, char *sql, size_t size) {
    char columns[SESSION_COLUMNS_SQL], on[160];
    gonio_session_list_columns(table, "t.", columns);
    if (table->keys[1] != NULL) {
        snprintf(on, sizeof on,
                 "t.%s = CAST(c.key AS INTEGER) AND t.%s = CAST(substr(c.key, instr(c.key, '/') + 1) AS INTEGER)",
                 table->keys[0], table->keys[1]);
    } else {
        snprintf(on, sizeof on, strcmp(table->keys[0], "key") == 0 ? "t.%s = c.key" : "t.%s = CAST(c.key AS INTEGER)",
                 table->keys[0]);
    }
    // Of a group's other columns SQLite gives those of the row with max(seq).
    snprintf(sql, size,
             "SELECT c.key, c.op, c.content, %s FROM (SELECT key, op, content, max(seq) FROM chain WHERE tbl = '%s'"
             " GROUP BY key) AS c LEFT JOIN %s AS t ON %s",
             columns, table->name, table->name, on);
}

enum { ROW_AT = 3 }; // the row's columns stand behind the record's in that query

static gonio_status check_row(verification *v, const session_table *table, sqlite3_stmt *rows, int64_t *there,
                              gonio_error *error) {
    const char *key = text_of(rows, 0);
    const bool put = strcmp(text_of(rows, 1), "put") == 0;
    const bool lives = sqlite3_column_type(rows, ROW_AT) != SQLITE_NULL;
    char content[GONIO_SHA256_HEX];
    *there += lives;
    if (put != lives) {
        found(v->proof, "table %s, row %s: %s", table->name, key,
              put ? "it is missing" : "it is there and should not be: it was deleted");
        return GONIO_OK;
    }
    const gonio_status status = lives ? gonio_session_row_hash(table, rows, ROW_AT, content, error) : GONIO_OK;
    if (status == GONIO_OK && lives && strcmp(content, text_of(rows, 2)) != 0) {
        name_column(v, table, rows, ROW_AT, key, text_of(rows, 2));
    }
    return status;
}

// A row that no record tells of.
static gonio_status check_unknown(verification *v, const session_table *table, int64_t there, gonio_error *error) {
    char key[SESSION_KEY_SQL], sql[512];
    gonio_session_key_sql(table, "", key);
    snprintf(sql, sizeof sql,
             "SELECT %s FROM %s WHERE (SELECT count(*) FROM %s) != %lld AND %s NOT IN (SELECT key FROM chain WHERE"
             " tbl = '%s') LIMIT 1",
             key, table->name, table->name, (long long)there, key, table->name);
    sqlite3_stmt *rows = NULL;
    const gonio_status status = prepare(v, sql, &rows, table->name, error);
    if (rows == NULL) {
        return status;
    }
    const int code = sqlite3_step(rows);
    if (code == SQLITE_ROW) {
        found(v->proof, "table %s, row %s: it is there and was never journalled", table->name, text_of(rows, 0));
    }
    return finish(v, rows, code, table->name, error);
}

static gonio_status check_table(verification *v, const session_table *table, gonio_error *error) {
    char sql[SESSION_COLUMNS_SQL + 512];
    sqlite3_stmt *rows = NULL;
    int64_t there = 0;
    join_sql(table, sql, sizeof sql);
    gonio_status status = prepare(v, sql, &rows, table->name, error);
    int code = SQLITE_DONE;
    while (rows != NULL && status == GONIO_OK && v->proof->what[0] == 0 && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        status = check_row(v, table, rows, &there, error);
    }
    if (rows != NULL && status == GONIO_OK) {
        status = finish(v, rows, code, table->name, error);
    } else {
        sqlite3_finalize(rows);
    }
    return status == GONIO_OK && v->proof->what[0] == 0 ? check_unknown(v, table, there, error) : status;
}

static gonio_status check_tables(verification *v, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (const session_table *t = gonio_session_tables; status == GONIO_OK && t->name != NULL; t++) {
        status = v->proof->what[0] == 0 ? check_table(v, t, error) : GONIO_OK;
    }
    return status;
}

// ---- the log ----

typedef struct log_check {
    verification *v;
    sqlite3_stmt *hash; // of a record of the chain
    bool any, proven, ahead, other, gap;
    long long bad_line;
} log_check;

static gonio_status check_line(const session_line *line, void *context, gonio_error *error) {
    (void)error;
    log_check *c = context;
    session_proof *proof = c->v->proof;
    c->any = true;
    c->proven = c->proven || line->proven;
    if (c->v->log_last == 0 && (!line->proven || line->record.seq != proof->log_seq + 1)) {
        c->bad_line = c->bad_line == 0 ? line->number : c->bad_line;
        c->gap = true;
    }
    if (!line->proven) {
        return GONIO_OK;
    }
    sqlite3_reset(c->hash);
    sqlite3_bind_int64(c->hash, 1, line->record.seq);
    const bool known = sqlite3_step(c->hash) == SQLITE_ROW;
    const bool same = known && strcmp(text_of(c->hash, 0), line->hash) == 0;
    c->ahead = c->ahead || (!known && line->end <= c->v->log_size);
    c->other = c->other || (known && !same);
    if (same && !c->gap) {
        proof->log_seq = line->record.seq;
        proof->log_size = line->end;
        snprintf(proof->log_hash, sizeof proof->log_hash, "%s", line->hash);
    }
    return GONIO_OK;
}

static session_log_state judge_log(const log_check *c) {
    session_proof *proof = c->v->proof;
    if (c->other) {
        found(proof, "session.log contradicts session.db from record %lld on", (long long)proof->log_seq + 1);
        return SESSION_LOG_OTHER;
    }
    if (c->ahead) {
        found(proof, "session.log has what session.db lacks, from record %lld on", (long long)proof->seq + 1);
        return SESSION_LOG_AHEAD;
    }
    if (proof->log_lag <= 1) {
        return SESSION_LOG_SOUND;
    }
    if (!c->any) {
        found(proof, "session.log is missing");
        return SESSION_LOG_MISSING;
    }
    if (c->bad_line > 0) {
        found(proof, "session.log, line %lld: it does not prove itself", c->bad_line);
        return SESSION_LOG_DAMAGED;
    }
    found(proof, "session.log lacks the last %lld transactions", (long long)proof->log_lag);
    return SESSION_LOG_SHORT;
}

static gonio_status count_lag(verification *v, gonio_error *error) {
    sqlite3_stmt *count = NULL;
    gonio_status status =
        prepare(v, "SELECT count(*) FROM chain WHERE seq > ? AND op = 'commit'", &count, "chain", error);
    if (count == NULL) {
        return status;
    }
    sqlite3_bind_int64(count, 1, v->proof->log_seq);
    const int code = sqlite3_step(count);
    v->proof->log_lag = code == SQLITE_ROW ? sqlite3_column_int64(count, 0) : 0;
    return finish(v, count, code, "chain", error);
}

static gonio_status check_log(verification *v, gonio_error *error) {
    log_check c = {.v = v};
    snprintf(v->proof->log_hash, sizeof v->proof->log_hash, "%s", SESSION_CHAIN_START);
    gonio_status status = prepare(v, "SELECT hash FROM chain WHERE seq = ?", &c.hash, "chain", error);
    if (c.hash == NULL) {
        return status;
    }
    status = gonio_session_log_for(v->session->folder_fd, v->session->path, v->log_last, check_line, &c, error);
    if (status == GONIO_OK && v->log_last > 0 && !c.proven) { // no line is as short as that, or damage: all of it tells
        v->log_last = 0;
        status = gonio_session_log_for(v->session->folder_fd, v->session->path, 0, check_line, &c, error);
    }
    sqlite3_finalize(c.hash);
    status = status == GONIO_OK ? count_lag(v, error) : status;
    if (status == GONIO_OK) {
        v->proof->log = judge_log(&c);
    }
    return status;
}

// ---- all of it ----

static gonio_status check_all(verification *v, gonio_error *error) {
    session_proof *proof = v->proof;
    gonio_status status = check_pages(v, error);
    if (status == GONIO_OK && proof->chained && proof->what[0] == 0) {
        status = check_chain(v, error);
        status = status == GONIO_OK && proof->what[0] == 0 ? check_tables(v, error) : status;
    }
    proof->database = status == GONIO_OK && proof->what[0] == 0;
    if (status == GONIO_OK && proof->chained) {
        status = check_log(v, error);
    }
    proof->sound = proof->database && proof->log == SESSION_LOG_SOUND; // as it is in version 1, which has none
    return status;
}

static gonio_status verify(gonio_session *session, int64_t log_last, session_proof *proof, gonio_error *error) {
    *proof = (session_proof){.chained = session->version > 1};
    verification v = {.session = session, .proof = proof, .log_last = log_last};
    struct stat info;
    if (fstatat(session->folder_fd, "session.log", &info, AT_SYMLINK_NOFOLLOW) == 0) {
        v.log_size = info.st_size;
    }
    // One state of the database, also while another process writes.
    const bool own = !session->in_transaction && sqlite3_exec(session->db, "BEGIN", NULL, NULL, NULL) == SQLITE_OK;
    const gonio_status status = check_all(&v, error);
    if (own) {
        sqlite3_exec(session->db, "COMMIT", NULL, NULL, NULL);
    }
    return status;
}

gonio_status gonio_session_verify(gonio_session *session, session_proof *proof, gonio_error *error) {
    return verify(session, 0, proof, error);
}

gonio_status gonio_session_verify_rows(gonio_session *session, session_proof *proof, gonio_error *error) {
    return verify(session, 1 << 18, proof, error);
}

gonio_status gonio_session_vouch(const gonio_session *session, const session_proof *proof, gonio_error *error) {
    // A log that is short or damaged takes nothing from a database that proves itself.
    return proof->database && proof->log != SESSION_LOG_AHEAD && proof->log != SESSION_LOG_OTHER
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                 "the journal is damaged: %s; `gonio doctor` tells more", proof->what);
}
