// SPDX-License-Identifier: BSD-3-Clause
// Text of pab-opto's pgII gonio-photometer (the program "mountain"; described in the manual page of Radiance's
// pabopto2bsdf): header lines with #, one incidence a file, then rows theta phi value in degrees. DSF values carry the
// cosine of the outgoing angle, BSDF values do not. Above the sample, theta < 90; rows on the other side of the sample
// than the light are transmission.
#include <math.h>
#include <string.h>
#include <strings.h>

#include "base/number.h"
#include "gonio/plan.h"
#include "io/optics/grid.h"

#define COSINE_MIN 1e-3

typedef struct pab {
    gonio_text text;
    gonio_row_collector collector;
    double theta_i, phi_i; // deg; NaN: not stated yet
    bool has_format, dsf, xyz;
    size_t elsewhere;
} pab;

// The comment lines at the beginning hold #format: and the incidence.
static bool recognise(const gonio_source *source) {
    bool format = false, incidence = false;
    for (const char *at = source->data; *at == '#'; at++) {
        format = format || strncmp(at, "#format: theta phi", 18) == 0;
        incidence = incidence || strncmp(at, "#intheta", 8) == 0 || strncmp(at, "#incident_angle", 15) == 0;
        at = strchr(at, '\n');
        if (at == NULL) {
            return false;
        }
    }
    return format && incidence;
}

// One or two numbers of a header line.
static gonio_status numbers(const pab *p, const char *words, double *a, double *b, gonio_error *error) {
    char *end;
    *a = gonio_number_parse(words, &end);
    bool good = end != words && isfinite(*a);
    if (b != NULL) {
        words = end;
        *b = gonio_number_parse(words, &end);
        good = good && end != words && isfinite(*b);
    }
    return good ? GONIO_OK : gonio_text_fail(&p->text, error, "expected %s", b != NULL ? "two angles" : "an angle");
}

static gonio_status read_format(pab *p, const char *word, gonio_error *error) {
    p->has_format = true;
    p->dsf = strcasecmp(word, "DSF") == 0;
    return p->dsf || strcasecmp(word, "BSDF") == 0 || strcasecmp(word, "BRDF") == 0
               ? GONIO_OK
               : gonio_text_fail(&p->text, error, "format: expected theta phi DSF, BSDF or BRDF, found '%.40s'", word);
}

static gonio_status read_header_line(pab *p, char *line, gonio_error *error) {
    static const struct {
        const char *name;
        int what;
    } names[] = {{"format: theta phi ", 0}, {"colorimetry: ", 1}, {"intheta", 2}, {"inphi", 3}, {"incident_angle", 4}};
    for (int k = 0; k < 5; k++) {
        const size_t n = strlen(names[k].name);
        if (strncmp(line, names[k].name, n) != 0) {
            continue;
        }
        char *rest = line + n;
        switch (names[k].what) {
        case 0:
            return read_format(p, rest, error);
        case 1:
            p->xyz = strcasecmp(rest, "CIE-XYZ") == 0;
            return p->xyz || strcasecmp(rest, "CIE-Y") == 0
                       ? GONIO_OK
                       : gonio_text_fail(&p->text, error, "colorimetry: expected CIE-Y or CIE-XYZ, found '%.40s'",
                                         rest);
        case 2:
            return numbers(p, rest, &p->theta_i, NULL, error);
        case 3:
            return numbers(p, rest, &p->phi_i, NULL, error);
        default:
            return numbers(p, rest, &p->theta_i, &p->phi_i, error);
        }
    }
    return strncmp(line, "format:", 7) == 0
               ? gonio_text_fail(&p->text, error, "format: expected theta phi DSF, BSDF or BRDF, found '%.40s'", line)
               : GONIO_OK; // notes
}

static gonio_status begin_rows(pab *p, gonio_error *error) {
    if (!p->has_format || !(p->theta_i >= 0 && p->theta_i <= 180) || isnan(p->phi_i)) {
        return gonio_text_fail(&p->text, error,
                               "the rows begin and there is no #format:, or no #intheta of 0 to 180 deg and #inphi");
    }
    const gonio_status status = gonio_row_collector_room(&p->collector, p->xyz ? 3 : 1, false, error);
    if (status == GONIO_OK) {
        p->collector.samples->isotropic = false;
        for (int c = 0; c < p->collector.samples->channels; c++) {
            snprintf(p->collector.samples->channel_names[c], GONIO_CHANNEL_NAME_MAX, "%.*s", p->xyz ? 1 : 7,
                     p->xyz ? &"rgb"[c] : "visible");
        }
    }
    return status;
}

