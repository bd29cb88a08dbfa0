// SPDX-License-Identifier: BSD-3-Clause
// A session's samples as NXdata, and files of its folder as NXnote.
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "gonio/output.h"
#include "host/session/hdf5.h"

#define CHUNK_ROWS 4096

// ---- samples ----

enum { THETA_I, PHI_I, THETA_O, PHI_O, STEP, VALUE, ERRORS, RANDOM, SYSTEMATIC, ARRAYS };
static const struct {
    const char *name, *units;
    h5_type kind;
    bool wide; // a column a channel
} arrays[ARRAYS] = {
    [THETA_I] = {"theta_i", "deg", H5_F64, false},
    [PHI_I] = {"phi_i", "deg", H5_F64, false},
    [THETA_O] = {"theta_o", "deg", H5_F64, false},
    [PHI_O] = {"phi_o", "deg", H5_F64, false},
    [STEP] = {"step", NULL, H5_I64, false},
    [VALUE] = {"f_r", "1/sr", H5_F64, true},
    [ERRORS] = {"f_r_errors", "1/sr", H5_F64, true},
    [RANDOM] = {"sigma_random", "1/sr", H5_F64, true},
    [SYSTEMATIC] = {"sigma_systematic", "1/sr", H5_F64, true},
};

typedef struct data_writer {
    const h5_file *file;
    h5_array arrays[ARRAYS];
    hsize_t rows, at;
    bool open;
} data_writer;

static gonio_status put_names(const h5_file *file, const gonio_samples *set, gonio_error *error) {
    h5_array names;
    const hsize_t channels = (hsize_t)set->channels;
    gonio_status status = gonio_h5_array_create(file, "/entry/data/channel", H5_TEXT, GONIO_CHANNEL_NAME_MAX, 1,
                                                &channels, channels, NULL, &names, error);
    if (status == GONIO_OK) {
        char(*padded)[GONIO_CHANNEL_NAME_MAX] = calloc(channels, sizeof *padded);
        for (int c = 0; padded != NULL && c < set->channels; c++) {
            snprintf(padded[c], sizeof padded[c], "%s", set->channel_names[c]);
        }
        status = padded != NULL ? gonio_h5_array_write(&names, 0, channels, padded, error)
                                : gonio_fail(error, GONIO_E_MEMORY, "no memory for channel names");
        free(padded);
        gonio_h5_array_close(&names);
    }
    return status;
}

static gonio_status open_arrays(data_writer *w, const gonio_samples *set, gonio_error *error) {
    const hsize_t dims[2] = {w->rows, (hsize_t)set->channels};
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < ARRAYS; k++) {
        char path[64];
        snprintf(path, sizeof path, "/entry/data/%s", arrays[k].name);
        status = gonio_h5_array_create(w->file, path, arrays[k].kind, 0, arrays[k].wide ? 2 : 1, dims, CHUNK_ROWS,
                                       arrays[k].units, &w->arrays[k], error);
    }
    w->open = true;
    return status == GONIO_OK ? put_names(w->file, set, error) : status;
}

static void fill(int array, const gonio_samples *set, int64_t step, void *to) {
    const size_t channels = (size_t)set->channels;
    for (size_t i = 0; i < set->n && array <= STEP; i++) {
        const double angles[4] = {set->pairs[i].theta_i, set->pairs[i].phi_i, set->pairs[i].theta_o,
                                  set->pairs[i].phi_o};
        if (array == STEP) {
            ((int64_t *)to)[i] = step;
        } else {
            ((double *)to)[i] = gonio_degrees(angles[array]);
        }
    }
    for (size_t k = 0; k < set->n * channels && array > STEP; k++) {
        ((double *)to)[k] = array == VALUE    ? set->values[k]
                            : array == ERRORS ? hypot(set->sigma_random[k], set->sigma_systematic[k])
                            : array == RANDOM ? set->sigma_random[k]
                                              : set->sigma_systematic[k];
    }
}

static gonio_status put_set(void *context, int64_t step, const gonio_samples *set, gonio_error *error) {
    data_writer *w = context;
    gonio_status status = w->open ? GONIO_OK : open_arrays(w, set, error);
    double *buffer = malloc((set->n * (size_t)set->channels + 1) * sizeof *buffer);
    if (status == GONIO_OK && buffer == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", set->n);
    }
    for (int k = 0; status == GONIO_OK && k < ARRAYS; k++) {
        fill(k, set, step, buffer);
        status = gonio_h5_array_write(&w->arrays[k], w->at, set->n, buffer, error);
    }
    free(buffer);
    w->at += set->n;
    return status;
}

