// SPDX-License-Identifier: BSD-3-Clause
// TracePro's exported surface properties ("Surface Property Import/Export Format" of its help): header lines, a table
// of specular terms, then behind a line Table_BSDF_Data rows of temperature (K), wavelength (um), polar angle and
// azimuth of incidence (degrees), length and azimuth (degrees) of the vector beta - beta_0, BRDF and BTDF (1/sr). beta
// is the outgoing direction's projection on the surface, beta_0 that of the mirror direction. Azimuth 0 of beta -
// beta_0 is the surface's local x axis (TracePro 2019 User's Manual, 7.19 to 7.21, "Asymmetric Table BSDF"), of which
// there are two, and the file does not tell which is meant: fixed on the sample, the axis from which azimuths of
// incidence count too, taken as those of beta_0; or floating, orthogonal to the plane of incidence, so that 90 deg
// points outwards along beta_0 (figure 7.7). --zero-azimuth says which. A symmetric table (Scatter 4) holds at every
// azimuth and is read at five. BTDFs, about the way straight through, are read where --transmission asks for them.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "base/number.h"
#include "io/long_rows.h"

#define FIRST_LINE "TracePro Surface Property Data"
#define TABLE "Table_BSDF_Data"
enum { COLUMNS = 8, SYMMETRIC = 4, ASYMMETRIC = 5 };
enum { ZERO_AZIMUTH = GONIO_TEXT_OPTIONS_N };
enum { UNSTATED, FIXED, FLOATING };

typedef struct tracepro {
    gonio_text text;
    gonio_row_collector collector;
    gonio_long_rows rows;
    int scatter;                   // the type of its data
    double kelvin;                 // of all rows; NaN: none yet
    size_t reflected, transmitted; // rows with a BRDF, with a BTDF
    size_t below, turned;          // nodes below the horizon; rows of another azimuth
    int axis;                      // of azimuth 0: not stated, fixed, floating
    double ring[4], ring_value;    // incidence, its azimuth, wavelength and length of the last row; its BRDF
    bool varies;                   // values of one ring differ
    char name[200], made[100];
} tracepro;

