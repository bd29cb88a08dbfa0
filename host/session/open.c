// SPDX-License-Identifier: BSD-3-Clause
// Open a session: to write it, under its lock, or to read it, which leaves no trace.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "host/session/internal.h"

bool gonio_session_is(const char *path) {
    char *db;
    gonio_session_settle(path);
    if (asprintf(&db, "%s/session.db", path) < 0) {
        return false;
    }
    struct stat info; // of a link or a pipe too: opening it then says what is wrong
    const bool is = lstat(db, &info) == 0 && !S_ISDIR(info.st_mode);
    free(db);
    return is;
}

static gonio_status open_folder(gonio_session *session, gonio_error *error) {
    session->folder_fd = open(session->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (session->folder_fd < 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1, "cannot open the session: %s", strerror(errno));
    }
    return session->writable ? gonio_session_lock(session->folder_fd, session->path, error) : GONIO_OK;
}

static gonio_status open_to_write(gonio_session *session, int how, gonio_error *error) {
    session->writable = true;
    gonio_status status = open_folder(session, error);
    if (status == GONIO_OK && (how & SESSION_JOURNAL) == 0) {
        status = gonio_session_open_frames(session, error);
    }
    return status == GONIO_OK ? gonio_session_open_database(session, error) : status;
}

static gonio_status open_to_read(const char *path, gonio_session **session, gonio_error *error) {
    const gonio_status status = gonio_session_open_private(path, session, error);
    return status == GONIO_OK && (*session)->frames_fd < 0 ? gonio_session_open_frames(*session, error) : status;
}

static gonio_status open_once(const char *path, int how, gonio_session **session, gonio_error *error) {
    gonio_status status;
    if ((how & SESSION_WRITE) == 0) {
        status = open_to_read(path, session, error);
    } else if ((status = gonio_session_new(path, session, error)) == GONIO_OK) {
        status = open_to_write(*session, how, error);
    }
    return status == GONIO_OK ? gonio_session_prove(*session, how, error) : status;
}

static gonio_status open_existing(const char *path, int how, gonio_session **out, gonio_error *error) {
    *out = NULL;
    if (!gonio_session_is(path)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a session: a folder with a session.db is expected");
    }
    gonio_session *session = NULL;
    gonio_status status = open_once(path, how, &session, error);
    // A writer that has begun since the copy was made has a log that is ahead of it: then it is read beside the writer.
    if (status == GONIO_E_INPUT && session != NULL && session->private_path != NULL &&
        gonio_session_is_being_written(session->folder_fd)) {
        gonio_session_close(session);
        session = NULL;
        status = open_once(path, how, &session, error);
    }
    if (status != GONIO_OK) {
        gonio_session_close(session);
        return status;
    }
    *out = session;
    return GONIO_OK;
}

gonio_status gonio_session_open(const char *path, bool writable, gonio_session **out, gonio_error *error) {
    return open_existing(path, writable ? SESSION_WRITE : 0, out, error);
}

gonio_status gonio_session_open_unproven(const char *path, bool writable, gonio_session **out, gonio_error *error) {
    return open_existing(path, SESSION_UNPROVEN | (writable ? SESSION_WRITE : 0), out, error);
}

gonio_status gonio_session_open_journal(const char *path, gonio_session **out, gonio_error *error) {
    return open_existing(path, SESSION_WRITE | SESSION_UNPROVEN | SESSION_JOURNAL, out, error);
}
