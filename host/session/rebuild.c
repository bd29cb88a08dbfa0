// SPDX-License-Identifier: BSD-3-Clause
// A new journal from what is left of an old one: the union of the records and rows that session.db proves and of those
// that session.log proves. Either alone is enough.
//
// Everything is gathered in a database in memory: `record`, with the hash before each, and the row that belongs to it
// where anybody has it. Then the longest way back from a last record is followed: that is the chain.
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/session/internal.h"

typedef struct rebuilding {
    const char *path, *target;
    sqlite3 *all; // what was gathered
    sqlite3 *old; // a copy of session.db, however damaged; NULL: nothing can be made of it
    session_rebuilt *report;
    gonio_error *error;
} rebuilding;

static void note(session_rebuilt *report, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void note(session_rebuilt *report, const char *format, ...) {
    const size_t used = strlen(report->detail), room = sizeof report->detail - used;
    char line[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (strlen(line) + 2 < room) {
        snprintf(report->detail + used, room, "%s\n", line);
    }
}

static gonio_status fail_all(rebuilding *r) {
    return gonio_fail(r->error, GONIO_E_FAILED, "cannot gather the journal's records: %s", sqlite3_errmsg(r->all));
}

static gonio_status do_all(rebuilding *r, const char *sql) {
    return sqlite3_exec(r->all, sql, NULL, NULL, NULL) == SQLITE_OK ? GONIO_OK : fail_all(r);
}

static const char *text_of(sqlite3_stmt *row, int column) {
    const char *text = (const char *)sqlite3_column_text(row, column);
    return text != NULL ? text : "";
}

static const char gathering[] =
    "CREATE TABLE record(seq INTEGER, hash TEXT, prev TEXT, tbl TEXT, key TEXT, op TEXT, content TEXT, row TEXT,"
    " chosen INTEGER DEFAULT 0, PRIMARY KEY(seq, hash)); CREATE INDEX by_row ON record(tbl, key, content);"
    "CREATE INDEX newest ON record(chosen, tbl, key, seq);";

static gonio_status add_record(rebuilding *r, const session_record *record, const char *prev, const char *hash,
                               const char *row) {
    sqlite3_stmt *insert;
    if (sqlite3_prepare_v2(r->all,
                           "INSERT INTO record VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, 0) ON CONFLICT DO UPDATE SET"
                           " row = ifnull(row, ?8)",
                           -1, &insert, NULL) != SQLITE_OK) {
        return fail_all(r);
    }
    const char *const texts[] = {hash, prev, record->tbl, record->key, record->op, record->content, row};
    sqlite3_bind_int64(insert, 1, record->seq);
    for (int i = 0; i < 7; i++) {
        sqlite3_bind_text(insert, i + 2, texts[i], -1, SQLITE_TRANSIENT);
    }
    const gonio_status status = sqlite3_step(insert) == SQLITE_DONE ? GONIO_OK : fail_all(r);
    sqlite3_finalize(insert);
    return status;
}

// ---- from the log ----

static gonio_status take_line(const session_line *line, void *context, gonio_error *error) {
    (void)error;
    rebuilding *r = context;
    if (!line->proven) {
        return GONIO_OK;
    }
    char *row = line->row != NULL ? json_dumps(line->row, JSON_COMPACT | JSON_REAL_PRECISION(17)) : NULL;
    const gonio_status status = add_record(r, &line->record, line->prev, line->hash, row);
    free(row);
    return status;
}

static gonio_status take_log(rebuilding *r) {
    const int folder = open(r->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) {
        return gonio_fail_line(r->error, GONIO_E_INPUT, r->path, -1, "cannot open the session: %s", strerror(errno));
    }
    const gonio_status status = gonio_session_log_for(folder, r->path, 0, take_line, r, r->error);
    close(folder);
    return status;
}

// ---- from the database ----

// Call for the rows of a query and for those from its other end, as far as damage lets each be read.
typedef gonio_status (*row_fn)(rebuilding *r, sqlite3_stmt *row, const session_table *table);
static gonio_status from_both_ends(rebuilding *r, const char *columns, const session_table *table, const char *name,
                                   const char *const *order, row_fn call) {
    gonio_status status = GONIO_OK;
    for (int back = 0; status == GONIO_OK && back < 2; back++) {
        char sql[SESSION_COLUMNS_SQL + 128];
        snprintf(sql, sizeof sql, "SELECT %s FROM %s ORDER BY %s", columns, name, order[back]);
        sqlite3_stmt *rows = NULL;
        int code = sqlite3_prepare_v2(r->old, sql, -1, &rows, NULL);
        while (status == GONIO_OK && rows != NULL && (code = sqlite3_step(rows)) == SQLITE_ROW) {
            status = call(r, rows, table);
        }
        sqlite3_finalize(rows);
        if (code == SQLITE_DONE) {
            break;
        }
    }
    return status;
}

// Records that follow from the one before, whatever that one's own fields say.
static gonio_status take_record(rebuilding *r, sqlite3_stmt *row, const session_table *table) {
    (void)table;
    const session_record record = {sqlite3_column_int64(row, 0), text_of(row, 1), text_of(row, 2), text_of(row, 3),
                                   text_of(row, 4)};
    const char *prev = record.seq == 1 ? SESSION_CHAIN_START : text_of(row, 6), *found = text_of(row, 5);
    char hash[GONIO_SHA256_HEX];
    if (gonio_session_record_hash(prev, &record, hash, NULL) != GONIO_OK || strcmp(hash, found) != 0) {
        return GONIO_OK;
    }
    return add_record(r, &record, prev, hash, NULL);
}

static gonio_status take_row(rebuilding *r, sqlite3_stmt *row, const session_table *table) {
    char content[GONIO_SHA256_HEX];
    sqlite3_stmt *update;
    if (gonio_session_row_hash(table, row, 1, content, NULL) != GONIO_OK ||
        sqlite3_prepare_v2(r->all,
                           "UPDATE record SET row = ?1 WHERE tbl = ?2 AND key = ?3 AND content = ?4 AND row IS"
                           " NULL",
                           -1, &update, NULL) != SQLITE_OK) {
        return fail_all(r);
    }
    json_t *object = gonio_session_row_json(table, row, 1);
    char *text = object != NULL ? json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(17)) : NULL;
    json_decref(object);
    const char *const texts[] = {text, table->name, text_of(row, 0), content};
    for (int i = 0; i < 4; i++) {
        sqlite3_bind_text(update, i + 1, texts[i], -1, SQLITE_TRANSIENT);
    }
    const gonio_status status = sqlite3_step(update) == SQLITE_DONE ? GONIO_OK : fail_all(r);
    sqlite3_finalize(update);
    free(text);
    return status;
}

static gonio_status take_database(rebuilding *r) {
    static const char *const by_seq[] = {"seq", "seq DESC"};
    gonio_status status = from_both_ends(r,
                                         "seq, tbl, key, op, content, hash,"
                                         " (SELECT hash FROM chain AS p WHERE p.seq = chain.seq - 1)",
                                         NULL, "chain", by_seq, take_record);
    for (const session_table *t = gonio_session_tables; status == GONIO_OK && t->name != NULL; t++) {
        char key[SESSION_KEY_SQL], columns[SESSION_COLUMNS_SQL], both[SESSION_COLUMNS_SQL + SESSION_KEY_SQL + 2];
        // The key's columns stand behind the key as a text.
        static const char *const by_one[] = {"2", "2 DESC"}, *const by_two[] = {"2, 3", "2 DESC, 3 DESC"};
        gonio_session_key_sql(t, "", key);
        gonio_session_list_columns(t, "", columns);
        snprintf(both, sizeof both, "%s, %s", key, columns);
        status = from_both_ends(r, both, t, t->name, t->keys[1] != NULL ? by_two : by_one, take_row);
    }
    return status;
}

// ---- the chain ----

static gonio_status query_head(rebuilding *r, const char *sql, int64_t below, int64_t *seq,
                               char hash[GONIO_SHA256_HEX]) {
    sqlite3_stmt *query;
    *seq = 0;
    if (sqlite3_prepare_v2(r->all, sql, -1, &query, NULL) != SQLITE_OK) {
        return fail_all(r);
    }
    sqlite3_bind_int64(query, 1, below);
    if (sqlite3_step(query) == SQLITE_ROW) {
        *seq = sqlite3_column_int64(query, 0);
        snprintf(hash, GONIO_SHA256_HEX, "%s", text_of(query, 1));
    }
    sqlite3_finalize(query);
    return GONIO_OK;
}

// From a record back to the first, or to a gap; *seq is where it ends.
static gonio_status choose_back(rebuilding *r, int64_t *seq, char hash[GONIO_SHA256_HEX]) {
    sqlite3_stmt *choose;
    if (sqlite3_prepare_v2(r->all, "UPDATE record SET chosen = 1 WHERE seq = ? AND hash = ? RETURNING prev", -1,
                           &choose, NULL) != SQLITE_OK) {
        return fail_all(r);
    }
    bool found = true;
    while (found) {
        sqlite3_reset(choose);
        sqlite3_bind_int64(choose, 1, *seq);
        sqlite3_bind_text(choose, 2, hash, -1, SQLITE_TRANSIENT);
        found = sqlite3_step(choose) == SQLITE_ROW;
        if (found) {
            snprintf(hash, GONIO_SHA256_HEX, "%s", text_of(choose, 0));
            sqlite3_step(choose);
            --*seq;
        }
    }
    sqlite3_finalize(choose);
    return GONIO_OK;
}

// From the last record on; behind a gap, from the last one before it.
static gonio_status choose_chain(rebuilding *r) {
    char hash[GONIO_SHA256_HEX];
    int64_t seq, below = INT64_MAX, others = 0;
    gonio_status status = GONIO_OK;
    for (;;) {
        status = query_head(r, "SELECT seq, hash FROM record WHERE seq < ? ORDER BY seq DESC, hash LIMIT 1", below,
                            &seq, hash);
        if (status != GONIO_OK || seq == 0) {
            break;
        }
        status = choose_back(r, &seq, hash);
        if (status != GONIO_OK || seq == 0) {
            r->report->complete = below == INT64_MAX;
            break;
        }
        below = seq;
    }
    if (status == GONIO_OK) {
        status =
            query_head(r, "SELECT count(*), '' FROM record WHERE seq < ? AND NOT chosen", INT64_MAX, &others, hash);
        r->report->forked = others > 0;
    }
    return status;
}

// ---- the new journal ----

// The newest record of each row on the chain, with the row; NULL row where nobody has it.
#define NEWEST                                                                                                         \
    "SELECT tbl, key, row FROM (SELECT tbl, key, op, row, max(seq) FROM record WHERE chosen AND tbl = ? GROUP BY key)" \
    " WHERE op = 'put'"

static gonio_status fail_new(rebuilding *r, sqlite3 *db) {
    return gonio_fail_line(r->error, GONIO_E_IO, r->target, -1, "cannot make the new journal: %s", sqlite3_errmsg(db));
}

static gonio_status put_row(rebuilding *r, sqlite3 *db, const session_table *table, sqlite3_stmt *insert,
                            const char *key, const char *text) {
    json_t *row = text != NULL ? json_loads(text, 0, NULL) : NULL;
    sqlite3_reset(insert);
    const bool good = row != NULL && gonio_session_row_bind(table, insert, row);
    json_decref(row);
    if (!good) {
        r->report->lost++;
        note(r->report, "table %s, row %s is lost", table->name, key);
        return GONIO_OK;
    }
    r->report->rows++;
    return sqlite3_step(insert) == SQLITE_DONE ? GONIO_OK : fail_new(r, db);
}

static gonio_status put_rows(rebuilding *r, sqlite3 *db, const session_table *table) {
    char columns[SESSION_COLUMNS_SQL], marks[3 * SESSION_COLUMNS] = "?", sql[SESSION_COLUMNS_SQL + 256];
    for (int i = 1; i < gonio_session_columns(table); i++) {
        strcat(marks, ", ?");
    }
    gonio_session_list_columns(table, "", columns);
    snprintf(sql, sizeof sql, "INSERT INTO %s(%s) VALUES(%s)", table->name, columns, marks);
    sqlite3_stmt *insert = NULL, *rows = NULL;
    gonio_status status = sqlite3_prepare_v2(db, sql, -1, &insert, NULL) == SQLITE_OK ? GONIO_OK : fail_new(r, db);
    if (status == GONIO_OK && sqlite3_prepare_v2(r->all, NEWEST, -1, &rows, NULL) != SQLITE_OK) {
        status = fail_all(r);
    }
    sqlite3_bind_text(rows, 1, table->name, -1, SQLITE_STATIC);
    while (status == GONIO_OK && sqlite3_step(rows) == SQLITE_ROW) {
        status = put_row(r, db, table, insert, text_of(rows, 1), (const char *)sqlite3_column_text(rows, 2));
    }
    sqlite3_finalize(insert);
    sqlite3_finalize(rows);
    return status;
}

// The chain as it was, so that a log goes on with it.
static gonio_status put_chain(rebuilding *r, sqlite3 *db) {
    sqlite3_stmt *insert = NULL, *rows = NULL;
    gonio_status status =
        sqlite3_prepare_v2(db, "INSERT INTO chain VALUES(?, ?, ?, ?, ?, ?)", -1, &insert, NULL) == SQLITE_OK
            ? GONIO_OK
            : fail_new(r, db);
    if (status == GONIO_OK &&
        sqlite3_prepare_v2(r->all, "SELECT seq, tbl, key, op, content, hash FROM record WHERE chosen ORDER BY seq", -1,
                           &rows, NULL) != SQLITE_OK) {
        status = fail_all(r);
    }
    while (status == GONIO_OK && sqlite3_step(rows) == SQLITE_ROW) {
        sqlite3_reset(insert);
        for (int i = 0; i < 6; i++) {
            sqlite3_bind_value(insert, i + 1, sqlite3_column_value(rows, i));
        }
        status = sqlite3_step(insert) == SQLITE_DONE ? GONIO_OK : fail_new(r, db);
    }
    sqlite3_finalize(insert);
    sqlite3_finalize(rows);
    return status;
}

static gonio_status put_log(rebuilding *r, FILE *file) {
    sqlite3_stmt *rows;
    if (sqlite3_prepare_v2(r->all,
                           "SELECT seq, tbl, key, op, content, hash, prev, row FROM record WHERE chosen ORDER BY seq",
                           -1, &rows, NULL) != SQLITE_OK) {
        return fail_all(r);
    }
    bool good = true;
    while (good && sqlite3_step(rows) == SQLITE_ROW) {
        const session_record record = {sqlite3_column_int64(rows, 0), text_of(rows, 1), text_of(rows, 2),
                                       text_of(rows, 3), text_of(rows, 4)};
        const char *row = (const char *)sqlite3_column_text(rows, 7);
        json_t *line = gonio_session_line_json(&record, text_of(rows, 6), text_of(rows, 5),
                                               row != NULL ? json_loads(row, 0, NULL) : NULL);
        good = json_dumpf(line, file, JSON_COMPACT | JSON_REAL_PRECISION(17)) == 0 && fputc('\n', file) != EOF;
        json_decref(line);
    }
    sqlite3_finalize(rows);
    return good ? GONIO_OK
                : gonio_fail_line(r->error, GONIO_E_IO, r->target, -1, "cannot write session.log: %s", strerror(errno));
}

static gonio_status make_log(rebuilding *r, int folder) {
    const int fd = openat(folder, "session.log", O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    FILE *file = fd >= 0 ? fdopen(fd, "w") : NULL;
    if (file == NULL) {
        return gonio_fail_line(r->error, GONIO_E_IO, r->target, -1, "cannot make session.log: %s", strerror(errno));
    }
    gonio_status status = put_log(r, file);
    const bool synced = fflush(file) == 0 && fsync(fd) == 0;
    if ((fclose(file) != 0 || !synced) && status == GONIO_OK) {
        status = gonio_fail_line(r->error, GONIO_E_IO, r->target, -1, "cannot write session.log: %s", strerror(errno));
    }
    return status;
}

static gonio_status fill(rebuilding *r, sqlite3 *db) {
    char begin[160];
    snprintf(begin, sizeof begin,
             "PRAGMA synchronous = FULL; PRAGMA application_id = %d; PRAGMA user_version = %d; BEGIN",
             SESSION_APPLICATION_ID,
             r->report->complete ? GONIO_SESSION_VERSION : 1); // without a chain: opened, its rows begin one
    gonio_status status = sqlite3_exec(db, begin, NULL, NULL, NULL) == SQLITE_OK &&
                                  sqlite3_exec(db, gonio_session_schema, NULL, NULL, NULL) == SQLITE_OK
                              ? GONIO_OK
                              : fail_new(r, db);
    for (const session_table *t = gonio_session_tables; status == GONIO_OK && t->name != NULL; t++) {
        status = put_rows(r, db, t);
    }
    status = status == GONIO_OK && r->report->complete ? put_chain(r, db) : status;
    if (status == GONIO_OK && sqlite3_exec(db, "COMMIT", NULL, NULL, NULL) != SQLITE_OK) {
        status = fail_new(r, db);
    }
    return status;
}

static gonio_status make_database(rebuilding *r) {
    char *file;
    sqlite3 *db = NULL;
    if (asprintf(&file, "%s/session.db", r->target) < 0) {
        return gonio_fail(r->error, GONIO_E_MEMORY, "no memory for a path");
    }
    const gonio_status status = sqlite3_open(file, &db) == SQLITE_OK ? fill(r, db) : fail_new(r, db);
    sqlite3_close(db);
    free(file);
    return status;
}

// ---- what the new journal says of it ----

// The chain tells of rows that are not there any more: now it tells that they are gone, too.
static gonio_status enter_lost(rebuilding *r, gonio_session *session) {
    sqlite3_stmt *rows;
    gonio_status status = GONIO_OK;
    for (const session_table *t = gonio_session_tables; status == GONIO_OK && t->name != NULL; t++) {
        if (sqlite3_prepare_v2(r->all, NEWEST " AND row IS NULL", -1, &rows, NULL) != SQLITE_OK) {
            return fail_all(r);
        }
        sqlite3_bind_text(rows, 1, t->name, -1, SQLITE_STATIC);
        while (status == GONIO_OK && sqlite3_step(rows) == SQLITE_ROW) {
            status = gonio_session_do(session, r->error, "INSERT INTO touched VALUES(?, ?)", "tt", t->name,
                                      text_of(rows, 1));
        }
        sqlite3_finalize(rows);
    }
    return status;
}

static gonio_status enter_all(rebuilding *r, gonio_session *session) {
    // Rows of a step that is lost say nothing any more; and what is not whole is not finished.
    static const char orphans[] = "DELETE FROM frames WHERE step NOT IN (SELECT step FROM steps);"
                                  "DELETE FROM samples WHERE step NOT IN (SELECT step FROM steps);"
                                  "DELETE FROM flagged WHERE step NOT IN (SELECT step FROM steps);"
                                  "DELETE FROM final_samples; DELETE FROM settings WHERE key LIKE 'result.%'";
    char text[256];
    snprintf(text, sizeof text, "the journal was made anew from what is left of it: %lld rows, %lld are lost%s",
             (long long)r->report->rows, (long long)r->report->lost,
             r->report->complete ? "" : "; its chain had gaps and begins anew");
    gonio_status status = enter_lost(r, session);
    if (status == GONIO_OK && (r->report->lost > 0 || !r->report->complete)) {
        status = gonio_session_exec(session, orphans, r->error);
    }
    return status == GONIO_OK ? gonio_session_event(session, "rebuilt", text, r->error) : status;
}

static gonio_status enter(rebuilding *r) {
    gonio_session *session;
    gonio_status status = gonio_session_open_journal(r->target, &session, r->error);
    if (status == GONIO_OK) {
        status = gonio_session_begin(session, r->error);
        status = status == GONIO_OK ? gonio_session_end(session, enter_all(r, session), r->error) : status;
        gonio_session_close(session);
    }
    return status;
}

// ---- all of it ----

static gonio_status gather(rebuilding *r) {
    gonio_status status = sqlite3_open(":memory:", &r->all) == SQLITE_OK ? do_all(r, gathering) : fail_all(r);
    status = status == GONIO_OK ? take_log(r) : status;
    status = status == GONIO_OK && r->old != NULL ? take_database(r) : status;
    status = status == GONIO_OK ? choose_chain(r) : status;
    int64_t records = 0;
    char ignored[GONIO_SHA256_HEX];
    status = status == GONIO_OK ? query_head(r, "SELECT count(*), '' FROM record WHERE chosen AND seq < ?", INT64_MAX,
                                             &records, ignored)
                                : status;
    return status == GONIO_OK && records == 0
               ? gonio_fail_line(r->error, GONIO_E_INPUT, r->path, -1,
                                 "neither session.db nor session.log proves any of its rows")
               : status;
}

static gonio_status make(rebuilding *r) {
    const int folder = open(r->target, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) {
        return gonio_fail_line(r->error, GONIO_E_IO, r->target, -1, "cannot open it: %s", strerror(errno));
    }
    gonio_status status = make_database(r);
    status = status == GONIO_OK && r->report->complete ? make_log(r, folder) : status;
    status = status == GONIO_OK ? enter(r) : status;
    if (status == GONIO_OK && fsync(folder) != 0) {
        status = gonio_fail_line(r->error, GONIO_E_IO, r->target, -1, "cannot sync it: %s", strerror(errno));
    }
    close(folder);
    return status;
}

gonio_status gonio_session_rebuild(const char *path, const char *target, session_rebuilt *report, gonio_error *error) {
    *report = (session_rebuilt){0};
    rebuilding r = {.path = path, .target = target, .report = report, .error = error};
    session_copy copy;
    gonio_status status = gonio_session_copy_open(path, target, &copy, error);
    if (status == GONIO_OK) {
        r.old = copy.db;
        status = gather(&r);
        gonio_session_copy_close(&copy);
    }
    status = status == GONIO_OK ? make(&r) : status;
    sqlite3_close(r.all);
    return status;
}
