// SPDX-License-Identifier: BSD-3-Clause
// The BRDFs of CUReT, the Columbia-Utrecht reflectance and texture database (K. J. Dana, B. van Ginneken, S. K. Nayar
// and J. J. Koenderink, 1999; its page "BRDF measurement database"): abrdf.dat, and rbrdf.dat, gbrdf.dat, bbrdf.dat for
// colours, hold a row a sample, its number and 205 values of f_r in 1/sr. Which directions these belong to stands in a
// table of its own, a row a measurement: its number, theta_v, phi_v, theta_i, phi_i in radians. That table is
// --directions, by default table.txt beside the file.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "io/format.h"

enum { MEASUREMENTS = 205, SAMPLES = 61, ANGLES = 4 };
enum { DIRECTIONS = GONIO_TEXT_OPTIONS_N, SAMPLE };
#define STANDARD "table.txt"

// A row of 206 numbers, of which the first counts samples.
static bool recognise(const gonio_source *source) {
    const char *at = source->data;
    at += strspn(at, " \t\r\n");
    const size_t length = strcspn(at, "\r\n");
    int n = 0;
    for (const char *end = at + length; at < end; n++) {
        char *rest;
        const double value = gonio_number_parse(at, &rest);
        if (rest == at || rest > end || (*rest != 0 && strchr(" \t\r\n", *rest) == NULL) ||
            (n == 0 && !(value >= 1 && value <= SAMPLES && value == floor(value)))) {
            return false;
        }
        at = rest + strspn(rest, " \t");
    }
    return n == MEASUREMENTS + 1;
}

// ---- the directions ----

static gonio_status read_direction(const gonio_text *text, char *line, int index, gonio_pair *pair,
                                   gonio_error *error) {
    static const char *const names[ANGLES] = {"theta_v", "phi_v", "theta_i", "phi_i"};
    char *fields[ANGLES + 1];
    double number, a[ANGLES];
    const int n = gonio_text_split(line, ' ', fields, ANGLES + 1);
    gonio_status status =
        n == ANGLES + 1
            ? gonio_text_number(text, fields[0], "measurement", &number, error)
            : gonio_text_fail(text, error, "expected a number and theta_v, phi_v, theta_i, phi_i, found %d numbers", n);
    if (status == GONIO_OK && number != index + 1) {
        status = gonio_text_fail(text, error, "expected measurement %d, found %g", index + 1, number);
    }
    for (int k = 0; k < ANGLES && status == GONIO_OK; k++) {
        status = gonio_text_number(text, fields[k + 1], names[k], &a[k], error);
    }
    status = status == GONIO_OK ? gonio_polar_rad(text, names[0], a[0], &pair->theta_o, error) : status;
    status = status == GONIO_OK ? gonio_polar_rad(text, names[2], a[2], &pair->theta_i, error) : status;
    if (status == GONIO_OK && !(fabs(a[1]) <= 2 * GONIO_PI && fabs(a[3]) <= 2 * GONIO_PI)) {
        status =
            gonio_text_fail(text, error, "expected azimuths of -2 pi to 2 pi radians, found %g and %g", a[1], a[3]);
    }
    if (status == GONIO_OK) {
        pair->phi_o = gonio_angle_canonical(remainder(a[1], 2 * GONIO_PI));
        pair->phi_i = gonio_angle_canonical(remainder(a[3], 2 * GONIO_PI));
    }
    return status;
}

