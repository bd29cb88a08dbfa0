// SPDX-License-Identifier: BSD-3-Clause
// How a motion controller with commands in text is talked to: a small table of templates and patterns.
//
// Templates: {axis} is the axis's own name there, {value} a position. A template with {axis} is sent once an axis,
// but what stands between [ and ] is repeated for every axis within one command. && separates commands. \n \r \xHH are
// bytes; \c at the end keeps the line's end from being sent. Patterns are those of a shell (* ? [a-z]); | separates
// alternatives. A position's pattern holds {value}, or {values} for a list with commas of which each axis has its
// place.
#ifndef GONIO_DRIVERS_LINES_TABLE_H
#define GONIO_DRIVERS_LINES_TABLE_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/rig.h"

enum { GONIO_LINES_TEXT = 128, GONIO_LINES_COMMAND = 512 };

typedef enum gonio_lines_number {
    GONIO_LINES_DECIMAL, // -12.3456
    GONIO_LINES_INTEGER, // -123456
    GONIO_LINES_HEX8,    // two's complement, eight digits
} gonio_lines_number;

typedef struct gonio_lines_table {
    char end[GONIO_LINES_TEXT]; // sent behind every command
    char ack[GONIO_LINES_TEXT]; // pattern of the answer to a command; "": commands are not answered
    char error[GONIO_LINES_TEXT], ignore[GONIO_LINES_TEXT]; // patterns of answers
    char open[GONIO_LINES_TEXT], home[GONIO_LINES_TEXT], move[GONIO_LINES_TEXT];
    char stop[GONIO_LINES_TEXT];                               // "": it cannot be stopped
    char stopped[GONIO_LINES_TEXT], release[GONIO_LINES_TEXT]; // state after a stop, and what then makes it ready
    char state[GONIO_LINES_TEXT], idle[GONIO_LINES_TEXT], busy[GONIO_LINES_TEXT], unhomed[GONIO_LINES_TEXT];
    char position[GONIO_LINES_TEXT], position_answer[GONIO_LINES_TEXT];
    char check[GONIO_LINES_TEXT], check_good[GONIO_LINES_TEXT]; // asked after commands; "": nothing
    double home_timeout_s;                                      // 0: the caller's
    int number;                                                 // gonio_lines_number
} gonio_lines_table;

// A table that Gonio brings (grbl, esp, smc100, elliptec) or, where the name has a dot or a slash, a file: lines
// `key = value`, comments after ; or #. GONIO_E_INPUT with the file's line.
gonio_status gonio_lines_table_read(const char *name, gonio_lines_table *table, gonio_error *error);

// The axes that a command is for: their names there, and values in the controller's units.
typedef struct gonio_lines_axes {
    int n;
    const char *names[GONIO_AXES];
    double values[GONIO_AXES];
} gonio_lines_axes;

// The command of a template for all axes (where it has a [ ] part) or for the axis of that number; *n its bytes, with
// the line's end. GONIO_E_INPUT where it does not fit.
gonio_status gonio_lines_command(const gonio_lines_table *table, const char *template, const gonio_lines_axes *axes,
                                 int axis, char command[GONIO_LINES_COMMAND], size_t *n, gonio_error *error);
// Does the template name {axis} outside [ ]?
bool gonio_lines_each(const char *template);
// The k-th command of a template, from 0 on; false past the last.
bool gonio_lines_part(const char *template, int k, char part[GONIO_LINES_TEXT]);
// Does an answer match one of the patterns? axis: what {axis} stands for; NULL: nothing. "": never.
bool gonio_lines_match(const char *patterns, const char *axis, const char *answer);
// The number of a position's answer; place: the axis's place in a list of {values}. False where there is none.
bool gonio_lines_number_in(const gonio_lines_table *table, const char *pattern, const char *axis, int place,
                           const char *answer, double *value);

#endif
