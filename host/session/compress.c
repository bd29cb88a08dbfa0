// Frames that were stored as they are, made small afterwards. Checksums are of pixels, so none changes.
#include <stdlib.h>
#include <sys/stat.h>

#include "host/session/internal.h"

void gonio_session_set_plain(gonio_session *session, bool plain) { session->plain = plain; }

// One file, whose pixels are already verified: replaced only where that makes it smaller.
static gonio_status compress_one(gonio_session *session, const gonio_frame *frame, int bits, int64_t *saved,
                                 gonio_error *error) {
    char name[SESSION_FRAME_NAME];
    struct stat before;
    session_png png;
    session_file file;
    session_frame_name(frame->stamp.pose, frame->stamp.frame, name);
    if (fstatat(session->frames_fd, name, &before, 0) != 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1, "frames/%s cannot be found", name);
    }
    gonio_status status = session_png_encode(frame, bits, false, &png, error);
    if (status == GONIO_OK && (int64_t)png.size < before.st_size) {
        status = session_file_write(session, name, &png, &file, error);
        if (status == GONIO_OK) {
            status = session_files_keep(session, &file, 1, error);
        }
        *saved = status == GONIO_OK ? before.st_size - (int64_t)png.size : 0;
    }
    free(png.data);
    return status;
}

static gonio_status compress_step(gonio_session *session, const gonio_step *step, int bits, void *context,
                                  gonio_error *error) {
    int64_t *saved = context;
    gonio_exposure *exposures;
    int n, failed = -1;
    gonio_status status = gonio_session_exposures(session, step->index, &exposures, &n, error);
    if (status != GONIO_OK) {
        return status;
    }
    int64_t sum = 0;
    gonio_error first = {0};
#pragma omp parallel for schedule(dynamic, 1) reduction(+ : sum) if (n > 1)
    for (int i = 0; i < n; i++) {
        int64_t less = 0;
        gonio_error why = {0};
        const gonio_status one = compress_one(session, &exposures[i].frame, bits, &less, &why);
        sum += less;
        if (one != GONIO_OK) {
#pragma omp critical(gonio_compress)
            if (failed < 0 || i < failed) {
                failed = i;
                first = why;
                status = one;
            }
        }
    }
    if (status != GONIO_OK && error != NULL) {
        *error = first;
    }
    *saved += sum;
    gonio_exposures_free(exposures, n);
    return status;
}

gonio_status gonio_session_compress(gonio_session *session, int64_t *saved_bytes, gonio_error *error) {
    *saved_bytes = 0;
    return session_for_done(session, compress_step, saved_bytes, NULL, error);
}
