// SPDX-License-Identifier: BSD-3-Clause
// What each column of a lab's own table is: by the mapping, and what it leaves open by the names of the header.
#ifndef GONIO_IO_TABLE_COLUMNS_H
#define GONIO_IO_TABLE_COLUMNS_H

#include "io/table_layout.h"

typedef struct gonio_table_columns {
    int angle[GONIO_MAPPED_ANGLES];       // column; -1: a constant, or none
    double constant[GONIO_MAPPED_ANGLES]; // in the table's unit; NaN: a column, or none
    int channels;
    int value[GONIO_CHANNELS_MAX], sigma[GONIO_CHANNELS_MAX]; // columns; without sigma -1
    char names[GONIO_CHANNELS_MAX][GONIO_CHANNEL_NAME_MAX];
    bool with_sigma;
    int wavelength; // -1: none
    double to_um;   // of its numbers; 0: by their size
    char aside[256];
} gonio_table_columns;

// source: for messages. GONIO_E_INPUT where the table lacks what it needs.
gonio_status gonio_table_columns_find(const gonio_source *source, const gonio_mapping *mapping,
                                      const gonio_table_layout *layout, gonio_table_columns *columns,
                                      gonio_error *error);
// Does the name speak of an angle? False: no.
bool gonio_table_angle_of_name(const char *name, gonio_mapped_role *role);
// "column 2 'Measure_angle' is theta_o in degrees, signed; ..."
void gonio_table_columns_text(const gonio_mapping *mapping, const gonio_table_layout *layout,
                              const gonio_table_columns *columns, char *text, size_t size);

#endif
