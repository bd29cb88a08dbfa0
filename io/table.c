// SPDX-License-Identifier: BSD-3-Clause
// A lab's own table: any separator, decimal sign, header and order of columns, read by a mapping that is given as
// options or lies beside the data (docs/formats.md).
//
// A signed theta below 0 lies on the side of phi + 180 deg; without columns of azimuths phi is 0. Where the table's
// mirror direction stands at 0, its phi_o is turned by half a turn.
#include "io/table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/long_rows.h"
#include "io/table_matrix.h"

// No text is recognised as such: the mapping says so.
static bool recognise(const gonio_source *source) {
    (void)source;
    return false;
}

bool gonio_table_may_be(const gonio_source *source) {
    const size_t looked_at = source->size < 65536 ? source->size : 65536;
    return memchr(source->data, 0, looked_at) == NULL;
}

typedef struct reader {
    gonio_text text;
    const gonio_mapping *mapping;
    const gonio_table_layout *layout;
    const gonio_table_columns *columns;
    gonio_row_collector *collector;
    int mirror_at; // GONIO_MIRROR_AT_0: phi_o is to be turned
    char **fields;
    double *numbers;        // values, sigmas and zeros of a row
    gonio_long_rows *tall;  // NULL: a row is a sample
    const long long *lines; // of the file, for each line of an unfolded matrix; NULL: they are the same
} reader;

// ---- a row ----

// The field with a decimal point, in place.
static gonio_status to_point(const reader *r, char *field, gonio_error *error) {
    if (r->layout->decimal == '.') {
        return GONIO_OK;
    }
    if (strchr(field, '.') != NULL) {
        return gonio_text_fail(&r->text, error, "found '%.60s' with a point; the decimal sign here is a comma", field);
    }
    for (char *comma = field; (comma = strchr(comma, ',')) != NULL;) {
        *comma = '.';
    }
    return GONIO_OK;
}

static gonio_status parse_angle(const reader *r, gonio_mapped_role role, double *value, gonio_error *error) {
    const gonio_table_columns *c = r->columns;
    *value = isnan(c->constant[role]) ? 0 : c->constant[role];
    gonio_status status = GONIO_OK;
    const char *name = gonio_mapped_role_name(role);
    if (c->angle[role] >= 0) {
        char *field = r->fields[c->angle[role]];
        status = to_point(r, field, error);
        status = status == GONIO_OK ? gonio_text_number(&r->text, field, name, value, error) : status;
    }
    const bool polar = role == GONIO_MAPPED_THETA_I || role == GONIO_MAPPED_THETA_O;
    const double limit = (r->mapping->radians ? GONIO_PI / 180 : 1) * (!polar                 ? 36000
                                                                       : r->text.transmission ? 180
                                                                                              : 90);
    if (status != GONIO_OK) {
        return status;
    }
    if (polar && r->mapping->elevation && c->angle[role] >= 0) {
        if (!(*value >= 0 && *value <= 2 * limit)) {
            return gonio_text_fail(&r->text, error, "%s: expected 0 to %.9g from the surface, found %.9g", name,
                                   2 * limit, *value);
        }
        *value = limit - *value; // beyond the normal it is on the other side
    }
    if (polar && *value < 0 && !r->mapping->is_signed) {
        return gonio_text_fail(&r->text, error, "%s: found %.9g; with --signed negative ones lie on the other side",
                               name, *value);
    }
    return fabs(*value) <= limit + (r->mapping->radians ? 1e-6 : 0)
               ? GONIO_OK
               : gonio_text_fail(&r->text, error, "%s: expected at most %.9g %s, found %.9g", name, limit,
                                 r->mapping->radians ? "radians" : "degrees", *value);
}

// One direction from a polar angle, which may be signed, and an azimuth, both in the table's unit.
static void direction(const reader *r, double polar, double azimuth, bool turned, double *theta, double *phi) {
    const double half = r->mapping->radians ? GONIO_PI : 180;
    double sum = fmod(azimuth, 2 * half) + ((polar < 0) != turned ? half : 0);
    sum = sum > 2 * half ? sum - 2 * half : sum;
    if (r->mapping->radians) {
        *theta = gonio_angle_canonical(fmin(fabs(polar), r->text.transmission ? GONIO_PI : GONIO_PI / 2));
        *phi = gonio_angle_canonical(sum);
    } else {
        *theta = gonio_radians(fabs(polar));
        *phi = gonio_radians(sum);
    }
}

