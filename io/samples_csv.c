// SPDX-License-Identifier: BSD-3-Clause
// Gonio's own samples file, read and written (docs/formats.md).
//
//   theta_i,phi_i,theta_o,phi_o,<channels...>[,sigma_<channel>...]
//       [,sigma_random_<channel>...,sigma_systematic_<channel>...[,systematic_group]]
//
// Angles in degrees, f_r in 1/sr. sigma_<channel> is the combined standard uncertainty. The two parts follow where the
// systematic one is not zero throughout; a reader takes them then and the combined one only where they are missing. The
// systematic part is common to the rows of one systematic_group: sets of several sessions have several. The comment
// "# anisotropic" says that the geometry does not reduce to the difference of azimuths, "# halves = reflection,
// transmission" that thetas beyond 90 deg are directions behind the sample.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/head.h"
#include "io/columns.h"
#include "io/long_rows.h"

#define ANISOTROPIC "# anisotropic"
#define CHANNELS "# channels = "
#define TRANSMISSION "# halves = reflection,transmission"

// A header that holds one of the angles: what else is wrong with it, this reader says best.
static bool recognise(const gonio_source *source) {
    long long number;
    static const char *const angles[] = {"theta_i", "phi_i", "theta_o", "phi_o"};
    char line[256];
    const char *first = gonio_source_first_line(source, line, sizeof line, &number);
    if (strncasecmp(first, "VARS", 4) == 0) {
        return false; // ASTM's
    }
    for (size_t k = 0; k < sizeof angles / sizeof *angles; k++) {
        if (strstr(first, angles[k]) != NULL) {
            return true;
        }
    }
    return false;
}

// ---- reading ----

// The group of the sample that was read last.
static gonio_status parse_group(const gonio_text *text, const char *field, gonio_samples *samples, gonio_error *error) {
    size_t group;
    if (!gonio_text_count(field, &group) || group < 1 || group > UINT16_MAX) {
        return gonio_text_fail(text, error, GONIO_COLUMN_GROUP ": expected 1 to %d, found '%.60s'", UINT16_MAX, field);
    }
    return gonio_samples_set_group(samples, samples->n - 1, (uint16_t)group, error);
}

static gonio_status parse_sigma(const gonio_row_collector *collector, const char *field, double *sigma,
                                gonio_error *error) {
    const gonio_status status = gonio_row_collector_number(collector, field, "sigma", sigma, error);
    if (status == GONIO_OK && *sigma < 0) {
        return gonio_text_fail(collector->text, error, "sigma: expected 0 or more, found %s", field);
    }
    return status;
}

// One row's numbers; values, random, systematic have room for every channel.
static gonio_status parse_row(const gonio_row_collector *collector, char **fields, const gonio_columns *l,
                              char *const *names, gonio_pair *pair, double *values, double *random, double *systematic,
                              gonio_error *error) {
    const gonio_text *text = collector->text;
    gonio_status status = gonio_text_pair(text, fields, pair, error);
    for (int c = 0; c < l->channels && status == GONIO_OK; c++) {
        status = gonio_row_collector_number(collector, fields[l->value[c]], names[c], &values[c], error);
        if (status == GONIO_OK && l->with_sigma) {
            systematic[c] = 0;
            status = parse_sigma(collector, fields[l->with_parts ? l->random[c] : l->sigma[c]], &random[c], error);
        }
        if (status == GONIO_OK && l->with_parts) {
            status = parse_sigma(collector, fields[l->systematic[c]], &systematic[c], error);
        }
    }
    return status;
}

// What the rows need beside the columns.
typedef struct rows {
    gonio_text *text;
    char **fields, **names; // the row's fields; the channels' names
    const gonio_columns *columns;
    gonio_long_rows *tall; // NULL: a row is a sample
    double *numbers;       // values, random and systematic sigmas of a row
} rows;

static gonio_status add_row(const rows *r, const gonio_pair *pair, gonio_row_collector *collector, gonio_error *error) {
    const gonio_columns *l = r->columns;
    double *random = r->numbers + l->channels, *systematic = random + l->channels;
    if (r->tall == NULL) {
        const size_t before = collector->samples->n;
        const gonio_status status = gonio_row_collector_add(collector, pair, r->numbers, l->with_sigma ? random : NULL,
                                                            l->with_sigma ? systematic : NULL, error);
        return status == GONIO_OK && l->group >= 0 && collector->samples->n > before
                   ? parse_group(r->text, r->fields[l->group], collector->samples, error)
                   : status;
    }
    gonio_long_row row = {*pair, 0, r->numbers[0], l->with_sigma ? hypot(random[0], systematic[0]) : 0, r->text->line};
    const gonio_status status =
        gonio_long_rows_wavelength(r->text, r->fields[l->wavelength], l->to_um, &row.lambda_um, error);
    return status == GONIO_OK ? gonio_long_rows_add(r->text, r->tall, &row, error) : status;
}

