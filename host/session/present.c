// SPDX-License-Identifier: BSD-3-Clause
// Before a session goes on: is every frame of a done step there? A folder that was copied while a measure ran, or whose
// disk lost files, must not go on as if it were whole. No frame is read whose file has its journalled size.
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "host/session/internal.h"

typedef struct looking {
    int64_t all, bad;
    char first[SESSION_FRAME_NAME + 64]; // what is wrong with the first bad one
} looking;

// Another size than was journalled: `gonio doctor --compress`, stopped between a file and its row, leaves that. Then
// the pixels tell.
static bool pixels_sound(gonio_session *session, sqlite3_stmt *row, const char *name, int bits) {
    gonio_frame frame = {.window = {0, 0, sqlite3_column_int(row, 3), sqlite3_column_int(row, 4)}};
    const char *hash = (const char *)sqlite3_column_text(row, 1);
    const bool sound = hash != NULL && frame.window.width > 0 && frame.window.height > 0 &&
                       gonio_session_frame_read(session, name, hash, bits, &frame, NULL) == GONIO_OK;
    free(frame.pixels);
    return sound;
}

static void look_at(gonio_session *session, sqlite3_stmt *row, int bits, looking *l) {
    const char *name = (const char *)sqlite3_column_text(row, 0);
    const bool sized = sqlite3_column_type(row, 2) != SQLITE_NULL; // sessions of version 1 had no sizes
    const int64_t bytes = sqlite3_column_int64(row, 2);
    struct stat info;
    const bool there =
        name != NULL && fstatat(session->frames_fd, name, &info, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(info.st_mode);
    l->all++;
    if (there && (sized ? info.st_size == bytes : info.st_size > 0)) {
        return;
    }
    if (there && pixels_sound(session, row, name, bits)) {
        return;
    }
    if (l->bad++ == 0 && there) {
        snprintf(l->first, sizeof l->first, "frames/%.47s has %lld bytes, %lld were journalled", name,
                 (long long)info.st_size, (long long)bytes);
    } else if (l->bad == 1) {
        snprintf(l->first, sizeof l->first, "frames/%.47s is missing", name != NULL ? name : "");
    }
}

gonio_status gonio_session_check_present(gonio_session *session, gonio_error *error) {
    sqlite3_stmt *rows;
    int bits, code;
    gonio_status status = gonio_session_frame_bits(session, &bits, error);
    status = status == GONIO_OK
                 ? gonio_session_prepare(session,
                                         "SELECT file, sha256, bytes, width, height FROM frames WHERE step IN (SELECT"
                                         " step FROM steps WHERE done != 0) ORDER BY step, frame",
                                         &rows, error)
                 : status;
    if (status != GONIO_OK) {
        return status;
    }
    looking l = {0};
    while ((code = sqlite3_step(rows)) == SQLITE_ROW) {
        look_at(session, rows, bits, &l);
    }
    if (code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "list the frames");
    } else if (l.bad > 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, session->path, -1,
                                 "%lld of %lld frames of finished steps are not as they were stored: %s; `gonio doctor"
                                 " --repair` has such steps measured again",
                                 (long long)l.bad, (long long)l.all, l.first);
    }
    sqlite3_finalize(rows);
    return status;
}
