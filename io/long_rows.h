// SPDX-License-Identifier: BSD-3-Clause
// Tables with a row for each geometry and wavelength -> sets with a channel for each wavelength.
#ifndef GONIO_IO_LONG_ROWS_H
#define GONIO_IO_LONG_ROWS_H

#include "io/format.h"

typedef struct gonio_long_row {
    gonio_pair pair;
    double lambda_um, value, sigma;
    long long line;
} gonio_long_row;

// {0} to begin with; free rows.
typedef struct gonio_long_rows {
    gonio_long_row *rows;
    size_t n, capacity;
    double lambdas_um[GONIO_CHANNELS_MAX]; // ascending
    int n_lambdas;
} gonio_long_rows;

// A wavelength of a row: nobody measures below 20 nm or beyond 100 um. to_um: of the numbers; 0: by their size.
gonio_status gonio_long_rows_wavelength(const gonio_text *text, const char *field, double to_um, double *um,
                                        gonio_error *error);
gonio_status gonio_long_rows_add(const gonio_text *text, gonio_long_rows *all, const gonio_long_row *row,
                                 gonio_error *error);
// Keep one wavelength only, that one or the nearest within half the spacing, which is then told in notes.
gonio_status gonio_long_rows_choose(const gonio_text *text, gonio_long_rows *all, double lambda_um, char *notes,
                                    size_t size, gonio_error *error);
// Every geometry must come once with each wavelength, which then are channels of that name, "550nm".
gonio_status gonio_long_rows_collect(gonio_text *text, gonio_long_rows *all, bool with_sigma,
                                     gonio_row_collector *collector, gonio_error *error);

#endif
