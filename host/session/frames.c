// SPDX-License-Identifier: BSD-3-Clause
// The frame store: files under frames/ and their rows in the journal.
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "host/session/internal.h"

gonio_status gonio_session_frame_bits(gonio_session *session, int *bits, gonio_error *error) {
    char *text;
    *bits = 16;
    if (gonio_session_get(session, "camera.bits", &text, NULL) != GONIO_OK) {
        return GONIO_OK;
    }
    *bits = atoi(text);
    free(text);
    return *bits >= 1 && *bits <= 16 ? GONIO_OK
                                     : gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                                       "setting camera.bits is %d; 1 to 16 is expected", *bits);
}

// ---- writing ----

// UTC with milliseconds, as the events have it.
static const char *utc_text(double utc_s, char text[32]) {
    const time_t whole = (time_t)utc_s;
    struct tm parts;
    char seconds[24];
    if (!(utc_s > 0) || gmtime_r(&whole, &parts) == NULL ||
        strftime(seconds, sizeof seconds, "%Y-%m-%dT%H:%M:%S", &parts) == 0) {
        return NULL;
    }
    snprintf(text, 32, "%s.%03dZ", seconds, (int)(1000 * (utc_s - (double)whole)));
    return text;
}

static gonio_status enter_frame(gonio_session *session, const gonio_exposure *exposure, int64_t step, int number,
                                const session_stored *stored, gonio_error *error) {
    const gonio_frame *frame = &exposure->frame;
    const gonio_window *w = &frame->window;
    char name[SESSION_FRAME_NAME], utc[32];
    gonio_session_frame_name(step, number, name);
    return gonio_session_do(
        session, error,
        "INSERT INTO frames(step, frame, file, sha256, x, y, width, height, exposure_s, gain_db, clock_s, monitor,"
        " monitor_sigma, utc, monotonic_s, bytes) VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)",
        "littiiiirrrrrtrl", step, number, name, stored->sha256, w->x, w->y, w->width, w->height, frame->exposure_s,
        frame->gain_db, frame->stamp.clock_s, exposure->monitor, exposure->monitor_sigma,
        utc_text(exposure->utc_s, utc), exposure->utc_s > 0 ? exposure->monotonic_s : NAN, stored->bytes);
}

static gonio_status mark_done(gonio_session *session, const gonio_step *step, int frames, gonio_error *error) {
    const gonio_status status =
        gonio_session_do(session, error,
                         "UPDATE steps SET done = 1, frames = ?, clock_end_s = ?, exposure_end_s = ?,"
                         " utc = strftime('%Y-%m-%dT%H:%M:%fZ', 'now') WHERE step = ? AND done = 0",
                         "irrl", frames, step->clock_end_s, step->exposure_end_s, step->index);
    if (status == GONIO_OK && sqlite3_changes(session->db) != 1) {
        return gonio_fail_line(error, GONIO_E_FAILED, session->db_path, -1, "step %lld is done already, or unknown",
                               (long long)step->index);
    }
    return status;
}

static gonio_status enter(gonio_session *session, const gonio_step *step, const gonio_exposure *exposures, int n,
                          const session_stored *stored, const gonio_samples *samples, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < n; i++) {
        status = enter_frame(session, &exposures[i], step->index, i, &stored[i], error);
    }
    if (status == GONIO_OK && samples != NULL) {
        status = gonio_session_store_samples(session, step->index, samples, error);
    }
    if (status == GONIO_OK && step->flagged) {
        status = gonio_session_do(session, error, "INSERT OR IGNORE INTO flagged VALUES(?)", "l", step->index);
    }
    return status == GONIO_OK ? mark_done(session, step, n, error) : status;
}

gonio_status gonio_session_finish_step(gonio_session *session, const gonio_step *step, const gonio_exposure *exposures,
                                       int n, const gonio_samples *samples, gonio_error *error) {
    int bits;
    gonio_status status = gonio_session_frame_bits(session, &bits, error);
    if (status != GONIO_OK) {
        return status;
    }
    session_stored *stored = calloc((size_t)n + 1, sizeof *stored);
    if (stored == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d checksums", n);
    }
    status = gonio_session_store_frames(session, step->index, exposures, n, bits, stored, error);
    if (status == GONIO_OK) {
        bool own;
        status = gonio_session_begin_own(session, &own, error);
        if (status == GONIO_OK) {
            status =
                gonio_session_end_own(session, own, enter(session, step, exposures, n, stored, samples, error), error);
        }
    }
    free(stored);
    return status;
}

// ---- reading ----

gonio_status gonio_session_frame_file(gonio_session *session, const char *name, session_png *png, gonio_error *error) {
    *png = (session_png){0};
    const int fd = openat(session->frames_fd, name, O_RDONLY | O_CLOEXEC);
    struct stat info;
    gonio_status status = GONIO_OK;
    if (fd < 0 || fstat(fd, &info) != 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, session->path, -1, "frames/%s: %s", name, strerror(errno));
    } else if ((png->data = malloc((size_t)info.st_size + 1)) == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for frames/%s", name);
    } else {
        ssize_t got;
        while (png->size < (size_t)info.st_size &&
               (got = read(fd, png->data + png->size, (size_t)info.st_size - png->size)) > 0) {
            png->size += (size_t)got;
        }
    }
    if (fd >= 0) {
        close(fd);
    }
    return status;
}

