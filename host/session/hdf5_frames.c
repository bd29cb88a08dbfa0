// SPDX-License-Identifier: BSD-3-Clause
// Frames <-> HDF5: an NXdetector for every read-out window, its frames in the order of the journal, one frame a chunk.
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "host/session/hdf5.h"

#define FRAME_PIXELS_MAX ((int64_t)500 << 20)
#define FIELD_ROWS 4096

// What stands beside each frame.
enum { EXPOSURE, GAIN, CLOCK, MONITOR, MONITOR_SIGMA, FIELDS };
static const struct {
    const char *name, *units;
} fields[FIELDS] = {
    {"count_time", "s"}, {"gain", "dB"}, {"clock", "s"}, {"monitor", NULL}, {"monitor_relative_sigma", NULL}};

typedef struct detector {
    gonio_window window;
    int64_t frames, at; // in all; the next one
    char path[64];
    h5_array data;
    int64_t *step, *frame;
    double *values[FIELDS];
} detector;

typedef struct mover {
    const h5_file *file;
    gonio_session *session;
    detector *detectors;
    size_t n;
    int bits;
    int64_t done, total;
    const h5_progress *progress;
} mover;

static void release(mover *m) {
    for (size_t i = 0; i < m->n; i++) {
        detector *d = &m->detectors[i];
        gonio_h5_array_close(&d->data);
        free(d->step);
        free(d->frame);
        for (int k = 0; k < FIELDS; k++) {
            free(d->values[k]);
        }
    }
    free(m->detectors);
}

static bool take_window(sqlite3_stmt *row, gonio_window *w) {
    const int64_t size[2] = {sqlite3_column_int64(row, 2), sqlite3_column_int64(row, 3)};
    *w = (gonio_window){sqlite3_column_int(row, 0), sqlite3_column_int(row, 1), (int)size[0], (int)size[1]};
    return size[0] >= 1 && size[1] >= 1 && size[0] <= 1 << 16 && size[1] <= 1 << 16 &&
           size[0] * size[1] <= FRAME_PIXELS_MAX;
}

static gonio_status add_detector(mover *m, sqlite3_stmt *row, gonio_error *error) {
    detector *larger = realloc(m->detectors, (m->n + 1) * sizeof *larger);
    if (larger == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu windows", m->n + 1);
    }
    m->detectors = larger;
    detector *d = &larger[m->n];
    *d = (detector){.frames = sqlite3_column_int64(row, 4)};
    if (!take_window(row, &d->window)) {
        return gonio_fail_line(error, GONIO_E_INPUT, m->session->db_path, -1,
                               "table frames has a window of %lld x %lld; 1 x 1 to 65536 x 65536 is possible",
                               (long long)sqlite3_column_int64(row, 2), (long long)sqlite3_column_int64(row, 3));
    }
    snprintf(d->path, sizeof d->path, "/entry/instrument/detector%s%.0zu", m->n > 0 ? "_" : "", m->n);
    m->total += d->frames;
    m->n++;
    return GONIO_OK;
}

