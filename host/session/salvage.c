// SPDX-License-Identifier: BSD-3-Clause
// A damaged journal: copy every row that SQLite still gives into a new one.
//
// Tables are read forward until damage stops them, then backward from the other end: what a damaged page between hides
// is lost, everything else is kept. Steps whose frames or samples did not survive are found by the doctor afterwards.
#include <stdio.h>
#include <string.h>

#include "host/session/internal.h"

enum { SQL = 1024 };

// INSERT of the columns that a row of the old table has and the new table knows; the rest of either stays out.
static sqlite3_stmt *insert_like(sqlite3 *to, const session_table *table, sqlite3_stmt *rows, int *taken) {
    char sql[SQL], marks[3 * SESSION_COLUMNS + 1] = "";
    int n = snprintf(sql, sizeof sql, "INSERT OR IGNORE INTO %s(", table->name), count = 0;
    for (int i = 0; i < sqlite3_column_count(rows); i++) {
        for (int k = 0; k < gonio_session_columns(table) && count < SESSION_COLUMNS; k++) {
            if (strcmp(sqlite3_column_name(rows, i), table->columns[k]) == 0) {
                n += snprintf(sql + n, sizeof sql - (size_t)n, "%s%s", count > 0 ? "," : "", table->columns[k]);
                strcat(marks, count > 0 ? ",?" : "?");
                taken[count++] = i;
            }
        }
    }
    snprintf(sql + n, sizeof sql - (size_t)n, ") VALUES(%s)", marks);
    taken[count] = -1;
    sqlite3_stmt *insert = NULL;
    sqlite3_prepare_v2(to, sql, -1, &insert, NULL);
    return insert;
}

// *left_out: rows that violate their table, which is damage too.
static int copy_rows(sqlite3 *from, sqlite3 *to, const session_table *table, bool backward, int64_t *left_out) {
    char sql[SQL];
    const char *down = backward ? " DESC" : "", *second = table->keys[1];
    sqlite3_stmt *rows = NULL, *insert = NULL;
    int taken[SESSION_COLUMNS + 1];
    snprintf(sql, sizeof sql, "SELECT * FROM %s ORDER BY %s%s%s%s%s", table->name, table->keys[0], down,
             second != NULL ? ", " : "", second != NULL ? second : "", second != NULL ? down : "");
    int code = sqlite3_prepare_v2(from, sql, -1, &rows, NULL);
    while (code == SQLITE_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        insert = insert != NULL ? insert : insert_like(to, table, rows, taken);
        if (insert == NULL) {
            break;
        }
        for (int i = 0; taken[i] >= 0; i++) {
            sqlite3_bind_value(insert, i + 1, sqlite3_column_value(rows, taken[i]));
        }
        *left_out += sqlite3_step(insert) != SQLITE_DONE || sqlite3_changes(to) == 0;
        sqlite3_reset(insert);
        code = SQLITE_OK;
    }
    sqlite3_finalize(insert);
    sqlite3_finalize(rows);
    return code;
}

static void copy_table(sqlite3 *from, sqlite3 *to, const session_table *table, gonio_doctor_report *report) {
    int64_t left_out = 0, known = 0;
    const int code = copy_rows(from, to, table, false, &left_out);
    // Sessions of earlier releases lack tables.
    if (code == SQLITE_ERROR && (strcmp(table->name, "flagged") == 0 || strcmp(table->name, "hosts") == 0)) {
        return;
    }
    if (code != SQLITE_DONE) {
        gonio_doctor_note(report, "rows of table %s are lost: %s", table->name, sqlite3_errmsg(from));
        report->rows_lost++;
        copy_rows(from, to, table, true, &known);
    }
    if (left_out > 0) {
        gonio_doctor_note(report, "%lld rows of table %s are lost: no session has such", (long long)left_out,
                          table->name);
        report->rows_lost += left_out;
    }
}

static void copy_tables(sqlite3 *from, sqlite3 *to, gonio_doctor_report *report) {
    sqlite3_exec(to, "BEGIN", NULL, NULL, NULL);
    for (const session_table *t = gonio_session_tables; t->name != NULL; t++) {
        copy_table(from, to, t, report);
    }
    // A session that lost anything is not called finished: `gonio resume` finishes it, where that is possible.
    if (report->rows_lost > 0) {
        sqlite3_exec(to, "DELETE FROM final_samples; DELETE FROM settings WHERE key LIKE 'result.%'", NULL, NULL, NULL);
    }
    sqlite3_exec(to,
                 "INSERT INTO events(utc, kind, text) VALUES(strftime('%Y-%m-%dT%H:%M:%fZ', 'now'), 'salvaged',"
                 " 'the journal was damaged; its readable rows were copied')",
                 NULL, NULL, NULL);
    // Rows that lost what they refer to are not done any more.
    sqlite3_exec(to,
                 "DELETE FROM frames WHERE step NOT IN (SELECT step FROM steps);"
                 "DELETE FROM samples WHERE step NOT IN (SELECT step FROM steps);"
                 "DELETE FROM flagged WHERE step NOT IN (SELECT step FROM steps);"
                 "DELETE FROM final_samples WHERE step NOT IN (SELECT step FROM samples);",
                 NULL, NULL, NULL);
}

static gonio_status fill(const char *damaged, const char *fresh, gonio_doctor_report *report, gonio_error *error) {
    sqlite3 *from = NULL, *to = NULL;
    char versions[96];
    snprintf(versions, sizeof versions, "PRAGMA application_id = %d; PRAGMA user_version = %d;", SESSION_APPLICATION_ID,
             1); // the chain did not survive: opened to be written, all rows begin a new one
    gonio_status status = GONIO_OK;
    if (sqlite3_open(fresh, &to) != SQLITE_OK || sqlite3_exec(to, versions, NULL, NULL, NULL) != SQLITE_OK ||
        sqlite3_exec(to, gonio_session_schema, NULL, NULL, NULL) != SQLITE_OK) {
        status = gonio_fail_line(error, GONIO_E_IO, fresh, -1, "cannot make a new journal: %s", sqlite3_errmsg(to));
    } else if (sqlite3_open_v2(damaged, &from, SQLITE_OPEN_READWRITE, NULL) == SQLITE_OK) {
        copy_tables(from, to, report);
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

gonio_status gonio_session_salvage(const char *damaged, const char *fresh, gonio_doctor_report *report,
                                   gonio_error *error) {
    const gonio_status status = fill(damaged, fresh, report, error);
    return status == GONIO_OK && count_steps(fresh) == 0
               ? gonio_fail_line(error, GONIO_E_INPUT, "session.db", -1,
                                 "the journal is damaged and none of its steps can be read; nothing was changed")
               : status;
}
