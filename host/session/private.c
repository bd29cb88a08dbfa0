// SPDX-License-Identifier: BSD-3-Clause
// Read a session and leave its folder as it is, to the last byte and time: SQLite, which makes files beside a database
// that it only reads and merges what a killed writer left, works on a copy elsewhere.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "host/session/folder.h"
#include "host/session/internal.h"

static const char *const parts[] = {"session.db", "session.db-wal", "session.db-journal"};
enum { PARTS = 3 };

gonio_status gonio_session_copy_journal(int folder_fd, const char *path, int to, bool *room, gonio_error *error) {
    *room = true;
    for (int i = 0; i < PARTS; i++) {
        bool reading = false;
        int result = -1;
        for (int tries = 0; tries < 3 && result != 0 && (tries == 0 || errno == EIO); tries++) {
            result = gonio_folder_copy(folder_fd, parts[i], to, parts[i], &reading);
        }
        if (result == 0 || (i > 0 && reading && errno == ENOENT)) {
            continue;
        }
        if (reading && (errno == ENOENT || errno == ELOOP || errno == EINVAL || errno == ENXIO)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "its journal's %s is %s", parts[i],
                                   errno == ENOENT ? "missing" : "no regular file");
        }
        *room = reading;
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "%s %s: %s",
                               reading ? "its journal is unreadable:" : "cannot copy its journal:", parts[i],
                               strerror(errno));
    }
    return GONIO_OK;
}

static bool look(int folder_fd, struct stat facts[PARTS]) {
    bool any = false;
    for (int i = 0; i < PARTS; i++) {
        facts[i] = (struct stat){0};
        any = fstatat(folder_fd, parts[i], &facts[i], AT_SYMLINK_NOFOLLOW) == 0 || any;
    }
    return any;
}

static bool changed(const struct stat before[PARTS], const struct stat after[PARTS]) {
    for (int i = 0; i < PARTS; i++) {
        const struct stat *a = &before[i], *b = &after[i];
        if (a->st_ino != b->st_ino || a->st_size != b->st_size || a->st_mtim.tv_sec != b->st_mtim.tv_sec ||
            a->st_mtim.tv_nsec != b->st_mtim.tv_nsec) {
            return true;
        }
    }
    return false;
}

// Held for no time at all: only whether a writer is there.
bool gonio_session_is_being_written(int folder_fd) {
    if (flock(folder_fd, LOCK_SH | LOCK_NB) != 0) {
        return true;
    }
    flock(folder_fd, LOCK_UN);
    return false;
}

// *in_place: there is no room for a copy, or a writer has come; then the journal is read where it is.
static gonio_status copy(gonio_session *session, bool *in_place, gonio_error *error) {
    const gonio_status plain = gonio_session_check_database_files(session->folder_fd, session->path, error);
    if (plain != GONIO_OK) {
        return plain;
    }
    const char *temporary = getenv("TMPDIR");
    char *folder;
    if (asprintf(&folder, "%s/gonio-journal-XXXXXX", temporary != NULL ? temporary : "/tmp") < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    if (mkdtemp(folder) == NULL) {
        free(folder);
        *in_place = true;
        return GONIO_OK;
    }
    session->private_folder = folder;
    session->private_made = true;
    const int fd = gonio_folder_open(AT_FDCWD, folder);
    struct stat before[PARTS], after[PARTS];
    look(session->folder_fd, before);
    bool room;
    const gonio_status status = gonio_session_copy_journal(session->folder_fd, session->path, fd, &room, error);
    look(session->folder_fd, after);
    close(fd);
    *in_place = !room || changed(before, after);
    return status == GONIO_OK && asprintf(&session->private_path, "%s/session.db", folder) < 0
               ? gonio_fail(error, GONIO_E_MEMORY, "no memory for a path")
               : status;
}

static gonio_status open_parts(gonio_session *session, gonio_error *error) {
    session->folder_fd = open(session->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (session->folder_fd < 0) {
        return gonio_fail_line(error, errno == ENOENT || errno == ENOTDIR ? GONIO_E_INPUT : GONIO_E_IO, session->path,
                               -1, "cannot open the session: %s", strerror(errno));
    }
    bool in_place = gonio_session_is_being_written(session->folder_fd);
    const gonio_status status = in_place ? GONIO_OK : copy(session, &in_place, error);
    if (in_place) {
        free(session->private_path);
        session->private_path = NULL;
    }
    return status == GONIO_OK || in_place ? gonio_session_open_database(session, error) : status;
}

gonio_status gonio_session_open_private(const char *path, gonio_session **out, gonio_error *error) {
    *out = NULL;
    gonio_session *session = NULL;
    gonio_status status = gonio_session_new(path, &session, error);
    status = status == GONIO_OK ? open_parts(session, error) : status;
    if (status != GONIO_OK) {
        gonio_session_close(session);
        return status;
    }
    gonio_session_open_frames(session, NULL);
    *out = session;
    return GONIO_OK;
}
