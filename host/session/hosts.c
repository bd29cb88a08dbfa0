// SPDX-License-Identifier: BSD-3-Clause
// Who wrote: a row for each run that changed the session, entered with its first change.
#include <fcntl.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "gonio/version.h"
#include "host/session/internal.h"

// The commit that was built, where that was a repository (files.mk).
#ifndef GONIO_COMMIT
#define GONIO_COMMIT ""
#endif

// The command line as a shell would take it again: arguments with anything but plain characters stand in quotes.
static void read_command(char *command, size_t size) {
    char arguments[4096];
    const int fd = open("/proc/self/cmdline", O_RDONLY | O_CLOEXEC);
    const ssize_t got = fd >= 0 ? read(fd, arguments, sizeof arguments - 1) : 0;
    if (fd >= 0) {
        close(fd);
    }
    size_t at = 0;
    for (const char *a = arguments; a < arguments + (got > 0 ? got : 0) && at + 4 < size; a += strlen(a) + 1) {
        arguments[got] = 0;
        const bool plain =
            a[0] != 0 && a[strspn(a, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/@%")] == 0;
        at += (size_t)snprintf(command + at, size - at, plain ? "%s%s" : "%s'%s'", at > 0 ? " " : "", a);
        at = at < size ? at : size - 1;
    }
    command[at] = 0;
}

static void read_user(char *user, size_t size) {
    char buffer[4096];
    struct passwd entry, *found = NULL;
    if (getpwuid_r(geteuid(), &entry, buffer, sizeof buffer, &found) == 0 && found != NULL) {
        snprintf(user, size, "%s", entry.pw_name);
    } else {
        snprintf(user, size, "%u", (unsigned)geteuid());
    }
}

gonio_status gonio_session_enter_host(gonio_session *session, gonio_error *error) {
    char command[8192] = "", user[256], hostname[256] = "";
    if (gethostname(hostname, sizeof hostname - 1) != 0) {
        hostname[0] = 0;
    }
    read_command(command, sizeof command);
    read_user(user, sizeof user);
    return gonio_session_do(session, error,
                            "INSERT INTO hosts(version, commit_id, hostname, user, utc, command) VALUES(?, ?, ?, ?,"
                            " strftime('%Y-%m-%dT%H:%M:%fZ', 'now'), ?)",
                            "ttttt", gonio_version(), GONIO_COMMIT[0] != 0 ? GONIO_COMMIT : NULL, hostname, user,
                            command);
}
