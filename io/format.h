// SPDX-License-Identifier: BSD-3-Clause
// What the readers share: one gonio_format a file format, and the collector that collects rows.
#ifndef GONIO_IO_FORMAT_H
#define GONIO_IO_FORMAT_H

#include "base/text.h"
#include "gonio/io.h"
#include "io/declaration.h"

// A file in memory. data ends with a 0 byte that size does not count; text readers cut it up.
struct gonio_source {
    const char *path;
    char *data;
    size_t size;
    long long preamble; // so many lines at its beginning are remarks, without a mark of such
};

// The values of a format's options, in the order of its table.
typedef struct gonio_format_value {
    const char *text; // as given, or the option's standard
    size_t count;     // COUNT
    int choice;       // CHOICE: which of the words
} gonio_format_value;

typedef struct gonio_format_values {
    uint64_t seed;
    int threads; // 0: all
    double wavelength_nm;
    size_t max_bytes; // of writing; 0: the format's own
    gonio_half half;  // of writing a model of one half: which that is
    gonio_format_value at[GONIO_FORMAT_SETTINGS_MAX];
} gonio_format_values;

// A format is one file, its registration last there, and one line in io/formats.def.
typedef struct gonio_format {
    const char *name, *summary, *extensions; // as in gonio_format_facts
    // Is it of this format? Must not change the data; a damaged file of the format still counts, its reader says why.
    // At most one format says yes to a file.
    bool (*recognise)(const gonio_source *source);
    bool by_mapping; // recognise says no to every file: gonio_read takes it where a mapping is given or lies beside
    // The samples; the caller frees them. On failure *out is NULL.
    gonio_status (*read)(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                         gonio_read_report *report, gonio_error *error);
    // An interpolating model. NULL: the format holds scattered samples, which must be fitted.
    gonio_status (*table)(const gonio_source *source, gonio_model **out, gonio_error *error);
    // Optional, both: samples, or a model as a table, to a stream. The stream's own failures are the caller's matter.
    gonio_status (*write)(const gonio_samples *samples, FILE *stream, gonio_error *error);
    // The model is one that answers for several halves, where the format holds several, or that of values->half, whose
    // directions lie in front (gonio_written_half tells them apart).
    // told: format, quantity, convention and theta_max_deg are filled; the writer may say more in about and lost.
    gonio_status (*write_table)(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                gonio_write_report *told, gonio_error *error);
    // Of a format that is written but not read: the model that the file stands for. The caller frees it.
    gonio_status (*meant)(const gonio_model *model, int threads, gonio_model **out, gonio_error *error);
    unsigned halves; // that write_table can hold, bits 1 << gonio_half; 0: the front reflection alone
    bool one_half;   // one of them a file
    bool fitted;     // what write_table writes comes close to the model at no place of the file's own
    const gonio_format_option *write_options; // of write_table; NULL: none
    const gonio_format_alias *aliases;        // NULL: none
    const char *quantity, *convention;        // of what is written: "f_r, 1/sr"; which direction lies where
    double theta_max_deg;                     // of what is written; 0: 90
    double precision;                         // as in gonio_format_facts
    const gonio_format_option *options;       // of read; NULL: none
} gonio_format;

// By number, from 0 on; NULL past the last.
const gonio_format *gonio_format_at(int number);
// The values that the options give; GONIO_E_USAGE for an option that the format does not have, or a wrong value.
gonio_status gonio_format_parse(const gonio_format *format, const gonio_read_options *options,
                                gonio_format_values *values, gonio_error *error);
// The format that has a writer and that name, or, where name is NULL, an extension in which path ends.
gonio_status gonio_format_find_writer(const char *name, const char *path, const gonio_format **out, gonio_error *error);
// Is the file of a format that is read as a model without a fit? False where it is of none, or cannot be read.
bool gonio_format_is_table(const char *path);
// The status of writing, or the stream's own failure.
gonio_status gonio_write_flushed(FILE *stream, const char *path, gonio_status status, gonio_error *error);
// The same for writing. name: by which the format was asked for; NULL or its own: no alias.
gonio_status gonio_format_parse_write(const gonio_format *format, const char *name, const gonio_write_options *options,
                                      gonio_format_values *values, gonio_error *error);
