// SPDX-License-Identifier: BSD-3-Clause
// SESSION/lost+found/: what Gonio cannot use and will not delete. Its LIST says what came from where, when and why.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "host/session/internal.h"

static gonio_status fail(const gonio_session *session, gonio_error *error, const char *what, const char *name) {
    return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot %s %s: %s", what, name, strerror(errno));
}

static int open_lost_found(const gonio_session *session) {
    return mkdirat(session->folder_fd, "lost+found", 0777) == 0 || errno == EEXIST
               ? openat(session->folder_fd, "lost+found", O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC)
               : -1;
}

static bool enlist(int lost, const char *new_name, const char *was, const char *why) {
    char utc[32];
    struct tm parts;
    const time_t now = time(NULL);
    const int list = openat(lost, "LIST", O_WRONLY | O_APPEND | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
    gmtime_r(&now, &parts);
    strftime(utc, sizeof utc, "%Y-%m-%dT%H:%M:%SZ", &parts);
    const bool good = list >= 0 && dprintf(list, "%s\t%s\t%s\t%s\n", utc, new_name, was, why) > 0 && fsync(list) == 0;
    if (list >= 0) {
        close(list);
    }
    return good;
}

// Under the holder's lock nobody else takes a name here between looking and renaming.
static bool move(int from, const char *name, int lost, const char *was, const char *why) {
    char new_name[300];
    struct stat facts;
    for (int n = 0;; n++) {
        snprintf(new_name, sizeof new_name, n == 0 ? "%s" : "%s.%d", name, n);
        if (fstatat(lost, new_name, &facts, AT_SYMLINK_NOFOLLOW) != 0) {
            break;
        }
    }
    return errno == ENOENT && enlist(lost, new_name, was, why) && renameat(from, name, lost, new_name) == 0 &&
           fsync(lost) == 0 && fsync(from) == 0;
}

gonio_status gonio_session_set_aside(gonio_session *session, int folder, const char *where, const char *name,
                                     const char *why, gonio_error *error) {
    char was[300];
    snprintf(was, sizeof was, "%s%s", where, name);
    const int lost = open_lost_found(session);
    const bool good = lost >= 0 && move(folder, name, lost, was, why);
    const gonio_status status = good ? GONIO_OK : fail(session, error, "set aside", was);
    if (lost >= 0) {
        close(lost);
    }
    return status;
}
