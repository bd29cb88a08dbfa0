// SPDX-License-Identifier: BSD-3-Clause
// lost+found/: where everything goes that stands in the way, or that nobody owns. Nothing is ever deleted; LIST says
// what came from where, when and why.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "host/session/folder.h"
#include "host/session/internal.h"

#define LOST "lost+found"
#define LIST "LIST"

static gonio_status fail(const gonio_session *session, gonio_error *error, const char *what, const char *name) {
    return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot %s %s: %s", what, name, strerror(errno));
}

gonio_status gonio_session_lost_open(gonio_session *session, session_lost *l, gonio_error *error) {
    *l = (session_lost){session, -1, -1};
    if (mkdirat(session->folder_fd, LOST, 0777) != 0 && errno != EEXIST) {
        return fail(session, error, "make", LOST "/");
    }
    l->fd = gonio_folder_open(session->folder_fd, LOST);
    if (l->fd < 0) {
        return fail(session, error, "open", LOST "/, where strays go");
    }
    l->list = openat(l->fd, LIST, O_WRONLY | O_APPEND | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
    if (l->list < 0) {
        const gonio_status status = fail(session, error, "open", LOST "/" LIST);
        close(l->fd);
        l->fd = -1;
        return status;
    }
    return GONIO_OK;
}

gonio_status gonio_session_lost_close(session_lost *l, gonio_status status, gonio_error *error) {
    if (l->fd < 0) {
        return status;
    }
    if (status == GONIO_OK &&
        (fsync(l->list) != 0 || fsync(l->fd) != 0 ||
         (l->session->frames_fd >= 0 && fsync(l->session->frames_fd) != 0) || fsync(l->session->folder_fd) != 0)) {
        status = fail(l->session, error, "sync", LOST "/");
    }
    close(l->list);
    close(l->fd);
    return status;
}

static gonio_status enlist(const session_lost *l, const char *new_name, const char *was, const char *why,
                           gonio_error *error) {
    char utc[32];
    struct tm parts;
    const time_t now = time(NULL);
    gmtime_r(&now, &parts);
    strftime(utc, sizeof utc, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return dprintf(l->list, "%s\t%s\t%s\t%s\n", utc, new_name, was, why) > 0
               ? GONIO_OK
               : fail(l->session, error, "write", LOST "/" LIST);
}

static bool taken(int folder, const char *name) {
    struct stat facts;
    return fstatat(folder, name, &facts, AT_SYMLINK_NOFOLLOW) == 0;
}

// The list is written first: a kill in between leaves a line too many, never a file that no line explains.
gonio_status gonio_session_lost_put(const session_lost *l, int folder, const char *where, const char *name,
                                    const char *why, gonio_error *error) {
    char new_name[FOLDER_NAME + 16], was[FOLDER_NAME + 16];
    snprintf(was, sizeof was, "%s%s", where, name);
    // A folder on another disk than the session's: the file stays in it under a name that no step has.
    for (bool here = false;; here = true) {
        const int to = here ? folder : l->fd;
        for (int n = 0;; n++) {
            snprintf(new_name, sizeof new_name, n == 0 ? "%s%s" : "%s%s.%d", name, here ? ".stray" : "", n);
            if (taken(to, new_name)) {
                continue;
            }
            const gonio_status status = enlist(l, new_name, was, why, error);
            if (status != GONIO_OK || gonio_folder_rename(folder, name, to, new_name) == 0) {
                return status;
            }
            if (errno != EEXIST) {
                break;
            }
        }
        if (errno != EXDEV || here) {
            return fail(l->session, error, "set aside", was);
        }
    }
}

gonio_status gonio_session_set_aside(gonio_session *session, int folder, const char *where, const char *name,
                                     const char *why, gonio_error *error) {
    session_lost l;
    gonio_status status = gonio_session_lost_open(session, &l, error);
    status = status == GONIO_OK ? gonio_session_lost_put(&l, folder, where, name, why, error) : status;
    return gonio_session_lost_close(&l, status, error);
}

gonio_status gonio_session_make_way(gonio_session *session, const char *name, const char *why, gonio_error *error) {
    return taken(session->folder_fd, name) ? gonio_session_set_aside(session, session->folder_fd, "", name, why, error)
                                           : GONIO_OK;
}

gonio_status gonio_session_keep_file(const char *path, gonio_error *error) {
    struct stat facts;
    if (lstat(path, &facts) != 0) {
        return errno == ENOENT ? GONIO_OK
                               : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot look at it: %s", strerror(errno));
    }
    char *name = NULL;
    int result = -1;
    errno = EEXIST;
    for (int n = 1; result != 0 && errno == EEXIST; n++) {
        free(name);
        if (asprintf(&name, "%s.old-%d", path, n) < 0) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
        }
        result = gonio_folder_rename(AT_FDCWD, path, AT_FDCWD, name);
    }
    free(name);
    return result == 0 ? GONIO_OK
                       : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot give what is there another name: %s",
                                         strerror(errno));
}
