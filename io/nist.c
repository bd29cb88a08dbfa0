// SPDX-License-Identifier: BSD-3-Clause
// NIST's Mueller-matrix BRDF of sintered PTFE (Germer 2017; docs/formats.md): a row is one geometry at one wavelength,
// lambda (um), thetai, phii, thetar, phir (deg), f_r11 (1/sr), then the 15 other elements divided by f_r11.
//
// thetai is signed: a negative one lies on the side of phii + 180 deg, so that light at -60 deg is mirrored to phir =
// 0. Without a chosen wavelength every wavelength becomes a channel, which takes the same geometries at each.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/long_rows.h"

#define COLUMNS 21
enum { MUELLER = GONIO_TEXT_OPTIONS_N }; // option

static bool recognise(const gonio_source *source) {
    long long number;
    char line[64], *fields[1];
    gonio_source_first_line(source, line, sizeof line, &number);
    return gonio_text_split(line, ',', fields, 1) > 1 && strcmp(fields[0], "lambda") == 0;
}

// "f_r23" -> 6; -1: no such element.
static int element_of(const char *name) {
    const bool sound = strlen(name) == 5 && strncmp(name, "f_r", 3) == 0 && name[3] >= '1' && name[3] <= '4' &&
                       name[4] >= '1' && name[4] <= '4';
    return sound ? 4 * (name[3] - '1') + (name[4] - '1') : -1;
}

// A negative polar angle lies half a turn further; the sum stays within a turn, as every samples file wants it.
static double azimuth_deg(double polar_deg, double phi_deg) {
    return polar_deg >= 0 ? phi_deg : phi_deg > 180 ? phi_deg - 180 : phi_deg + 180;
}

