// SPDX-License-Identifier: BSD-3-Clause
// Sessions come from elsewhere. Here is what stands between one and the machine: files that are opened are plain files
// of the session's own folder, and the database holds the session's tables, sound ones, and nothing that SQLite would
// run by itself.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"
#include "host/session/internal.h"

// ---- files ----

static const char *what_it_is(mode_t mode) {
    return S_ISDIR(mode)    ? "a folder"
           : S_ISFIFO(mode) ? "a pipe"
           : S_ISSOCK(mode) ? "a socket"
           : S_ISLNK(mode)  ? "a symbolic link"
                            : "a device";
}

gonio_status gonio_session_open_plain(int folder, const char *name, const char *shown, int64_t limit, int *fd,
                                      int64_t *size, gonio_error *error) {
    struct stat info = {0};
    *size = 0;
    *fd = openat(folder, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (*fd < 0) {
        const int why = errno;
        if (fstatat(folder, name, &info, AT_SYMLINK_NOFOLLOW) == 0 && !S_ISREG(info.st_mode)) {
            return gonio_fail_line(error, GONIO_E_INPUT, shown, -1, "found %s, expected a file",
                                   what_it_is(info.st_mode));
        }
        const bool missing = why == ENOENT || why == ENOTDIR || why == ELOOP || why == ENAMETOOLONG;
        return gonio_fail_line(error, missing ? GONIO_E_INPUT : GONIO_E_IO, shown, -1, "cannot open it: %s",
                               strerror(why));
    }
    gonio_status status = GONIO_OK;
    if (fstat(*fd, &info) != 0) {
        status = gonio_fail_line(error, GONIO_E_IO, shown, -1, "cannot open it: %s", strerror(errno));
    } else if (!S_ISREG(info.st_mode)) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, shown, -1, "found %s, expected a file", what_it_is(info.st_mode));
    } else if (info.st_size > limit) {
        status = gonio_fail_line(error, GONIO_E_INPUT, shown, -1, "found %lld bytes, expected at most %lld",
                                 (long long)info.st_size, (long long)limit);
    }
    if (status != GONIO_OK) {
        close(*fd);
        *fd = -1;
    }
    *size = info.st_size;
    return status;
}

gonio_status gonio_session_check_file(gonio_session *session, const char *name, int64_t limit, gonio_error *error) {
    char *shown;
    if (asprintf(&shown, "%s/%s", session->path, name) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    int fd;
    int64_t size;
    const gonio_status status = gonio_session_open_plain(session->folder_fd, name, shown, limit, &fd, &size, error);
    if (status == GONIO_OK) {
        close(fd);
    }
    free(shown);
    return status;
}

// ---- the database's files ----

// The last bytes of a rollback journal that belongs to a transaction over several databases. SQLite would open, and
// delete, the file that such a journal names, wherever it is. Gonio never writes one.
static bool names_another_file(int fd, int64_t size) {
    static const unsigned char magic[8] = {0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7};
    unsigned char tail[8];
    return size >= 8 && pread(fd, tail, sizeof tail, size - 8) == 8 && memcmp(tail, magic, sizeof magic) == 0;
}

static gonio_status check_database_file(int folder, const char *name, const char *shown, gonio_error *error) {
    struct stat info;
    // Not opened, but for the rollback journal: closing one of SQLite's files gives up the locks that this process
    // holds.
    if (fstatat(folder, name, &info, AT_SYMLINK_NOFOLLOW) != 0) {
        return errno == ENOENT ? GONIO_OK
                               : gonio_fail_line(error, GONIO_E_IO, shown, -1, "cannot open it: %s", strerror(errno));
    }
    if (!S_ISREG(info.st_mode) || info.st_size > SESSION_DATABASE_MAX) {
        return gonio_fail_line(error, GONIO_E_INPUT, shown, -1, "found %s, expected a file",
                               S_ISREG(info.st_mode) ? "a huge file" : what_it_is(info.st_mode));
    }
    if (strcmp(name, "session.db-journal") != 0) {
        return GONIO_OK;
    }
    int fd;
    int64_t size;
    gonio_status status = gonio_session_open_plain(folder, name, shown, SESSION_DATABASE_MAX, &fd, &size, error);
    if (status == GONIO_OK && names_another_file(fd, size)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, shown, -1,
                                 "the journal of a transaction over several databases, which no session has; it names "
                                 "another file, which SQLite would delete");
    }
    if (fd >= 0) {
        close(fd);
    }
    return status;
}

