// SPDX-License-Identifier: BSD-3-Clause
// A copy of the database and of its write-ahead log, for whoever cannot or must not write beside the original: SQLite
// wants to make a -shm file to read a -wal, and to roll back what was not finished.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/session/internal.h"

static const char *const parts[] = {"", "-wal", "-journal", "-shm"};
enum { COPIED = 3, PARTS = 4 }; // SQLite makes the -shm file anew

static bool copy_bytes(int in, int out, bool *reading) {
    char buffer[1 << 16];
    ssize_t got;
    while ((got = read(in, buffer, sizeof buffer)) != 0) {
        *reading = got < 0;
        for (ssize_t at = 0; at < got;) {
            const ssize_t wrote = write(out, buffer + at, (size_t)(got - at));
            if (wrote < 0 && errno != EINTR) {
                return false;
            }
            at += wrote > 0 ? wrote : 0;
        }
        if (got < 0 && errno != EINTR) {
            return false;
        }
    }
    return true;
}

static gonio_status copy_file(int folder, const char *shown, const char *name, const char *to, gonio_error *error) {
    struct stat info;
    const int in = openat(folder, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (in < 0 && errno == ENOENT) {
        return GONIO_OK;
    }
    bool reading = in < 0;
    const bool plain = in >= 0 && fstat(in, &info) == 0 && S_ISREG(info.st_mode);
    const int out = plain ? open(to, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600) : -1;
    const bool good = out >= 0 && copy_bytes(in, out, &reading);
    const int why = errno;
    if (out >= 0) {
        close(out);
    }
    if (in >= 0) {
        close(in);
    }
    if (good) {
        return GONIO_OK;
    }
    return in >= 0 && !plain
               ? gonio_fail_line(error, GONIO_E_INPUT, shown, -1, "%s: a plain file is expected", name)
               : gonio_fail_line(error, GONIO_E_IO, shown, -1, "%s is unreadable or cannot be copied (%s): %s", name,
                                 reading ? "reading" : "writing", strerror(why));
}

void gonio_session_copy_close(session_copy *copy) {
    sqlite3_close(copy->db);
    for (int i = 0; copy->path != NULL && i < PARTS; i++) {
        char *part;
        if (asprintf(&part, "%s%s", copy->path, parts[i]) >= 0) {
            unlink(part);
            free(part);
        }
    }
    free(copy->path);
    *copy = (session_copy){0};
}

static gonio_status copy_parts(int folder, const char *from, session_copy *copy, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < COPIED; i++) {
        char *part, name[32];
        snprintf(name, sizeof name, "session.db%s", parts[i]);
        if (asprintf(&part, "%s%s", copy->path, parts[i]) < 0) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
        }
        status = copy_file(folder, from, name, part, error);
        free(part);
    }
    return status;
}

static bool connect_to(session_copy *copy, int folder) {
    if (sqlite3_open_v2(copy->path, &copy->db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_FULLMUTEX, NULL) != SQLITE_OK) {
        return false;
    }
    gonio_session_secure(copy->db, folder, &copy->budget);
    return sqlite3_exec(copy->db, "SELECT 1 FROM sqlite_master", NULL, NULL, NULL) == SQLITE_OK;
}

gonio_status gonio_session_copy_open(const char *from, const char *into, session_copy *copy, gonio_error *error) {
    *copy = (session_copy){0};
    const int folder = open(from, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, from, -1, "cannot open the session: %s", strerror(errno));
    }
    gonio_status status = gonio_session_check_database_files(folder, from, error);
    if (status == GONIO_OK) {
        status = asprintf(&copy->path, "%s/old.db", into) >= 0
                     ? copy_parts(folder, from, copy, error)
                     : gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    struct stat info;
    if (status == GONIO_OK && stat(copy->path, &info) == 0 && !connect_to(copy, folder)) {
        sqlite3_close(copy->db);
        copy->db = NULL;
    }
    close(folder);
    if (status != GONIO_OK) {
        gonio_session_copy_close(copy);
    }
    return status;
}
