// SPDX-License-Identifier: BSD-3-Clause
// Tables that describe devices of other makers: one that Gonio brings, or a file with lines `key = value`.
#ifndef GONIO_DRIVERS_TABLE_FILE_H
#define GONIO_DRIVERS_TABLE_FILE_H

#include "base/keys.h"

typedef struct gonio_table_text {
    const char *name, *text;
} gonio_table_text;

typedef struct gonio_table_form {
    const char *what;                        // "table of commands"
    const gonio_table_text *texts;           // those that Gonio brings; ends with a NULL name
    const gonio_key *keys;                   // in the section ""
    const char *(*lacks)(const void *table); // what a whole table must have and this one has not; NULL: nothing
} gonio_table_form;

// One of the texts by its name or, where the name has a dot or a slash, a file; comments begin after ; or #, at a
// line's beginning or behind a blank. `table` has its initial values. GONIO_E_INPUT with the file's line.
gonio_status gonio_table_file_read(const gonio_table_form *form, const char *name, void *table, gonio_error *error);

#endif