static gonio_status read_directions(const gonio_source *source, const char *given, bool transmission, gonio_pair *pairs,
                                    gonio_error *error) {
    char *path = NULL;
    const char *slash = strrchr(source->path, '/');
    const int folder = slash != NULL ? (int)(slash - source->path) + 1 : 0;
    if (asprintf(&path, "%.*s%s", given[0] == 0 ? folder : 0, source->path, given[0] == 0 ? STANDARD : given) < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    gonio_text text;
    gonio_status status = gonio_text_open(path, 1 << 20, &text, error);
    if (status != GONIO_OK) {
        free(path);
        return status == GONIO_E_INPUT && given[0] == 0 && error != NULL
                   ? gonio_fail_line(
                         error, GONIO_E_INPUT, source->path, -1,
                         "its directions stand in a table of their own; name it with --directions, or put it "
                         "beside the file as " STANDARD)
                   : status;
    }
    text.transmission = transmission;
    int n = 0;
    for (char *line; status == GONIO_OK && n < MEASUREMENTS && (line = gonio_text_content(&text)) != NULL; n++) {
        status = read_direction(&text, line, n, &pairs[n], error);
    }
    if (status == GONIO_OK && (n < MEASUREMENTS || gonio_text_content(&text) != NULL)) {
        status = gonio_text_fail(&text, error, "expected %d measurements, found %s", MEASUREMENTS,
                                 n < MEASUREMENTS ? "fewer" : "more");
    }
    gonio_text_free(&text);
    free(path);
    return status;
}

// ---- the values ----

static gonio_status add_values(gonio_row_collector *collector, char *const *fields, const gonio_pair *pairs,
                               gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; k < MEASUREMENTS && status == GONIO_OK; k++) {
        double value;
        status = gonio_row_collector_number(collector, fields[k + 1], "value", &value, error);
        status = status == GONIO_OK ? gonio_row_collector_add(collector, &pairs[k], &value, NULL, NULL, error) : status;
    }
    return status;
}

// The row of the sample that is wanted; 0: there must be one alone.
static gonio_status read_row(gonio_text *text, size_t wanted, gonio_row_collector *collector, const gonio_pair *pairs,
                             gonio_error *error) {
    char *fields[MEASUREMENTS + 1];
    gonio_status status = GONIO_OK;
    size_t rows = 0, read = 0;
    for (char *line; status == GONIO_OK && (line = gonio_text_content(text)) != NULL; rows++) {
        double number;
        const int n = gonio_text_split(line, ' ', fields, MEASUREMENTS + 1);
        status = n == MEASUREMENTS + 1
                     ? gonio_text_number(text, fields[0], "sample", &number, error)
                     : gonio_text_fail(text, error, "expected a sample's number and %d values, found %d numbers",
                                       MEASUREMENTS, n);
        if (status == GONIO_OK && wanted == 0 && rows > 0) {
            return gonio_fail_line(error, GONIO_E_INPUT, text->path, text->line,
                                   "the file holds several samples; --sample chooses one by its number");
        }
        if (status == GONIO_OK && (wanted == 0 || number == (double)wanted)) {
            status = add_values(collector, fields, pairs, error);
            read++;
        }
    }
    return status == GONIO_OK && read != 1
               ? gonio_fail_line(error, GONIO_E_INPUT, text->path, -1, "%zu rows of sample %zu", read, wanted)
               : status;
}

static gonio_status read_curet(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                               gonio_read_report *report, gonio_error *error) {
    gonio_text text = gonio_text_begin(source->path, source->data, source->size);
    gonio_row_collector collector;
    gonio_pair pairs[MEASUREMENTS];
    gonio_status status = gonio_row_collector_begin(&collector, &text, source, values, NULL, "curet", error);
    if (status == GONIO_OK) {
        status = read_directions(source, values->at[DIRECTIONS].text, text.transmission, pairs, error);
    }
    status = status == GONIO_OK ? gonio_row_collector_room(&collector, 1, false, error) : status;
    if (status == GONIO_OK) {
        strcpy(collector.samples->channel_names[0], "value");
        // The samples are woven, knitted, ribbed: nobody says that turning them changes nothing.
        collector.samples->isotropic = false;
        status = read_row(&text, values->at[SAMPLE].count, &collector, pairs, error);
    }
    return gonio_row_collector_end(&collector, status, out, report, error);
}

static const gonio_format_option options[] = {
    GONIO_TEXT_OPTIONS,
    [DIRECTIONS] = {"directions", GONIO_FORMAT_TEXT, "FILE", "",
                    "the table of directions (" STANDARD " beside the file)"},
    [SAMPLE] = {"sample", GONIO_FORMAT_COUNT, "N", "0", "which sample of several"},
    {0}};

const gonio_format gonio_format_curet = {.name = "curet",
                                         .summary = "CUReT BRDF text",
                                         .extensions = ".dat",
                                         .recognise = recognise,
                                         .read = read_curet,
                                         .options = options};