// The windows of the session's frames, the most frequent first: on both ways the journal gives the same.
static gonio_status begin(mover *m, gonio_error *error) {
    sqlite3_stmt *rows;
    gonio_status status = gonio_session_frame_bits(m->session, &m->bits, error);
    if (status == GONIO_OK) {
        status = gonio_session_prepare(m->session,
                                       "SELECT x, y, width, height, count(*) FROM frames GROUP BY x, y, width, height"
                                       " ORDER BY 5 DESC, 1, 2, 3, 4",
                                       &rows, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    int code = SQLITE_DONE;
    while (status == GONIO_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        status = add_detector(m, rows, error);
    }
    if (status == GONIO_OK && code != SQLITE_DONE) {
        status = gonio_session_db_fail(m->session, error, "read the frames' windows");
    }
    sqlite3_finalize(rows);
    return status;
}

static detector *find(const mover *m, const gonio_window *w) {
    for (size_t i = 0; i < m->n; i++) {
        if (memcmp(&m->detectors[i].window, w, sizeof *w) == 0 && m->detectors[i].at < m->detectors[i].frames) {
            return &m->detectors[i];
        }
    }
    return NULL;
}

static bool go_on(mover *m) {
    m->done++;
    const h5_progress *p = m->progress;
    return p->call == NULL || p->call(p->context, (double)m->done / (double)m->total, "frames", NAN);
}

// A row of `frames` as the query below gives it; texts live as long as the row.
typedef struct frame_row {
    const char *name, *sha256;
    gonio_frame frame;
    double values[FIELDS];
    detector *detector;
} frame_row;

static gonio_status read_row(const mover *m, sqlite3_stmt *row, frame_row *out, gonio_error *error) {
    char expected[SESSION_FRAME_NAME];
    *out = (frame_row){.name = (const char *)sqlite3_column_text(row, 6), //
                       .sha256 = (const char *)sqlite3_column_text(row, 7)};
    out->frame.stamp = (gonio_stamp){sqlite3_column_int64(row, 4), sqlite3_column_int(row, 5), 0};
    const bool sound = take_window(row, &out->frame.window);
    out->detector = sound ? find(m, &out->frame.window) : NULL;
    for (int k = 0; k < FIELDS; k++) {
        const bool none = sqlite3_column_type(row, 8 + k) == SQLITE_NULL;
        out->values[k] = none ? NAN : sqlite3_column_double(row, 8 + k);
    }
    out->frame.exposure_s = out->values[EXPOSURE];
    out->frame.gain_db = out->values[GAIN];
    out->frame.stamp.clock_s = out->values[CLOCK];
    gonio_session_frame_name(out->frame.stamp.pose, out->frame.stamp.frame, expected);
    return out->detector != NULL && out->name != NULL && out->sha256 != NULL && strcmp(out->name, expected) == 0
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_INPUT, m->session->db_path, -1,
                                 "table frames, step %lld, frame %d: not the row of a frame",
                                 (long long)out->frame.stamp.pose, out->frame.stamp.frame);
}

typedef gonio_status (*row_fn)(mover *m, frame_row *row, gonio_error *error);

static gonio_status for_rows(mover *m, row_fn call, gonio_error *error) {
    sqlite3_stmt *rows;
    gonio_status status =
        gonio_session_prepare(m->session,
                              "SELECT x, y, width, height, step, frame, file, sha256, exposure_s, gain_db, clock_s,"
                              " monitor, monitor_sigma FROM frames ORDER BY step, frame",
                              &rows, error);
    int code = SQLITE_DONE;
    while (status == GONIO_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        frame_row row;
        status = read_row(m, rows, &row, error);
        status = status == GONIO_OK ? call(m, &row, error) : status;
        if (status == GONIO_OK && !go_on(m)) {
            status = gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %lld of %lld frames", (long long)m->done,
                                (long long)m->total);
        }
    }
    if (status == GONIO_OK && code != SQLITE_DONE) {
        status = gonio_session_db_fail(m->session, error, "read a frame's row");
    }
    sqlite3_finalize(rows);
    return status;
}

// ---- writing ----

