// SPDX-License-Identifier: BSD-3-Clause
// session.log: the chain again, one JSON object a line, with the rows themselves. Each line proves itself, so that the
// journal can be made anew from whatever lines are left.
//
// Lines are appended after the COMMIT that they tell of: the log may lag behind the database by one transaction, and is
// never ahead of it.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/session/internal.h"

#define LOG "session.log"
#define HASH_LENGTH (GONIO_SHA256_HEX - 1)

// ---- reading ----

typedef struct reader {
    sqlite3 *db;                          // in memory: binds the values of a line, so that they hash as a row does
    sqlite3_stmt *values[SESSION_TABLES]; // SELECT ?, ?, ...
    char content[GONIO_SHA256_HEX];
} reader;

static gonio_status reader_open(reader *r, gonio_error *error) {
    *r = (reader){0};
    bool good = sqlite3_open(":memory:", &r->db) == SQLITE_OK;
    for (int t = 0; good && t < SESSION_TABLES; t++) {
        char sql[16 + 3 * SESSION_COLUMNS] = "SELECT ?";
        for (int i = 1; i < gonio_session_columns(&gonio_session_tables[t]); i++) {
            strcat(sql, ", ?");
        }
        good = sqlite3_prepare_v2(r->db, sql, -1, &r->values[t], NULL) == SQLITE_OK;
    }
    return good ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to read session.log");
}

static void reader_close(reader *r) {
    for (int t = 0; t < SESSION_TABLES; t++) {
        sqlite3_finalize(r->values[t]);
    }
    sqlite3_close(r->db);
}

static const char *text_of(const json_t *object, const char *key, size_t length) {
    const char *text = json_string_value(json_object_get(object, key));
    return text != NULL && (length == 0 || strlen(text) == length) ? text : NULL;
}

// The checksum of the row that the line holds; NULL: it holds none that its table could have.
static const char *content_of(reader *r, const session_table *table, json_t *row) {
    sqlite3_stmt *values = r->values[table - gonio_session_tables];
    sqlite3_reset(values);
    const bool good = gonio_session_row_bind(table, values, row) && sqlite3_step(values) == SQLITE_ROW &&
                      gonio_session_row_hash(table, values, 0, r->content, NULL) == GONIO_OK;
    sqlite3_reset(values);
    return good ? r->content : NULL;
}

static bool read_fields(reader *r, const json_t *object, session_line *line) {
    const json_t *seq = json_object_get(object, "seq");
    session_record *record = &line->record;
    record->seq = json_integer_value(seq);
    record->op = text_of(object, "op", 0);
    line->prev = text_of(object, "prev", HASH_LENGTH);
    line->hash = text_of(object, "hash", HASH_LENGTH);
    if (!json_is_integer(seq) || record->op == NULL || line->prev == NULL || line->hash == NULL) {
        return false;
    }
    record->tbl = record->key = record->content = "";
    if (strcmp(record->op, "commit") == 0) {
        return true;
    }
    record->tbl = text_of(object, "tbl", 0);
    record->key = text_of(object, "key", 0);
    const session_table *table = gonio_session_table(record->tbl);
    if (table == NULL || record->key == NULL) {
        return false;
    }
    line->row = json_object_get(object, "row");
    if (strcmp(record->op, "put") == 0) {
        record->content = line->row != NULL ? content_of(r, table, line->row) : text_of(object, "content", HASH_LENGTH);
        return record->content != NULL;
    }
    return strcmp(record->op, "delete") == 0 && line->row == NULL;
}

static gonio_status read_line(reader *r, const char *text, size_t n, session_line *line, session_line_fn call,
                              void *context, gonio_error *error) {
    // A line without its end was not written to its end.
    json_t *object = n > 0 && text[n - 1] == '\n' ? json_loadb(text, n, JSON_REJECT_DUPLICATES, NULL) : NULL;
    char hash[GONIO_SHA256_HEX];
    line->proven = object != NULL && read_fields(r, object, line) &&
                   gonio_session_record_hash(line->prev, &line->record, hash, NULL) == GONIO_OK &&
                   strcmp(hash, line->hash) == 0;
    const gonio_status status = call(line, context, error);
    json_decref(object);
    return status;
}

