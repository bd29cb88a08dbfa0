// SPDX-License-Identifier: BSD-3-Clause
// Reading text files strictly: whole file in memory, line by line, errors with file and line.
#ifndef GONIO_BASE_TEXT_H
#define GONIO_BASE_TEXT_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/direction.h"
#include "gonio/status.h"

// All bytes of a file, pipe or device ("-": standard input), with a 0 byte behind them. The caller frees *data.
// limit (0: the machine's memory): a larger file is refused before it is read. GONIO_E_INPUT where it cannot be read.
gonio_status gonio_file_read(const char *path, size_t limit, char **data, size_t *size, gonio_error *error);

// A cursor over a text; data is cut up while it is read. Borrowed, nothing to free.
typedef struct gonio_text {
    const char *path; // for messages
    char *next, *end;
    long long line; // number of the line that gonio_text_line gave last
    // Thetas of pairs go on to 180 deg, behind the sample; the text declares it, or who reads it was told so.
    bool transmission;
    char *data; // of gonio_text_open, which gonio_text_free releases; else NULL
} gonio_text;

// Every list, certificate, curve, plan and rig file is read through these: a UTF-8 byte order mark, CRLF, tabs and
// blanks around fields count for nothing.
gonio_status gonio_text_open(const char *path, size_t limit, gonio_text *text, gonio_error *error);
void gonio_text_free(gonio_text *text);
// GONIO_E_INPUT, which names it, for a text of another kind: UTF-16, UTF-32, lines that end with CR alone.
gonio_status gonio_text_check(const char *path, const char *data, size_t size, gonio_error *error);

gonio_text gonio_text_begin(const char *path, char *data, size_t size); // skips the byte order mark
// The next line, without its end and the blanks around it; NULL after the last one.
char *gonio_text_line(gonio_text *text);
// The text without the blanks around it, those that do not break (U+00A0) among them. In place.
char *gonio_text_trim(char *text);
// The next line that is neither empty nor a # comment.
char *gonio_text_content(gonio_text *text);
// A line of a table: where it has no comma, each run of blanks and tabs becomes one.
char *gonio_text_commas(char *line);
char *gonio_text_row(gonio_text *text); // the next content line, so
// Of an INI file, by its rules: the next "key = value" without the comment behind the value (; or # after a blank),
// which goes to *comment (NULL: none); *value NULL: a line of another kind. NULL after the last one.
char *gonio_text_setting(gonio_text *text, char **value, char **comment);
// Does a comment line before or among the rows say so: "# halves = reflection,transmission"? Of what is still to be
// read.
bool gonio_text_declares_transmission(const gonio_text *text);
// Cut a line at separators (a blank separator: at runs of blanks), trim each field; returns how many there are, also
// where that is more than maximum; fields past it are not stored.
int gonio_text_split(char *line, char separator, char **fields, int maximum);
// Are the fields of the line these, up to NULL?
bool gonio_text_is_header(char *const *fields, int n, const char *const *names);
// A finite decimal number that fills the field. Failing names `what`, the field and the line.
gonio_status gonio_text_number(const gonio_text *text, const char *field, const char *what, double *value,
                               gonio_error *error);
// The same, or one over another, as exposures are written: 1/60.
gonio_status gonio_text_ratio(const gonio_text *text, char *field, const char *what, double *value, gonio_error *error);
// A number of things, 0 or more, as options have it: 5000, 5k, 1.5M, 2G. False where it is none.
bool gonio_text_count(const char *text, size_t *value);
// Four fields theta_i,phi_i,theta_o,phi_o in degrees -> rad, theta 0 to 90 (180 with transmission), phi -360 to 360, of
// the same directions: a theta below 0 lies on the side of phi + 180, and any whole turns of phi (up to 100) count for
// nothing.
gonio_status gonio_text_pair(const gonio_text *text, char *const fields[4], gonio_pair *pair, gonio_error *error);
// GONIO_E_INPUT at the current line.
gonio_status gonio_text_fail(const gonio_text *text, gonio_error *error, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#define GONIO_PAIR_HEADER "theta_i,phi_i,theta_o,phi_o"
// True where the first four fields are that header's.
bool gonio_text_is_pair_header(char *const *fields, int n);

// Append what printf would write, as far as there is room.
void gonio_text_append(char *text, size_t size, const char *format, ...) __attribute__((format(printf, 3, 4)));
// The text as a terminal may be given it: control characters (line breaks too), those that turn the direction of
// writing, and bytes that are not UTF-8 become \n, \x1b or \u202e. Cut, with ... at the end, where there is no room;
// size is 4 or more.
void gonio_text_printable(const char *text, char *out, size_t size);
bool gonio_text_is_printable(const char *text); // nothing of that is in it
// The shortest decimal that reads back as exactly this finite double; buffer: 32 bytes.
void gonio_text_shortest(double value, char *buffer);

#endif
