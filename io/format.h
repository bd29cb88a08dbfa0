// What the readers share: one gonio_format a file format, and the sink that collects rows.
#ifndef GONIO_IO_FORMAT_H
#define GONIO_IO_FORMAT_H

#include "base/text.h"
#include "gonio/io.h"

// A file in memory. data ends with a 0 byte that size does not count; text readers cut it up.
typedef struct gonio_source {
    const char *path;
    char *data;
    size_t size;
} gonio_source;

typedef struct gonio_format {
    const char *name;
    // Is it of this format? Must not change the data; a damaged file of the format still counts, its reader says why.
    bool (*is)(const gonio_source *source);
    // The samples; the caller frees them. On failure *out is NULL.
    gonio_status (*read)(const gonio_source *source, const gonio_read_options *options, gonio_samples **out,
                         gonio_read_report *report, gonio_error *error);
    // An interpolating model. NULL: the format holds scattered samples, which must be fitted.
    gonio_status (*table)(const gonio_source *source, gonio_model **out, gonio_error *error);
} gonio_format;

extern const gonio_format gonio_format_samples, gonio_format_cornell, gonio_format_nist, gonio_format_retro,
    gonio_format_merl, gonio_format_rgl;

// The first line of a text that is neither empty nor a comment, for recognising it; "" where there is none or the data
// is binary. buffer holds it.
const char *gonio_source_first_line(const gonio_source *source, char *buffer, size_t size);

// Names that a samples file can hold: each once, not empty, no comma, quote, blank end or control character, none that
// reads as a sigma column.
gonio_status gonio_channel_names_check(const char *path, const char (*names)[GONIO_CHANNEL_NAME_MAX], int n,
                                       gonio_error *error);

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
} gonio_row_collector;

gonio_row_collector gonio_row_collector_begin(const gonio_text *text, const gonio_read_options *options,
                                              const char *format);
// values may be changed (clamped). sigma_random and sigma_systematic: both NULL where the file states none. The line is
// the text's current one.
gonio_status gonio_row_collector_add(gonio_row_collector *sink, const gonio_pair *pair, double *values,
                                     const double *sigma_random, const double *sigma_systematic, gonio_error *error);
// Give the set out, or the error that the policy asks for (the set is freed then). status: how reading went so far.
gonio_status gonio_row_collector_end(gonio_row_collector *sink, gonio_status status, gonio_samples **out,
                                     gonio_read_report *report, gonio_error *error);

// Angles of files in radians: a polar angle at most rounding beyond the horizon is taken back to it.
gonio_status gonio_polar_rad(const gonio_text *text, const char *what, double rad, double *theta, gonio_error *error);

#endif