// A row's blob takes two characters a byte; a line beyond that is none of ours.
#define LINE_LONGEST (2 * (size_t)SESSION_ROW_MAX + 65536)

// The next line with its end, as getline gives it, but no longer than a line can be: 0 at the end, -1 with errno.
static ssize_t next_line(FILE *file, char **text, size_t *capacity) {
    size_t n = 0;
    int c = 0;
    while (c != '\n' && (c = getc_unlocked(file)) != EOF) {
        if (n + 1 >= *capacity) {
            const size_t more = *capacity < LINE_LONGEST ? 2 * *capacity + 4096 : 0;
            char *larger = more > 0 ? realloc(*text, more) : NULL;
            if (larger == NULL) {
                errno = more > 0 ? ENOMEM : EFBIG;
                return -1;
            }
            *text = larger;
            *capacity = more;
        }
        (*text)[n++] = (char)c;
        (*text)[n] = 0;
    }
    return (ssize_t)n;
}

static gonio_status read_lines(reader *r, FILE *file, int64_t from, const char *folder, session_line_fn call,
                               void *context, gonio_error *error) {
    char *text = NULL;
    size_t capacity = 0;
    ssize_t n = 0;
    gonio_status status = GONIO_OK;
    int64_t at = from;
    long long number = 0;
    if (from > 0 && fseeko(file, from, SEEK_SET) == 0 && (n = next_line(file, &text, &capacity)) > 0) {
        at += n; // the end of a line
    }
    while (status == GONIO_OK && n >= 0 && (n = next_line(file, &text, &capacity)) > 0) {
        number++;
        session_line line = {.number = number, .begin = at, .end = at + n};
        at += n;
        status = read_line(r, text, (size_t)n, &line, call, context, error);
    }
    if (status == GONIO_OK && (n < 0 || ferror(file))) {
        const bool foreign = n < 0 && errno == EFBIG;
        status = gonio_fail_line(error, foreign ? GONIO_E_INPUT : GONIO_E_IO, folder, -1, "cannot read " LOG ": %s",
                                 strerror(errno));
    }
    free(text);
    return status;
}

gonio_status gonio_session_log_for(int folder_fd, const char *folder, int64_t last, session_line_fn call, void *context,
                                   gonio_error *error) {
    const int fd = openat(folder_fd, LOG, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0 && errno == ENOENT) {
        return GONIO_OK;
    }
    struct stat info;
    FILE *file = fd >= 0 && fstat(fd, &info) == 0 && S_ISREG(info.st_mode) ? fdopen(fd, "r") : NULL;
    if (file == NULL) {
        const gonio_status status =
            gonio_fail_line(error, fd < 0 ? GONIO_E_IO : GONIO_E_INPUT, folder, -1, "cannot read " LOG ": %s",
                            fd < 0 ? strerror(errno) : "a plain file is expected");
        if (fd >= 0) {
            close(fd);
        }
        return status;
    }
    reader r;
    gonio_status status = reader_open(&r, error);
    status = status == GONIO_OK ? read_lines(&r, file, last > 0 && info.st_size > last ? info.st_size - last : 0,
                                             folder, call, context, error)
                                : status;
    reader_close(&r);
    fclose(file);
    return status;
}

// ---- writing ----

json_t *gonio_session_line_json(const session_record *record, const char *prev, const char *hash, json_t *row) {
    json_t *line = json_object();
    json_object_set_new(line, "seq", json_integer(record->seq));
    if (record->tbl[0] != 0) {
        json_object_set_new(line, "tbl", json_string(record->tbl));
        json_object_set_new(line, "key", json_string(record->key));
    }
    json_object_set_new(line, "op", json_string(record->op));
    if (row != NULL) {
        json_object_set_new(line, "row", row);
    } else if (record->content[0] != 0) {
        json_object_set_new(line, "content", json_string(record->content));
    }
    json_object_set_new(line, "prev", json_string(prev));
    json_object_set_new(line, "hash", json_string(hash));
    return line;
}

