// SPDX-License-Identifier: BSD-3-Clause
// What a file's comments declare: heeded where the format's table knows it, refused where it is not known and could
// change a value.
#ifndef GONIO_IO_DECLARATION_H
#define GONIO_IO_DECLARATION_H

#include "base/text.h"

typedef struct gonio_source gonio_source;

typedef enum gonio_declared_effect {
    GONIO_DECLARED_NOTHING,     // as Gonio takes it anyway
    GONIO_DECLARED_ISOTROPIC,   //
    GONIO_DECLARED_ANISOTROPIC, // phi_i matters beyond phi_o - phi_i
    GONIO_DECLARED_COSINE,      // values are f_r cos(theta_o)
    GONIO_DECLARED_FACTOR,      // values are pi f_r, the reflectance factor
    GONIO_DECLARED_MISSING,     // the number that stands for missing values
    GONIO_DECLARED_KNOWN,       // no value depends on it: kept with the samples, as all is that nobody knows
    GONIO_DECLARED_FIGURE,      // likewise, and it must be a number of 0 or more
    GONIO_DECLARED_HALVES,      // thetas beyond 90 deg are directions behind the sample
    GONIO_DECLARED_THROUGH,     // all rows are transmission
    GONIO_DECLARED_CHANNELS,    // which columns are channels
} gonio_declared_effect;

// One known declaration; a table ends with {0}. Keys and values are compared without case, blanks, and _ - ^ * .
typedef struct gonio_declaration {
    const char *key;    // "quantity"; of a line without key and value a phrase in it
    const char *values; // words, | between them, for which it holds; NULL: any
    gonio_declared_effect effect;
} gonio_declaration;

typedef struct gonio_declared {
    bool isotropic, anisotropic;
    bool cosine;                // values are to be divided by cos(theta_o)
    double factor;              // and by this
    bool transmission, through; // thetas go to 180 deg; every row is transmitted
    long long through_line;     // a remark that speaks of transmission; 0: none does
    char through_remark[112];
    bool has_missing;
    double missing;
    char *channels; // "a,b,c" of the columns that are channels, NULL: it does not say; owned
    char *head;     // "key = value" lines of what the measurement was, NULL: none; owned
} gonio_declared;

// What every text format knows besides its own table.
extern const gonio_declaration gonio_declarations_common[];

// Go through all comment lines of a text, and the lines before its table. own: NULL, or the format's table, which comes
// first. Changes nothing in the source. Free declared->head and ->channels; on failure there are none.
gonio_status gonio_declarations_read(const gonio_source *source, const gonio_declaration *own, gonio_declared *declared,
                                     gonio_error *error);
// An error where a remark speaks of transmission that nothing declares.
gonio_status gonio_declarations_transmit(const gonio_source *source, const gonio_declared *declared,
                                         gonio_error *error);
// Would the line "key = value" be heeded without a word, as one of those that every text format knows?
bool gonio_declaration_holds(const char *key, const char *value);

#endif
