// SPDX-License-Identifier: BSD-3-Clause
// The frame store: files under frames/ and their rows in the journal.
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/text.h"
#include "host/session/internal.h"

gonio_status gonio_session_frame_bits(gonio_session *session, int *bits, gonio_error *error) {
    char *text, *end;
    *bits = 16;
    gonio_status status = gonio_session_find(session, "camera.bits", &text, error);
    if (status != GONIO_OK || text == NULL) {
        return status;
    }
    const long value = strtol(text, &end, 10);
    if (end == text || *end != 0 || value < 1 || value > 16) {
        char shown[40];
        gonio_text_printable(text, shown, sizeof shown);
        status = gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                 "table settings, row key = 'camera.bits', column value: found '%s', expected 1 to 16",
                                 shown);
    } else {
        *bits = (int)value;
    }
    free(text);
    return status;
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
    if (status == GONIO_OK && step->radiance.channels > 0) {
        status = gonio_session_put_radiance(session, step->index, &step->radiance, error);
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

gonio_status gonio_session_frame_file(gonio_session *session, const char *name, int64_t limit, session_png *png,
                                      gonio_error *error) {
    char shown[SESSION_FRAME_NAME + 8];
    snprintf(shown, sizeof shown, "frames/%s", name);
    return gonio_session_file_read(session->frames_fd, name, shown, limit, png, error);
}

// A frame's file: its words as they are, a filter's byte a row, and the wrapping of zlib and PNG.
static int64_t largest_file(const gonio_window *w) {
    const int64_t bytes = (int64_t)w->height * (2 * (int64_t)w->width + 1);
    return bytes + bytes / 64 + (1 << 20);
}

gonio_status gonio_session_frame_read(gonio_session *session, const char *name, const char *sha256, int bits,
                                      gonio_frame *frame, gonio_error *error) {
    char file[SESSION_FRAME_NAME + 8], hash[GONIO_SHA256_HEX];
    snprintf(file, sizeof file, "frames/%s", name);
    session_png png;
    gonio_status status = gonio_session_frame_file(session, name, largest_file(&frame->window), &png, error);
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

static void read_window(session_rows *rows, gonio_window *w) {
    w->x = (int)gonio_row_integer(rows, 4, 0, SESSION_SIZE_MAX);
    w->y = (int)gonio_row_integer(rows, 5, 0, SESSION_SIZE_MAX);
    w->width = (int)gonio_row_integer(rows, 6, 1, SESSION_SIZE_MAX);
    w->height = (int)gonio_row_integer(rows, 7, 1, SESSION_PIXELS_MAX / (w->width > 0 ? w->width : 1));
}

static gonio_status read_frame(session_rows *rows, int64_t step, int number, session_frame *out) {
    gonio_frame *frame = &out->exposure.frame;
    *out = (session_frame){.exposure.frame.stamp = {step, (int)gonio_row_integer(rows, 1, number, number), 0}};
    const char *name = gonio_row_text(rows, 2, SESSION_FRAME_NAME - 1), *hash = gonio_row_sha256(rows, 3);
    gonio_session_frame_name(step, number, out->file);
    if (name != NULL && strcmp(name, out->file) != 0) {
        gonio_row_fail(rows, 2, "'%s'", out->file);
    }
    snprintf(out->sha256, sizeof out->sha256, "%s", hash != NULL ? hash : "");
    read_window(rows, &frame->window);
    frame->exposure_s = gonio_row_real(rows, 8, 0, SESSION_EXPOSURE_MAX);
    frame->gain_db = gonio_row_real(rows, 9, -1000, 1000);
    frame->stamp.clock_s = gonio_row_real(rows, 10, -SESSION_CLOCK_MAX, SESSION_CLOCK_MAX);
    out->exposure.monitor = gonio_row_real_or(rows, 11, -DBL_MAX, DBL_MAX, NAN);
    out->exposure.monitor_sigma = gonio_row_real_or(rows, 12, 0, DBL_MAX, NAN);
    const bool sized = sqlite3_column_type(rows->statement, 13) != SQLITE_NULL;
    out->bytes = sized ? gonio_row_integer(rows, 13, 0, INT64_MAX) : -1;
    return rows->status;
}

gonio_status gonio_session_for_frames(gonio_session *session, int64_t step, session_frame_fn call, void *context,
                                      int *n, gonio_error *error) {
    session_rows rows;
    char sql[256];
    snprintf(sql, sizeof sql,
             "SELECT step, frame, file, sha256, x, y, width, height, exposure_s, gain_db, clock_s, monitor,"
             " monitor_sigma, %s AS bytes FROM frames WHERE step = ? ORDER BY frame",
             session->version > 1 ? "bytes" : "NULL");
    if (gonio_rows_open(&rows, session, "frames", 2, sql, error) == GONIO_OK) {
        sqlite3_bind_int64(rows.statement, 1, step);
    }
    for (*n = 0; gonio_rows_next(&rows); ++*n) {
        session_frame frame;
        if (read_frame(&rows, step, *n, &frame) != GONIO_OK) {
            break;
        }
        rows.status = call(session, &frame, context, error);
    }
    return gonio_rows_close(&rows);
}

typedef struct frame_list {
    gonio_exposure *items;
    int n, count, bits; // count: as the step says
    uint64_t bytes, memory;
} frame_list;

static gonio_status take_frame(gonio_session *session, const session_frame *row, void *context, gonio_error *error) {
    frame_list *list = context;
    gonio_exposure *exposure = &list->items[list->n];
    const gonio_window *w = &row->exposure.frame.window;
    if (list->n == list->count) {
        return GONIO_OK; // told when all are counted
    }
    list->bytes += 2 * (uint64_t)w->width * (uint64_t)w->height;
    if (list->bytes > list->memory) {
        return gonio_fail_frame(error, GONIO_E_INPUT, row->exposure.frame.stamp.pose, list->n,
                                "the step's frames have %llu bytes or more; this machine's memory is %llu",
                                (unsigned long long)list->bytes, (unsigned long long)list->memory);
    }
    *exposure = row->exposure;
    const gonio_status status =
        gonio_session_frame_read(session, row->file, row->sha256, list->bits, &exposure->frame, error);
    list->n += status == GONIO_OK;
    return status;
}

// How many frames the step says it has.
static gonio_status count_frames(gonio_session *session, int64_t step, int *count, gonio_error *error) {
    session_rows rows;
    if (gonio_rows_open(&rows, session, "steps", 1, "SELECT step, frames FROM steps WHERE step = ?", error) ==
        GONIO_OK) {
        sqlite3_bind_int64(rows.statement, 1, step);
    }
    const bool found = gonio_rows_next(&rows);
    *count = found ? (int)gonio_row_integer(&rows, 1, 0, SESSION_FRAMES_MAX) : 0;
    const gonio_status status = gonio_rows_close(&rows);
    return status != GONIO_OK || found ? status
                                       : gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                                         "table steps: there is no step %lld", (long long)step);
}

gonio_status gonio_session_exposures(gonio_session *session, int64_t step, gonio_exposure **exposures, int *n,
                                     gonio_error *error) {
    *exposures = NULL;
    *n = 0;
    int rows = 0;
    frame_list list = {.memory = (uint64_t)sysconf(_SC_PHYS_PAGES) * (uint64_t)sysconf(_SC_PAGESIZE)};
    gonio_status status = gonio_session_frame_bits(session, &list.bits, error);
    status = status == GONIO_OK ? count_frames(session, step, &list.count, error) : status;
    if (status == GONIO_OK) {
        list.items = calloc((size_t)list.count + 1, sizeof *list.items);
        status = list.items != NULL ? gonio_session_for_frames(session, step, take_frame, &list, &rows, error)
                                    : gonio_fail(error, GONIO_E_MEMORY, "no memory for %d frames", list.count);
    }
    if (status == GONIO_OK && rows != list.count) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                            "table frames: step %lld has %d frames; %d were stored", (long long)step, rows, list.count);
    }
    if (status != GONIO_OK) {
        gonio_exposures_free(list.items, list.n);
        return status;
    }
    *exposures = list.items;
    *n = list.n;
    return GONIO_OK;
}

gonio_status gonio_session_monitor(gonio_session *session, double *value, gonio_error *error) {
    session_rows rows;
    *value = 0;
    gonio_rows_open(&rows, session, "frames", 2,
                    "SELECT step, frame, monitor FROM frames WHERE monitor IS NOT NULL"
                    " ORDER BY step DESC, frame DESC LIMIT 1",
                    error);
    if (gonio_rows_next(&rows)) {
        *value = gonio_row_real(&rows, 2, -DBL_MAX, DBL_MAX);
    }
    return gonio_rows_close(&rows);
}

void gonio_exposures_free(gonio_exposure *exposures, int n) {
    for (int i = 0; exposures != NULL && i < n; i++) {
        free(exposures[i].frame.pixels);
    }
    free(exposures);
}
