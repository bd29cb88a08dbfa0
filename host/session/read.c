// SPDX-License-Identifier: BSD-3-Clause
// Read a file whole. A disk or a network that hiccups is asked again, and what cannot be read (GONIO_E_IO) is never
// taken for what is damaged or missing (GONIO_E_INPUT): its bytes may well be there.
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "host/session/internal.h"

enum { TRIES = 3, PAUSE_MS = 20 };

static gonio_status read_bytes(int fd, const char *shown, session_png *file, gonio_error *error) {
    while (file->size < file->capacity) {
        const ssize_t got = read(fd, file->data + file->size, file->capacity - file->size);
        if (got == 0) {
            break; // it has become shorter: the decoder tells
        }
        if (got < 0 && errno != EINTR) {
            return gonio_fail_line(error, GONIO_E_IO, shown, -1, "unreadable: %s", strerror(errno));
        }
        file->size += got > 0 ? (size_t)got : 0;
    }
    return GONIO_OK;
}

static gonio_status read_once(int folder, const char *name, const char *shown, int64_t limit, session_png *file,
                              gonio_error *error) {
    int fd;
    int64_t size;
    gonio_status status = gonio_session_open_plain(folder, name, shown, limit, &fd, &size, error);
    if (status != GONIO_OK) {
        return status;
    }
    *file = (session_png){.data = malloc((size_t)size + 1), .capacity = (size_t)size};
    status = file->data != NULL ? read_bytes(fd, shown, file, error)
                                : gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", shown);
    close(fd);
    if (status != GONIO_OK) {
        free(file->data);
        *file = (session_png){0};
    }
    return status;
}

gonio_status gonio_session_file_read(int folder, const char *name, const char *shown, int64_t limit, session_png *file,
                                     gonio_error *error) {
    *file = (session_png){0};
    gonio_status status = read_once(folder, name, shown, limit, file, error);
    for (int tries = 1; status == GONIO_E_IO && tries < TRIES; tries++) {
        nanosleep(&(struct timespec){.tv_nsec = PAUSE_MS * 1000000L}, NULL);
        status = read_once(folder, name, shown, limit, file, error);
    }
    return status;
}
