// SPDX-License-Identifier: BSD-3-Clause
// UTIA BRDF database (J. Filip and R. Vavra, "Template-based sampling of anisotropic BRDFs", 2014): 3 planes of 288 x
// 288 float64, little-endian, R, G, B; index (48 i + j) of 6 incident thetas in steps of 15 deg and 48 azimuths in
// steps of 7.5 deg, times the same of outgoing ones. Published readers disagree on the numbers' scale, so it has to be
// stated: f_r = scale x number.
#include <endian.h>
#include <math.h>
#include <string.h>

#include "base/number.h"
#include "io/format.h"

enum { THETAS = 6, PHIS = 48, SIDE = THETAS * PHIS };
#define NUMBERS ((size_t)3 * SIDE * SIDE)

static double number_at(const gonio_source *source, size_t at) {
    uint64_t raw;
    double value;
    memcpy(&raw, source->data + 8 * at, 8);
    raw = le64toh(raw);
    memcpy(&value, &raw, 8);
    return value;
}

// The size alone would fit other files: the first numbers must be values too.
static bool recognise(const gonio_source *source) {
    if (source->size != NUMBERS * 8) {
        return false;
    }
    for (size_t k = 0; k < PHIS; k++) {
        const double value = number_at(source, k);
        if (!(value >= 0 && value < 1e6) || (value > 0 && value < 1e-12)) {
            return false;
        }
    }
    return true;
}

static gonio_status parse_scale(const char *text, double *scale, gonio_error *error) {
    char *end;
    *scale = gonio_number_parse(text, &end);
    return end != text && *end == 0 && *scale > 0 && isfinite(*scale)
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE,
                            "--scale: expected the number above 0 that makes f_r in 1/sr of this UTIA file's values "
                            "(published readers disagree on it), found '%s'",
                            text);
}

static gonio_status add_row(const gonio_source *source, int in, double scale, gonio_samples *samples,
                            gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int out = 0; status == GONIO_OK && out < SIDE; out++) {
        if ((in < PHIS && in > 0) || (out < PHIS && out > 0)) {
            continue; // azimuths of the pole are one direction
        }
        const gonio_pair pair = {gonio_radians(15.0 * (in / PHIS)), gonio_radians(7.5 * (in % PHIS)),
                                 gonio_radians(15.0 * (out / PHIS)), gonio_radians(7.5 * (out % PHIS))};
        double rgb[3];
        for (size_t c = 0; c < 3; c++) {
            const size_t at = c * SIDE * SIDE + (size_t)in * SIDE + (size_t)out;
            rgb[c] = scale * number_at(source, at);
            if (!isfinite(rgb[c]) || rgb[c] < 0) {
                return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)(8 * at),
                                       "expected a finite number, 0 or more, found %g", rgb[c]);
            }
        }
        status = gonio_samples_add(samples, &pair, rgb, NULL, NULL, error);
    }
    return status;
}

static gonio_status read_utia(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                              gonio_read_report *report, gonio_error *error) {
    double scale;
    gonio_status status = parse_scale(values->at[0].text, &scale, error);
    status = status == GONIO_OK ? gonio_samples_new(3, false, out, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    (*out)->isotropic = false;
    memcpy((*out)->channel_names, (const char[3][GONIO_CHANNEL_NAME_MAX]){"r", "g", "b"},
           3 * sizeof *(*out)->channel_names);
    for (int in = 0; status == GONIO_OK && in < SIDE; in++) {
        status = add_row(source, in, scale, *out, error);
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    } else if (report != NULL) {
        *report = (gonio_read_report){.format = "utia", .rows = (*out)->n, .first_negative_line = -1};
    }
    return status;
}

static const gonio_format_option options[] = {
    {"scale", GONIO_FORMAT_TEXT, "NUMBER", "", "f_r over the file's numbers; has to be stated"}, {0}};

const gonio_format gonio_format_utia = {.name = "utia",
                                        .summary = "UTIA BRDF table",
                                        .extensions = ".bin",
                                        .recognise = recognise,
                                        .read = read_utia,
                                        .options = options};