gonio_status gonio_session_frame_read(gonio_session *session, const char *name, const char *sha256, int bits,
                                      gonio_frame *frame, gonio_error *error) {
    char file[SESSION_FRAME_NAME + 8], hash[GONIO_SHA256_HEX];
    snprintf(file, sizeof file, "frames/%s", name);
    session_png png;
    gonio_status status = gonio_session_frame_file(session, name, &png, error);
    status = status == GONIO_OK ? gonio_session_png_decode(&png, file, bits, frame, error) : status;
    free(png.data);
    if (status == GONIO_OK) {
        status = gonio_session_frame_hash(frame, hash, error);
        if (status == GONIO_OK && strcmp(hash, sha256) != 0) {
            status = gonio_fail_line(error, GONIO_E_INPUT, file, -1,
                                     "its pixels have SHA-256 %.12s..., %.12s... was journalled", hash, sha256);
        }
        if (status != GONIO_OK) {
            free(frame->pixels);
            frame->pixels = NULL;
        }
    }
    return status;
}

static double column_or_nan(sqlite3_stmt *row, int column) {
    return sqlite3_column_type(row, column) == SQLITE_NULL ? NAN : sqlite3_column_double(row, column);
}

static gonio_status read_exposure(gonio_session *session, sqlite3_stmt *row, int64_t step, int bits,
                                  gonio_exposure *exposure, gonio_error *error) {
    const char *name = (const char *)sqlite3_column_text(row, 1), *hash = (const char *)sqlite3_column_text(row, 2);
    const int width = sqlite3_column_int(row, 5), height = sqlite3_column_int(row, 6);
    if (name == NULL || hash == NULL || strchr(name, '/') != NULL || width < 1 || height < 1 || width > 1 << 16 ||
        height > 1 << 16) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1, "step %lld has a damaged frame row",
                               (long long)step);
    }
    *exposure = (gonio_exposure){
        .frame = {.window = {sqlite3_column_int(row, 3), sqlite3_column_int(row, 4), width, height},
                  .exposure_s = sqlite3_column_double(row, 7),
                  .gain_db = sqlite3_column_double(row, 8),
                  .stamp = {step, sqlite3_column_int(row, 0), sqlite3_column_double(row, 9)}},
        .monitor = column_or_nan(row, 10),
        .monitor_sigma = column_or_nan(row, 11),
    };
    return gonio_session_frame_read(session, name, hash, bits, &exposure->frame, error);
}

static gonio_status read_rows(gonio_session *session, sqlite3_stmt *rows, int64_t step, int bits,
                              gonio_exposure *exposures, int count, int *n, gonio_error *error) {
    int code = SQLITE_DONE;
    gonio_status status = GONIO_OK;
    *n = 0;
    while (status == GONIO_OK && *n < count && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        status = read_exposure(session, rows, step, bits, &exposures[*n], error);
        *n += status == GONIO_OK;
    }
    if (status == GONIO_OK && *n < count) {
        status = code == SQLITE_DONE
                     ? gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                       "step %lld has %d frames; %d were stored", (long long)step, *n, count)
                     : gonio_session_db_fail(session, error, "read a frame's row");
    }
    return status;
}

gonio_status gonio_session_exposures(gonio_session *session, int64_t step, gonio_exposure **exposures, int *n,
                                     gonio_error *error) {
    *exposures = NULL;
    *n = 0;
    int bits;
    int64_t count = 0;
    char sql[96];
    snprintf(sql, sizeof sql, "SELECT frames FROM steps WHERE step = %lld", (long long)step);
    gonio_status status = gonio_session_frame_bits(session, &bits, error);
    status = status == GONIO_OK ? gonio_session_integer(session, sql, &count, error) : status;
    sqlite3_stmt *rows = NULL;
    if (status == GONIO_OK) {
        status = gonio_session_prepare(session,
                                       "SELECT frame, file, sha256, x, y, width, height, exposure_s, gain_db, clock_s,"
                                       " monitor, monitor_sigma FROM frames WHERE step = ? ORDER BY frame",
                                       &rows, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    sqlite3_bind_int64(rows, 1, step);
    gonio_exposure *list = calloc((size_t)count + 1, sizeof *list);
    status = list == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for %lld frames", (long long)count)
                          : read_rows(session, rows, step, bits, list, (int)count, n, error);
    sqlite3_finalize(rows);
    if (status != GONIO_OK) {
        gonio_exposures_free(list, *n);
        *n = 0;
        return status;
    }
    *exposures = list;
    return GONIO_OK;
}

gonio_status gonio_session_monitor(gonio_session *session, double *value, gonio_error *error) {
    sqlite3_stmt *row;
    *value = 0;
    gonio_status status = gonio_session_prepare(session,
                                                "SELECT monitor FROM frames WHERE monitor IS NOT NULL"
                                                " ORDER BY step DESC, frame DESC LIMIT 1",
                                                &row, error);
    if (status != GONIO_OK) {
        return status;
    }
    const int code = sqlite3_step(row);
    if (code == SQLITE_ROW) {
        *value = sqlite3_column_double(row, 0);
    } else if (code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "read the monitor's last reading");
    }
    sqlite3_finalize(row);
    return status;
}

void gonio_exposures_free(gonio_exposure *exposures, int n) {
    for (int i = 0; exposures != NULL && i < n; i++) {
        free(exposures[i].frame.pixels);
    }
    free(exposures);
}