static gonio_status open_detector(const mover *m, detector *d, gonio_error *error) {
    char path[160];
    const hsize_t dims[3] = {(hsize_t)d->frames, (hsize_t)d->window.height, (hsize_t)d->window.width};
    gonio_status status = gonio_h5_group(m->file, d->path, "NXdetector", error);
    snprintf(path, sizeof path, "%s/data", d->path);
    if (status == GONIO_OK) {
        status = gonio_h5_array_create(m->file, path, H5_U16, 0, 3, dims, 1, "counts", &d->data, error);
    }
    status =
        status == GONIO_OK ? gonio_h5_attribute_integer(m->file, path, "significant_bits", m->bits, error) : status;
    status = status == GONIO_OK ? gonio_h5_attribute_integer(m->file, d->path, "window_x", d->window.x, error) : status;
    status = status == GONIO_OK ? gonio_h5_attribute_integer(m->file, d->path, "window_y", d->window.y, error) : status;
    const size_t n = (size_t)d->frames + 1;
    d->step = calloc(n, sizeof *d->step);
    d->frame = calloc(n, sizeof *d->frame);
    bool room = d->step != NULL && d->frame != NULL;
    for (int k = 0; k < FIELDS; k++) {
        d->values[k] = calloc(n, sizeof *d->values[k]);
        room = room && d->values[k] != NULL;
    }
    return status == GONIO_OK && !room ? gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu frames' rows", n)
                                       : status;
}

static gonio_status put_frame(mover *m, frame_row *row, gonio_error *error) {
    detector *d = row->detector;
    gonio_status status = gonio_session_frame_read(m->session, row->name, row->sha256, m->bits, &row->frame, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_h5_array_write(&d->data, (hsize_t)d->at, 1, row->frame.pixels, error);
    free(row->frame.pixels);
    d->step[d->at] = row->frame.stamp.pose;
    d->frame[d->at] = row->frame.stamp.frame;
    for (int k = 0; k < FIELDS; k++) {
        d->values[k][d->at] = row->values[k];
    }
    d->at++;
    return status;
}

static gonio_status put_field(const mover *m, const detector *d, const char *name, h5_type kind, const char *units,
                              const void *values, gonio_error *error) {
    char path[160];
    h5_array array;
    const hsize_t n = (hsize_t)d->frames;
    snprintf(path, sizeof path, "%s/%s", d->path, name);
    gonio_status status = gonio_h5_array_create(m->file, path, kind, 0, 1, &n, FIELD_ROWS, units, &array, error);
    if (status == GONIO_OK) {
        status = gonio_h5_array_write(&array, 0, n, values, error);
        gonio_h5_array_close(&array);
    }
    return status;
}

static gonio_status put_fields(const mover *m, const detector *d, gonio_error *error) {
    gonio_status status = put_field(m, d, "step", H5_I64, NULL, d->step, error);
    status = status == GONIO_OK ? put_field(m, d, "frame", H5_I64, NULL, d->frame, error) : status;
    for (int k = 0; status == GONIO_OK && k < FIELDS; k++) {
        status = put_field(m, d, fields[k].name, H5_F64, fields[k].units, d->values[k], error);
    }
    return status;
}

gonio_status gonio_h5_put_frames(const h5_file *file, gonio_session *session, const h5_progress *progress,
                                 gonio_error *error) {
    mover m = {.file = file, .session = session, .progress = progress};
    gonio_status status = begin(&m, error);
    for (size_t i = 0; status == GONIO_OK && i < m.n; i++) {
        status = open_detector(&m, &m.detectors[i], error);
    }
    status = status == GONIO_OK ? for_rows(&m, put_frame, error) : status;
    for (size_t i = 0; status == GONIO_OK && i < m.n; i++) {
        status = put_fields(&m, &m.detectors[i], error);
    }
    release(&m);
    return status;
}

// ---- reading ----

static gonio_status find_detector(const mover *m, detector *d, gonio_error *error) {
    char path[160];
    snprintf(path, sizeof path, "%s/data", d->path);
    const gonio_status status = gonio_h5_array_open(m->file, path, H5_U16, 3, &d->data, error);
    const hsize_t *dims = d->data.dims;
    return status == GONIO_OK && (dims[0] != (hsize_t)d->frames || dims[1] != (hsize_t)d->window.height ||
                                  dims[2] != (hsize_t)d->window.width)
               ? gonio_fail_line(error, GONIO_E_INPUT, m->file->path, -1,
                                 "%s: %llu x %llu x %llu, the journal has %lld frames of %d x %d", path,
                                 (unsigned long long)dims[0], (unsigned long long)dims[1], (unsigned long long)dims[2],
                                 (long long)d->frames, d->window.width, d->window.height)
               : status;
}

static gonio_status store(const mover *m, const frame_row *row, gonio_error *error) {
    session_png png = {0};
    session_file out;
    char hash[GONIO_SHA256_HEX];
    gonio_status status = gonio_session_frame_hash(&row->frame, hash, error);
    if (status == GONIO_OK && strcmp(hash, row->sha256) != 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, m->file->path, -1,
                               "step %lld, frame %d: its pixels have SHA-256 %.12s..., %.12s... was journalled",
                               (long long)row->frame.stamp.pose, row->frame.stamp.frame, hash, row->sha256);
    }
    status = status == GONIO_OK ? gonio_session_png_encode(&row->frame, m->bits, false, &png, error) : status;
    if (status == GONIO_OK) {
        status = gonio_session_file_write(m->session, row->name, &png, &out, error);
        status = status == GONIO_OK ? gonio_session_files_keep(m->session, &out, 1, false, error) : status;
    }
    free(png.data);
    return status == GONIO_E_DEVICE ? GONIO_E_INPUT : status; // more bits than a camera's words: the file is to blame
}

