// SPDX-License-Identifier: BSD-3-Clause
// What each column behind the angles of a samples table is: a channel, an uncertainty, a wavelength, or kept aside.
#ifndef GONIO_IO_COLUMNS_H
#define GONIO_IO_COLUMNS_H

#include "io/column_names.h"
#include "io/format.h"

#define GONIO_COLUMNS_MAX (4 + 4 * GONIO_CHANNELS_MAX + 1)
#define GONIO_COLUMN_GROUP "systematic_group"

// Columns of each channel; -1: absent.
typedef struct gonio_columns {
    int columns, channels;
    int value[GONIO_CHANNELS_MAX], sigma[GONIO_CHANNELS_MAX];
    int random[GONIO_CHANNELS_MAX], systematic[GONIO_CHANNELS_MAX];
    bool with_sigma, with_parts;
    int group;            // column of systematic_group; -1: none
    int wavelength;       // column of a table with a row for each wavelength; -1: none
    double to_um;         // of its numbers; 0: by their size
    bool named;           // a column is a channel by its name alone
    const char *declared; // the channels that the file says it has, commas between them; NULL: it does not
    char aside[256];      // names of the columns that are not read, blanks between them
} gonio_columns;

// fields: the header's, of which the first four are the angles. channels: as the file declares them, or NULL.
gonio_status gonio_columns_read(const gonio_text *text, char *const *fields, int columns, const char *channels,
                                gonio_columns *out, gonio_error *error);
// Would all these channels be read as such by their names alone, without "# channels = ..."?
bool gonio_columns_are_plain(const gonio_samples *samples);

#endif
