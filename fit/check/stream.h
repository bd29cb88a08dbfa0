// SPDX-License-Identifier: BSD-3-Clause
// A table in a text file, row by row: a row is an incidence, whose lines stand together. One scan finds where each
// begins and holds the directions against those of the first; after that a row is one seek.
#ifndef GONIO_FIT_CHECK_STREAM_H
#define GONIO_FIT_CHECK_STREAM_H

#include <stdio.h>

#include "fit/check/table.h"
#include "io/columns.h"

typedef struct gonio_stream {
    const char *path;
    FILE *file;
    char *line; // the last one
    size_t room;
    char *head; // comments and header as they stand
    size_t head_size;
    gonio_columns *columns;
    size_t channels;
    double *numbers; // of a line, [columns]
    gonio_table *table;
    off_t *offset;          // [n_in]
    size_t memory, channel; // channel: the one that gonio_stream_channel_row reads
    bool failed;            // a line that was read before is none any more
} gonio_stream;

// memory: bytes of the table to hold at most; 0: the standard. Close it, also on failure.
gonio_status gonio_stream_open(const char *path, size_t memory, gonio_stream *stream, gonio_error *error);
void gonio_stream_close(gonio_stream *stream);
gonio_status gonio_stream_sound(const gonio_stream *stream, gonio_error *error);

// Values, and sigmas where the file has them, of n directions: a set without pairs. NULL: no memory.
gonio_samples *gonio_stream_entries(const gonio_stream *stream, size_t n);
void gonio_stream_entries_free(gonio_samples *entries);
// Bytes of one of them.
size_t gonio_stream_entry_bytes(const gonio_stream *stream);
// The row of stored incidence p into entries from `at` on, n_out of them.
void gonio_stream_read(gonio_stream *stream, size_t p, gonio_samples *entries, size_t at);
// A row of the matrix of one channel, or of its sigma: of gonio_row_source, the stream being the context.
void gonio_stream_channel_row(void *stream, size_t row, double *values);
void gonio_stream_sigma_row(void *stream, size_t row, double *values);

#endif
