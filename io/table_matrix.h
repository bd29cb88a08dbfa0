// SPDX-License-Identifier: BSD-3-Clause
// Tables whose rows and columns are two of the coordinates, a value in each cell; several of them may stand one behind
// the other, under headings that tell a third.
#ifndef GONIO_IO_TABLE_MATRIX_H
#define GONIO_IO_TABLE_MATRIX_H

#include "io/table_layout.h"

// A table of a row a cell in the matrix' place: columns row, column, block and value. Free both.
typedef struct gonio_table_flat {
    gonio_source source;
    long long *lines; // of the file, for each of the flat table's; [0] is unused
} gonio_table_flat;

// Take the keys of "theta_o,theta_i" or "theta_o,wavelength,phi" into the mapping and unfold. The separator and the
// decimal sign are the mapping's, which states them from then on.
gonio_status gonio_table_unfold(const gonio_source *source, const char *keys, gonio_mapping *mapping,
                                gonio_table_flat *flat, gonio_error *error);
void gonio_table_flat_free(gonio_table_flat *flat);
// Does the text seem to be such a matrix: a row of rising or falling numbers over rows that begin with such? *blocks:
// under how many headings with a number, 0: none. Nothing is refused, and nothing said.
bool gonio_table_is_matrix(const gonio_source *source, int *blocks, double columns[2], double rows[2],
                           char heading[80]);

#endif
