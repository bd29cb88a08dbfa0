// SPDX-License-Identifier: BSD-3-Clause
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "gonio/session.h"
#include "host/control/internal.h"

// A folder of this user's that nobody else may enter or change.
static int open_private(const char *path) {
    struct stat info;
    const int fd = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (fd >= 0 && fstat(fd, &info) == 0 && info.st_uid == geteuid() && (info.st_mode & 077) == 0) {
        return fd;
    }
    if (fd >= 0) {
        close(fd);
    }
    return -1;
}

int gonio_control_folder(int number, bool make) {
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    char path[4096];
    int length = -1;
    if (number == 0 && runtime != NULL && runtime[0] == '/') {
        length = snprintf(path, sizeof path, "%s/gonio", runtime);
    } else if (number == 1) {
        length = snprintf(path, sizeof path, "/run/user/%ld/gonio", (long)geteuid());
    } else if (number == 2) {
        length = snprintf(path, sizeof path, "/tmp/gonio-%ld", (long)geteuid());
    }
    if (length < 0 || (size_t)length >= sizeof path) {
        return -1;
    }
    if (make && mkdir(path, 0700) != 0 && errno != EEXIST) {
        return -1;
    }
    return open_private(path);
}

gonio_status gonio_control_name(gonio_control_kind kind, const char *identity, char name[CONTROL_NAME],
                                gonio_error *error) {
    static const char *const kinds[GONIO_CONTROL_KINDS] = {"session", "rig"};
    char hash[GONIO_SHA256_HEX];
    const gonio_status status = gonio_sha256(identity, strlen(identity), hash, error);
    if (status == GONIO_OK) {
        snprintf(name, CONTROL_NAME, "%s-%.32s", kinds[kind], hash);
    }
    return status;
}

void gonio_control_address(int folder, const char *name, struct sockaddr_un *address) {
    *address = (struct sockaddr_un){.sun_family = AF_UNIX};
    snprintf(address->sun_path, sizeof address->sun_path, "/proc/self/fd/%d/%.63s.socket", folder, name);
}

bool gonio_control_mine(int socket) {
    struct ucred peer;
    socklen_t size = sizeof peer;
    return getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 && peer.uid == geteuid();
}
