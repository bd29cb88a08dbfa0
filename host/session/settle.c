// SPDX-License-Identifier: BSD-3-Clause
// Where a file system cannot exchange two names, a repaired session takes its place by two renames, and something may
// stop it between them: then nothing has the session's name, and beside it is the repaired one, whole, verified and
// synced, under a name that it has in no other moment. Whoever next asks for the session gives it its name.
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/session/folder.h"
#include "host/session/internal.h"

enum { DIGITS = 5 }; // of gonio_folder_make

static bool is_settled_name(const char *entry, const char *base) {
    const size_t n = strlen(base), end = strlen(SESSION_REPAIRED);
    return strncmp(entry, base, n) == 0 && strncmp(entry + n, SESSION_REPAIRED, end) == 0 &&
           strlen(entry + n + end) == DIGITS && strspn(entry + n + end, "0123456789abcdef") == DIGITS;
}

static bool find(int parent, const char *base, char found[FOLDER_NAME]) {
    DIR *list = gonio_folder_list(parent);
    const char *entry = NULL;
    while (list != NULL && (entry = gonio_folder_next(list)) != NULL && !is_settled_name(entry, base)) {
    }
    snprintf(found, FOLDER_NAME, "%s", entry != NULL ? entry : "");
    if (list != NULL) {
        closedir(list);
    }
    return found[0] != 0;
}

void gonio_session_settle(const char *path) {
    struct stat facts;
    char found[FOLDER_NAME];
    if (lstat(path, &facts) == 0 || errno != ENOENT) {
        return;
    }
    char *copies[2] = {strdup(path), strdup(path)};
    const char *base = copies[1] != NULL ? basename(copies[1]) : "";
    const int parent =
        copies[0] != NULL && base[0] != 0 ? open(dirname(copies[0]), O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
    if (parent >= 0 && find(parent, base, found) && gonio_folder_rename(parent, found, parent, base) == 0) {
        fsync(parent);
    }
    if (parent >= 0) {
        close(parent);
    }
    free(copies[0]);
    free(copies[1]);
}