static gonio_status read_rows(const rows *r, gonio_row_collector *collector, gonio_error *error) {
    const gonio_columns *l = r->columns;
    gonio_status status = GONIO_OK;
    for (char *line; status == GONIO_OK && (line = gonio_text_row(r->text)) != NULL;) {
        const int n = gonio_text_split(line, ',', r->fields, GONIO_COLUMNS_MAX);
        gonio_pair pair;
        if (n != l->columns) {
            status = gonio_text_fail(r->text, error, "expected %d columns as in the header, found %d", l->columns, n);
        } else {
            status = parse_row(collector, r->fields, l, r->names, &pair, r->numbers, r->numbers + l->channels,
                               r->numbers + 2 * l->channels, error);
        }
        status = status == GONIO_OK ? add_row(r, &pair, collector, error) : status;
    }
    return status;
}

static gonio_status read_tall(const rows *r, const gonio_format_values *values, gonio_row_collector *collector,
                              gonio_error *error) {
    gonio_status status = read_rows(r, collector, error);
    if (status == GONIO_OK && values->wavelength_nm > 0) {
        status = gonio_long_rows_choose(r->text, r->tall, values->wavelength_nm / 1000, collector->report.notes,
                                        sizeof collector->report.notes, error);
    }
    return status == GONIO_OK ? gonio_long_rows_collect(r->text, r->tall, r->columns->with_sigma, collector, error)
                              : status;
}

static gonio_status read_wide(const rows *r, gonio_row_collector *collector, gonio_error *error) {
    const gonio_columns *l = r->columns;
    const gonio_status status = gonio_row_collector_room(collector, l->channels, l->with_sigma, error);
    if (status != GONIO_OK) {
        return status;
    }
    for (int c = 0; c < l->channels; c++) {
        snprintf(collector->samples->channel_names[c], GONIO_CHANNEL_NAME_MAX, "%s", r->names[c]);
    }
    const gonio_status named = gonio_row_collector_named(collector, error);
    return named == GONIO_OK ? read_rows(r, collector, error) : named;
}

static gonio_status read_header(gonio_text *text, char **fields, gonio_columns *l, gonio_row_collector *collector,
                                gonio_error *error) {
    char *header = gonio_text_row(text);
    if (header == NULL) {
        return gonio_text_fail(text, error, "no header; expected " GONIO_PAIR_HEADER ",...");
    }
    const int columns = gonio_text_split(header, ',', fields, GONIO_COLUMNS_MAX);
    if (columns > GONIO_COLUMNS_MAX) {
        return gonio_text_fail(text, error, "%d columns; at most %d are read", columns, GONIO_COLUMNS_MAX);
    }
    if (!gonio_text_is_pair_header(fields, columns)) {
        return gonio_text_fail(
            text, error, "expected a header that begins with " GONIO_PAIR_HEADER ", found '%.60s' first", fields[0]);
    }
    const gonio_status status = gonio_columns_read(text, fields, columns, collector->declared.channels, l, error);
    if (status == GONIO_OK && l->aside[0] != 0) {
        gonio_text_append(collector->report.notes, sizeof collector->report.notes,
                          "columns that are no channels and not read: %s\n", l->aside);
    }
    return status;
}