static gonio_status parse_pair(const reader *r, gonio_pair *pair, gonio_error *error) {
    double angles[GONIO_MAPPED_ANGLES];
    for (int k = 0; k < GONIO_MAPPED_ANGLES; k++) {
        const gonio_status status = parse_angle(r, (gonio_mapped_role)k, &angles[k], error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    direction(r, angles[GONIO_MAPPED_THETA_I], angles[GONIO_MAPPED_PHI_I], false, &pair->theta_i, &pair->phi_i);
    direction(r, angles[GONIO_MAPPED_THETA_O], angles[GONIO_MAPPED_PHI_O] + angles[GONIO_MAPPED_PHI],
              r->mirror_at == GONIO_MIRROR_AT_0, &pair->theta_o, &pair->phi_o);
    return GONIO_OK;
}

static gonio_status parse_values(const reader *r, gonio_error *error) {
    const gonio_table_columns *c = r->columns;
    double *sigmas = r->numbers + c->channels, *zeros = sigmas + c->channels;
    gonio_status status = GONIO_OK;
    for (int k = 0; k < c->channels && status == GONIO_OK; k++) {
        char *field = r->fields[c->value[k]];
        sigmas[k] = zeros[k] = 0;
        status = to_point(r, field, error);
        if (field[0] == 0 && r->collector->missing.automatic) {
            r->numbers[k] = NAN; // left out, and counted
            continue;
        }
        status = status == GONIO_OK
                     ? gonio_row_collector_number(r->collector, field, c->names[k], &r->numbers[k], error)
                     : status;
        if (status == GONIO_OK && c->with_sigma) {
            char *sigma = r->fields[c->sigma[k]];
            status = to_point(r, sigma, error);
            status = status == GONIO_OK ? gonio_row_collector_number(r->collector, sigma, "sigma", &sigmas[k], error)
                                        : status;
            if (status == GONIO_OK && sigmas[k] < 0) {
                return gonio_text_fail(&r->text, error, "sigma: expected 0 or more, found %s", sigma);
            }
        }
        zeros[k] = 0;
    }
    return status;
}

static gonio_status parse_wavelength(const reader *r, double *um, gonio_error *error) {
    char *field = r->fields[r->columns->wavelength];
    const gonio_status status = to_point(r, field, error);
    return status == GONIO_OK ? gonio_long_rows_wavelength(&r->text, field, r->columns->to_um, um, error) : status;
}

static gonio_status add_row(const reader *r, gonio_error *error) {
    const gonio_table_columns *c = r->columns;
    double *sigmas = r->numbers + c->channels, *zeros = sigmas + c->channels;
    gonio_pair pair;
    gonio_status status = parse_pair(r, &pair, error);
    status = status == GONIO_OK ? parse_values(r, error) : status;
    if (status != GONIO_OK || r->tall == NULL) {
        return status == GONIO_OK
                   ? gonio_row_collector_add(r->collector, &pair, r->numbers, c->with_sigma ? sigmas : NULL,
                                             c->with_sigma ? zeros : NULL, error)
                   : status;
    }
    gonio_long_row row = {pair, 0, r->numbers[0], c->with_sigma ? sigmas[0] : 0, r->text.line};
    status = parse_wavelength(r, &row.lambda_um, error);
    return status == GONIO_OK ? gonio_long_rows_add(&r->text, r->tall, &row, error) : status;
}

// ---- the table ----

static gonio_status read_rows(reader *r, gonio_error *error) {
    const gonio_table_layout *l = r->layout;
    gonio_status status = GONIO_OK;
    for (char *line; status == GONIO_OK && (line = gonio_text_line(&r->text)) != NULL;) {
        if (r->text.line < l->first_row || gonio_table_is_blank(line) || r->text.line > l->last_row) {
            continue;
        }
        const long long own = r->text.line;
        r->text.line = r->lines != NULL ? r->lines[own] : own;
        const int n = gonio_table_split(line, l->separator, l->columns, r->fields, GONIO_TABLE_COLUMNS_MAX);
        status = n == l->columns ? add_row(r, error)
                                 : gonio_text_fail(&r->text, error, "expected %d columns as in the first row, found %d",
                                                   l->columns, n);
        r->text.line = own;
    }
    if (status == GONIO_OK && l->footers > 0) {
        gonio_text_append(r->collector->report.notes, sizeof r->collector->report.notes,
                          "%zu lines of text behind the table are not read (the first is line %lld)\n", l->footers,
                          l->first_footer);
    }
    return status;
}

static gonio_status read_all(reader *r, const gonio_format_values *values, gonio_error *error) {
    gonio_row_collector *collector = r->collector;
    const gonio_table_columns *c = r->columns;
    if (r->tall == NULL) {
        const gonio_status status = gonio_row_collector_room(collector, c->channels, c->with_sigma, error);
        for (int k = 0; k < c->channels && status == GONIO_OK; k++) {
            snprintf(collector->samples->channel_names[k], GONIO_CHANNEL_NAME_MAX, "%s", c->names[k]);
        }
        return status == GONIO_OK ? read_rows(r, error) : status;
    }
    gonio_status status = read_rows(r, error);
    if (status == GONIO_OK && values->wavelength_nm > 0) {
        status = gonio_long_rows_choose(&r->text, r->tall, values->wavelength_nm / 1000, collector->report.notes,
                                        sizeof collector->report.notes, error);
    }
    return status == GONIO_OK ? gonio_long_rows_collect(&r->text, r->tall, c->with_sigma, collector, error) : status;
}

// What the mapping says of the values stands for what comments declare.
static void set_quantity(gonio_quantity quantity, gonio_row_collector *collector) {
    if (quantity != GONIO_QUANTITY_UNSTATED) {
        collector->declared.cosine = quantity == GONIO_QUANTITY_F_R_COS;
        collector->declared.factor = quantity == GONIO_QUANTITY_BRF       ? GONIO_PI
                                     : quantity == GONIO_QUANTITY_PERCENT ? 100 * GONIO_PI
                                                                          : 1;
        collector->by_mapping = true;
    }
}

static const gonio_declaration in_degrees[] = {{"angle_units", "deg|degree|degrees", GONIO_DECLARED_NOTHING},
                                               {"wavelength_units", "nm|um", GONIO_DECLARED_NOTHING},
                                               {"mirror_at", "0|180|0 deg|180 deg", GONIO_DECLARED_NOTHING},
                                               {0}};
static const gonio_declaration in_radians[] = {{"radian", NULL, GONIO_DECLARED_NOTHING},
                                               {"angle_units", "rad|radian|radians", GONIO_DECLARED_NOTHING},
                                               {"wavelength_units", "nm|um", GONIO_DECLARED_NOTHING},
                                               {"mirror_at", "0|180|0 deg|180 deg", GONIO_DECLARED_NOTHING},
                                               {0}};

// One reading with the mirror direction at that azimuth. The data is cut up.
static gonio_status read_once(const gonio_source *source, const gonio_format_values *values, reader *r,
                              gonio_samples **out, gonio_read_report *report, gonio_error *error) {
    gonio_row_collector collector;
    gonio_long_rows tall = {0};
    const size_t channels = (size_t)r->columns->channels;
    r->text = gonio_text_begin(source->path, source->data, source->size);
    r->collector = &collector;
    r->tall = r->columns->wavelength >= 0 ? &tall : NULL;
    r->fields = malloc(GONIO_TABLE_COLUMNS_MAX * sizeof *r->fields);
    r->numbers = malloc(3 * channels * sizeof *r->numbers);
    gonio_status status = gonio_row_collector_begin(&collector, &r->text, source, values,
                                                    r->mapping->radians ? in_radians : in_degrees, "table", error);
    set_quantity(r->mapping->quantity, &collector);
    if (status == GONIO_OK && (r->fields == NULL || r->numbers == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a row");
    }
    status = status == GONIO_OK ? read_all(r, values, error) : status;
    free(r->fields);
    free(r->numbers);
    free(tall.rows);
    r->collector = NULL;
    r->tall = NULL;
    return gonio_row_collector_end(&collector, status, out, report, error);
}

// ---- where the mirror direction stands ----

int gonio_mirror_of_samples(const gonio_samples *s, double means[2]) {
    double sums[3] = {0};
    size_t counts[3] = {0};
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        const double delta = p->phi_o - p->phi_i, value = s->values[i * (size_t)s->channels];
        if (p->theta_i < gonio_radians(8)) {
            continue; // both are one
        }
        int side = 2;
        for (int k = 0; k < 2; k++) {
            const double cosine =
                sin(p->theta_i) * sin(p->theta_o) * cos(delta - k * GONIO_PI) + cos(p->theta_i) * cos(p->theta_o);
            side = cosine > cos(gonio_radians(15)) ? k : side;
        }
        sums[side] += value;
        counts[side]++;
    }
    for (int k = 0; k < 2; k++) {
        means[k] = counts[k] > 0 ? sums[k] / (double)counts[k] : (double)NAN;
    }
    const double rest = counts[2] > 0 ? sums[2] / (double)counts[2] : (double)NAN;
    for (int k = 0; k < 2; k++) {
        const double other = counts[1 - k] > 0 ? means[1 - k] : rest;
        if (counts[k] > 0 && means[k] > 1.2 * other && means[k] > 1.2 * rest) {
            return k == 0 ? 0 : 180;
        }
    }
    return -1;
}

// Do the values rise towards that side's direction itself, and not only from the other's?
static bool has_peak(const gonio_samples *s, int side) {
    double sums[2] = {0};
    size_t counts[2] = {0};
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        const double cosine = sin(p->theta_i) * sin(p->theta_o) * cos(p->phi_o - p->phi_i - side * GONIO_PI) +
                              cos(p->theta_i) * cos(p->theta_o);
        const double deg = gonio_degrees(acos(fmin(fmax(cosine, -1), 1)));
        if (p->theta_i >= gonio_radians(20) && (deg <= 4 || (deg >= 8 && deg <= 16))) {
            sums[deg > 4] += s->values[i * (size_t)s->channels];
            counts[deg > 4]++;
        }
    }
    return counts[0] > 0 && counts[1] > 1 && sums[0] / (double)counts[0] > 1.3 * sums[1] / (double)counts[1];
}

bool gonio_mirror_is_open(const gonio_source *source, const gonio_samples *samples, char *why, size_t size) {
    const char *slash = strrchr(source->path, '/');
    const bool both = has_peak(samples, 0) && has_peak(samples, 1);
    const bool retro = strcasestr(slash != NULL ? slash : source->path, "retro") != NULL ||
                       memmem(source->data, source->size, "retro", 5) != NULL ||
                       memmem(source->data, source->size, "Retro", 5) != NULL;
    snprintf(why, size,
             "%s: --mirror-at 0 where a theta_o of theta_i's own sign is the mirror direction, --mirror-at 180 where "
             "it is the light's side",
             both ? "peaks stand on both sides of the normal, one of them a retro-reflector's"
                  : "a retro-reflector's peak looks like a mirror direction");
    return both || retro;
}

static bool has_azimuth(const gonio_table_columns *c) {
    static const gonio_mapped_role azimuths[] = {GONIO_MAPPED_PHI, GONIO_MAPPED_PHI_I, GONIO_MAPPED_PHI_O};
    bool has = false;
    for (size_t k = 0; k < sizeof azimuths / sizeof *azimuths; k++) {
        has = has || c->angle[azimuths[k]] >= 0 || !isnan(c->constant[azimuths[k]]);
    }
    return has;
}

static void note_mirror(const reader *r, int shown, const double means[2], gonio_read_report *report) {
    char *notes = report->notes, both[80] = "";
    const size_t size = sizeof report->notes;
    if (r->mapping->mirror_at != GONIO_MIRROR_UNSTATED) {
        return;
    }
    if (!isnan(means[0]) && !isnan(means[1])) {
        snprintf(both, sizeof both, " (mean %.3g at 0, %.3g at 180)", means[0], means[1]);
    }
    if (!has_azimuth(r->columns)) {
        gonio_text_append(
            notes, size,
            "the mirror direction is taken to stand at %d%s%s; --mirror-at says it, as it must of a retro-reflector\n",
            r->mirror_at == GONIO_MIRROR_AT_0 ? 0 : 180, shown >= 0 ? ", as the values show" : "", both);
    } else if (shown == 0) {
        gonio_text_append(notes, size,
                          "the largest values stand opposite to the mirror direction, at azimuth 0%s: is it a table "
                          "with --mirror-at 0?\n",
                          both);
    }
}

// Without azimuths no convention is usual: the values show it, or it does not matter much.
static gonio_status read_both(const gonio_source *source, const gonio_format_values *values, reader *r,
                              gonio_samples **out, gonio_read_report *report, gonio_error *error) {
    double means[2] = {NAN, NAN};
    const bool open = r->mapping->mirror_at == GONIO_MIRROR_UNSTATED;
    r->mirror_at = open ? GONIO_MIRROR_AT_180 : r->mapping->mirror_at;
    gonio_source copy = *source;
    copy.data = open ? malloc(source->size + 1) : NULL;
    if (open && copy.data == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a second reading");
    }
    if (open) {
        memcpy(copy.data, source->data, source->size + 1);
    }
    gonio_status status = read_once(source, values, r, out, report, error);
    char why[300];
    if (status == GONIO_OK && open && !has_azimuth(r->columns) && gonio_mirror_is_open(&copy, *out, why, sizeof why)) {
        gonio_samples_free(*out);
        *out = NULL;
        free(copy.data);
        return gonio_fail_line(error, GONIO_E_INPUT, source->path,
                               r->lines != NULL ? r->lines[r->layout->first_row] : r->layout->first_row, "%s", why);
    }
    const int shown = status == GONIO_OK && open ? gonio_mirror_of_samples(*out, means) : -1;
    if (status == GONIO_OK && shown == 0 && !has_azimuth(r->columns)) {
        gonio_samples_free(*out);
        r->mirror_at = GONIO_MIRROR_AT_0;
        status = read_once(&copy, values, r, out, report, error);
    }
    if (status == GONIO_OK) {
        note_mirror(r, shown, means, report);
    }
    free(copy.data);
    return status;
}

static void note_words(const reader *r, gonio_read_report *report) {
    char words[900], notes[sizeof report->notes];
    gonio_table_columns_text(r->mapping, r->layout, r->columns, words, sizeof words);
    snprintf(notes, sizeof notes, "%s", report->notes);
    snprintf(report->notes, sizeof report->notes, "%s\n%s", words, r->columns->aside[0] != 0 ? "not read: " : "");
    if (r->columns->aside[0] != 0) {
        gonio_text_append(report->notes, sizeof report->notes, "%s\n", r->columns->aside);
    }
    gonio_text_append(report->notes, sizeof report->notes, "%s", notes);
}

// What the comments of a matrix declare, with the file's own lines; the unfolded one has others.
static gonio_status check_declarations(const gonio_source *source, const gonio_format_values *values, bool radians,
                                       gonio_error *error) {
    gonio_declared declared = {0};
    const gonio_status status =
        values->at[GONIO_TEXT_DECLARED].choice == 0
            ? gonio_declarations_read(source, radians ? in_radians : in_degrees, &declared, error)
            : GONIO_OK;
    free(declared.head);
    free(declared.channels);
    return status;
}

static gonio_status read_table(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                               gonio_read_report *report, gonio_error *error) {
    gonio_mapping *mapping = malloc(sizeof *mapping);
    gonio_table_columns *columns = malloc(sizeof *columns);
    gonio_table_layout layout = {0};
    gonio_read_report own;
    *out = NULL;
    report = report != NULL ? report : &own;
    gonio_status status = mapping != NULL && columns != NULL ? gonio_mapping_parse(values, mapping, error)
                                                             : gonio_fail(error, GONIO_E_MEMORY, "no memory");
    gonio_table_flat flat = {0};
    const char *matrix = values->at[GONIO_TABLE_MATRIX].text;
    if (status == GONIO_OK && strcmp(matrix, "auto") != 0) {
        status = check_declarations(source, values, mapping->radians, error);
        status = status == GONIO_OK ? gonio_table_unfold(source, matrix, mapping, &flat, error) : status;
        source = status == GONIO_OK ? &flat.source : source;
    }
    status = status == GONIO_OK ? gonio_table_layout_find(source, mapping, &layout, error) : status;
    status = status == GONIO_OK ? gonio_table_columns_find(source, mapping, &layout, columns, error) : status;
    if (status == GONIO_OK) {
        reader r = {.mapping = mapping, .layout = &layout, .columns = columns, .lines = flat.lines};
        gonio_source whole = *source;
        if (flat.lines == NULL && mapping->quantity == GONIO_QUANTITY_UNSTATED) {
            whole.preamble = (layout.header_line > 0 ? layout.header_line : layout.first_row) - 1;
        }
        status = read_both(&whole, values, &r, out, report, error);
        if (status == GONIO_OK) {
            note_words(&r, report);
        }
    }
    gonio_table_layout_free(&layout);
    gonio_table_flat_free(&flat);
    free(columns);
    free(mapping);
    return status;
}

static const gonio_format_option options[] = {
    GONIO_TEXT_OPTIONS,
    [GONIO_TABLE_COLUMNS] = {"columns", GONIO_FORMAT_TEXT, "KEY=COLUMN,...", "auto",
                             "theta_i, phi_i, theta_o, phi_o, phi, wavelength, sigma, value or a channel, each =NAME, "
                             "=#NUMBER or of an angle =30deg"},
    [GONIO_TABLE_SEPARATOR] = {"separator", GONIO_FORMAT_TEXT, "SIGN", "auto",
                               "between columns: comma, semicolon, tab, blanks, or the sign"},
    [GONIO_TABLE_DECIMAL] = {"decimal", GONIO_FORMAT_TEXT, "SIGN", "auto", "the decimal sign, . or ,"},
    [GONIO_TABLE_SIGNED] = {"signed", GONIO_FORMAT_FLAG, "no|yes", "no",
                            "polar angles below 0 lie on the side of phi + 180"},
    [GONIO_TABLE_ANGLES] = {"angles", GONIO_FORMAT_CHOICE, "deg|rad", "deg", "unit of the angles"},
    [GONIO_TABLE_QUANTITY] = {"quantity", GONIO_FORMAT_CHOICE, "auto|f_r|brf|percent|f_r_cos", "auto",
                              "what the values are: brf = pi f_r, percent = 100 pi f_r, f_r_cos = f_r cos(theta_o)"},
    [GONIO_TABLE_MIRROR_AT] = {"mirror-at", GONIO_FORMAT_CHOICE, "auto|0|180", "auto",
                               "phi_o of the mirror direction of phi_i = 0"},
    [GONIO_TABLE_WAVELENGTH] = {"wavelength-column", GONIO_FORMAT_TEXT, "COLUMN", "auto",
                                "of a table with a row for each wavelength"},
    [GONIO_TABLE_MATRIX] = {"matrix", GONIO_FORMAT_TEXT, "ROWS,COLUMNS,BLOCKS", "auto",
                            "a value a cell: which coordinates rows, columns and the headings of blocks tell"},
    [GONIO_TABLE_ELEVATION] = {"elevation", GONIO_FORMAT_FLAG, "no|yes", "no",
                               "polar angles are measured from the surface: theta = 90 - angle"},
    [GONIO_TABLE_MAP] = {"map", GONIO_FORMAT_TEXT, "FILE", "auto",
                         "these options from a file (INPUT" GONIO_MAP_ENDING ")"},
    {0}};

const gonio_format gonio_format_table = {.name = "table",
                                         .summary = "a table of your own (--columns, `gonio look`)",
                                         .extensions = ".tsv",
                                         .recognise = recognise,
                                         .by_mapping = true,
                                         .read = read_table,
                                         .options = options};
