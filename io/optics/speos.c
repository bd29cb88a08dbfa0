// SPDX-License-Identifier: BSD-3-Clause
// OPTIS / Ansys Speos .brdf, text of versions 8 and 9: for each incidence and wavelength a reflectance in per cent and
// a table over theta and phi, whose mirror direction lies at phi = 0; of a file of both halves a table of each, which
// its thetas tell: 0 to 90 deg of reflection, 90 to 180 deg of transmission. The table gives the shape, the percentage
// its scale: the hemisphere's integral of f_r cos(theta_o), by the trapezoidal rule over the table.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "io/optics/grid.h"

#define MAGIC "OPTIS - brdf surface file v"
enum { ANGLES_MAX = 100000 };

static bool recognise(const gonio_source *source) {
    return source->size > sizeof MAGIC && memcmp(source->data, MAGIC, sizeof MAGIC - 1) == 0;
}

// The tables of one incidence: angles that all its wavelengths share, values[wavelength][theta][phi].
typedef struct tables {
    int thetas, phis;
    bool behind; // thetas run from 90 to 180 deg
    double *theta, *phi, *values;
} tables;

// From the normal of the side where the light leaves.
static double leaving_deg(const tables *t, int i) { return t->behind ? 180 - t->theta[i] : t->theta[i]; }

typedef struct speos {
    gonio_words words;
    gonio_negatives policy;
    gonio_samples *samples;
    gonio_read_report report;
    bool intensity, through, both; // through: tables of transmission alone; both: of either half
    int incidences, wavelengths;
    double *incidence;
    tables half[2]; // of the incidence that is read: reflection, transmission
    int done[2];    // tables of each
} speos;

static gonio_status count(speos *s, const char *what, int most, int *n, gonio_error *error) {
    double value;
    const gonio_status status = gonio_word_number(&s->words, what, &value, error);
    *n = status == GONIO_OK && value >= 1 && value <= most && value == floor(value) ? (int)value : 0;
    return status != GONIO_OK || *n > 0
               ? status
               : gonio_text_fail(&s->words.text, error, "%s: expected 1 to %d, found %g", what, most, value);
}

// ---- the head ----

// A description of so many bytes, over as many lines as they take.
static gonio_status skip_description(speos *s, gonio_error *error) {
    double bytes;
    const gonio_status status = gonio_word_number(&s->words, "length of the description", &bytes, error);
    if (status != GONIO_OK) {
        return status;
    }
    s->words.rest = NULL;
    for (double seen = 0; seen < bytes;) {
        const char *line = gonio_text_line(&s->words.text);
        if (line == NULL) {
            return gonio_text_fail(&s->words.text, error, "the file ends inside its description");
        }
        seen += (double)strlen(line) + 1;
    }
    return GONIO_OK;
}

static gonio_status read_kind(speos *s, gonio_error *error) {
    int reflection = 0, transmission = 0, bsdf;
    const char *version = gonio_text_line(&s->words.text) + sizeof MAGIC - 1;
    if (strncmp(version, "8.", 2) != 0 && strncmp(version, "9.", 2) != 0) {
        return gonio_text_fail(&s->words.text, error, "version '%.20s' of a Speos brdf; 8.0 and 9.0 are read", version);
    }
    gonio_status status = gonio_word_choice(&s->words, "text (0) or binary", "0", &bsdf, error);
    s->words.rest = gonio_text_line(&s->words.text); // a comment
    s->words.rest = NULL;
    status = status == GONIO_OK ? skip_description(s, error) : status;
    status = status == GONIO_OK ? gonio_word_choice(&s->words, "reflection", "0|1", &reflection, error) : status;
    status = status == GONIO_OK ? gonio_word_choice(&s->words, "transmission", "0|1", &transmission, error) : status;
    if (status == GONIO_OK && reflection == 0 && transmission == 0) {
        status = gonio_text_fail(&s->words.text, error, "a file of neither reflection nor transmission");
    }
    s->both = reflection == 1 && transmission == 1;
    s->through = transmission == 1 && !s->both;
    status = status == GONIO_OK ? gonio_word_choice(&s->words, "intensity or bsdf", "0|1", &bsdf, error) : status;
    s->intensity = bsdf == 0;
    return status;
}