static gonio_status get_frame(mover *m, frame_row *row, gonio_error *error) {
    detector *d = row->detector;
    row->frame.pixels = malloc(d->data.row_bytes);
    gonio_status status = row->frame.pixels != NULL
                              ? gonio_h5_array_read(&d->data, (hsize_t)d->at, 1, row->frame.pixels, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for a frame");
    d->at++;
    status = status == GONIO_OK ? store(m, row, error) : status;
    free(row->frame.pixels);
    return status;
}

gonio_status gonio_h5_get_frames(const h5_file *file, gonio_session *session, const h5_progress *progress,
                                 gonio_error *error) {
    mover m = {.file = file, .session = session, .progress = progress};
    gonio_status status = begin(&m, error);
    for (size_t i = 0; status == GONIO_OK && i < m.n; i++) {
        status = find_detector(&m, &m.detectors[i], error);
    }
    status = status == GONIO_OK ? for_rows(&m, get_frame, error) : status;
    release(&m);
    return status;
}

// Rows whose file has another size than they say; change: they say it then.
static gonio_status for_other_sizes(gonio_session *session, bool change, bool *any, gonio_error *error) {
    sqlite3_stmt *rows;
    gonio_status status = gonio_session_prepare(
        session, "SELECT step, frame, file, bytes FROM frames WHERE bytes IS NOT NULL", &rows, error);
    int code = SQLITE_DONE;
    *any = false;
    while (status == GONIO_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        struct stat facts;
        const char *name = (const char *)sqlite3_column_text(rows, 2);
        if (fstatat(session->frames_fd, name, &facts, AT_SYMLINK_NOFOLLOW) == 0 &&
            facts.st_size == sqlite3_column_int64(rows, 3)) {
            continue;
        }
        *any = true;
        if (change) {
            status =
                gonio_session_do(session, error, "UPDATE frames SET bytes = ? WHERE step = ? AND frame = ?", "lll",
                                 (int64_t)facts.st_size, sqlite3_column_int64(rows, 0), sqlite3_column_int64(rows, 1));
        }
    }
    if (status == GONIO_OK && code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "read a frame's row");
    }
    sqlite3_finalize(rows);
    return status;
}

gonio_status gonio_h5_sizes_differ(gonio_session *session, bool *differ, gonio_error *error) {
    return for_other_sizes(session, false, differ, error);
}

gonio_status gonio_h5_enter_sizes(gonio_session *session, gonio_error *error) {
    bool any;
    gonio_status status = gonio_session_begin(session, error);
    if (status == GONIO_OK) {
        status = gonio_session_end(session, for_other_sizes(session, true, &any, error), error);
    }
    return status;
}
