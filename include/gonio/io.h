// SPDX-License-Identifier: BSD-3-Clause
// BRDF files in and out; one file a format under io/. Formats are recognised by content, never by name.
#ifndef GONIO_IO_H
#define GONIO_IO_H

#include <stdio.h>

#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/sample.h"

GONIO_BEGIN

// ---- the formats ----

typedef enum gonio_format_option_type {
    GONIO_FORMAT_TEXT,   // the reader says what it takes
    GONIO_FORMAT_COUNT,  // a number of things, 0 or more; suffixes k, M, G
    GONIO_FORMAT_FLAG,   // no|yes; on the command line without an argument
    GONIO_FORMAT_CHOICE, // one of the words of `argument`, between which | stands
} gonio_format_option_type;

// An option of reading or writing one format.
typedef struct gonio_format_option {
    const char *name; // "negatives"; NULL ends a list
    gonio_format_option_type type;
    const char *argument; // "noise|reject|clamp|keep", "N"
    const char *standard; // its value where none is given
    const char *help;     // one line
} gonio_format_option;

// Another name of a format's writer: of a program that reads it.
typedef struct gonio_format_alias {
    const char *name;            // "pbrt"; NULL ends a list
    const char *setting, *value; // of one of the write options, where that is not given; NULL: none
} gonio_format_alias;

// What a format is and can do. Everything it points to is static.
typedef struct gonio_format_facts {
    const char *name;       // "merl"
    const char *summary;    // "MERL table"
    const char *extensions; // of its files, each with its dot, blanks between them; a reader goes by the content alone
    bool reads;             // gonio_read
    bool reads_table;       // gonio_read_table
    bool writes;            // gonio_write_as
    bool writes_table;      // gonio_write_table_as
    double precision;       // of a value that is written and read again: relative error at most; 0: the same bits
    const gonio_format_option *options;       // of gonio_read
    const gonio_format_option *write_options; // of gonio_write_table_as
    const gonio_format_alias *aliases;        // that a writer's name may be
} gonio_format_facts;

// The formats by number, from 0 on; false past the last.
bool gonio_format_get(int number, gonio_format_facts *facts);
// The format that has a writer and that name (or alias) or, where name is NULL, an extension in which path ends.
// GONIO_E_USAGE with the list of writers.
gonio_status gonio_format_writer(const char *name, const char *path, gonio_format_facts *facts, gonio_error *error);

// ---- reading ----

#define GONIO_NOISE_SIGMAS 5 // combined standard uncertainties; noise alone goes beyond once in 3.5 million values

typedef struct gonio_format_setting {
    const char *name, *value; // of one of the format's options: "negatives", "clamp"
} gonio_format_setting;
enum { GONIO_FORMAT_SETTINGS_MAX = 16 };

// How to read. gonio_read_options_default() first, or {.seed = 1}.
typedef struct gonio_read_options {
    uint64_t seed;        // of what is drawn: which cells of a table, which pairs
    int threads;          // 0: all
    double wavelength_nm; // of formats that hold wavelengths in rows of their own (NIST): only this one. 0: all
    // A NULL name ends them; borrowed. An option that the file's format does not have is GONIO_E_USAGE and the message
    // lists those it has.
    gonio_format_setting settings[GONIO_FORMAT_SETTINGS_MAX];
} gonio_read_options;

typedef struct gonio_read_report {
    char format[32]; // "samples" "cornell" "nist" "merl" "rgl" ...
    size_t rows, negatives, invalid;
    size_t noise;                  // of the negatives: within GONIO_NOISE_SIGMAS of 0
    size_t clamped;                // of the negatives: raised to 0
    long long first_negative_line; // -1: none
    bool open_end;                 // a text whose last line has no line end: it may have been cut short inside a number
    // What else is worth a line to the reader of the samples; "" where there is nothing. Lines end with a line feed.
    char notes[1024];
} gonio_read_report;

void gonio_read_options_default(gonio_read_options *options);
// Read any known BRDF file as samples; the caller frees them. options and report may be NULL.
gonio_status gonio_read(const char *path, const gonio_read_options *options, gonio_samples **out,
                        gonio_read_report *report, gonio_error *error);
// Is it a file that begins as a Gonio model file does? Never blocks; false where it cannot be read.
bool gonio_model_file_is(const char *path);
// A measured table (MERL, RGL ...) as a model that interpolates it. The caller frees it.
gonio_status gonio_read_table(const char *path, gonio_model **out, gonio_error *error);

// ---- writing ----
// Every writer writes beside, syncs and renames: a failure leaves what was there.

// How to write a model as a table. gonio_write_options{0} is the standard.
typedef struct gonio_write_options {
    int threads;      // 0: all; the bytes do not depend on it
    size_t max_bytes; // of formats whose size can be chosen; 0: each has its own
    gonio_half half;  // of formats that hold one half a file; the first that the model has where it has none of this
    double max_error; // the largest median relative error of what is read back; beyond it nothing is written. 0: any
    gonio_format_setting settings[GONIO_FORMAT_SETTINGS_MAX]; // of the format's write options; as of reading
} gonio_write_options;

enum { GONIO_WRITE_TILTS = 4 };

// What a written table is and how far what our own reader finds in it lies from the model: at random pairs up to
// 80 deg, or at the file's own pairs where it is read as samples.
typedef struct gonio_write_report {
    char format[32];
    char about[512];                   // what was chosen: sizes, nodes
    char lost[512];                    // what the format does not hold of this model; "" where it holds all
    const char *quantity, *convention; // static
    double theta_max_deg;              // up to where the values are the model's
    size_t bytes, pairs;
    unsigned halves;             // of the file, bits 1 << gonio_half
    int channels;                // of the file
    bool at_its_nodes;           // pairs are the file's own
    double median, p95, largest; // relative errors, the sum over channels
    double tilt_deg[GONIO_WRITE_TILTS], albedo[GONIO_WRITE_TILTS],
        albedo_error[GONIO_WRITE_TILTS]; // relative; NaN: none
} gonio_write_report;

// Samples, or a model as a table, as a format that gonio_format_writer finds: format NULL goes by the path's extension.
// GONIO_E_USAGE where that format is not written from samples, or not from a model. options and report may be NULL; the
// report costs reading the file back. GONIO_E_MISMATCH where max_error is exceeded.
gonio_status gonio_write_as(const gonio_samples *samples, const char *path, const char *format, gonio_error *error);
gonio_status gonio_write_table_as(const gonio_model *model, const char *path, const char *format,
                                  const gonio_write_options *options, gonio_write_report *report, gonio_error *error);
// The samples CSV, whatever the path ends in; reading it gives the same bits.
gonio_status gonio_write_samples(const gonio_samples *samples, const char *path, gonio_error *error);
gonio_status gonio_write_samples_stream(const gonio_samples *samples, FILE *stream, gonio_error *error);

// The model's values (and sigma, where it carries one, as the systematic part) at n pairs, as samples; the caller frees
// them. threads 0: all.
gonio_status gonio_samples_of_model(const gonio_model *model, const gonio_pair *pairs, size_t n, int threads,
                                    gonio_samples **out, gonio_error *error);

GONIO_END
#endif
