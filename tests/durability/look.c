// SPDX-License-Identifier: BSD-3-Clause
// The harness' own look at a session: what it holds, not what the program says about it.
#include <ctype.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "tests/durability/campaign.h"

// A look must change nothing: on a copy of the journal and its log of changes.
static sqlite3 *open_copy(worker *w, const char *session) {
    static const char *const ends[] = {"", "-wal", "-journal"};
    sqlite3 *db = NULL;
    char from[400], to[400];
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        snprintf(to, sizeof to, "%s/look.db%s", w->scratch, ends[i]);
        unlink(to);
        snprintf(from, sizeof from, "%s/session.db%s", session, ends[i]);
        const tree_bytes bytes = tree_read(from);
        if (bytes.data != NULL) {
            tree_write(to, bytes.data, bytes.size);
        } else if (i == 0) {
            return NULL;
        }
        free(bytes.data);
    }
    snprintf(to, sizeof to, "%s/look.db-shm", w->scratch);
    unlink(to);
    snprintf(to, sizeof to, "%s/look.db", w->scratch);
    if (sqlite3_open_v2(to, &db, SQLITE_OPEN_READWRITE, NULL) != SQLITE_OK ||
        sqlite3_exec(db, "PRAGMA cell_size_check = ON; PRAGMA trusted_schema = OFF", NULL, NULL, NULL) != SQLITE_OK) {
        sqlite3_close(db);
        return NULL;
    }
    return db;
}

static int64_t one_number(sqlite3 *db, const char *sql) {
    sqlite3_stmt *query = NULL;
    int64_t number = -1;
    if (sqlite3_prepare_v2(db, sql, -1, &query, NULL) == SQLITE_OK && sqlite3_step(query) == SQLITE_ROW) {
        number = sqlite3_column_int64(query, 0);
    }
    sqlite3_finalize(query);
    return number;
}

int64_t look_done(worker *w, const char *session, bool *finished) {
    sqlite3 *db = open_copy(w, session);
    const int64_t done = db != NULL ? one_number(db, "SELECT count(*) FROM steps WHERE done = 1") : -1;
    *finished = db != NULL && one_number(db, "SELECT count(*) FROM settings WHERE key = 'result.samples_sha256'") == 1;
    sqlite3_close(db);
    return done;
}

// ---- all values ----

static void put_value(FILE *out, sqlite3_stmt *row, int column) {
    const int type = sqlite3_column_type(row, column);
    if (type == SQLITE_FLOAT) {
        fprintf(out, " %.17g", sqlite3_column_double(row, column));
    } else if (type == SQLITE_INTEGER) {
        fprintf(out, " %lld", (long long)sqlite3_column_int64(row, column));
    } else if (type == SQLITE_NULL) {
        fprintf(out, " null");
    } else {
        const unsigned char *bytes = sqlite3_column_blob(row, column);
        const int n = sqlite3_column_bytes(row, column);
        fprintf(out, type == SQLITE_TEXT ? " t'" : " b'");
        for (int i = 0; i < n; i++) {
            if (type == SQLITE_TEXT && bytes[i] >= ' ' && bytes[i] < 127) {
                fputc(bytes[i], out);
            } else {
                fprintf(out, "\\%02x", bytes[i]);
            }
        }
        fputc('\'', out);
    }
}

static bool put_table(FILE *out, sqlite3 *db, const char *table) {
    char sql[200];
    sqlite3_stmt *rows = NULL;
    snprintf(sql, sizeof sql, "SELECT * FROM \"%.100s\" ORDER BY 1, 2", table);
    int code = sqlite3_prepare_v2(db, sql, -1, &rows, NULL);
    if (code != SQLITE_OK) { // a table of one column
        snprintf(sql, sizeof sql, "SELECT * FROM \"%.100s\" ORDER BY 1", table);
        code = sqlite3_prepare_v2(db, sql, -1, &rows, NULL);
    }
    while (code == SQLITE_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        fprintf(out, "%s", table);
        for (int i = 0; i < sqlite3_column_count(rows); i++) {
            put_value(out, rows, i);
        }
        fputc('\n', out);
        code = SQLITE_OK;
    }
    sqlite3_finalize(rows);
    return code == SQLITE_DONE;
}

static bool put_database(FILE *out, sqlite3 *db) {
    sqlite3_stmt *tables = NULL;
    bool sound =
        sqlite3_prepare_v2(db, "SELECT name, sql FROM sqlite_master ORDER BY name", -1, &tables, NULL) == SQLITE_OK;
    int code = SQLITE_DONE;
    fprintf(out, "version %lld %lld\n", (long long)one_number(db, "PRAGMA application_id"),
            (long long)one_number(db, "PRAGMA user_version"));
    while (sound && (code = sqlite3_step(tables)) == SQLITE_ROW) {
        const char *name = (const char *)sqlite3_column_text(tables, 0),
                   *sql = (const char *)sqlite3_column_text(tables, 1);
        fprintf(out, "schema %s %s\n", name != NULL ? name : "", sql != NULL ? sql : "");
        if (sql != NULL && strncmp(sql, "CREATE TABLE", 12) == 0) {
            sound = name != NULL && put_table(out, db, name);
        }
    }
    sqlite3_finalize(tables);
    return sound && code == SQLITE_DONE;
}

