// SPDX-License-Identifier: BSD-3-Clause
// Look-up tables of ASAM OpenMATERIAL 3D (schema material_brdf): JSON with rows of wavelength in m, incident and exit
// zenith angle, exit azimuth relative to the incident one, in rad, and f_r in 1/sr, sorted by columns; isotropic. The
// specification does not say which azimuth is the mirror's; both directions point away from the surface here, so that
// it lies at pi. The schema's bounds are truncated, 1.570796 and 6.283185: pi/2 and 2 pi themselves are refused by it.
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/random.h"
#include "io/optics/grid.h"

#define ZENITH_BOUND 1.570796
#define AZIMUTH_BOUND 6.283185
#define TRUNCATION 1e-6
#define WAVELENGTH_MIN_M 1e-9
#define WAVELENGTH_MAX_M 17.16e-3

enum { WAVELENGTH, THETA_I, THETA_O, PHI, VALUE, COLUMNS };

static bool recognise(const gonio_source *source) {
    const char *at = source->data + strspn(source->data, " \t\r\n");
    return *at == '{' && strstr(at, "\"lookupTable\"") != NULL && strstr(at, "\"brdf\"") != NULL;
}

// ---- reading ----

typedef struct reading {
    const gonio_source *source;
    const json_t *rows, *wavelengths;
    size_t n_wavelengths, n; // rows a wavelength
    gonio_negatives policy;
    gonio_samples *samples;
    gonio_read_report report;
} reading;

static gonio_status row_fail(const reading *r, size_t row, gonio_error *error, const char *what) {
    return gonio_fail_line(error, GONIO_E_INPUT, r->source->path, -1, "lookupTable[%zu]: %s", row, what);
}

// The numbers of a row; *missing: one of them is null.
static gonio_status read_row(const reading *r, size_t row, double v[COLUMNS], bool *missing, gonio_error *error) {
    static const double most[COLUMNS] = {WAVELENGTH_MAX_M, GONIO_PI / 2, GONIO_PI / 2, 2 * GONIO_PI, INFINITY};
    const json_t *one = json_array_get(r->rows, row);
    *missing = false;
    if (json_array_size(one) != COLUMNS) {
        return row_fail(r, row, error, "expected 5 numbers");
    }
    for (size_t k = 0; k < COLUMNS; k++) {
        const json_t *number = json_array_get(one, k);
        *missing = *missing || json_is_null(number);
        if (!json_is_number(number) && !json_is_null(number)) {
            return row_fail(r, row, error, "expected numbers or null");
        }
        v[k] = json_number_value(number);
        if (k < VALUE && !(v[k] >= 0 && v[k] <= most[k] + TRUNCATION)) {
            return row_fail(
                r, row, error,
                "expected a wavelength up to 17.16e-3 m, zenith angles from 0 to pi/2, an azimuth from 0 to "
                "2 pi, in rad");
        }
    }
    return GONIO_OK;
}

// Bounds of the schema stand for what they truncate.
static double whole(double rad, double bound) { return fabs(rad - bound) < TRUNCATION ? bound : rad; }

static gonio_status value_of(reading *r, size_t row, double *value, gonio_error *error) {
    if (*value >= 0) {
        return GONIO_OK;
    }
    r->report.negatives++;
    if (r->policy == GONIO_NEGATIVES_CLAMP) {
        r->report.clamped++;
        *value = 0;
    }
    return r->policy == GONIO_NEGATIVES_CLAMP || r->policy == GONIO_NEGATIVES_KEEP
               ? GONIO_OK
               : row_fail(r, row, error, "a negative value; --negatives clamp or keep lets it pass");
}

