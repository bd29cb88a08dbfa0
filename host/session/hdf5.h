// SPDX-License-Identifier: BSD-3-Clause
// HDF5 files (libhdf5) with Gonio's errors, and with every length checked before it is used.
//
// Files are written in the library's newest format, whose metadata carry checksums, and nothing in them needs the parts
// that have none (variable-length values, links to elsewhere): damage is found before it is interpreted. A reader takes
// nothing else.
#ifndef GONIO_SESSION_HDF5_H
#define GONIO_SESSION_HDF5_H

#include <hdf5.h>

#include "host/session/internal.h"

#define H5_FORMAT_VERSION 1
// Rows of a table are moved in pieces of about so many bytes.
#define H5_PIECE_BYTES ((size_t)1 << 20)
#define H5_TEXT_MAX ((size_t)1 << 24)

typedef struct h5_file {
    hid_t id;
    const char *path; // for messages; borrowed
    // How the thread prints HDF5's errors; silent while the file is open.
    H5E_auto2_t print;
    void *print_to;
} h5_file;

gonio_status gonio_h5_create(const char *path, const char *name, h5_file *file, gonio_error *error);
// GONIO_E_INPUT where it is none, or damaged.
gonio_status gonio_h5_open(const char *path, h5_file *file, gonio_error *error);
// What is still to be written goes out; status: how the work went so far, which comes back where it failed.
gonio_status gonio_h5_close(h5_file *file, gonio_status status, gonio_error *error);
// The library's own last message behind `what`. A full disk is GONIO_E_IO; while reading, status is GONIO_E_INPUT.
gonio_status gonio_h5_fail(const h5_file *file, gonio_status status, gonio_error *error, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

// ---- groups, texts and numbers; paths are absolute, their groups are made where they lack ----
gonio_status gonio_h5_group(const h5_file *file, const char *path, const char *nx_class, gonio_error *error);
gonio_status gonio_h5_attribute(const h5_file *file, const char *path, const char *name, const char *text,
                                gonio_error *error);
gonio_status gonio_h5_attribute_integer(const h5_file *file, const char *path, const char *name, int64_t value,
                                        gonio_error *error);
gonio_status gonio_h5_text(const h5_file *file, const char *path, const char *text, gonio_error *error);
// units NULL: none.
gonio_status gonio_h5_number(const h5_file *file, const char *path, double value, const char *units,
                             gonio_error *error);
// Is there something of this path, reached by hard links alone?
bool gonio_h5_exists(const h5_file *file, const char *path);
// An integer attribute; GONIO_E_INPUT where it lacks or is none.
gonio_status gonio_h5_read_integer(const h5_file *file, const char *path, const char *name, int64_t *value,
                                   gonio_error *error);
// The caller frees *text.
gonio_status gonio_h5_read_text(const h5_file *file, const char *path, const char *name, char **text,
                                gonio_error *error);
// ---- arrays ----
typedef enum h5_type { H5_I64, H5_F64, H5_U8, H5_U16, H5_TEXT } h5_type;
typedef struct h5_array {
    const h5_file *file;
    char path[160];
    hid_t dataset;
    hid_t type; // in memory
    h5_type kind;
    int rank;
    hsize_t dims[3];
    size_t row_bytes; // of one item of the first dimension
} h5_array;
// width: bytes of a text, which is filled with zeros. chunk_rows: of the first dimension, compressed as one.
gonio_status gonio_h5_array_create(const h5_file *file, const char *path, h5_type kind, size_t width, int rank,
                                   const hsize_t *dims, size_t chunk_rows, const char *units, h5_array *array,
                                   gonio_error *error);
// One of this type and rank; every size of it is sound, so that what it claims to hold can be in the file.
gonio_status gonio_h5_array_open(const h5_file *file, const char *path, h5_type kind, int rank, h5_array *array,
                                 gonio_error *error);
gonio_status gonio_h5_array_write(h5_array *array, hsize_t first, hsize_t n, const void *data, gonio_error *error);
gonio_status gonio_h5_array_read(h5_array *array, hsize_t first, hsize_t n, void *data, gonio_error *error);
void gonio_h5_array_close(h5_array *array); // zeros are allowed
// Rows that fill a piece.
size_t gonio_h5_piece(size_t row_bytes);

// ---- hdf5_table.c: the journal's tables, column by column ----
gonio_status gonio_h5_put_table(const h5_file *file, gonio_session *session, const char *table, gonio_error *error);
// Enter what the file has of a table that the session has and that is empty there.
gonio_status gonio_h5_get_table(const h5_file *file, gonio_session *session, const char *table, gonio_error *error);
// The names of the session's tables, one call each.
typedef gonio_status (*h5_name_fn)(void *context, const char *name, gonio_error *error);
gonio_status gonio_h5_for_tables(gonio_session *session, h5_name_fn call, void *context, gonio_error *error);

// ---- hdf5_frames.c ----
typedef struct h5_progress {
    gonio_progress_fn call; // false: stop. NULL: none
    void *context;
} h5_progress;
gonio_status gonio_h5_put_frames(const h5_file *file, gonio_session *session, const h5_progress *progress,
                                 gonio_error *error);
// Files under frames/ for every row of the journal; their pixels are verified.
gonio_status gonio_h5_get_frames(const h5_file *file, gonio_session *session, const h5_progress *progress,
                                 gonio_error *error);
// A burst's frames were not compressed, and another zlib compresses otherwise: do the rows name other sizes than the
// files have? And make them name those.
gonio_status gonio_h5_sizes_differ(gonio_session *session, bool *differ, gonio_error *error);
gonio_status gonio_h5_enter_sizes(gonio_session *session, gonio_error *error);

// ---- hdf5_data.c ----
// The final samples, or those journalled so far.
gonio_status gonio_h5_put_data(const h5_file *file, gonio_session *session, gonio_error *error);
// A file (where it is there) as /entry/files/NAME; limit: bytes of it at most, -1: all.
gonio_status gonio_h5_put_file(const h5_file *file, int folder, const char *path, const char *name, int64_t limit,
                               gonio_error *error);
gonio_status gonio_h5_get_file(const h5_file *file, const char *name, const char *path, gonio_error *error);

// ---- hdf5_read.c: gonio_session_import and gonio_session_read_hdf5 in steps. Another process may take the second ----
// ---- step: what libhdf5's crash leaves there, the last one removes. ----
// A new folder: beside the session to be, or (path NULL) a temporary one. *made is the last step's, NULL on failure.
gonio_status gonio_h5_folder(const char *path, char **made, gonio_error *error);
gonio_status gonio_h5_fill(const char *hdf5, const char *made, gonio_progress_fn progress, void *context,
                           gonio_error *error);
gonio_status gonio_h5_samples(const char *hdf5, const char *made, gonio_samples **out, gonio_error *error);
// It takes its name where all went well so far, and is removed otherwise. Takes *made, which may be NULL.
gonio_status gonio_h5_folder_end(const char *path, char *made, gonio_status status, gonio_error *error);

// ---- hdf5_write.c ----
extern const char
    *const gonio_h5_folder_files[]; // that a session's folder may hold beside journal and frames; NULL ends

#endif
