// SPDX-License-Identifier: BSD-3-Clause
// What a lab's own table seems to be, as a mapping to propose.
#ifndef GONIO_IO_TABLE_GUESS_H
#define GONIO_IO_TABLE_GUESS_H

#include "io/table.h"

typedef struct gonio_table_column_facts {
    char name[64]; // "": none
    char key[40];  // what it is proposed as: "theta_i"; "": nothing
    size_t numbers, distinct;
    double low, high;
} gonio_table_column_facts;

enum { GONIO_TABLE_DISTINCT_MAX = 200 }; // further ones are not counted

typedef struct gonio_table_guess {
    size_t rows;
    gonio_table_layout layout;
    gonio_table_column_facts *columns; // layout.columns of them
    char mapped[4096], constants[32], separator[12], decimal[4];
    gonio_read_options options; // the proposal; its texts are here
    bool whole;                 // the proposal leaves nothing open
    char open[320];             // else: what
    char reasons[1200];         // lines
    char command[4400];         // the options as a shell takes them
} gonio_table_guess;

// GONIO_E_INPUT where the file is no table, or of another format. Free the guess, also on failure.
gonio_status gonio_table_guess_make(const char *path, gonio_table_guess *guess, gonio_error *error);
void gonio_table_guess_free(gonio_table_guess *guess);

#endif