// The same geometry of every wavelength: rows are sorted by wavelength first.
static gonio_status add_geometry(reading *r, size_t k, double *values, gonio_error *error) {
    double first[COLUMNS] = {0}, v[COLUMNS];
    bool missing, any = false;
    for (size_t w = 0; w < r->n_wavelengths; w++) {
        const size_t row = w * r->n + k;
        gonio_status status = read_row(r, row, v, &missing, error);
        status = status == GONIO_OK && !missing ? value_of(r, row, &v[VALUE], error) : status;
        if (status != GONIO_OK) {
            return status;
        }
        any = any || missing;
        if (!missing && (fabs(v[WAVELENGTH] - json_number_value(json_array_get(r->wavelengths, w))) > 1e-12)) {
            return row_fail(r, row, error,
                            "its wavelength is not the one whose turn it is; rows are sorted by columns");
        }
        for (size_t c = THETA_I; c <= PHI && w > 0 && !any; c++) {
            if (fabs(v[c] - first[c]) > 1e-9) {
                return row_fail(r, row, error, "its angles are not those of the first wavelength's row");
            }
        }
        memcpy(first, w == 0 ? v : first, sizeof first);
        values[w] = v[VALUE];
    }
    r->report.rows++;
    if (any) {
        r->report.invalid++;
        return GONIO_OK;
    }
    const double phi = remainder(whole(first[PHI], 2 * GONIO_PI), 2 * GONIO_PI);
    const gonio_pair pair = {gonio_angle_canonical(whole(first[THETA_I], GONIO_PI / 2)), 0,
                             gonio_angle_canonical(whole(first[THETA_O], GONIO_PI / 2)), gonio_angle_canonical(phi)};
    return gonio_samples_add(r->samples, &pair, values, NULL, NULL, error);
}

static gonio_status begin(reading *r, const json_t *root, gonio_error *error) {
    const json_t *brdf = json_object_get(root, "brdf");
    r->rows = json_object_get(brdf, "lookupTable");
    r->wavelengths = json_object_get(brdf, "wavelengths");
    r->n_wavelengths = json_array_size(r->wavelengths);
    const size_t rows = json_array_size(r->rows);
    if (r->n_wavelengths < 1 || r->n_wavelengths > GONIO_CHANNELS_MAX || rows == 0 || rows % r->n_wavelengths != 0) {
        return gonio_fail_line(
            error, GONIO_E_INPUT, r->source->path, -1,
            "brdf: %zu wavelengths and %zu rows of lookupTable; expected 1 to %d wavelengths, and as "
            "many rows of each",
            r->n_wavelengths, rows, GONIO_CHANNELS_MAX);
    }
    r->n = rows / r->n_wavelengths;
    const gonio_status status = gonio_samples_new((int)r->n_wavelengths, false, &r->samples, error);
    for (size_t w = 0; status == GONIO_OK && w < r->n_wavelengths; w++) {
        const double m = json_number_value(json_array_get(r->wavelengths, w));
        if (!(m >= WAVELENGTH_MIN_M && m <= WAVELENGTH_MAX_M)) {
            return gonio_fail_line(error, GONIO_E_INPUT, r->source->path, -1,
                                   "wavelengths[%zu]: expected 1e-9 to 17.16e-3 m, found %g", w, m);
        }
        gonio_number_format(r->samples->channel_names[w], GONIO_CHANNEL_NAME_MAX, "%.10gnm", m * 1e9);
    }
    return status;
}

static gonio_status read_openmaterial(const gonio_source *source, const gonio_format_values *values,
                                      gonio_samples **out, gonio_read_report *report, gonio_error *error) {
    json_error_t wrong;
    json_t *root = json_loadb(source->data, source->size, JSON_REJECT_DUPLICATES, &wrong);
    *out = NULL;
    if (root == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, source->path, wrong.line, "no JSON: %s", wrong.text);
    }
    reading r = {.source = source,
                 .policy = (gonio_negatives)values->at[0].choice,
                 .report = {.format = "openmaterial", .first_negative_line = -1}};
    gonio_status status = begin(&r, root, error);
    double *row = calloc(r.n_wavelengths + 1, sizeof *row);
    status = status == GONIO_OK && row == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for a row") : status;
    for (size_t k = 0; k < r.n && status == GONIO_OK; k++) {
        status = add_geometry(&r, k, row, error);
    }
    if (status == GONIO_OK && r.samples->n == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, source->path, -1, "lookupTable: every row has a null");
    }
    if (status == GONIO_OK) {
        r.samples->isotropic = true;
        *out = r.samples;
        if (report != NULL) {
            *report = r.report;
        }
    } else {
        gonio_samples_free(r.samples);
    }
    free(row);
    json_decref(root);
    return status;
}

// ---- writing ----

// One material has one identifier: of its values, as they are written.
static void put_uuid(const gonio_grid *g, size_t n, FILE *stream) {
    uint64_t hash = gonio_random(n);
    for (size_t k = 0; k < n; k += 97) {
        char digits[32];
        snprintf(digits, sizeof digits, "%.9g", g->values[k]);
        const double value = gonio_number_parse(digits, &(char *){NULL});
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        hash = gonio_random(hash ^ bits);
    }
    const uint64_t more = gonio_random(hash + GONIO_RANDOM_STEP);
    fprintf(stream, "%08x-%04x-8%03x-8%03x-%012llx", (unsigned)(hash >> 32), (unsigned)(hash >> 16 & 0xffff),
            (unsigned)(hash & 0xfff), (unsigned)(more >> 52), (unsigned long long)(more & 0xffffffffffff));
}

