// SPDX-License-Identifier: BSD-3-Clause
// Cornell Program of Computer Graphics' gonioreflectometer text (Foo 1997; docs/formats.md): N, N wavelengths (nm),
// then rows theta_i phi_i theta_s phi_s (rad) and N values (1/sr). Numbers are separated by blanks; the header's may
// stand on any number of lines. Zeros are noise that the laboratory clamped.
#include <math.h>
#include <stdlib.h>

#include "base/number.h"
#include "io/format.h"

// The text's six decimals may round a full turn up.
#define AZIMUTH_MAX (2 * GONIO_PI + 1e-5)

static double azimuth(double phi) { return gonio_angle_canonical(fmin(fmax(phi, -2 * GONIO_PI), 2 * GONIO_PI)); }

static bool recognise(const gonio_source *source) {
    long long number;
    char line[64], *end;
    const char *first = gonio_source_first_line(source, line, sizeof line, &number);
    const long n = strtol(first, &end, 10);
    return end != first && *end == 0 && n > 0;
}

// The wavelengths, over as many lines as they take.
static gonio_status read_wavelengths(gonio_text *text, char **fields, gonio_samples *samples, gonio_error *error) {
    int found = 0;
    while (found < samples->channels) {
        char *line = gonio_text_content(text);
        if (line == NULL) {
            return gonio_text_fail(text, error, "expected %d wavelengths, found %d before the file ended",
                                   samples->channels, found);
        }
        const int n = gonio_text_split(line, ' ', fields, 4 + samples->channels);
        if (n > samples->channels - found) {
            return gonio_text_fail(text, error, "expected %d more wavelengths, found %d numbers",
                                   samples->channels - found, n);
        }
        for (int k = 0; k < n; k++) {
            double nm;
            const gonio_status status = gonio_text_number(text, fields[k], "wavelength", &nm, error);
            if (status != GONIO_OK) {
                return status;
            }
            if (!(nm >= 20 && nm <= 1e6)) {
                return gonio_text_fail(text, error, "wavelength: expected 20 to 1e6 nm, found %s", fields[k]);
            }
            gonio_number_format(samples->channel_names[found++], GONIO_CHANNEL_NAME_MAX, "%.10gnm", nm);
        }
    }
    return GONIO_OK;
}

static gonio_status read_row(const gonio_text *text, char **fields, gonio_row_collector *collector, double *numbers,
                             gonio_error *error) {
    static const char *const names[4] = {"theta_i", "phi_i", "theta_s", "phi_s"};
    const int channels = collector->samples->channels;
    gonio_status status = GONIO_OK;
    for (int k = 0; k < 4 + channels && status == GONIO_OK; k++) {
        status = k < 4 ? gonio_text_number(text, fields[k], names[k], &numbers[k], error)
                       : gonio_row_collector_number(collector, fields[k], collector->samples->channel_names[k - 4],
                                                    &numbers[k], error);
    }
    gonio_pair pair = {0};
    status = status == GONIO_OK ? gonio_polar_rad(text, names[0], numbers[0], &pair.theta_i, error) : status;
    status = status == GONIO_OK ? gonio_polar_rad(text, names[2], numbers[2], &pair.theta_o, error) : status;
    if (status == GONIO_OK && !(fabs(numbers[1]) <= AZIMUTH_MAX && fabs(numbers[3]) <= AZIMUTH_MAX)) {
        status = gonio_text_fail(text, error, "phi: expected -2 pi to 2 pi radians, found %g and %g", numbers[1],
                                 numbers[3]);
    }
    if (status != GONIO_OK) {
        return status;
    }
    pair.phi_i = azimuth(numbers[1]);
    pair.phi_o = azimuth(numbers[3]);
    return gonio_row_collector_add(collector, &pair, numbers + 4, NULL, NULL, error);
}

static gonio_status read_rows(gonio_text *text, char **fields, gonio_row_collector *collector, gonio_error *error) {
    const int columns = 4 + collector->samples->channels;
    double *numbers = malloc((size_t)columns * sizeof *numbers);
    if (numbers == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
    }
    gonio_status status = GONIO_OK;
    for (char *line; status == GONIO_OK && (line = gonio_text_content(text)) != NULL;) {
        const int n = gonio_text_split(line, ' ', fields, columns);
        status = n == columns ? read_row(text, fields, collector, numbers, error)
                              : gonio_text_fail(text, error, "expected 4 angles and %d values, found %d numbers",
                                                columns - 4, n);
    }
    free(numbers);
    return status;
}

static const gonio_declaration declarations[] = {
    {"radian", NULL, GONIO_DECLARED_NOTHING}, {"angle_units", "radian|radians|rad", GONIO_DECLARED_NOTHING}, {0}};

static gonio_status read_cornell(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                                 gonio_read_report *report, gonio_error *error) {
    gonio_text text = gonio_text_begin(source->path, source->data, source->size);
    gonio_row_collector collector;
    gonio_status status = gonio_row_collector_begin(&collector, &text, source, values, declarations, "cornell", error);
    if (status != GONIO_OK) {
        return status;
    }
    char *fields[4 + GONIO_CHANNELS_MAX];
    const char *first = gonio_text_content(&text);
    const long channels = strtol(first, NULL, 10);
    if (channels > GONIO_CHANNELS_MAX) {
        status = gonio_text_fail(&text, error, "%ld wavelengths; 1 to %d are possible", channels, GONIO_CHANNELS_MAX);
    } else {
        status = gonio_row_collector_room(&collector, (int)channels, false, error);
    }
    status = status == GONIO_OK ? read_wavelengths(&text, fields, collector.samples, error) : status;
    status = status == GONIO_OK ? read_rows(&text, fields, &collector, error) : status;
    return gonio_row_collector_end(&collector, status, out, report, error);
}

static const gonio_format_option options[] = {GONIO_TEXT_OPTIONS, {0}};

const gonio_format gonio_format_cornell = {.name = "cornell",
                                           .summary = "Cornell gonioreflectometer text",
                                           .extensions = ".brdf",
                                           .recognise = recognise,
                                           .read = read_cornell,
                                           .options = options};
