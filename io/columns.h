// SPDX-License-Identifier: BSD-3-Clause
// What each column behind the angles of a samples table is: a channel, an uncertainty, a wavelength, or kept aside.
#ifndef GONIO_IO_COLUMNS_H
#define GONIO_IO_COLUMNS_H

#include "io/format.h"

#define GONIO_COLUMNS_MAX (4 + 4 * GONIO_CHANNELS_MAX + 1)
#define GONIO_COLUMN_GROUP "systematic_group"

// Columns of each channel; -1: absent.
typedef struct gonio_columns {
    int columns, channels;
    int value[GONIO_CHANNELS_MAX], sigma[GONIO_CHANNELS_MAX];
    int random[GONIO_CHANNELS_MAX], systematic[GONIO_CHANNELS_MAX];
    bool with_sigma, with_parts;
    int group;       // column of systematic_group; -1: none
    int wavelength;  // column of a table with a row for each wavelength; -1: none
    double to_um;    // of its numbers; 0: by their size
    char aside[256]; // names of the columns that are not read, blanks between them
} gonio_columns;

// What a column is by its name alone.
typedef enum gonio_column_role {
    GONIO_COLUMN_CHANNEL,
    GONIO_COLUMN_SIGMA,
    GONIO_COLUMN_WAVELENGTH,
    GONIO_COLUMN_ASIDE,   // of something else
    GONIO_COLUMN_FOREIGN, // values, but no f_r
} gonio_column_role;
gonio_column_role gonio_column_role_of(const char *name);
// "std_r", "r_unc": its uncertainty's channel, within the name, and that one's length; NULL: it is none.
const char *gonio_column_sigma_of(const char *name, size_t *length);

// fields: the header's, of which the first four are the angles.
gonio_status gonio_columns_read(const gonio_text *text, char *const *fields, int columns, gonio_columns *out,
                                gonio_error *error);

#endif
