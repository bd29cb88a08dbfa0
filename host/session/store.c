// SPDX-License-Identifier: BSD-3-Clause
// The files of a step's frames, as one group: written, then synced, then named, so that a file of a final name is whole
// and the disk gets one long stream instead of a wait for each file.
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#include "base/thread_pool.h"
#include "host/session/folder.h"
#include "host/session/internal.h"

static bool write_all(int fd, const session_png *png) {
    for (size_t at = 0; at < png->size;) {
        const ssize_t wrote = write(fd, png->data + at, png->size - at);
        if (wrote < 0 && errno != EINTR) {
            return false;
        }
        at += wrote > 0 ? (size_t)wrote : 0;
    }
    return true;
}

// A new file under a name that nothing has, link or file: what lies about is not written to, and stays.
static int create_temporary(gonio_session *session, session_file *file) {
    int tries = 100;
    do {
        uint32_t number;
        if (getrandom(&number, sizeof number, 0) != sizeof number) {
            return -1;
        }
        snprintf(file->temporary, sizeof file->temporary, ".%s.%08" PRIx32 ".new", file->name, number);
        file->fd =
            openat(session->frames_fd, file->temporary, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    } while (file->fd < 0 && errno == EEXIST && --tries > 0);
    return file->fd;
}

static gonio_status fail_file(const gonio_session *session, const session_file *file, int why, gonio_error *error) {
    return gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot store frames/%s: %s%s", file->name,
                           strerror(why), why == ENOSPC ? "; make room and resume" : "");
}

static void discard(gonio_session *session, session_file *file) {
    if (file->fd >= 0) {
        close(file->fd);
        unlinkat(session->frames_fd, file->temporary, 0);
        file->fd = -1;
    }
}

gonio_status gonio_session_file_write(gonio_session *session, const char *name, const session_png *png,
                                      session_file *file, gonio_error *error) {
    *file = (session_file){.fd = -1};
    snprintf(file->name, sizeof file->name, "%s", name);
    if (create_temporary(session, file) < 0) {
        return fail_file(session, file, errno, error);
    }
    if (!write_all(file->fd, png)) {
        const int why = errno;
        discard(session, file);
        return fail_file(session, file, why, error);
    }
#ifdef SYNC_FILE_RANGE_WRITE
    if (!session->unsynced) {
        sync_file_range(file->fd, 0, 0,
                        SYNC_FILE_RANGE_WRITE); // the disk begins at once; a hint, whose failure is harmless
    }
#endif
    return GONIO_OK;
}

// Whatever has the name already was not written by this step.
static int give_name(gonio_session *session, const char *temporary, const char *name, bool replace) {
    if (replace) {
        return renameat(session->frames_fd, temporary, session->frames_fd, name);
    }
    int result;
    while ((result = gonio_folder_rename(session->frames_fd, temporary, session->frames_fd, name)) != 0 &&
           errno == EEXIST) {
        if (gonio_session_set_aside(session, session->frames_fd, "frames/", name, "it had the name of a step's frame",
                                    NULL) != GONIO_OK) {
            errno = EEXIST;
            break;
        }
    }
    return result;
}

static bool keep(gonio_session *session, session_file *file, bool replace, int *why) {
    *why = 0;
    if (close(file->fd) != 0 || give_name(session, file->temporary, file->name, replace) != 0) {
        *why = errno;
        unlinkat(session->frames_fd, file->temporary, 0);
    }
    file->fd = -1;
    return *why == 0;
}

gonio_status gonio_session_set_sync(gonio_session *session, bool sync, gonio_error *error) {
    session->unsynced = !sync;
    // Not gonio_session_exec: within a transaction it cannot be changed, and it is no change of the journal.
    const char *sql = sync ? "PRAGMA synchronous = FULL" : "PRAGMA synchronous = OFF";
    return sqlite3_exec(session->db, sql, NULL, NULL, NULL) == SQLITE_OK ? GONIO_OK
                                                                         : gonio_session_db_fail(session, error, sql);
}

int gonio_session_sync(const gonio_session *session, int fd) { return session->unsynced ? 0 : fsync(fd); }

gonio_status gonio_session_files_keep(gonio_session *session, session_file *files, int n, bool replace,
                                      gonio_error *error) {
    int at = 0, why = 0;
    while (at < n && gonio_session_sync(session, files[at].fd) == 0) {
        at++;
    }
    if (at < n) {
        why = errno;
    } else {
        for (at = 0; at < n && keep(session, &files[at], replace, &why); at++) {
        }
    }
    if (at == n && gonio_session_sync(session, session->frames_fd) == 0) {
        return GONIO_OK;
    }
    const gonio_status status =
        at < n ? fail_file(session, &files[at], why, error)
               : gonio_fail_line(error, GONIO_E_IO, session->path, -1, "cannot sync frames/: %s", strerror(errno));
    for (int i = 0; i < n; i++) {
        discard(session, &files[i]);
    }
    return status;
}

static gonio_status store_one(gonio_session *session, int64_t step, int number, const gonio_frame *frame, int bits,
                              session_stored *stored, session_file *file, gonio_error *error) {
    session_png png = {0};
    char name[SESSION_FRAME_NAME];
    gonio_session_frame_name(step, number, name);
    gonio_status status = gonio_session_frame_hash(frame, stored->sha256, error);
    status = status == GONIO_OK ? gonio_session_png_encode(frame, bits, session->plain, &png, error) : status;
    status = status == GONIO_OK ? gonio_session_file_write(session, name, &png, file, error) : status;
    stored->bytes = (int64_t)png.size;
    free(png.data);
    return status;
}

typedef struct storing {
    gonio_session *session;
    int64_t step;
    const gonio_exposure *exposures;
    int bits;
    session_stored *stored;
    session_file *files;
} storing;

static gonio_status store_frame(void *context, size_t i, gonio_error *error) {
    const storing *s = context;
    return store_one(s->session, s->step, (int)i, &s->exposures[i].frame, s->bits, &s->stored[i], &s->files[i], error);
}

gonio_status gonio_session_store_frames(gonio_session *session, int64_t step, const gonio_exposure *exposures, int n,
                                        int bits, session_stored *stored, gonio_error *error) {
    session_file *files = calloc((size_t)n + 1, sizeof *files);
    if (files == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d frames", n);
    }
    for (int i = 0; i < n; i++) {
        files[i].fd = -1;
    }
    // Only a burst is in such a hurry; compressing has its frames from a scan, whose own threads are busy.
    gonio_status status = gonio_pool_try(session->plain ? 0 : 1, (size_t)n, store_frame,
                                         &(storing){session, step, exposures, bits, stored, files}, error);
    if (status == GONIO_OK) {
        status = gonio_session_files_keep(session, files, n, false, error);
    } else {
        for (int i = 0; i < n; i++) {
            discard(session, &files[i]);
        }
    }
    free(files);
    return status;
}
