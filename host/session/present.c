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
    int bits;
    char first[SESSION_FRAME_NAME + 64]; // what is wrong with the first bad one
} looking;

// Another size than was journalled: `gonio doctor --compress`, stopped between a file and its row, leaves that. Then
// the pixels tell.
static bool pixels_sound(gonio_session *session, const session_frame *row, int bits) {
    gonio_frame frame = row->exposure.frame;
    const bool sound = gonio_session_frame_read(session, row->file, row->sha256, bits, &frame, NULL) == GONIO_OK;
    free(frame.pixels);
    return sound;
}

static gonio_status look_at(gonio_session *session, const session_frame *row, void *context, gonio_error *error) {
    (void)error;
    looking *l = context;
    const bool sized = row->bytes >= 0; // sessions of version 1 had no sizes
    struct stat info;
    const bool there = fstatat(session->frames_fd, row->file, &info, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(info.st_mode);
    l->all++;
    if (there && ((sized ? info.st_size == row->bytes : info.st_size > 0) || pixels_sound(session, row, l->bits))) {
        return GONIO_OK;
    }
    if (l->bad++ == 0 && there) {
        snprintf(l->first, sizeof l->first, "frames/%s has %lld bytes, %lld were journalled", row->file,
                 (long long)info.st_size, (long long)row->bytes);
    } else if (l->bad == 1) {
        snprintf(l->first, sizeof l->first, "frames/%s is missing", row->file);
    }
    return GONIO_OK;
}

static gonio_status look_at_step(gonio_session *session, const gonio_step *step, int bits, void *context,
                                 gonio_error *error) {
    int n;
    ((looking *)context)->bits = bits;
    return gonio_session_for_frames(session, step->index, look_at, context, &n, error);
}

gonio_status gonio_session_check_present(gonio_session *session, gonio_error *error) {
    looking l = {0};
    gonio_status status = gonio_session_for_done(session, look_at_step, &l, NULL, error);
    if (status == GONIO_OK && l.bad > 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, session->path, -1,
                                 "%lld of %lld frames of finished steps are not as they were stored: %s; `gonio doctor"
                                 " --repair` has such steps measured again",
                                 (long long)l.bad, (long long)l.all, l.first);
    }
    return status;
}