static gonio_status name_channels(speos *s, gonio_error *error) {
    gonio_status status = gonio_samples_new(s->wavelengths, false, &s->samples, error);
    for (int k = 0; status == GONIO_OK && k < s->wavelengths; k++) {
        double nm;
        status = gonio_word_number(&s->words, "wavelength", &nm, error);
        if (status == GONIO_OK && !(nm >= 1 && nm <= 1e6)) {
            status = gonio_text_fail(&s->words.text, error, "wavelength: expected 1 to 1e6 nm, found %g", nm);
        }
        if (status == GONIO_OK) {
            gonio_number_format(s->samples->channel_names[k], GONIO_CHANNEL_NAME_MAX, "%.10gnm", nm);
        }
    }
    return status;
}

static gonio_status read_head(speos *s, gonio_error *error) {
    gonio_status status = read_kind(s, error);
    status = status == GONIO_OK ? count(s, "number of incidences", ANGLES_MAX, &s->incidences, error) : status;
    status =
        status == GONIO_OK ? count(s, "number of wavelengths", GONIO_CHANNELS_MAX, &s->wavelengths, error) : status;
    if (status == GONIO_OK && (s->incidence = malloc((size_t)s->incidences * sizeof(double))) == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %d angles", s->incidences);
    }
    for (int k = 0; status == GONIO_OK && k < s->incidences; k++) {
        status = gonio_word_number(&s->words, "incidence", &s->incidence[k], error);
        if (status == GONIO_OK && !(s->incidence[k] >= 0 && s->incidence[k] <= 90)) {
            status =
                gonio_text_fail(&s->words.text, error, "incidence: expected 0 to 90 deg, found %g", s->incidence[k]);
        }
    }
    return status == GONIO_OK ? name_channels(s, error) : status;
}

// ---- the tables ----

static gonio_status allocate(speos *s, tables *t, int thetas, int phis, gonio_error *error) {
    if (t->values != NULL) {
        return t->thetas == thetas && t->phis == phis
                   ? GONIO_OK
                   : gonio_text_fail(&s->words.text, error,
                                     "a table of %d x %d; the first wavelength of this incidence has %d x %d", thetas,
                                     phis, t->thetas, t->phis);
    }
    const size_t n = (size_t)thetas * (size_t)phis;
    if (n > ((size_t)1 << 26) / (size_t)s->wavelengths) {
        return gonio_text_fail(&s->words.text, error, "too many values");
    }
    t->thetas = thetas;
    t->phis = phis;
    t->theta = calloc((size_t)thetas, sizeof *t->theta);
    t->phi = calloc((size_t)phis, sizeof *t->phi);
    t->values = malloc(n * (size_t)s->wavelengths * sizeof *t->values);
    return t->theta != NULL && t->phi != NULL && t->values != NULL
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_MEMORY, "no memory for a table");
}

// An angle of the first wavelength, or the same again; ascending.
static gonio_status keep_angle(speos *s, const char *what, double value, double high, double *list, int k, bool first,
                               gonio_error *error) {
    if (!(value >= 0 && value <= high) || (k > 0 && value <= list[k - 1]) || (!first && value != list[k])) {
        return gonio_text_fail(&s->words.text, error,
                               first ? "%s: expected ascending angles of 0 to %g deg, found %g"
                                     : "%s: expected the angles of the first wavelength (0 to %g), found %g",
                               what, high, value);
    }
    list[k] = value;
    return GONIO_OK;
}

// Of transmission, thetas may run from 90 to 180 deg; they are kept as 0 to 90 from the far side's normal, with the
// rows as they stand.
static gonio_status keep_theta(speos *s, tables *t, double deg, int i, bool first, gonio_error *error) {
    const bool through = t == &s->half[1];
    const gonio_status status = keep_angle(s, "theta", deg, through ? 180 : 90, t->theta, i, first, error);
    if (status == GONIO_OK && i == 0) {
        t->behind = through && t->theta[0] >= 90;
    }
    return status == GONIO_OK && !t->behind && t->theta[i] > 90
               ? gonio_text_fail(&s->words.text, error, "theta: expected 0 to 90 or 90 to 180 deg, found %g",
                                 t->theta[i])
               : status;
}