// The model's three channels as linear sRGB, by io/colour.h; the model itself where it has them. Frees nothing of the
// model, which must live as long. Where *view is not the model, the caller frees it.
gonio_status gonio_model_as_rgb(const gonio_model *model, gonio_model **view, gonio_error *error);
// Smooth spectra in place of r, g, b; the model must live as long, and the caller frees the result.
gonio_status gonio_model_as_spectra(const gonio_model *rgb, gonio_model **out, gonio_error *error);
// The model with a wavelength a channel; of one channel, which is then said to be 550 nm, or of wavelengths, it is the
// model itself. The caller frees *out unless it is *rgb, and *rgb unless it is the model.
gonio_status gonio_model_as_wavelengths(const gonio_model *model, gonio_model **rgb, gonio_model **out,
                                        gonio_write_report *told, gonio_error *error);
// Add to what the report says is lost; of a model with channels that a file of r, g, b (3) or one value (1) lacks.
void gonio_write_lost(gonio_write_report *report, const char *what);
void gonio_write_lost_channels(const gonio_model *model, int channels, gonio_write_report *report);
// Of a model that write_table is given, the model of a half; NULL: the file has none of it.
const gonio_model *gonio_written_half(const gonio_model *model, const gonio_format_values *values, gonio_half half);
// Measure what was written to path of report->halves against the whole model, and fill the report's figures.
gonio_status gonio_write_measure(const gonio_model *model, const gonio_format *format, const char *path, int threads,
                                 gonio_write_report *report, gonio_error *error);

// " a, b and c" of every format for which `which` holds, for messages.
void gonio_format_summaries(bool (*which)(const gonio_format *format), char *text, size_t size);

// The first line of a text that is neither empty nor a comment, for recognising it; "" where there is none or the data
// is binary. buffer holds it; *number: which line it is.
const char *gonio_source_first_line(const gonio_source *source, char *buffer, size_t size, long long *number);

// Names that a samples file can hold: each once, not empty, no comma, quote, blank end or control character, none that
// reads as something else than a channel (gonio_column_role_of, gonio_column_sigma_of).
gonio_status gonio_channel_names_check(const char *path, const char (*names)[GONIO_CHANNEL_NAME_MAX], int n,
                                       gonio_error *error);

// What becomes of negative values, in the order of the option's words.
typedef enum gonio_negatives {
    // Kept where the file states sigma and every one lies within GONIO_NOISE_SIGMAS of 0, as a calibrated measurement
    // of
    // something black scatters; else an error, as REJECT.
    GONIO_NEGATIVES_NOISE,
    GONIO_NEGATIVES_REJECT, // an error with the count and the first line
    GONIO_NEGATIVES_CLAMP,  // raised to 0, counted
    GONIO_NEGATIVES_KEEP,
} gonio_negatives;
// "none", "auto", or the number or word that stands for a missing value.
#define GONIO_OPTION_MISSING                                                                                           \
    {                                                                                                                  \
        "missing", GONIO_FORMAT_TEXT, "VALUE|auto|none", "auto",                                                       \
            "what stands for missing values; rows with it are left out (auto: what stands out as such)"                \
    }
#define GONIO_OPTION_DECLARED                                                                                          \
    { "declared", GONIO_FORMAT_CHOICE, "heed|ignore", "heed", "what the comments declare of the values" }
// The options of every text format stand first, in this order.
#define GONIO_OPTION_TRANSMISSION                                                                                      \
    {                                                                                                                  \
        "transmission", GONIO_FORMAT_FLAG, "no|yes", "no",                                                             \
            "thetas from 90 to 180 deg are directions behind the sample, as '# halves = reflection,transmission' says" \
    }
#define GONIO_TEXT_OPTIONS                                                                                             \
    [GONIO_TEXT_NEGATIVES] = GONIO_OPTION_NEGATIVES, [GONIO_TEXT_MISSING] = GONIO_OPTION_MISSING,                      \
    [GONIO_TEXT_DECLARED] = GONIO_OPTION_DECLARED, [GONIO_TEXT_TRANSMISSION] = GONIO_OPTION_TRANSMISSION