static double azimuth(double deg) { return gonio_angle_canonical(gonio_radians(remainder(deg, 360))); }

static gonio_status read_row(pab *p, char *line, gonio_error *error) {
    const int columns = p->xyz ? 5 : 3;
    char *fields[5];
    double v[5] = {0};
    const int n = gonio_text_split(line, ' ', fields, columns);
    gonio_status status =
        n == columns
            ? GONIO_OK
            : gonio_text_fail(&p->text, error, "expected theta, phi and %d values, found %d numbers", columns - 2, n);
    for (int k = 0; status == GONIO_OK && k < columns; k++) {
        status = gonio_text_number(&p->text, fields[k], k == 0 ? "theta" : k == 1 ? "phi" : "value", &v[k], error);
    }
    if (status == GONIO_OK && !(v[0] >= 0 && v[0] <= 180)) {
        status = gonio_text_fail(&p->text, error, "theta: expected 0 to 180 deg, found %g", v[0]);
    }
    if (status != GONIO_OK) {
        return status;
    }
    if (v[0] == 90) { // neither reflected nor transmitted
        p->elsewhere++;
        return GONIO_OK;
    }
    for (int k = 2; p->dsf && k < columns; k++) {
        v[k] /= fmax(fabs(cos(gonio_radians(v[0]))), COSINE_MIN);
    }
    if (p->xyz) {
        gonio_xyz_to_rgb((double[3]){v[2], v[3], v[4]}, v + 2);
    }
    const gonio_pair pair = {gonio_angle_canonical(gonio_radians(p->theta_i)), azimuth(p->phi_i),
                             gonio_angle_canonical(gonio_radians(v[0])), azimuth(v[1])};
    return gonio_row_collector_add(&p->collector, &pair, v + 2, NULL, NULL, error);
}

static gonio_status read_lines(pab *p, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (char *line; status == GONIO_OK && (line = gonio_text_line(&p->text)) != NULL;) {
        if (line[0] == '#' && p->collector.samples != NULL) {
            return gonio_text_fail(&p->text, error, "a header line behind the first row");
        }
        if (line[0] == '#') {
            status = read_header_line(p, line + 1, error);
        } else if (line[0] != 0) {
            status = p->collector.samples == NULL ? begin_rows(p, error) : GONIO_OK;
            status = status == GONIO_OK ? read_row(p, line, error) : status;
        }
    }
    return status != GONIO_OK || (p->collector.samples != NULL && p->collector.samples->n > 0)
               ? status
               : gonio_text_fail(&p->text, error, "there is no row on either side of the sample");
}

// What the back reflects, measured alone, is a reflection like any other.
static void settle_halves(gonio_samples *s) {
    s->transmission = gonio_pairs_transmit(s->pairs, s->n);
    if (s->transmission && gonio_samples_halves(s) == 1u << GONIO_REFLECTION_BACK) {
        for (size_t i = 0; i < s->n; i++) {
            s->pairs[i] = gonio_pair_raised(s->pairs[i]);
        }
        s->transmission = false;
    }
}

static gonio_status read_pab(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                             gonio_read_report *report, gonio_error *error) {
    pab p = {.text = gonio_text_begin(source->path, source->data, source->size), .theta_i = NAN, .phi_i = NAN};
    gonio_status status = gonio_row_collector_begin(&p.collector, &p.text, source, values, NULL, "pab", error);
    status = status == GONIO_OK ? read_lines(&p, error) : status;
    if (status == GONIO_OK) {
        settle_halves(p.collector.samples);
    }
    p.collector.report.invalid += p.elsewhere;
    p.collector.report.rows += p.elsewhere;
    return gonio_row_collector_end(&p.collector, status, out, report, error);
}

// The header's lines are the reader's own matter; what else stands there are notes of the instrument.
static const gonio_format_option options[] = {[GONIO_TEXT_NEGATIVES] = GONIO_OPTION_NEGATIVES,
                                              [GONIO_TEXT_MISSING] = GONIO_OPTION_MISSING,
                                              [GONIO_TEXT_DECLARED] = {"declared", GONIO_FORMAT_CHOICE, "heed|ignore",
                                                                       "ignore",
                                                                       "what the comments declare of the values"},
                                              {0}};

const gonio_format gonio_format_pab = {.name = "pab",
                                       .summary = "pab-opto pgII text",
                                       .extensions = ".txt .dat",
                                       .recognise = recognise,
                                       .read = read_pab,
                                       .options = options};