static void put_head(const gonio_grid *g, const gonio_model *model, size_t n, FILE *stream) {
    fputs("{\n\"metadata\": {\"name\": \"Gonio\", \"description\": \"Written by Gonio; the mirror direction is at "
          "azimuth "
          "pi.\", \"uuid\": \"",
          stream);
    put_uuid(g, n, stream);
    fputs("\", \"materialVersion\": \"1.0.0\", \"openMaterial3dVersion\": \"1.0.0\", \"copyrights\": [\"not stated\"], "
          "\"license\": \"not stated\", \"authors\": [\"not stated\"], \"sources\": \"a model of measured or simulated "
          "data\"},\n\"brdf\": {\"wavelengths\": [",
          stream);
    for (int c = 0; c < g->channels; c++) {
        const double nm = gonio_model_wavelength_nm(model, c);
        fprintf(stream, "%s%.9ge-9", c > 0 ? ", " : "", isnan(nm) ? 550 : nm);
    }
    fputs("],\n\"lookupTable\": [\n", stream);
}

static void put_rows(gonio_grid *g, const gonio_model *model, FILE *stream) {
    const gonio_grid_axis *in = &g->axis[GONIO_GRID_IN_THETA], *out = &g->axis[GONIO_GRID_OUT_THETA],
                          *phi = &g->axis[GONIO_GRID_OUT_PHI];
    for (int c = 0; c < g->channels; c++) {
        const double nm = gonio_model_wavelength_nm(model, c);
        for (int k = 0; k < in->n * out->n * phi->n; k++) {
            const int i = k / phi->n / out->n, o = k / phi->n % out->n, p = k % phi->n;
            fprintf(stream, "%s[%.9ge-9,%.9g,%.9g,%.9g,%.9g]", c + k > 0 ? ",\n" : "", isnan(nm) ? 550 : nm,
                    fmin(gonio_radians(in->deg[i]), ZENITH_BOUND), fmin(gonio_radians(out->deg[o]), ZENITH_BOUND),
                    fmin(gonio_radians(phi->deg[p]), AZIMUTH_BOUND), gonio_grid_written(g, c, 0, i, p, o));
        }
    }
    fputs("\n]}}", stream); // no line end: a file that is cut anywhere shows it
}

static gonio_status write_openmaterial(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                       gonio_write_report *told, gonio_error *error) {
    if (!model->isotropic) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "an OpenMATERIAL 3D table is isotropic; the model is not");
    }
    gonio_model *rgb, *written;
    gonio_status status = gonio_model_as_wavelengths(model, &rgb, &written, told, error);
    gonio_grid g = {.frame = GONIO_GRID_ABSOLUTE};
    status = status == GONIO_OK ? gonio_grid_of_model(&g, written, values->at[0].count, false, values->threads, error)
                                : status;
    if (status == GONIO_OK) {
        put_head(&g, written, (size_t)g.channels * (size_t)(g.axis[1].n * g.axis[2].n * g.axis[3].n), stream);
        put_rows(&g, written, stream);
        gonio_grid_tell(&g, written, told);
    }
    gonio_grid_free(&g);
    gonio_model_free(written != rgb ? written : NULL);
    gonio_model_free(rgb != model ? rgb : NULL);
    return status;
}

static const gonio_format_option options[] = {GONIO_OPTION_NEGATIVES, {0}};
static const gonio_format_option write_options[] = {GONIO_OPTION_GRID_STEP, {0}};

const gonio_format gonio_format_openmaterial = {.name = "openmaterial",
                                                .summary = "ASAM OpenMATERIAL 3D table",
                                                .extensions = ".xomb",
                                                .recognise = recognise,
                                                .read = read_openmaterial,
                                                .write_table = write_openmaterial,
                                                .write_options = write_options,
                                                .quantity = "f_r, 1/sr",
                                                .convention =
                                                    "radians; azimuth relative to the light's, the mirror at pi",
                                                .theta_max_deg = GONIO_GRID_WRITE_MAX_DEG,
                                                .precision = 1e-7,
                                                .options = options};