static gonio_status parse_row(const gonio_row_collector *collector, char **fields, int element, bool divided,
                              gonio_long_row *row, gonio_error *error) {
    const gonio_text *text = collector->text;
    static const char *const names[5] = {"lambda", "thetai", "phii", "thetar", "phir"};
    double number[5], f11, ratio = 1;
    gonio_status status = GONIO_OK;
    for (int k = 0; k < 5 && status == GONIO_OK; k++) {
        status = gonio_text_number(text, fields[k], names[k], &number[k], error);
    }
    status = status == GONIO_OK ? gonio_row_collector_number(collector, fields[5], "f_r11", &f11, error) : status;
    if (status == GONIO_OK && element > 0) {
        status = gonio_row_collector_number(collector, fields[5 + element], "Mueller element", &ratio, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    const int largest = text->transmission ? 180 : 90;
    if (!(fabs(number[1]) <= largest && fabs(number[3]) <= largest)) {
        return gonio_text_fail(text, error, "thetai, thetar: expected -%d to %d degrees, found %s and %s", largest,
                               largest, fields[1], fields[3]);
    }
    if (!(fabs(number[2]) <= 360 && fabs(number[4]) <= 360 && number[0] > 0 && number[0] <= 100)) {
        return gonio_text_fail(text, error, "expected a lambda of 0 to 100 um and azimuths of -360 to 360 degrees");
    }
    row->lambda_um = number[0];
    row->value = element == 0 || divided ? f11 * ratio : ratio;
    row->sigma = 0;
    row->line = text->line;
    row->pair = (gonio_pair){gonio_radians(fabs(number[1])), gonio_radians(azimuth_deg(number[1], number[2])),
                             gonio_radians(fabs(number[3])), gonio_radians(azimuth_deg(number[3], number[4]))};
    return GONIO_OK;
}

// What the header says of the values: f_r11 itself, and the others divided by it unless their names lack "/f_r11".
static gonio_status check_header(const gonio_text *text, char *const *fields, int n, int element, bool *divided,
                                 gonio_error *error) {
    static const char *const names[6] = {"lambda", "thetai", "phii", "thetar", "phir", "f_r11"};
    if (n != COLUMNS || strcmp(fields[1], names[1]) != 0) {
        return gonio_text_fail(text, error, "expected a header of %d columns, lambda,thetai,..., found %d", COLUMNS, n);
    }
    for (int k = 2; k < 6; k++) {
        if (strcmp(fields[k], names[k]) != 0 && !(k == 2 && strcmp(fields[k], "phi") == 0)) {
            return gonio_text_fail(text, error, "column %d: expected %s, found '%.60s'", k + 1, names[k], fields[k]);
        }
    }
    *divided = element == 0 || element_of(fields[5 + element]) != element;
    return GONIO_OK;
}

static gonio_status read_rows(gonio_text *text, const gonio_row_collector *collector, int element, gonio_long_rows *all,
                              gonio_error *error) {
    char *fields[COLUMNS];
    char *line = gonio_text_content(text);
    int n = gonio_text_split(line, ',', fields, COLUMNS);
    bool divided = true;
    gonio_status status = check_header(text, fields, n, element, &divided, error);
    while (status == GONIO_OK && (line = gonio_text_content(text)) != NULL) {
        n = gonio_text_split(line, ',', fields, COLUMNS);
        gonio_long_row row;
        status = n == COLUMNS ? parse_row(collector, fields, element, divided, &row, error)
                              : gonio_text_fail(text, error, "expected %d columns, found %d", COLUMNS, n);
        status = status == GONIO_OK ? gonio_long_rows_add(text, all, &row, error) : status;
    }
    return status;
}

static const gonio_declaration declarations[] = {
    {"angle_units", "deg|degree|degrees", GONIO_DECLARED_NOTHING},
    {"wavelength_units", "um|micrometre|micrometres|micrometer|micrometers|micron|microns", GONIO_DECLARED_NOTHING},
    {"mirror_at", "0|0 deg", GONIO_DECLARED_NOTHING},
    {0}};

static gonio_status read_element(const gonio_source *source, const gonio_format_values *values, int element,
                                 gonio_samples **out, gonio_read_report *report, gonio_error *error) {
    gonio_text text = gonio_text_begin(source->path, source->data, source->size);
    gonio_row_collector collector;
    gonio_status status = gonio_row_collector_begin(&collector, &text, source, values, declarations, "nist", error);
    if (element > 0) {
        collector.policy = GONIO_NEGATIVES_KEEP; // every element but the first is signed by nature
    }
    gonio_long_rows all = {0};
    status = status == GONIO_OK ? read_rows(&text, &collector, element, &all, error) : status;
    if (status == GONIO_OK && values->wavelength_nm > 0) {
        status = gonio_long_rows_choose(&text, &all, values->wavelength_nm / 1000, collector.report.notes,
                                        sizeof collector.report.notes, error);
    }
    status = status == GONIO_OK ? gonio_long_rows_collect(&text, &all, false, &collector, error) : status;
    free(all.rows);
    return gonio_row_collector_end(&collector, status, out, report, error);
}

// One wavelength: f_r11 to f_r44; several: 351nm_f_r11 ...
static void name_element(const gonio_samples *one, int wavelength, int element, char name[GONIO_CHANNEL_NAME_MAX]) {
    const bool several = one->channels > 1;
    snprintf(name, GONIO_CHANNEL_NAME_MAX, "%.20s%sf_r%d%d", several ? one->channel_names[wavelength] : "",
             several ? "_" : "", element / 4 + 1, element % 4 + 1);
}

static gonio_status join(gonio_samples *const sets[16], gonio_samples **out, gonio_error *error) {
    const gonio_samples *first = sets[0];
    const int channels = first->channels;
    for (int e = 1; e < 16; e++) {
        if (sets[e]->n != first->n || memcmp(sets[e]->pairs, first->pairs, first->n * sizeof *first->pairs) != 0) {
            return gonio_fail(error, GONIO_E_INPUT, "elements 1 and %d are missing at different geometries", e + 1);
        }
    }
    gonio_status status = gonio_samples_new(16 * channels, false, out, error);
    status = status == GONIO_OK ? gonio_samples_reserve(*out, first->n, error) : status;
    for (int c = 0; c < 16 * channels && status == GONIO_OK; c++) {
        name_element(first, c / 16, c % 16, (*out)->channel_names[c]);
    }
    for (size_t i = 0; i < first->n && status == GONIO_OK; i++) {
        double values[GONIO_CHANNELS_MAX];
        for (int c = 0; c < 16 * channels; c++) {
            values[c] = sets[c % 16]->values[i * (size_t)channels + (size_t)(c / 16)];
        }
        status = gonio_samples_add(*out, &first->pairs[i], values, NULL, NULL, error);
    }
    if (status == GONIO_OK) {
        (*out)->isotropic = first->isotropic;
        (*out)->head = sets[0]->head;
        sets[0]->head = NULL;
    }
    return status;
}

// Each element as it is read alone, from a copy: reading cuts the text up.
static gonio_status read_matrix(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                                gonio_read_report *report, gonio_error *error) {
    gonio_samples *sets[16] = {0};
    gonio_source copy = {.path = source->path, .data = malloc(source->size + 1), .size = source->size};
    gonio_status status =
        copy.data != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", source->path);
    for (int e = 0; e < 16 && status == GONIO_OK; e++) {
        gonio_read_report own;
        memcpy(copy.data, source->data, source->size + 1);
        status = read_element(&copy, values, e, &sets[e], &own, error);
        if (report != NULL && e == 0) {
            *report = own;
        }
    }
    free(copy.data);
    if (status == GONIO_OK && sets[0]->channels > GONIO_CHANNELS_MAX / 16) {
        status = gonio_fail(error, GONIO_E_INPUT, "16 elements of %d wavelengths; --wavelength chooses one",
                            sets[0]->channels);
    }
    status = status == GONIO_OK ? join(sets, out, error) : status;
    for (int e = 0; e < 16; e++) {
        gonio_samples_free(sets[e]);
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}

static gonio_status read_nist(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                              gonio_read_report *report, gonio_error *error) {
    const int element = element_of(values->at[MUELLER].text);
    *out = NULL;
    if (strcmp(values->at[MUELLER].text, "all") == 0) {
        return read_matrix(source, values, out, report, error);
    }
    return element >= 0 ? read_element(source, values, element, out, report, error)
                        : gonio_fail(error, GONIO_E_USAGE, "Mueller element '%s'; expected f_r11 to f_r44, or all",
                                     values->at[MUELLER].text);
}

static const gonio_format_option options[] = {
    GONIO_TEXT_OPTIONS,
    [MUELLER] = {"mueller", GONIO_FORMAT_TEXT, "ELEMENT|all", "f_r11",
                 "Mueller element, f_r11 to f_r44, or all sixteen as channels"},
    {0}};

const gonio_format gonio_format_nist = {.name = "nist",
                                        .summary = "NIST Mueller-matrix CSV",
                                        .extensions = ".csv",
                                        .recognise = recognise,
                                        .read = read_nist,
                                        .options = options};