// The row as it is now, where it is still the one that the record tells of; NULL: a later change has its own line.
static gonio_status row_of(gonio_session *session, const session_record *record, json_t **out, gonio_error *error) {
    const session_table *table = gonio_session_table(record->tbl);
    char content[GONIO_SHA256_HEX];
    sqlite3_stmt *row = NULL;
    *out = NULL;
    if (table == NULL || strcmp(record->op, "put") != 0) {
        return GONIO_OK;
    }
    gonio_status status = gonio_session_row(session, table, record->key, &row, error);
    if (status == GONIO_OK && row != NULL) {
        status = gonio_session_row_hash(table, row, 0, content, error);
        if (status == GONIO_OK && strcmp(content, record->content) == 0) {
            *out = gonio_session_row_json(table, row, 0);
            status = *out != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
        }
        sqlite3_reset(row);
    }
    return status;
}

static const char *column_text(sqlite3_stmt *row, int column) {
    const char *text = (const char *)sqlite3_column_text(row, column);
    return text != NULL ? text : "";
}

typedef struct writer {
    FILE *stream;
    char *text;
    size_t size;
    int64_t seq;
    char hash[GONIO_SHA256_HEX];
} writer;

static gonio_status write_record(gonio_session *session, sqlite3_stmt *record_row, writer *w, gonio_error *error) {
    const session_record record = {sqlite3_column_int64(record_row, 0), column_text(record_row, 1),
                                   column_text(record_row, 2), column_text(record_row, 3), column_text(record_row, 4)};
    const char *hash = column_text(record_row, 5);
    json_t *row;
    const gonio_status status = row_of(session, &record, &row, error);
    if (status != GONIO_OK) {
        return status;
    }
    json_t *line = gonio_session_line_json(&record, w->hash, hash, row);
    const bool good =
        json_dumpf(line, w->stream, JSON_COMPACT | JSON_REAL_PRECISION(17)) == 0 && fputc('\n', w->stream) != EOF;
    json_decref(line);
    w->seq = record.seq;
    snprintf(w->hash, sizeof w->hash, "%s", hash);
    return good ? GONIO_OK
                : gonio_fail_line(error, GONIO_E_INPUT, session->path, -1, "record %lld cannot be written as JSON",
                                  (long long)record.seq);
}

// The lines that the log lacks, as text.
static gonio_status write_records(gonio_session *session, writer *w, gonio_error *error) {
    sqlite3_stmt *rows;
    gonio_status status = gonio_session_prepare(
        session, "SELECT seq, tbl, key, op, content, hash FROM chain WHERE seq > ? ORDER BY seq", &rows, error);
    if (status != GONIO_OK) {
        return status;
    }
    sqlite3_bind_int64(rows, 1, w->seq);
    int code = SQLITE_DONE;
    while (status == GONIO_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        status = write_record(session, rows, w, error);
    }
    if (status == GONIO_OK && code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "read the chain");
    }
    sqlite3_finalize(rows);
    return status;
}

static gonio_status fail(const gonio_session *session, gonio_error *error) {
    return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot write " LOG ": %s%s", strerror(errno),
                           errno == ENOSPC ? "; make room and resume" : "");
}

static bool put_text(int fd, int64_t at, const char *text, size_t n) {
    if (lseek(fd, at, SEEK_SET) != at) {
        return false;
    }
    while (n > 0) {
        const ssize_t wrote = write(fd, text, n);
        if (wrote < 0 && errno != EINTR) {
            return false;
        }
        text += wrote > 0 ? wrote : 0;
        n -= wrote > 0 ? (size_t)wrote : 0;
    }
    return true;
}

static gonio_status open_file(gonio_session *session, bool create, gonio_error *error) {
    if (session->log.fd >= 0) {
        return GONIO_OK;
    }
    const int flags = O_RDWR | O_NOFOLLOW | O_CLOEXEC;
    session->log.fd = openat(session->folder_fd, LOG, flags);
    if (session->log.fd < 0 && errno == ENOENT) {
        if (!create) {
            return GONIO_OK;
        }
        session->log.fd = openat(session->folder_fd, LOG, flags | O_CREAT | O_EXCL, 0666);
        if (session->log.fd >= 0 && gonio_session_sync(session, session->folder_fd) != 0) {
            return fail(session, error);
        }
    }
    return session->log.fd >= 0 ? GONIO_OK : fail(session, error);
}