static gonio_status value(speos *s, double *to, gonio_error *error) {
    const gonio_status status = gonio_word_number(&s->words, "value", to, error);
    if (status != GONIO_OK || *to >= 0) {
        return status;
    }
    s->report.first_negative_line = s->report.negatives++ == 0 ? s->words.text.line : s->report.first_negative_line;
    if (s->policy == GONIO_NEGATIVES_CLAMP) {
        s->report.clamped++;
        *to = 0;
    }
    return s->policy >= GONIO_NEGATIVES_CLAMP
               ? GONIO_OK
               : gonio_text_fail(&s->words.text, error, "negative value %g; --negatives clamp or keep lets it pass",
                                 *to);
}

// The projected solid angle's integral: 0 to 180 deg stand for both halves, one phi for all.
static double integral(const tables *t, const double *v) {
    double sum = 0;
    for (int i = 0; i + 1 < t->thetas; i++) {
        const double low = sin(gonio_radians(leaving_deg(t, i))), high = sin(gonio_radians(leaving_deg(t, i + 1)));
        const double ring = fabs(high * high - low * low) / 2;
        const double *a = v + (size_t)i * (size_t)t->phis, *b = a + t->phis;
        double mean = t->phis == 1 ? (a[0] + b[0]) * GONIO_PI : 0;
        for (int k = 0; k + 1 < t->phis; k++) {
            mean += (a[k] + a[k + 1] + b[k] + b[k + 1]) / 4 * gonio_radians(t->phi[k + 1] - t->phi[k]);
        }
        sum += ring * mean;
    }
    const double span = t->phis > 1 ? t->phi[t->phis - 1] - t->phi[0] : 360;
    return span > 0 ? sum * 360 / span : 0;
}

// The half whose thetas begin so; the angles phi, read before, become its own.
static gonio_status begin_table(speos *s, double first_theta, int thetas, int phis, const double *phi, tables **out,
                                gonio_error *error) {
    tables *t = &s->half[s->both ? first_theta >= 90 : s->through];
    *out = t;
    if (s->done[t - s->half] == s->incidences * s->wavelengths) {
        return gonio_text_fail(&s->words.text, error, "theta: a table of %s too many, from %g deg on",
                               t == s->half ? "reflection" : "transmission", first_theta);
    }
    const bool first = t->values == NULL;
    gonio_status status = allocate(s, t, thetas, phis, error);
    for (int k = 0; status == GONIO_OK && k < phis; k++) {
        status = keep_angle(s, "phi", phi[k], 360, t->phi, k, first, error);
    }
    return status == GONIO_OK ? keep_theta(s, t, first_theta, 0, first, error) : status;
}

// Up to the first theta, which tells the half.
static gonio_status read_table_head(speos *s, double *percent, tables **t, bool *first, gonio_error *error) {
    int thetas = 0, phis = 0;
    double first_theta = 0;
    gonio_status status = gonio_word_number(&s->words, "reflectance in per cent", percent, error);
    if (status == GONIO_OK && !(*percent >= 0 && *percent <= 1000)) {
        status = gonio_text_fail(&s->words.text, error, "a reflectance of %g %%", *percent);
    }
    status = status == GONIO_OK ? count(s, "number of thetas", ANGLES_MAX, &thetas, error) : status;
    status = status == GONIO_OK ? count(s, "number of phis", ANGLES_MAX, &phis, error) : status;
    double *phi = malloc(((size_t)phis + 1) * sizeof *phi);
    if (status == GONIO_OK && phi == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %d angles", phis);
    }
    for (int k = 0; status == GONIO_OK && k < phis; k++) {
        status = gonio_word_number(&s->words, "phi", &phi[k], error);
    }
    status = status == GONIO_OK ? gonio_word_number(&s->words, "theta", &first_theta, error) : status;
    if (status == GONIO_OK) {
        *first = s->half[s->both ? first_theta >= 90 : s->through].values == NULL;
        status = begin_table(s, first_theta, thetas, phis, phi, t, error);
    }
    free(phi);
    return status;
}