gonio_status gonio_session_check_database_files(int folder, const char *path, gonio_error *error) {
    static const char *const names[] = {"session.db", "session.db-wal", "session.db-shm", "session.db-journal"};
    gonio_status status = GONIO_OK;
    for (int i = 0; i < 4 && status == GONIO_OK; i++) {
        char *shown;
        if (asprintf(&shown, "%s/%s", path, names[i]) < 0) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
        }
        status = check_database_file(folder, names[i], shown, error);
        free(shown);
    }
    return status;
}

// ---- the connection ----

// Steps of SQLite's machine between two looks at whether a query still ends.
#define STEPS_A_LOOK (1 << 20)
// Reading a row takes some 50 steps, and a row 6 bytes or more.
#define LOOKS_FREE 200

static int too_long(void *context) {
    session_budget *budget = context;
    return ++budget->looks > budget->limit;
}

void gonio_session_secure(sqlite3 *db, int folder, session_budget *budget) {
    struct stat base = {0}, wal = {0};
    fstatat(folder, "session.db", &base, AT_SYMLINK_NOFOLLOW);
    fstatat(folder, "session.db-wal", &wal, AT_SYMLINK_NOFOLLOW);
    budget->limit = LOOKS_FREE + 10 * (base.st_size + wal.st_size) / STEPS_A_LOOK;
    budget->looks = 0;
    sqlite3_db_config(db, SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
    sqlite3_db_config(db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
    sqlite3_db_config(db, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, NULL); // temporary ones, the host's own, stay
    sqlite3_db_config(db, SQLITE_DBCONFIG_ENABLE_VIEW, 0, NULL);
    sqlite3_limit(db, SQLITE_LIMIT_LENGTH, SESSION_ROW_MAX);
    sqlite3_limit(db, SQLITE_LIMIT_ATTACHED, 0);
    sqlite3_progress_handler(db, STEPS_A_LOOK, too_long, budget);
    sqlite3_exec(db, "PRAGMA cell_size_check = ON; PRAGMA mmap_size = 0", NULL, NULL, NULL);
}

// ---- the schema ----

// A table's columns in the order of their names, each as one text.
static const char columns_sql[] =
    "SELECT name || ' ' || type || iif(\"notnull\", ' NOT NULL', '') || ifnull(' DEFAULT ' || dflt_value, '') ||"
    " iif(pk, ' PRIMARY KEY ' || pk, '') || iif(hidden, ' hidden', '') FROM pragma_table_xinfo(?) ORDER BY name";

typedef struct schema {
    sqlite3 *db;                            // in memory, as this Gonio would make it
    sqlite3_stmt *known, *expected, *found; // the text of a table of its; columns of a table there and in the session
    int tables;
} schema;

static gonio_status not_ours(session_rows *rows, const char *type, const char *name, const char *why) {
    char shown[64];
    gonio_text_printable(name, shown, sizeof shown);
    rows->status = gonio_fail_line(rows->error, GONIO_E_INPUT, rows->session->db_path, -1,
                                   "not the journal of a session: its schema has the %s %s%s", type, shown, why);
    return rows->status;
}

// Words that make a table do more than hold rows. Columns, keys and references of a session's tables have none of them.
static const char *active_word(const char *sql) {
    static const char *const words[] = {"CHECK", "COLLATE", "GENERATED", " AS ", "CONFLICT", "VIRTUAL"};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        if (strcasestr(sql, words[i]) != NULL) {
            return words[i];
        }
    }
    return NULL;
}

static const char *next_column(sqlite3_stmt *columns) {
    return sqlite3_step(columns) == SQLITE_ROW ? (const char *)sqlite3_column_text(columns, 0) : NULL;
}

// Tables that not every session of version 1 has: the first release had no flags, and a salvaged one may have the
// others.
static bool was_added(const char *table) {
    static const char *const added[] = {"flagged", "hosts", "chain", "radiance", "files"};
    bool is = false;
    for (size_t i = 0; i < sizeof added / sizeof *added; i++) {
        is |= strcmp(table, added[i]) == 0;
    }
    return is;
}

// Columns that version 1 lacks, or has where it was salvaged from a later one.
static bool is_later(const char *column) {
    static const char *const later[] = {"utc TEXT", "monotonic_s REAL", "bytes INTEGER"};
    bool is = false;
    for (size_t i = 0; i < sizeof later / sizeof *later; i++) {
        is |= strcmp(column, later[i]) == 0;
    }
    return is;
}

static void bind_table(sqlite3_stmt *columns, const char *table) {
    sqlite3_reset(columns);
    sqlite3_bind_text(columns, 1, table, -1, SQLITE_TRANSIENT);
}

static gonio_status check_columns(session_rows *rows, schema *s, const char *table) {
    const char *expected, *found;
    bind_table(s->expected, table);
    bind_table(s->found, table);
    do {
        expected = next_column(s->expected);
        found = next_column(s->found);
        while (rows->session->version == 1 && expected != NULL && is_later(expected) &&
               (found == NULL || strcmp(expected, found) != 0)) {
            expected = next_column(s->expected);
        }
    } while (expected != NULL && found != NULL && strcmp(expected, found) == 0);
    if (expected != NULL || found != NULL) {
        char shown[80] = "no more columns";
        if (found != NULL) {
            gonio_text_printable(found, shown, sizeof shown);
        }
        rows->status = gonio_fail_line(rows->error, GONIO_E_INPUT, rows->session->db_path, -1,
                                       "not the journal of a session: table %s: found the column '%s', expected '%s'",
                                       table, shown, expected != NULL ? expected : "no more columns");
    }
    return rows->status;
}

// Everything in the schema is one of the tables, with nothing of its own that SQLite would run.
static gonio_status check_entry(session_rows *rows, schema *s) {
    const char *type = gonio_row_text(rows, 0, 16), *name = gonio_row_text(rows, 1, 64);
    if (rows->status != GONIO_OK) {
        return rows->status;
    }
    if (strcmp(type, "index") == 0 && strncmp(name, "sqlite_autoindex_", 17) == 0 &&
        sqlite3_column_type(rows->statement, 2) == SQLITE_NULL) {
        return GONIO_OK; // of a primary key
    }
    bind_table(s->known, name);
    const char *text = next_column(s->known);
    if (strcmp(type, "table") != 0 || text == NULL) {
        return not_ours(rows, type, name, ", which no session has");
    }
    s->tables += rows->session->version > 1 || !was_added(name);
    const char *sql = gonio_row_text(rows, 2, 4096);
    const char *word = sql != NULL ? active_word(sql) : NULL;
    if (word != NULL) {
        char why[40];
        snprintf(why, sizeof why, " with %s in it", word);
        return not_ours(rows, "table", name, why);
    }
    if (rows->status == GONIO_OK && check_columns(rows, s, name) == GONIO_OK && rows->session->version > 1 &&
        (sql == NULL || strcmp(sql, text) != 0)) { // ALTER TABLE leaves the same text
        return not_ours(rows, "table", name, " in other words than it was made in");
    }
    return rows->status;
}

static gonio_status check_entries(gonio_session *session, schema *s, gonio_error *error) {
    session_rows rows;
    gonio_rows_open(&rows, session, "sqlite_master", 0, "SELECT type, name, sql FROM sqlite_master", error);
    while (gonio_rows_next(&rows)) {
        check_entry(&rows, s);
    }
    return gonio_rows_close(&rows);
}

static bool prepare_schema(gonio_session *session, schema *s) {
    return sqlite3_open(":memory:", &s->db) == SQLITE_OK &&
           sqlite3_exec(s->db, gonio_session_schema, NULL, NULL, NULL) == SQLITE_OK &&
           sqlite3_prepare_v2(s->db, "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?", -1, &s->known,
                              NULL) == SQLITE_OK &&
           sqlite3_prepare_v2(s->db, columns_sql, -1, &s->expected, NULL) == SQLITE_OK &&
           sqlite3_prepare_v2(session->db, columns_sql, -1, &s->found, NULL) == SQLITE_OK;
}

gonio_status gonio_session_check_schema(gonio_session *session, gonio_error *error) {
    schema s = {0};
    const int tables = session->version > 1 ? SESSION_TABLES + 1 : SESSION_TABLES - 4;
    gonio_status status = prepare_schema(session, &s) ? check_entries(session, &s, error)
                                                      : gonio_session_db_fail(session, error, "read the schema");
    if (status == GONIO_OK && s.tables < tables) {
        status = gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                 "not the journal of a session: found %d of its tables, expected %d", s.tables, tables);
    }
    sqlite3_finalize(s.known);
    sqlite3_finalize(s.expected);
    sqlite3_finalize(s.found);
    sqlite3_close(s.db);
    return status;
}
