// SPDX-License-Identifier: BSD-3-Clause
// A new session: in a folder where nothing is that a measure would write over.
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/session/folder.h"
#include "host/session/internal.h"

// ---- the journal ----

static gonio_status write_schema(gonio_session *session, gonio_error *error) {
    char versions[96];
    snprintf(versions, sizeof versions, "PRAGMA application_id = %d; PRAGMA user_version = %d;", SESSION_APPLICATION_ID,
             GONIO_SESSION_VERSION);
    gonio_status status = gonio_session_exec(session, "PRAGMA synchronous = FULL", error);
    status = status == GONIO_OK ? gonio_session_begin(session, error) : status;
    if (status == GONIO_OK) {
        status = gonio_session_exec(session, versions, error);
        status = status == GONIO_OK ? gonio_session_exec(session, gonio_session_schema, error) : status;
        status = gonio_session_end(session, status, error);
    }
    return status;
}

static gonio_status write_database(gonio_session *session, const char *name, gonio_error *error) {
    char *file;
    if (asprintf(&file, "%s/%s", session->path, name) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    gonio_status status = GONIO_OK;
    if (sqlite3_open(file, &session->db) != SQLITE_OK) {
        status = gonio_session_db_fail(session, error, "create the journal");
    }
    status = status == GONIO_OK ? write_schema(session, error) : status;
    sqlite3_close(session->db);
    session->db = NULL;
    free(file);
    return status;
}

// The schema is written beside and renamed: a session.db is a whole journal from the first moment it exists.
static gonio_status create_database(gonio_session *session, gonio_error *error) {
    char name[FOLDER_NAME];
    const int fd = gonio_folder_temporary(session->folder_fd, SESSION_NEW_JOURNAL "-", name);
    if (fd < 0) {
        return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot write the journal: %s", strerror(errno));
    }
    close(fd);
    gonio_status status = write_database(session, name, error);
    if (status == GONIO_OK && (gonio_folder_rename(session->folder_fd, name, session->folder_fd, "session.db") != 0 ||
                               fsync(session->folder_fd) != 0)) {
        status = gonio_fail_line(error, GONIO_E_IO, session->db_path, -1, "cannot write it: %s", strerror(errno));
    }
    if (status != GONIO_OK) {
        unlinkat(session->folder_fd, name, 0);
    }
    return status;
}

// ---- the folder ----

static bool is_there(const gonio_session *session, const char *name) {
    struct stat facts;
    return fstatat(session->folder_fd, name, &facts, AT_SYMLINK_NOFOLLOW) == 0;
}

static gonio_status count_frame(gonio_session *session, const session_stray *stray, void *context, gonio_error *error) {
    (void)session, (void)error;
    *(int64_t *)context += stray->ours && stray->where[0] != 0;
    return GONIO_OK;
}

// Without a journal: frames that are there lost theirs, and the rest is somebody's.
static gonio_status check_folder(gonio_session *session, gonio_error *error) {
    int64_t frames = 0;
    const gonio_status status = gonio_session_for_strays(session, count_frame, &frames, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (frames > 0 || is_there(session, "session.log")) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1,
                               "the journal of a session is lost here, and %lld of its frames are there; nothing was "
                               "changed. `gonio doctor --repair` restores what can be; measure into another folder",
                               (long long)frames);
    }
    static const char *const own[] = {"session.db-wal", "session.db-journal", "session.db-shm",
                                      "model.gonio",    "response.csv",       "reference.model",
                                      "flat.map",       "library.prior",      "scene.needs"};
    for (size_t i = 0; i < sizeof own / sizeof *own; i++) {
        if (is_there(session, own[i])) {
            return gonio_fail_line(error, GONIO_E_USAGE, session->path, -1,
                                   "the folder holds a file %s, which a session would write; name another folder",
                                   own[i]);
        }
    }
    return GONIO_OK;
}

static gonio_status already_there(const char *path, gonio_error *error) {
    return gonio_fail_line(error, GONIO_E_USAGE, path, -1,
                           "a session is already there; `gonio resume` goes on with it, or name another folder");
}