static int by_path(const void *a, const void *b) {
    return strcmp(((const tree_file *)a)->path, ((const tree_file *)b)->path);
}

// A frame that no row tells of is what a stopped step left: nobody vouches for it.
static bool is_stray(sqlite3 *db, const char *path) {
    sqlite3_stmt *query = NULL;
    if (strncmp(path, "frames/", 7) != 0 ||
        sqlite3_prepare_v2(db, "SELECT 1 FROM frames WHERE file = ?", -1, &query, NULL) != SQLITE_OK) {
        return false;
    }
    sqlite3_bind_text(query, 1, path + 7, -1, SQLITE_STATIC);
    const bool stray = sqlite3_step(query) == SQLITE_DONE;
    sqlite3_finalize(query);
    return stray;
}

static void put_files(FILE *out, sqlite3 *db, const char *session) {
    tree_list list = tree_files(session);
    qsort(list.files, list.n, sizeof *list.files, by_path);
    for (size_t i = 0; i < list.n; i++) {
        const tree_file *f = &list.files[i];
        if (strncmp(f->path, "session.db", 10) != 0 && strcmp(f->path, "session.log") != 0 && !is_stray(db, f->path)) {
            fprintf(out, "file %s %016llx\n", f->path, (unsigned long long)(f->pixels != 0 ? f->pixels : f->content));
        }
    }
    tree_files_free(&list);
}

char *look_values(worker *w, const char *session) {
    char *text = NULL;
    size_t n;
    sqlite3 *db = open_copy(w, session);
    FILE *out = db != NULL ? open_memstream(&text, &n) : NULL;
    const bool sound = out != NULL && put_database(out, db);
    if (out != NULL) {
        put_files(out, db, session);
        fclose(out);
    }
    sqlite3_close(db);
    if (!sound) {
        free(text);
        text = NULL;
    }
    return text;
}

// ---- the log ----

// The end of the last transaction but one: the log may lag by one, and be torn in it.
static size_t vouched(const tree_bytes *log) {
    static const char commit[] = "\"op\":\"commit\"";
    int commits = 0;
    for (size_t end = log->size, i = log->size; i-- > 0;) {
        end = log->data[i] == '\n' ? i + 1 : end;
        if (log->size - i >= sizeof commit - 1 && memcmp(log->data + i, commit, sizeof commit - 1) == 0 &&
            ++commits == 2) {
            return end;
        }
    }
    return 0;
}

// Letters of numbers and of hexadecimal digits mean the same in both cases: 1e-5 and 1E-5.
static int folded(const unsigned char *data, size_t i) {
    const bool digits = i > 0 && (isxdigit(data[i - 1]) || data[i - 1] == '"');
    return digits && data[i] >= 'A' && data[i] <= 'F' ? data[i] - 'A' + 'a' : data[i];
}

bool look_log_changed(const char *sound, const char *session) {
    char path[400];
    snprintf(path, sizeof path, "%s/session.log", sound);
    tree_bytes before = tree_read(path);
    snprintf(path, sizeof path, "%s/session.log", session);
    tree_bytes after = tree_read(path);
    const size_t n = before.data != NULL ? vouched(&before) : 0;
    bool changed = after.size < n;
    for (size_t i = 0; i < n && !changed; i++) {
        changed = folded(before.data, i) != folded(after.data, i);
    }
    free(before.data);
    free(after.data);
    return changed;
}

void look_missing(const char *before, const char *after, char *text, size_t room) {
    static const char *const tables[] = {"settings ",      "hosts ",   "steps ",    "frames ", "samples ",
                                         "final_samples ", "flagged ", "radiance ", "files ",  "events "};
    text[0] = 0;
    for (const char *line = before; *line != 0; line += strcspn(line, "\n") + 1) {
        const size_t n = strcspn(line, "\n") + 1;
        bool stored = false, found = false;
        for (size_t t = 0; t < sizeof tables / sizeof *tables; t++) {
            stored = stored || strncmp(line, tables[t], strlen(tables[t])) == 0;
        }
        for (const char *at = after; stored && !found && *at != 0; at += strcspn(at, "\n") + 1) {
            found = strncmp(at, line, n) == 0;
        }
        if (stored && !found) {
            snprintf(text, room, "%.*s", n < 120 ? (int)n - 1 : 120, line);
            return;
        }
    }
}

void look_difference(const char *a, const char *b, char *text, size_t room) {
    size_t line = 0, i = 0;
    while (a[i] != 0 && a[i] == b[i]) {
        i++;
        line = a[i - 1] == '\n' ? i : line;
    }
    // What differs, with what stands before it in its line.
    const size_t from = i - line > 60 ? i - 60 : line;
    snprintf(text, room, "'%.*s' was '%.*s'", (int)strcspn(b + from, "\n") < 110 ? (int)strcspn(b + from, "\n") : 110,
             b + from, (int)strcspn(a + from, "\n") < 110 ? (int)strcspn(a + from, "\n") : 110, a + from);
}