// What stands behind the last whole line is the beginning of the next ones, cut by a kill or a power cut, or nothing of
// ours: that is kept elsewhere.
static gonio_status keep_tail(gonio_session *session, const writer *w, gonio_error *error) {
    struct stat info;
    if (fstat(session->log.fd, &info) != 0) {
        return fail(session, error);
    }
    const size_t n = info.st_size > session->log.size ? (size_t)(info.st_size - session->log.size) : 0;
    char *tail = malloc(n + 1);
    if (tail == NULL || pread(session->log.fd, tail, n, session->log.size) != (ssize_t)n) {
        free(tail);
        return fail(session, error);
    }
    gonio_status status = GONIO_OK;
    if (n > w->size || memcmp(tail, w->text, n) != 0) {
        const int copy =
            openat(session->folder_fd, LOG ".tail", O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
        status = copy >= 0 && put_text(copy, 0, tail, n) && fsync(copy) == 0 ? GONIO_OK : fail(session, error);
        if (copy >= 0) {
            close(copy);
            status = status == GONIO_OK
                         ? gonio_session_set_aside(session, session->folder_fd, "", LOG ".tail",
                                                   "the end of " LOG ", which was not written whole", error)
                         : status;
        }
        if (status == GONIO_OK && ftruncate(session->log.fd, session->log.size) != 0) {
            status = fail(session, error);
        }
    }
    free(tail);
    session->log.tail = session->log.tail && status != GONIO_OK;
    return status;
}

static gonio_status append(gonio_session *session, const writer *w, gonio_error *error) {
    gonio_status status = open_file(session, w->size > 0, error);
    if (status == GONIO_OK && session->log.fd >= 0 && session->log.tail) {
        status = keep_tail(session, w, error);
    }
    if (status == GONIO_OK && w->size > 0 &&
        (!put_text(session->log.fd, session->log.size, w->text, w->size) ||
         gonio_session_sync(session, session->log.fd) != 0)) {
        status = fail(session, error);
    }
    if (status == GONIO_OK) {
        session->log.lags = false;
        session->log.seq = w->seq;
        session->log.size += (int64_t)w->size;
        memcpy(session->log.hash, w->hash, sizeof w->hash);
    }
    return status;
}

gonio_status gonio_session_log_catch_up(gonio_session *session, gonio_error *error) {
    if (session->log.off) {
        return GONIO_OK;
    }
    writer w = {.seq = session->log.seq};
    memcpy(w.hash, session->log.hash, sizeof w.hash);
    w.stream = open_memstream(&w.text, &w.size);
    if (w.stream == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for session.log");
    }
    gonio_status status = write_records(session, &w, error);
    if (fclose(w.stream) != 0 && status == GONIO_OK) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for session.log");
    }
    status = status == GONIO_OK ? append(session, &w, error) : status;
    free(w.text);
    return status;
}

// ---- going on with a log that is there ----

// What cannot be gone on with is kept elsewhere, and the database tells all that it proves once more.
static gonio_status begin_anew(gonio_session *session, gonio_error *error) {
    struct stat info;
    session->log.seq = session->log.size = 0;
    snprintf(session->log.hash, sizeof session->log.hash, "%s", SESSION_CHAIN_START);
    const bool there = fstatat(session->folder_fd, LOG, &info, AT_SYMLINK_NOFOLLOW) == 0;
    gonio_status status = there ? gonio_session_set_aside(session, session->folder_fd, "", LOG,
                                                          "it lacked lines that the database proves", error)
                                : GONIO_OK;
    status = status == GONIO_OK ? gonio_session_log_catch_up(session, error) : status;
    return status == GONIO_OK
               ? gonio_session_event(session, "journal", LOG " was written anew from the database", error)
               : status;
}

gonio_status gonio_session_log_open(gonio_session *session, const session_proof *proof, gonio_error *error) {
    session->log.off = !proof->database || proof->log == SESSION_LOG_AHEAD || proof->log == SESSION_LOG_OTHER;
    if (session->log.off) {
        return GONIO_OK;
    }
    if (proof->log != SESSION_LOG_SOUND) {
        return begin_anew(session, error);
    }
    session->log.seq = proof->log_seq;
    session->log.size = proof->log_size;
    session->log.tail = true;
    memcpy(session->log.hash, proof->log_hash, sizeof session->log.hash);
    return gonio_session_log_catch_up(session, error);
}