static gonio_status read_with(gonio_text *text, char **fields, gonio_columns *l, const gonio_format_values *values,
                              gonio_row_collector *collector, gonio_error *error) {
    gonio_status status = read_header(text, fields, l, collector, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t channels = (size_t)l->channels;
    gonio_long_rows tall = {0};
    rows r = {text,
              fields,
              malloc(channels * sizeof(char *)),
              l,
              l->wavelength >= 0 ? &tall : NULL,
              malloc(3 * channels * sizeof(double))};
    if (r.names == NULL || r.numbers == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
    }
    for (int c = 0; c < l->channels && status == GONIO_OK; c++) {
        r.names[c] = fields[l->value[c]]; // the header's text stays where it is
    }
    if (status == GONIO_OK) {
        status = r.tall != NULL ? read_tall(&r, values, collector, error) : read_wide(&r, collector, error);
    }
    free(r.names);
    free(r.numbers);
    free(tall.rows);
    return status;
}

static const gonio_declaration declarations[] = {{"angle_units", "deg|degree|degrees", GONIO_DECLARED_NOTHING}, {0}};

static gonio_status read_samples(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                                 gonio_read_report *report, gonio_error *error) {
    char **fields = malloc(GONIO_COLUMNS_MAX * sizeof *fields);
    gonio_columns *l = malloc(sizeof *l);
    gonio_text text = gonio_text_begin(source->path, source->data, source->size);
    gonio_row_collector collector;
    gonio_status status = gonio_row_collector_begin(&collector, &text, source, values, declarations, "samples", error);
    if (status == GONIO_OK && (fields == NULL || l == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", source->path);
    }
    status = status == GONIO_OK ? read_with(&text, fields, l, values, &collector, error) : status;
    free(l);
    free(fields);
    return gonio_row_collector_end(&collector, status, out, report, error);
}

// ---- writing ----

static void put_number(FILE *stream, double value) {
    char text[32];
    gonio_text_shortest(value, text);
    fputc(',', stream);
    fputs(text, stream);
}

static bool has_systematic(const gonio_samples *s) {
    for (size_t i = 0; s->sigma_systematic != NULL && i < s->n * (size_t)s->channels; i++) {
        if (s->sigma_systematic[i] != 0) {
            return true;
        }
    }
    return false;
}

static void put_header(const gonio_samples *s, bool systematic, FILE *stream) {
    char key[GONIO_HEAD_KEY_MAX], value[4096];
    for (const char *at = s->head; gonio_head_next(&at, key, value, sizeof value);) {
        fprintf(stream, "# %s = %s\n", key, value);
    }
    if (!s->isotropic) {
        fputs(ANISOTROPIC "\n", stream);
    }
    if (s->transmission) {
        fputs(TRANSMISSION "\n", stream);
    }
    for (int c = 0; c < s->channels && !gonio_columns_are_plain(s); c++) {
        fprintf(stream, "%s%s%s", c == 0 ? CHANNELS : ",", s->channel_names[c], c + 1 == s->channels ? "\n" : "");
    }
    fputs(GONIO_PAIR_HEADER, stream);
    static const char *const prefixes[4] = {"", "sigma_", "sigma_random_", "sigma_systematic_"};
    const int groups = s->sigma_random == NULL ? 1 : systematic ? 4 : 2;
    for (int group = 0; group < groups; group++) {
        for (int c = 0; c < s->channels; c++) {
            fprintf(stream, ",%s%s", prefixes[group], s->channel_names[c]);
        }
    }
    fputs(systematic && s->group != NULL ? "," GONIO_COLUMN_GROUP : "", stream);
    fputc('\n', stream);
}

static void put_row(const gonio_samples *s, size_t i, bool systematic, FILE *stream) {
    const gonio_pair *p = &s->pairs[i];
    const size_t at = i * (size_t)s->channels;
    char text[32];
    gonio_text_shortest(gonio_degrees(p->theta_i), text);
    fputs(text, stream);
    put_number(stream, gonio_degrees(p->phi_i));
    put_number(stream, gonio_degrees(p->theta_o));
    put_number(stream, gonio_degrees(p->phi_o));
    for (int c = 0; c < s->channels; c++) {
        put_number(stream, s->values[at + (size_t)c]);
    }
    for (int c = 0; c < s->channels && s->sigma_random != NULL; c++) {
        put_number(stream, gonio_samples_sigma(s, i, c));
    }
    for (int c = 0; c < s->channels && systematic; c++) {
        put_number(stream, s->sigma_random[at + (size_t)c]);
    }
    for (int c = 0; c < s->channels && systematic; c++) {
        put_number(stream, s->sigma_systematic[at + (size_t)c]);
    }
    if (systematic && s->group != NULL) {
        fprintf(stream, ",%u", (unsigned)s->group[i]);
    }
    fputc('\n', stream);
}

static gonio_status write_samples(const gonio_samples *samples, FILE *stream, gonio_error *error) {
    const gonio_status status = gonio_channel_names_check(
        NULL, (const char(*)[GONIO_CHANNEL_NAME_MAX])samples->channel_names, samples->channels, error);
    if (status != GONIO_OK) {
        return status;
    }
    const bool systematic = has_systematic(samples);
    put_header(samples, systematic, stream);
    for (size_t i = 0; i < samples->n && !ferror(stream); i++) {
        put_row(samples, i, systematic, stream);
    }
    return GONIO_OK;
}

static const gonio_format_option options[] = {GONIO_TEXT_OPTIONS, {0}};

const gonio_format gonio_format_samples = {.name = "samples",
                                           .summary = "samples CSV (header " GONIO_PAIR_HEADER ",...)",
                                           .extensions = ".csv",
                                           .recognise = recognise,
                                           .read = read_samples,
                                           .write = write_samples,
                                           .options = options};
