// SPDX-License-Identifier: BSD-3-Clause
// A damaged journal: copy every row that SQLite still gives into a new one.
//
// Tables are read forward until damage stops them, then backward from the other end: what a damaged page between hides
// is lost, everything else is kept. Steps whose frames or samples did not survive are found by the doctor afterwards.
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/session/internal.h"

typedef struct table {
    const char *name, *order; // the key, as "a, b" and descending
    const char *order_back;
} table;

static const table tables[] = {
    {"settings", "key", "key DESC"},
    {"steps", "step", "step DESC"},
    {"frames", "step, frame", "step DESC, frame DESC"},
    {"samples", "step", "step DESC"},
    {"final_samples", "step", "step DESC"},
    {"flagged", "step", "step DESC"},
    {"events", "event", "event DESC"},
};

static int copy_rows(sqlite3 *from, sqlite3 *to, const table *what, const char *order) {
    char sql[160];
    sqlite3_stmt *rows = NULL, *insert = NULL;
    snprintf(sql, sizeof sql, "SELECT * FROM %s ORDER BY %s", what->name, order);
    int code = sqlite3_prepare_v2(from, sql, -1, &rows, NULL);
    const int columns = code == SQLITE_OK ? sqlite3_column_count(rows) : 0;
    while (code == SQLITE_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        if (insert == NULL) {
            int at = snprintf(sql, sizeof sql, "INSERT OR IGNORE INTO %s VALUES(?", what->name);
            for (int i = 1; i < columns; i++) {
                at += snprintf(sql + at, sizeof sql - (size_t)at, ",?");
            }
            snprintf(sql + at, sizeof sql - (size_t)at, ")");
            if (sqlite3_prepare_v2(to, sql, -1, &insert, NULL) != SQLITE_OK) {
                break;
            }
        }
        for (int i = 0; i < columns; i++) {
            sqlite3_bind_value(insert, i + 1, sqlite3_column_value(rows, i));
        }
        sqlite3_step(insert); // a row that violates its table is damage too, and left out
        sqlite3_reset(insert);
        code = SQLITE_OK;
    }
    sqlite3_finalize(insert);
    sqlite3_finalize(rows);
    return code;
}

static void copy_tables(sqlite3 *from, sqlite3 *to) {
    sqlite3_exec(to, "BEGIN", NULL, NULL, NULL);
    for (size_t i = 0; i < sizeof tables / sizeof *tables; i++) {
        if (copy_rows(from, to, &tables[i], tables[i].order) != SQLITE_DONE) {
            copy_rows(from, to, &tables[i], tables[i].order_back);
        }
    }
    sqlite3_exec(to,
                 "INSERT INTO events(utc, kind, text) VALUES(strftime('%Y-%m-%dT%H:%M:%fZ', 'now'), 'salvaged',"
                 " 'the journal was damaged; its readable rows were copied, the old one is session.db.damaged')",
                 NULL, NULL, NULL);
    // Rows that lost what they refer to are not done any more.
    sqlite3_exec(to,
                 "DELETE FROM frames WHERE step NOT IN (SELECT step FROM steps);"
                 "DELETE FROM samples WHERE step NOT IN (SELECT step FROM steps);"
                 "DELETE FROM final_samples WHERE step NOT IN (SELECT step FROM samples);",
                 NULL, NULL, NULL);
}

static gonio_status fill(const char *damaged, const char *fresh, gonio_error *error) {
    sqlite3 *from = NULL, *to = NULL;
    char versions[96];
    snprintf(versions, sizeof versions, "PRAGMA application_id = %d; PRAGMA user_version = %d;", SESSION_APPLICATION_ID,
             1); // the chain did not survive: opened to be written, all rows begin a new one
    gonio_status status = GONIO_OK;
    if (sqlite3_open(fresh, &to) != SQLITE_OK || sqlite3_exec(to, versions, NULL, NULL, NULL) != SQLITE_OK ||
        sqlite3_exec(to, gonio_session_schema, NULL, NULL, NULL) != SQLITE_OK) {
        status = gonio_fail_line(error, GONIO_E_IO, fresh, -1, "cannot make a new journal: %s", sqlite3_errmsg(to));
    } else if (sqlite3_open_v2(damaged, &from, SQLITE_OPEN_READWRITE, NULL) == SQLITE_OK) {
        copy_tables(from, to);
        status = sqlite3_exec(to, "COMMIT", NULL, NULL, NULL) == SQLITE_OK
                     ? GONIO_OK
                     : gonio_fail_line(error, GONIO_E_IO, fresh, -1, "cannot write it: %s", sqlite3_errmsg(to));
    } else {
        status = gonio_fail_line(error, GONIO_E_INPUT, damaged, -1, "cannot be read at all: %s", sqlite3_errmsg(from));
    }
    sqlite3_close(from);
    sqlite3_close(to);
    return status;
}

static int count_steps(const char *path) {
    sqlite3 *db = NULL;
    sqlite3_stmt *query = NULL;
    int count = 0;
    if (sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL) == SQLITE_OK &&
        sqlite3_prepare_v2(db, "SELECT count(*) FROM steps", -1, &query, NULL) == SQLITE_OK &&
        sqlite3_step(query) == SQLITE_ROW) {
        count = sqlite3_column_int(query, 0);
    }
    sqlite3_finalize(query);
    sqlite3_close(db);
    return count;
}

gonio_status gonio_session_salvage(const char *path, gonio_error *error) {
    char *damaged = NULL, *fresh = NULL, *kept = NULL;
    if (asprintf(&damaged, "%s/session.db", path) < 0 || asprintf(&fresh, "%s/session.db.new", path) < 0 ||
        asprintf(&kept, "%s/session.db.damaged", path) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for paths");
    }
    unlink(fresh);
    gonio_status status = fill(damaged, fresh, error);
    if (status == GONIO_OK && count_steps(fresh) == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, damaged, -1,
                                 "the journal is damaged and none of its steps can be read; the frames are untouched");
    }
    // The old journal's WAL belongs to it and must not be applied to the new one; closing has merged what it held.
    if (status == GONIO_OK && (link(damaged, kept) != 0 && errno != EEXIST)) {
        status = gonio_fail_line(error, GONIO_E_IO, kept, -1, "cannot keep the damaged journal: %s", strerror(errno));
    }
    if (status == GONIO_OK) {
        char *side;
        for (int i = 0; i < 2; i++) {
            if (asprintf(&side, "%s-%s", damaged, i == 0 ? "wal" : "shm") >= 0) {
                unlink(side);
                free(side);
            }
        }
        if (rename(fresh, damaged) != 0) {
            status = gonio_fail_line(error, GONIO_E_IO, damaged, -1, "cannot be replaced: %s", strerror(errno));
        }
    }
    if (status != GONIO_OK) {
        unlink(fresh);
    }
    free(damaged);
    free(fresh);
    free(kept);
    return status;
}
