// BRDF files in and out; one file a format under io/. Formats are recognised by content, never by name.
#ifndef GONIO_IO_H
#define GONIO_IO_H

#include <stdio.h>

#include "gonio/model.h"
#include "gonio/sample.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gonio_negatives {
    GONIO_NEGATIVES_REJECT = 0, // an error with the count and the first line
    GONIO_NEGATIVES_CLAMP = 1,  // raised to 0, counted
    GONIO_NEGATIVES_KEEP = 2,
    // The default: kept where the file states sigma and every one lies within GONIO_NOISE_SIGMAS of 0, as a calibrated
    // measurement of something black scatters; else an error, as GONIO_NEGATIVES_REJECT.
    GONIO_NEGATIVES_NOISE = 3,
} gonio_negatives;
#define GONIO_NOISE_SIGMAS 5 // combined standard uncertainties; noise alone goes beyond once in 3.5 million values

// How to read. gonio_read_options_default() first.
typedef struct gonio_read_options {
    gonio_negatives negatives;
    double wavelength_um; // NIST: 0 = every wavelength a channel
    const char *mueller;  // NIST: "f_r11" (default) or "f_r12" ... (multiplied back by f_r11)
    size_t limit;         // tables: how many geometries to sample from them at most (0: the format's default)
    uint64_t seed;
} gonio_read_options;

typedef struct gonio_read_report {
    char format[32]; // "samples" "cornell" "nist" "merl" "rgl" ...
    size_t rows, negatives, invalid;
    size_t noise;                  // of the negatives: within GONIO_NOISE_SIGMAS of 0
    long long first_negative_line; // -1: none
} gonio_read_report;

void gonio_read_options_default(gonio_read_options *options);
// Read any known BRDF file as samples; the caller frees them. report may be NULL.
gonio_status gonio_read(const char *path, const gonio_read_options *options, gonio_samples **out,
                        gonio_read_report *report, gonio_error *error);
// Is it a file that begins as a Gonio model file does? Never blocks; false where it cannot be read.
bool gonio_model_file_is(const char *path);
// A measured table (MERL, RGL ...) as a model that interpolates it. The caller frees it.
gonio_status gonio_read_table(const char *path, gonio_model **out, gonio_error *error);

// Samples CSV (DESIGN section 4), written beside, synced and renamed; reading it gives the same bits.
gonio_status gonio_write_samples(const gonio_samples *samples, const char *path, gonio_error *error);
gonio_status gonio_write_samples_stream(const gonio_samples *samples, FILE *stream, gonio_error *error);

// The model's values (and sigma, where it carries one, as the systematic part) at n pairs, as samples; the caller frees
// them.
gonio_status gonio_samples_of_model(const gonio_model *model, const gonio_pair *pairs, size_t n, gonio_samples **out,
                                    gonio_error *error);
// Write an isotropic model of 1 or 3 channels as a MERL .binary, each cell by the value at its centre.
gonio_status gonio_write_merl(const gonio_model *model, const char *path, gonio_error *error);

#ifdef __cplusplus
}
#endif
#endif