// The values, scaled to the percentage.
static gonio_status read_values(speos *s, tables *t, double percent, bool first, double *v, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < t->thetas; i++) {
        double deg = t->theta[0];
        status = i > 0 ? gonio_word_number(&s->words, "theta", &deg, error) : GONIO_OK;
        status = status == GONIO_OK && i > 0 ? keep_theta(s, t, deg, i, first, error) : status;
        for (int k = 0; status == GONIO_OK && k < t->phis; k++) {
            double *to = &v[(size_t)i * (size_t)t->phis + (size_t)k];
            status = value(s, to, error);
            *to /= s->intensity ? fmax(cos(gonio_radians(leaving_deg(t, i))), 1e-4) : 1;
        }
    }
    if (status != GONIO_OK) {
        return status;
    }
    const double whole = integral(t, v);
    if (!(whole > 0) && percent > 0) {
        return gonio_text_fail(&s->words.text, error, "a table without any light, of %g %% reflectance", percent);
    }
    for (size_t k = 0; k < (size_t)t->thetas * (size_t)t->phis; k++) {
        v[k] *= whole > 0 ? percent / 100 / whole : 0;
    }
    return GONIO_OK;
}

static gonio_status add_tables(speos *s, const tables *t, double incidence, gonio_error *error) {
    double *values = calloc((size_t)s->wavelengths, sizeof *values);
    gonio_status status = values != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a sample");
    for (int i = 0; status == GONIO_OK && i < t->thetas; i++) {
        for (int k = 0; status == GONIO_OK && k < t->phis; k++) {
            s->report.rows++;
            // The pole is one direction, and so are 0 and 360 deg.
            if ((leaving_deg(t, i) == 0 && k > 0) || (k > 0 && t->phi[k] - t->phi[0] == 360)) {
                continue;
            }
            for (int w = 0; w < s->wavelengths; w++) {
                values[w] = t->values[((size_t)w * (size_t)t->thetas + (size_t)i) * (size_t)t->phis + (size_t)k];
            }
            const double phi = remainder(t->phi[k] + 180, 360);
            const gonio_pair pair = {gonio_angle_canonical(gonio_radians(incidence)), 0,
                                     gonio_angle_canonical(gonio_radians(leaving_deg(t, i))),
                                     gonio_angle_canonical(gonio_radians(phi))};
            const bool through = t == &s->half[1];
            const gonio_pair lowered = gonio_pair_lowered(pair, through ? GONIO_TRANSMISSION : GONIO_REFLECTION);
            s->samples->transmission = s->samples->transmission || through;
            status = gonio_samples_add(s->samples, &lowered, values, NULL, NULL, error);
        }
    }
    free(values);
    return status;
}

static void release(tables *t) {
    free(t->theta);
    free(t->phi);
    free(t->values);
    *t = (tables){0};
}

// The next table; once its incidence has all wavelengths, the samples.
static gonio_status read_table(speos *s, gonio_error *error) {
    tables *t = NULL;
    double percent;
    bool first = false;
    gonio_status status = read_table_head(s, &percent, &t, &first, error);
    if (status != GONIO_OK) {
        return status;
    }
    int *done = &s->done[t - s->half];
    const size_t n = (size_t)t->thetas * (size_t)t->phis;
    status = read_values(s, t, percent, first, t->values + (size_t)(*done % s->wavelengths) * n, error);
    (*done)++;
    if (status == GONIO_OK && *done % s->wavelengths == 0) {
        status = add_tables(s, t, s->incidence[*done / s->wavelengths - 1], error);
        release(t);
    }
    return status;
}

static gonio_status read_speos(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                               gonio_read_report *report, gonio_error *error) {
    speos s = {.words = gonio_words_begin(source, "\1"), // the format has no comments but its third line
               .policy = (gonio_negatives)values->at[0].choice,
               .report = {.format = "speos", .first_negative_line = -1}};
    s.report.open_end = s.words.open_end;
    gonio_status status = read_head(&s, error);
    for (int k = 0; status == GONIO_OK && k < (s.both ? 2 : 1) * s.incidences * s.wavelengths; k++) {
        status = read_table(&s, error);
    }
    release(&s.half[0]);
    release(&s.half[1]);
    free(s.incidence);
    if (status != GONIO_OK) {
        gonio_samples_free(s.samples);
        s.samples = NULL;
    } else if (report != NULL) {
        *report = s.report;
    }
    *out = s.samples;
    return status;
}

static const gonio_format_option options[] = {GONIO_OPTION_NEGATIVES, {0}};

// ---- writing ----