// Stopped before its steps were entered: nothing was measured, and this measure goes on with the journal.
static gonio_status take_over(gonio_session *session, gonio_error *error) {
    int64_t steps = 1, frames = 0;
    if (gonio_session_open_database(session, NULL) != GONIO_OK ||
        gonio_session_prove(session, SESSION_WRITE, NULL) != GONIO_OK ||
        gonio_session_integer(session, "SELECT count(*) FROM steps", &steps, NULL) != GONIO_OK || steps > 0 ||
        gonio_session_for_strays(session, count_frame, &frames, NULL) != GONIO_OK || frames > 0) {
        return already_there(session->path, error);
    }
    return GONIO_OK;
}

static gonio_status make_parts(gonio_session *session, gonio_error *error) {
    if (mkdirat(session->folder_fd, "frames", 0777) != 0 && errno != EEXIST) {
        return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot make frames/: %s", strerror(errno));
    }
    gonio_status status = gonio_session_open_frames(session, error);
    if (status == GONIO_OK && is_there(session, "session.db")) {
        return take_over(session, error);
    }
    status = status == GONIO_OK ? check_folder(session, error) : status;
    status = status == GONIO_OK ? create_database(session, error) : status;
    status = status == GONIO_OK ? gonio_session_open_database(session, error) : status;
    return status == GONIO_OK ? gonio_session_prove(session, SESSION_WRITE, error) : status;
}

// Everything is looked at under the lock: of two that measure into one folder the second is told so.
static gonio_status make_folder(gonio_session *session, gonio_error *error) {
    gonio_session_settle(session->path);
    if (mkdir(session->path, 0777) != 0 && errno != EEXIST) {
        return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot make the session's folder: %s",
                               strerror(errno));
    }
    session->folder_fd = open(session->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (session->folder_fd < 0) {
        return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot open the session's folder: %s",
                               strerror(errno));
    }
    return gonio_session_lock(session->folder_fd, session->path, error);
}

// The new folder's own name is durable once the folder that it stands in is synced.
static gonio_status sync_parent(gonio_session *session, gonio_error *error) {
    const int parent = openat(session->folder_fd, "..", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const bool synced = parent >= 0 && fsync(parent) == 0;
    const int why = errno;
    if (parent >= 0) {
        close(parent);
    }
    return synced ? GONIO_OK
                  : gonio_fail_line(error, GONIO_E_IO, session->path, -1,
                                    "cannot sync the folder that it stands in: %s", strerror(why));
}

static size_t full_length(const char *folder, const char *path) {
    return (folder != NULL ? strlen(folder) + 1 : 0) + strlen(path);
}

gonio_status gonio_session_check_length(const char *path, gonio_error *error) {
    char *here = path[0] != '/' ? getcwd(NULL, 0) : NULL, *copies[2] = {strdup(path), strdup(path)};
    char *real = copies[0] != NULL ? realpath(dirname(copies[0]), NULL) : NULL;
    const char *base = copies[1] != NULL ? basename(copies[1]) : "";
    const size_t name = strlen(base), given = full_length(here, path), followed = full_length(real, base);
    const size_t length = given > followed ? given : followed;
    free(here);
    free(real);
    free(copies[0]);
    free(copies[1]);
    if (length > SESSION_PATH_BYTES) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "a session's path of %zu bytes from the root on; at most %d are possible", length,
                          SESSION_PATH_BYTES);
    }
    return name <= SESSION_NAME_BYTES ? GONIO_OK
                                      : gonio_fail(error, GONIO_E_USAGE,
                                                   "a session's name of %zu bytes; at most %d are possible, so that a "
                                                   "repaired one has room beside it",
                                                   name, SESSION_NAME_BYTES);
}

gonio_status gonio_session_create(const char *path, gonio_session **out, gonio_error *error) {
    *out = NULL;
    gonio_session *session = NULL;
    gonio_status status = gonio_session_check_length(path, error);
    status = status == GONIO_OK ? gonio_session_new(path, &session, error) : status;
    if (status == GONIO_OK) {
        session->writable = true;
        status = make_folder(session, error);
    }
    status = status == GONIO_OK ? make_parts(session, error) : status;
    status = status == GONIO_OK ? sync_parent(session, error) : status;
    if (status != GONIO_OK) {
        gonio_session_close(session);
        return status;
    }
    *out = session;
    return GONIO_OK;
}