gonio_status gonio_h5_put_data(const h5_file *file, gonio_session *session, gonio_error *error) {
    data_writer w = {.file = file};
    bool final;
    int64_t rows = 0;
    gonio_status status = gonio_session_is_final(session, &final, error);
    if (status == GONIO_OK) {
        status = gonio_session_integer(
            session, final ? "SELECT ifnull(sum(n), 0) FROM final_samples" : "SELECT ifnull(sum(n), 0) FROM samples",
            &rows, error);
    }
    if (status != GONIO_OK || rows <= 0) {
        return status; // nothing measured yet
    }
    w.rows = (hsize_t)rows;
    status = gonio_h5_group(file, "/entry/data", "NXdata", error);
    status = status == GONIO_OK ? gonio_h5_attribute(file, "/entry/data", "signal", "f_r", error) : status;
    status = status == GONIO_OK ? gonio_h5_attribute_integer(file, "/entry/data", "final", final, error) : status;
    status = status == GONIO_OK ? gonio_session_each_set(session, final, put_set, &w, error) : status;
    for (int k = 0; k < ARRAYS; k++) {
        gonio_h5_array_close(&w.arrays[k]);
    }
    return status;
}

// ---- files ----

static gonio_status put_bytes(const h5_file *file, const char *name, int fd, int64_t size, gonio_error *error) {
    char path[160];
    h5_array bytes;
    const hsize_t n = (hsize_t)size;
    snprintf(path, sizeof path, "/entry/files/%.100s/data", name);
    unsigned char *buffer = malloc(H5_PIECE_BYTES);
    if (buffer == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a piece of a file");
    }
    gonio_status status = gonio_h5_array_create(file, path, H5_U8, 0, 1, &n, H5_PIECE_BYTES, NULL, &bytes, error);
    for (hsize_t at = 0; status == GONIO_OK && at < n;) {
        const size_t want = n - at < H5_PIECE_BYTES ? (size_t)(n - at) : H5_PIECE_BYTES;
        const ssize_t got = pread(fd, buffer, want, (off_t)at);
        status = got > 0 ? gonio_h5_array_write(&bytes, at, (hsize_t)got, buffer, error)
                         : gonio_fail(error, GONIO_E_IO, "%s became shorter while it was read", name);
        at += got > 0 ? (hsize_t)got : 0;
    }
    gonio_h5_array_close(&bytes);
    free(buffer);
    return status;
}

gonio_status gonio_h5_put_file(const h5_file *file, int folder, const char *path, const char *name, int64_t limit,
                               gonio_error *error) {
    char group[160];
    struct stat facts;
    const int fd = openat(folder, path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0 || fstat(fd, &facts) != 0 || !S_ISREG(facts.st_mode)) {
        if (fd >= 0) {
            close(fd);
        }
        return GONIO_OK; // it need not be there
    }
    const int64_t size = limit >= 0 && limit < facts.st_size ? limit : facts.st_size;
    snprintf(group, sizeof group, "/entry/files/%.100s", name);
    gonio_status status = gonio_h5_group(file, group, "NXnote", error);
    status = status == GONIO_OK ? gonio_h5_attribute(file, group, "file_name", name, error) : status;
    status = status == GONIO_OK ? put_bytes(file, name, fd, size, error) : status;
    close(fd);
    return status;
}

gonio_status gonio_h5_get_file(const h5_file *file, const char *name, const char *path, gonio_error *error) {
    char data[160];
    h5_array bytes;
    gonio_output *output;
    snprintf(data, sizeof data, "/entry/files/%.100s/data", name);
    unsigned char *buffer = malloc(H5_PIECE_BYTES);
    if (buffer == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a piece of a file");
    }
    gonio_status status = gonio_h5_array_open(file, data, H5_U8, 1, &bytes, error);
    if (status == GONIO_OK && (status = gonio_output_open(path, &output, error)) == GONIO_OK) {
        for (hsize_t at = 0; status == GONIO_OK && at < bytes.dims[0];) {
            const hsize_t left = bytes.dims[0] - at, n = left < H5_PIECE_BYTES ? left : H5_PIECE_BYTES;
            status = gonio_h5_array_read(&bytes, at, n, buffer, error);
            fwrite(buffer, 1, status == GONIO_OK ? n : 0, gonio_output_stream(output));
            at += n;
        }
        if (status == GONIO_OK) {
            status = gonio_output_commit(output, error);
        } else {
            gonio_output_abandon(output);
        }
    }
    gonio_h5_array_close(&bytes);
    free(buffer);
    return status;
}
