// SPDX-License-Identifier: BSD-3-Clause
// Frames that were stored as they are, made small afterwards. Checksums are of pixels, so none changes.
#include <fcntl.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/thread_pool.h"
#include "host/session/internal.h"

void gonio_session_set_plain(gonio_session *session, bool plain) { session->plain = plain; }

// A file is replaced by one whose pixels were compared, or not at all.
static gonio_status check_equal(const gonio_frame *frame, int bits, const session_png *png, const char *name,
                                gonio_error *error) {
    gonio_frame back = {.window = frame->window};
    const gonio_status status = gonio_session_png_decode(png, name, bits, &back, error);
    const size_t pixels = (size_t)frame->window.width * (size_t)frame->window.height;
    const bool equal = status == GONIO_OK && memcmp(back.pixels, frame->pixels, pixels * sizeof *back.pixels) == 0;
    free(back.pixels);
    return status == GONIO_OK && !equal
               ? gonio_fail(error, GONIO_E_FAILED, "frames/%s: compressing changes its pixels; it stays as it is", name)
               : status;
}

// One file, whose pixels are already verified: replaced only where that makes it smaller.
static gonio_status compress_one(gonio_session *session, const gonio_frame *frame, int bits, int64_t *saved,
                                 int64_t *bytes, gonio_error *error) {
    char name[SESSION_FRAME_NAME];
    struct stat before;
    session_png png;
    session_file file;
    gonio_session_frame_name(frame->stamp.pose, frame->stamp.frame, name);
    if (fstatat(session->frames_fd, name, &before, AT_SYMLINK_NOFOLLOW) != 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1, "frames/%s cannot be found", name);
    }
    gonio_status status = gonio_session_png_encode(frame, bits, false, &png, error);
    if (status == GONIO_OK && (int64_t)png.size < before.st_size) {
        status = check_equal(frame, bits, &png, name, error);
        status = status == GONIO_OK ? gonio_session_file_write(session, name, &png, &file, error) : status;
        status = status == GONIO_OK ? gonio_session_files_keep(session, &file, 1, true, error) : status;
        *saved = status == GONIO_OK ? before.st_size - (int64_t)png.size : 0;
        *bytes = status == GONIO_OK ? (int64_t)png.size : 0;
    }
    free(png.data);
    return status;
}

typedef struct compression {
    gonio_session *session;
    const gonio_exposure *exposures;
    int64_t *bytes; // of each frame's file now; 0: it was left as it is
    int bits, threads;
    atomic_llong saved;
} compression;

static gonio_status compress_frame(void *context, size_t i, gonio_error *error) {
    compression *c = context;
    int64_t saved = 0;
    const gonio_status status = compress_one(c->session, &c->exposures[i].frame, c->bits, &saved, &c->bytes[i], error);
    c->saved += saved;
    return status;
}

static gonio_status enter_sizes(const compression *c, int64_t step, int n, gonio_error *error) {
    bool own;
    gonio_status status = gonio_session_begin_own(c->session, &own, error);
    if (status != GONIO_OK) {
        return status;
    }
    for (int i = 0; status == GONIO_OK && i < n; i++) {
        if (c->bytes[i] > 0) {
            status = gonio_session_do(c->session, error, "UPDATE frames SET bytes = ? WHERE step = ? AND frame = ?",
                                      "lli", c->bytes[i], step, c->exposures[i].frame.stamp.frame);
        }
    }
    return gonio_session_end_own(c->session, own, status, error);
}

static gonio_status compress_all(compression *c, int n, gonio_error *error) {
    c->bytes = calloc((size_t)n + 1, sizeof *c->bytes);
    if (c->bytes == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d sizes", n);
    }
    const gonio_status status = gonio_pool_try(c->threads, (size_t)n, compress_frame, c, error);
    // Also after a failure: the others have their new size.
    const gonio_status entered = enter_sizes(c, c->exposures[0].frame.stamp.pose, n, status == GONIO_OK ? error : NULL);
    free(c->bytes);
    return status == GONIO_OK ? entered : status;
}

static gonio_status compress_step(gonio_session *session, const gonio_step *step, int bits, void *context,
                                  gonio_error *error) {
    compression *c = context;
    gonio_exposure *exposures;
    int n;
    gonio_status status = gonio_session_exposures(session, step->index, &exposures, &n, error);
    if (status == GONIO_OK) {
        c->exposures = exposures;
        c->bits = bits;
        status = n > 0 ? compress_all(c, n, error) : GONIO_OK;
    }
    gonio_exposures_free(exposures, n);
    return status;
}

gonio_status gonio_session_compress(gonio_session *session, int threads, int64_t *saved_bytes, gonio_error *error) {
    compression c = {.session = session, .threads = threads};
    const gonio_status status = gonio_session_for_done(session, compress_step, &c, NULL, error);
    *saved_bytes = c.saved;
    return status;
}