enum { GONIO_TEXT_NEGATIVES, GONIO_TEXT_MISSING, GONIO_TEXT_DECLARED, GONIO_TEXT_TRANSMISSION, GONIO_TEXT_OPTIONS_N };
#define GONIO_OPTION_NEGATIVES                                                                                         \
    {                                                                                                                  \
        "negatives", GONIO_FORMAT_CHOICE, "noise|reject|clamp|keep", "noise",                                          \
            "negative values (noise: kept within 5 sigma of 0, else refused)"                                          \
    }

// What stands for a missing value.
typedef struct gonio_missing {
    bool automatic, has_number;
    double number;
    const char *word; // "NaN"; NULL: none
    struct {          // of the numbers that programs write for it and this file holds
        double number;
        size_t count;
        long long line; // of the first
        int channel;    // and where it stood
        double sigma;
    } found[8];
    int n_found;
} gonio_missing;

// Rows of a text file on their way into a set: the policy on negative values, and the counts.
typedef struct gonio_row_collector {
    const gonio_text *text;
    gonio_negatives policy;
    gonio_samples *samples;
    gonio_read_report report;
    // What the policy does not accept: how many, and the first one; its sigma is NaN where the file states none.
    size_t refused;
    long long refused_line;
    int refused_channel;
    double refused_value, refused_sigma;
    gonio_declared declared;
    gonio_missing missing;
    long long *lines; // of the samples' rows
    size_t lines_capacity;
    double *sigmas;  // scratch of a row
    bool *is_signed; // channels that may be negative by nature: Mueller elements
    size_t horizon;  // rows left out there
    bool by_mapping; // what the values are is stated, and said, by a mapping
} gonio_row_collector;

// Before the text's first line is read: reads what its comments declare. own: what the format knows of that, or NULL.
// The text is told how far thetas go.
gonio_status gonio_row_collector_begin(gonio_row_collector *collector, gonio_text *text, const gonio_source *source,
                                       const gonio_format_values *values, const gonio_declaration *own,
                                       const char *format, gonio_error *error);
// A value of the row; NaN where the user said that this stands for a missing one.
gonio_status gonio_row_collector_number(const gonio_row_collector *collector, const char *field, const char *what,
                                        double *value, gonio_error *error);
// Make the empty set, of which the rows then are; once, before the first row.
gonio_status gonio_row_collector_room(gonio_row_collector *collector, int channels, bool with_sigma,
                                      gonio_error *error);
// Once the channels have their names: those of Mueller matrices are no subject of the policy.
gonio_status gonio_row_collector_named(gonio_row_collector *collector, gonio_error *error);
// values may be changed (clamped). sigma_random and sigma_systematic: both NULL where the file states none. The line is
// the text's current one.
gonio_status gonio_row_collector_add(gonio_row_collector *collector, const gonio_pair *pair, double *values,
                                     const double *sigma_random, const double *sigma_systematic, gonio_error *error);
// Give the set out, or the error that the policy asks for (the set is freed then). status: how reading went so far.
gonio_status gonio_row_collector_end(gonio_row_collector *collector, gonio_status status, gonio_samples **out,
                                     gonio_read_report *report, gonio_error *error);

// Look for missing values that are written as numbers: fill numbers, blocks of zeros or of another value; and for a
// ceiling. They are left out (the set is then another one) where `leave_out`, and told in notes. lines: of the set's
// rows, which follow.
gonio_status gonio_missing_look(gonio_samples **samples, long long *lines, bool leave_out, char *notes, size_t size,
                                gonio_error *error);

// Tell in notes of equal geometries whose values differ by more than they may.
gonio_status gonio_repeats_look(const gonio_samples *samples, const long long *lines, char *notes, size_t size,
                                gonio_error *error);

// Angles of files in radians: a polar angle at most rounding beyond the horizon is taken back to it.
gonio_status gonio_polar_rad(const gonio_text *text, const char *what, double rad, double *theta, gonio_error *error);

#endif