static void put_table(gonio_grid *g, int channel, int incidence, double albedo, FILE *stream) {
    const gonio_grid_axis *theta = &g->axis[GONIO_GRID_OUT_THETA], *phi = &g->axis[GONIO_GRID_OUT_PHI];
    fprintf(stream, "%.9g\n%d %d\n", 100 * albedo, theta->n, phi->n);
    for (int k = 0; k < phi->n; k++) {
        fprintf(stream, "\t%.9g", phi->deg[k]);
    }
    fputc('\n', stream);
    for (int row = 0; row < theta->n; row++) { // of transmission from 90 to 180 deg
        const bool behind = g->half == GONIO_TRANSMISSION;
        const int i = behind ? theta->n - 1 - row : row;
        fprintf(stream, "%.9g", behind ? 180 - theta->deg[i] : theta->deg[i]);
        for (int k = 0; k < phi->n; k++) {
            fprintf(stream, "\t%.9g", gonio_grid_written(g, channel, 0, incidence, k, i));
        }
        fputc('\n', stream);
    }
}

static void put_speos(gonio_grid *g, const gonio_model *model, FILE *stream) {
    static const char description[] = "Written by Gonio";
    const gonio_grid_axis *in = &g->axis[GONIO_GRID_IN_THETA];
    fprintf(stream, MAGIC "8.0\n0\n%s\n%zu\n%s\n%s\n1\n%d\t%d\n", description, sizeof description - 1, description,
            g->half == GONIO_TRANSMISSION ? "0\t1" : "1\t0", in->n, g->channels);
    for (int t = 0; t < in->n; t++) {
        fprintf(stream, "%s%.9g", t > 0 ? "\t" : "", in->deg[t]);
    }
    fputc('\n', stream);
    for (int c = 0; c < g->channels; c++) {
        const double nm = gonio_model_wavelength_nm(model, c);
        fprintf(stream, "%s%.9g", c > 0 ? "\t" : "", isnan(nm) ? 550 : nm);
    }
    fputc('\n', stream);
    for (int t = 0; t < in->n; t++) {
        double albedo[GONIO_CHANNELS_MAX];
        gonio_grid_albedo(g, model, 0, t, albedo);
        for (int c = 0; c < g->channels; c++) {
            put_table(g, c, t, albedo[c], stream);
        }
    }
}

static gonio_status write_speos(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                gonio_write_report *told, gonio_error *error) {
    if (!model->isotropic) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "a Speos .brdf is isotropic; the model is not");
    }
    gonio_model *rgb, *written;
    gonio_status status = gonio_model_as_wavelengths(model, &rgb, &written, told, error);
    if (status == GONIO_OK) {
        gonio_grid g = {
            .frame = GONIO_GRID_ABSOLUTE, .light_deg = 180, .half = values->half}; // the mirror direction at phi = 0
        status = gonio_grid_of_model(&g, written, values->at[0].count, true, values->threads, error);
        if (status == GONIO_OK) {
            put_speos(&g, written, stream);
            snprintf(told->about, sizeof told->about,
                     "%d incidences, %d angles x %d azimuths; the percentage is the albedo", g.axis[1].n, g.axis[3].n,
                     g.axis[2].n);
            gonio_write_lost(told, "what lies between the nodes, and beyond 85 deg");
        }
        gonio_grid_free(&g);
    }
    if (written != rgb) {
        gonio_model_free(written);
    }
    if (rgb != model) {
        gonio_model_free(rgb);
    }
    return status;
}

static const gonio_format_option write_options[] = {GONIO_OPTION_GRID_STEP, {0}};

const gonio_format gonio_format_speos = {.name = "speos",
                                         .summary = "Speos brdf text",
                                         .extensions = ".brdf",
                                         .recognise = recognise,
                                         .read = read_speos,
                                         .write_table = write_speos,
                                         .write_options = write_options,
                                         .halves = 1u << GONIO_REFLECTION | 1u << GONIO_TRANSMISSION,
                                         .one_half = true,
                                         .fitted = true, // readers scale a table by its percentage
                                         .quantity = "f_r, 1/sr, scaled by readers to the albedo in per cent",
                                         .convention = "the mirror direction at phi = 0",
                                         .theta_max_deg = GONIO_GRID_WRITE_MAX_DEG,
                                         .options = options};