static bool recognise(const gonio_source *source) {
    const char *at = source->data + (strncmp(source->data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0);
    return strncmp(at, FIRST_LINE, sizeof FIRST_LINE - 1) == 0;
}

static const char *value_of(const char *line, const char *key) {
    const size_t n = strlen(key);
    return strncmp(line, key, n) == 0 && (line[n] == ' ' || line[n] == '\t') ? line + n + strspn(line + n, " \t")
                                                                             : NULL;
}

static gonio_status read_scatter(tracepro *t, const char *value, gonio_error *error) {
    t->scatter = value[0] != 0 && strchr(" \t", value[1]) != NULL ? value[0] - '0' : -1;
    return t->scatter == SYMMETRIC || t->scatter == ASYMMETRIC
               ? GONIO_OK
               : gonio_text_fail(&t->text, error,
                                 "Scatter: expected 4 (a table) or 5 (an asymmetric table), found '%.20s': other types "
                                 "are parameters of models",
                                 value);
}

// Up to the names of the table's columns.
static gonio_status read_header(tracepro *t, gonio_error *error) {
    static const char *const names[COLUMNS] = {"Temperature", "Wavelength",     "IncAngle", "AziAngle",
                                               "ScatterBeta", "ScatterAzimuth", "BRDF",     "BTDF"};
    const char *value;
    gonio_status status = GONIO_OK;
    for (char *line; status == GONIO_OK && (line = gonio_text_line(&t->text)) != NULL;) {
        if (strcmp(line, TABLE) == 0) {
            char *fields[COLUMNS], *header = gonio_text_line(&t->text);
            const int n = header != NULL ? gonio_text_split(header, ' ', fields, COLUMNS) : 0;
            for (int k = 0; k < COLUMNS && status == GONIO_OK; k++) {
                status = k < n && n == COLUMNS && strcmp(fields[k], names[k]) == 0
                             ? GONIO_OK
                             : gonio_text_fail(&t->text, error,
                                               "expected the columns Temperature to BTDF, of which %s is %d.", names[k],
                                               k + 1);
            }
            return status == GONIO_OK && t->scatter == 0
                       ? gonio_text_fail(&t->text, error,
                                         "the table begins and no line Scatter says of which type it is")
                       : status;
        }
        if ((value = value_of(line, "Scatter")) != NULL) {
            status = read_scatter(t, value, error);
        } else if ((value = value_of(line, "Interaction")) != NULL && strcmp(value, "0") != 0) {
            status =
                gonio_text_fail(&t->text, error, "Interaction: expected 0, found '%.20s' (a retro-reflector)", value);
        } else if ((value = value_of(line, "Name")) != NULL) {
            snprintf(t->name, sizeof t->name, "%s", value);
        } else if ((value = value_of(line, "Data generated at")) != NULL) {
            snprintf(t->made, sizeof t->made, "%s", value);
        }
    }
    return status == GONIO_OK ? gonio_text_fail(&t->text, error, "the file ends before " TABLE) : status;
}

static double angle(double deg) { return gonio_angle_canonical(gonio_radians(remainder(deg, 360))); }

static gonio_status add_node(tracepro *t, const double *v, double azimuth_deg, bool through, gonio_error *error) {
    // In the frame of the plane of incidence: x from the normal to the mirror direction.
    const double beta_0 = sin(gonio_radians(v[2]));
    const double turn = gonio_radians(t->axis == FLOATING ? azimuth_deg - 90 : azimuth_deg - v[3]);
    const double x = beta_0 + v[4] * cos(turn), y = v[4] * sin(turn), beta = hypot(x, y);
    if (beta >= 1) {
        t->below++;
        return GONIO_OK;
    }
    const gonio_long_row row = {
        .pair = {angle(v[2]), angle(v[3]), gonio_angle_canonical(through ? GONIO_PI - asin(beta) : asin(beta)),
                 beta > 0 ? angle(v[3] + 180 + gonio_degrees(atan2(y, x))) : 0},
        .lambda_um = v[1],
        .value = v[through ? 7 : 6],
        .line = t->text.line,
    };
    return gonio_long_rows_add(&t->text, &t->rows, &row, error);
}

static gonio_status check_row(tracepro *t, const double *v, gonio_error *error) {
    if (!(v[1] > 0.02 && v[1] < 1000) || !(v[2] >= 0 && v[2] < 90) || !(fabs(v[3]) <= 360) ||
        !(v[4] >= 0 && v[4] <= 2) || !(fabs(v[5]) <= 360)) {
        return gonio_text_fail(
            &t->text, error,
            "expected a wavelength in um, an incidence of 0 to 90 deg, a length of 0 to 2 and azimuths "
            "of -360 to 360 deg, found %g, %g, %g, %g and %g",
            v[1], v[2], v[4], v[3], v[5]);
    }
    if (!isnan(t->kelvin) && v[0] != t->kelvin) {
        return gonio_text_fail(
            &t->text, error, "a table for %g K behind one for %g K; keep one temperature in the file", v[0], t->kelvin);
    }
    t->kelvin = v[0];
    return GONIO_OK;
}

static gonio_status read_row(tracepro *t, char *line, gonio_error *error) {
    char *fields[COLUMNS];
    double v[COLUMNS];
    const int n = gonio_text_split(line, ' ', fields, COLUMNS);
    gonio_status status =
        n == COLUMNS ? GONIO_OK : gonio_text_fail(&t->text, error, "expected %d numbers, found %d", COLUMNS, n);
    for (int k = 0; k < COLUMNS && status == GONIO_OK; k++) {
        status = k == 6 || (k == 7 && t->text.transmission)
                     ? gonio_row_collector_number(&t->collector, fields[k], k == 6 ? "BRDF" : "BTDF", &v[k], error)
                     : gonio_text_number(&t->text, fields[k], "column", &v[k], error);
    }
    status = status == GONIO_OK ? check_row(t, v, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    t->reflected += v[6] != 0;
    t->transmitted += v[7] != 0;
    t->turned += v[3] != 0;
    const double ring[4] = {v[2], v[3], v[1], v[4]};
    const bool same = memcmp(ring, t->ring, sizeof ring) == 0;
    t->varies = t->varies || (same && fabs(v[6] - t->ring_value) > 1e-6 * fabs(v[6]));
    memcpy(t->ring, ring, sizeof ring);
    t->ring_value = v[6];
    const bool every = t->scatter == SYMMETRIC && v[4] > 0;
    for (int k = 0; k < (every ? 5 : 1) && status == GONIO_OK; k++) {
        status = add_node(t, v, every ? 45 * k : v[5], false, error);
        if (status == GONIO_OK && t->text.transmission) {
            status = add_node(t, v, every ? 45 * k : v[5], true, error);
        }
    }
    return status;
}

// A column of zeros beside another of values says that this half was not measured.
static void drop_empty_half(tracepro *t) {
    if (!t->text.transmission || (t->reflected > 0) == (t->transmitted > 0)) {
        return;
    }
    size_t kept = 0;
    for (size_t i = 0; i < t->rows.n; i++) {
        if ((t->rows.rows[i].pair.theta_o > GONIO_PI / 2) == (t->transmitted > 0)) {
            t->rows.rows[kept++] = t->rows.rows[i];
        }
    }
    t->rows.n = kept;
}

static gonio_status tell_head(tracepro *t, gonio_error *error) {
    char text[32];
    gonio_samples *s = t->collector.samples;
    gonio_status status = gonio_samples_tell(s, "sample", t->name, error);
    status = status == GONIO_OK ? gonio_samples_tell(s, "date", t->made, error) : status;
    if (status == GONIO_OK && t->kelvin > 0) {
        gonio_number_format(text, sizeof text, "%.10g", t->kelvin - 273.15);
        status = gonio_samples_tell(s, "temperature_c", text, error);
    }
    s->isotropic = t->turned == 0;
    return status;
}

static gonio_status read_rows(tracepro *t, const gonio_format_values *values, gonio_error *error) {
    gonio_status status = GONIO_OK;
    char *line, *notes = t->collector.report.notes;
    const size_t size = sizeof t->collector.report.notes;
    while (status == GONIO_OK && (line = gonio_text_line(&t->text)) != NULL && strcmp(line, "SAVE-DATA") != 0 &&
           strncmp(line, "Side2_Data", 10) != 0) {
        status = line[0] != 0 ? read_row(t, line, error) : GONIO_OK;
    }
    if (status == GONIO_OK && line != NULL && gonio_text_content(&t->text) != NULL) {
        gonio_text_append(notes, size, "properties and sides behind the first are not read\n");
    }
    if (t->scatter == ASYMMETRIC && t->varies && t->axis == UNSTATED) {
        gonio_text_append(
            notes, size,
            "azimuth 0 of beta - beta_0 is taken for an axis fixed on the sample, which the file does not "
            "tell; --zero-azimuth floating: orthogonal to the plane of incidence\n");
    }
    drop_empty_half(t);
    if (status == GONIO_OK && values->wavelength_nm > 0) {
        status = gonio_long_rows_choose(&t->text, &t->rows, values->wavelength_nm / 1000, notes, size, error);
    }
    status = status == GONIO_OK ? gonio_long_rows_collect(&t->text, &t->rows, false, &t->collector, error) : status;
    status = status == GONIO_OK ? tell_head(t, error) : status;
    if (status == GONIO_OK && t->transmitted > 0 && !t->text.transmission) {
        gonio_text_append(notes, size, "the BTDF of %zu rows is not read; --transmission reads it\n", t->transmitted);
    }
    return status;
}

static gonio_status read_tracepro(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                                  gonio_read_report *report, gonio_error *error) {
    tracepro t = {.text = gonio_text_begin(source->path, source->data, source->size),
                  .kelvin = NAN,
                  .axis = values->at[ZERO_AZIMUTH].choice};
    gonio_status status = gonio_row_collector_begin(&t.collector, &t.text, source, values, NULL, "tracepro", error);
    status = status == GONIO_OK ? read_header(&t, error) : status;
    status = status == GONIO_OK ? read_rows(&t, values, error) : status;
    t.collector.report.invalid += t.below;
    t.collector.report.rows += t.below;
    free(t.rows.rows);
    return gonio_row_collector_end(&t.collector, status, out, report, error);
}

static const gonio_format_option options[] = {
    GONIO_TEXT_OPTIONS,
    [ZERO_AZIMUTH] =
        {"zero-azimuth", GONIO_FORMAT_CHOICE, "auto|fixed|floating", "auto",
         "where azimuth 0 of beta - beta_0 points: an axis of the sample (auto), or orthogonal to the plane "
         "of incidence"},
    {0}};

const gonio_format gonio_format_tracepro = {.name = "tracepro",
                                            .summary = "TracePro surface property",
                                            .extensions = ".txt",
                                            .recognise = recognise,
                                            .read = read_tracepro,
                                            .options = options};
