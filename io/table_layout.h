// SPDX-License-Identifier: BSD-3-Clause
// How a text holds a table: separator, decimal sign, header, where the rows begin. Found from the text, which stays as
// it is.
#ifndef GONIO_IO_TABLE_LAYOUT_H
#define GONIO_IO_TABLE_LAYOUT_H

#include "io/mapping.h"

enum { GONIO_TABLE_COLUMNS_MAX = 2100 };

typedef struct gonio_table_layout {
    char separator, decimal;
    int columns;           // of a row
    long long header_line; // 0: none
    long long first_row;   // line of the first row of numbers
    long long last_row;    // of the last; lines of text behind it, that could be no row, are footers
    long long first_footer;
    size_t footers;
    char *header;    // its line, cut up
    char **names;    // of the columns, "" where there is none; borrowed from header
    char *unit_line; // the line of units between header and rows, cut up; NULL: none
    char **units;    // of the columns, "" where none is told; borrowed from unit_line
} gonio_table_layout;

// The lines of a text one by one, each copied and trimmed; data is kept. Free buffer.
typedef struct gonio_table_lines {
    const char *at, *end;
    long long number; // of the line that was given last
    char *buffer;
    size_t capacity;
} gonio_table_lines;
gonio_table_lines gonio_table_lines_begin(const gonio_source *source);
char *gonio_table_lines_next(gonio_table_lines *lines); // NULL: past the last, or no memory

// Empty, or a comment: it holds no row.
bool gonio_table_is_blank(const char *line);
// Cut the line, quotes around fields removed; an empty last field beyond `columns` (0: any) does not count.
int gonio_table_split(char *line, char separator, int columns, char **fields, int maximum);
// A number that fills the field, with that decimal sign.
bool gonio_table_number(const char *field, char decimal, double *value);

// mapping: whose separator and decimal sign hold where they are stated, and whose names the header has. Free the
// layout, also on failure.
gonio_status gonio_table_layout_find(const gonio_source *source, const gonio_mapping *mapping,
                                     gonio_table_layout *layout, gonio_error *error);
// The unit of a column, from the line of units or from what stands in brackets in its name, as gonio_fold has it.
void gonio_table_unit(const gonio_table_layout *layout, int column, char *unit, size_t size);
void gonio_table_layout_free(gonio_table_layout *layout);
// The column of that name, from 0 on: the same text, else the same but for case and what stands in brackets; -1: none.
int gonio_table_find_name(char *const *names, int columns, const char *name);

#endif
