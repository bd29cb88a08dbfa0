// SPDX-License-Identifier: BSD-3-Clause
// Data files of ALTA, the library of Inria and CNRS for the analysis of BRDFs (its pages "Data file formats" and
// "params"): header lines #KEY VALUE, of which DIM N P, PARAM_IN and PARAM_OUT say what stands in a row of N
// coordinates and P values; then rows of text between blanks, or, behind #BEGIN_STREAM, float64 of the byte order that
// #ENDIAN names. Angles are in radians, the azimuth 0 of difference coordinates is the light's own side. #VS 1 or 2
// adds columns of vertical segments, within which a fit of ALTA's has to stay: no uncertainties, and not read.
#include <endian.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/vector.h"
#include "io/optics/grid.h"

enum { COLUMNS_MAX = 6 + 3 * 64 };

typedef struct alta {
    gonio_text text;
    gonio_row_collector collector;
    int coordinates, values, segments; // of a row
    const struct parametrisation *in;
    bool cosine, xyz, binary, big;
    double count;  // rows of a stream; < 0: not stated
    size_t stream; // where it begins
    size_t below;
} alta;

static double elevation(double x, double y) { return hypot(x, y); }

static gonio_vec3 polar(double theta, double phi) {
    return (gonio_vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
}

// Difference vector -> view, about the half vector; the light is its mirror image there.
static void from_half(double theta_h, double phi_h, double theta_d, double phi_d, gonio_vec3 *wi, gonio_vec3 *wo) {
    const gonio_vec3 h = polar(theta_h, phi_h), d = polar(theta_d, phi_d);
    const gonio_vec3 t = {d.x * cos(theta_h) + d.z * sin(theta_h), d.y, d.z * cos(theta_h) - d.x * sin(theta_h)};
    *wo = (gonio_vec3){t.x * cos(phi_h) - t.y * sin(phi_h), t.x * sin(phi_h) + t.y * cos(phi_h), t.z};
    const double along = 2 * dot(*wo, h);
    *wi = (gonio_vec3){along * h.x - wo->x, along * h.y - wo->y, along * h.z - wo->z};
}

static void half_4(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) { from_half(x[0], x[1], x[2], x[3], wi, wo); }
static void half_3(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) { from_half(x[0], 0, x[1], x[2], wi, wo); }
static void half_2(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) { from_half(x[0], 0, x[1], GONIO_PI / 2, wi, wo); }
static void cosines(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    from_half(acos(x[0]), 0, acos(x[1]), 0, wi, wo);
}
static void halves(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) { from_half(acos(x[0]), 0, 0, 0, wi, wo); }
static void spherical(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    *wi = polar(x[0], x[1]);
    *wo = polar(x[2], x[3]);
}
static void isotropic(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    *wo = polar(x[0], 0);
    *wi = polar(x[1], x[2]);
}
static void projected(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    *wi = polar(x[0], 0);
    *wo = polar(elevation(x[1], x[2]), atan2(x[2], x[1]));
}
static void normal_light(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    *wi = (gonio_vec3){0, 0, 1};
    *wo = polar(elevation(x[0], x[1]), atan2(x[1], x[0]));
}
static void cartesian(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    *wo = (gonio_vec3){x[0], x[1], x[2]};
    *wi = (gonio_vec3){x[3], x[4], x[5]};
}

// H = (l + v) / 2 projected on the surface, of length x[0] at azimuth 0, and B = (l - v) / 2: l = H + B, v = H - B.
static void half_and_back(gonio_vec3 h, gonio_vec3 b, gonio_vec3 *wi, gonio_vec3 *wo) {
    *wi = (gonio_vec3){h.x + b.x, h.y + b.y, h.z + b.z};
    *wo = (gonio_vec3){h.x - b.x, h.y - b.y, h.z - b.z};
}
// Neumann: the projections of both, |B| at azimuth x[2].
static void neumann_3(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    half_and_back((gonio_vec3){x[0], 0, 0}, (gonio_vec3){x[1] * cos(x[2]), x[1] * sin(x[2]), 0}, wi, wo);
    wi->z = sqrt(fmax(1 - wi->x * wi->x - wi->y * wi->y, 0));
    wo->z = sqrt(fmax(1 - wo->x * wo->x - wo->y * wo->y, 0));
}
static void neumann_2(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    neumann_3((const double[]){x[0], x[1], GONIO_PI / 2}, wi, wo);
}
// Stark: B's whole length and azimuth; it is perpendicular to H, as both directions are of length 1.
static void stark_3(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    const gonio_vec3 h = {x[0], 0, sqrt(fmax(1 - x[0] * x[0] - x[1] * x[1], 0))};
    const double theta = atan2(h.z, -h.x * cos(x[2])), s = x[1] * sin(theta);
    half_and_back(h, (gonio_vec3){s * cos(x[2]), s * sin(x[2]), x[1] * cos(theta)}, wi, wo);
}
static void stark_2(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    stark_3((const double[]){x[0], x[1], GONIO_PI / 2}, wi, wo);
}
// Schlick's back vector K stands half-way between the view and the light's mirror direction.
static void schlick(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    const gonio_vec3 k = polar(elevation(x[1], x[2]), atan2(x[2], x[1]));
    *wi = polar(x[0], 0);
    const gonio_vec3 r = {-wi->x, 0, wi->z};
    const double along = 2 * dot(k, r);
    *wo = (gonio_vec3){along * k.x - r.x, along * k.y - r.y, along * k.z - r.z};
}
// The view at an angle from the light, in a direction that counts from the normal's about the light.
static void retro(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    const double apart = elevation(x[1], x[2]), turn = atan2(x[2], x[1]);
    *wi = polar(x[0], 0);
    const double a = cos(apart), b = sin(apart) * cos(turn);
    *wo = (gonio_vec3){a * wi->x - b * wi->z, sin(apart) * sin(turn), a * wi->z + b * wi->x};
}
static gonio_vec3 stereographic_one(double x, double y) {
    const double r = x * x + y * y;
    return (gonio_vec3){2 * x / (1 + r), 2 * y / (1 + r), (1 - r) / (1 + r)};
}
static void stereographic(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    *wo = stereographic_one(x[0], x[1]);
    *wi = stereographic_one(x[2], x[3]);
}
static void half_vector(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) { *wi = *wo = (gonio_vec3){x[0], x[1], x[2]}; }
static void apart(const double *x, gonio_vec3 *wi, gonio_vec3 *wo) {
    *wi = (gonio_vec3){0, 0, 1};
    *wo = polar(acos(x[0]), 0);
}

// Those that tell both directions, where coordinates lack as ALTA itself fills them in. Of COS_TK, COS_TLR and
// SCHLICK_VK, slices or averages too, it makes no pair of directions of length 1.
static const struct parametrisation {
    const char *name;
    int coordinates;
    bool turns; // the light's azimuth is told
    void (*vectors)(const double *x, gonio_vec3 *wi, gonio_vec3 *wo);
} parametrisations[] = {
    {"RUSIN_TH_PH_TD_PD", 4, true, half_4},
    {"RUSIN_TH_TD_PD", 3, false, half_3},
    {"RUSIN_TH_TD", 2, false, half_2},
    {"COS_TH_TD", 2, false, cosines},
    {"COS_TH", 1, false, halves},
    {"SPHERICAL_TL_PL_TV_PV", 4, true, spherical},
    {"ISOTROPIC_TV_TL_DPHI", 3, false, isotropic},
    {"ISOTROPIC_TL_TV_PROJ_DPHI", 3, false, projected},
    {"ISOTROPIC_TV_PROJ_DPHI", 2, false, normal_light},
    {"CARTESIAN", 6, true, cartesian},
    {"NEUMANN_3D", 3, false, neumann_3},
    {"NEUMANN_2D", 2, false, neumann_2},
    {"STARK_3D", 3, false, stark_3},
    {"STARK_2D", 2, false, stark_2},
    {"SCHLICK_TL_TK_PROJ_DPHI", 3, false, schlick},
    {"RETRO_TL_TVL_PROJ_DPHI", 3, false, retro},
    {"STEREOGRAPHIC", 4, true, stereographic},
    {"RUSIN_VH", 3, true, half_vector},
    {"COS_TLV", 1, false, apart},
};
enum { PARAMETRISATIONS = sizeof parametrisations / sizeof *parametrisations };

// ---- the header ----

// The value of a header line of that key; NULL: it is another.
static const char *value_of(const char *line, const char *key) {
    const size_t n = strlen(key);
    return line[0] == '#' && strncmp(line + 1, key, n) == 0 && (line[n + 1] == ' ' || line[n + 1] == '\t')
               ? line + n + 1 + strspn(line + n + 1, " \t")
               : NULL;
}

// A line #PARAM_IN before the first row; CEA's own files have a reader of theirs.
static bool recognise(const gonio_source *source) {
    const char *at = source->data + (strncmp(source->data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0);
    bool dimensions = false, coordinates = false;
    for (int line = 0; line < 200 && at != NULL && *at != 0; line++) {
        at += strspn(at, " \t\r");
        dimensions = dimensions || value_of(at, "DIM") != NULL;
        coordinates = coordinates || value_of(at, "PARAM_IN") != NULL;
        if (strncmp(at, "#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI", 35) == 0) {
            return false;
        }
        if (*at != '#' && *at != '\n') {
            break;
        }
        at = strchr(at, '\n');
        at = at != NULL ? at + 1 : NULL;
    }
    return dimensions && coordinates;
}

static gonio_status read_dimensions(alta *a, const char *value, gonio_error *error) {
    char *end, *last;
    const double n = gonio_number_parse(value, &end), p = gonio_number_parse(end, &last);
    if (end == value || last == end || *last != 0 || !(n >= 1 && n <= 6 && n == floor(n)) ||
        !(p >= 1 && p <= 64 && p == floor(p))) {
        return gonio_text_fail(&a->text, error, "DIM: expected 1 to 6 coordinates and 1 to 64 values, found '%.40s'",
                               value);
    }
    a->coordinates = (int)n;
    a->values = (int)p;
    return GONIO_OK;
}

static gonio_status read_coordinates(alta *a, const char *value, gonio_error *error) {
    char known[400] = "";
    for (int k = 0; k < PARAMETRISATIONS; k++) {
        if (strcmp(value, parametrisations[k].name) == 0) {
            a->in = &parametrisations[k];
            return GONIO_OK;
        }
        gonio_text_append(known, sizeof known, "%s%s", k > 0 ? ", " : "", parametrisations[k].name);
    }
    return gonio_text_fail(&a->text, error, "PARAM_IN %.40s does not tell both directions; those that do: %s", value,
                           known);
}

static gonio_status read_quantity(alta *a, const char *value, gonio_error *error) {
    a->cosine = strcmp(value, "INV_STERADIAN_COSINE_FACTOR") == 0;
    a->xyz = strcmp(value, "XYZ_COLOR") == 0;
    return a->cosine || a->xyz || strcmp(value, "INV_STERADIAN") == 0 || strcmp(value, "RGB_COLOR") == 0
               ? GONIO_OK
               : gonio_text_fail(&a->text, error,
                                 "PARAM_OUT: expected INV_STERADIAN, INV_STERADIAN_COSINE_FACTOR, RGB_COLOR or "
                                 "XYZ_COLOR, found '%.40s'",
                                 value);
}

// A number for each value: 0, 1 or 2 columns. ALTA's own reader takes the first for all, its files name it once.
static gonio_status read_segments(alta *a, const char *value, gonio_error *error) {
    char *end;
    const double n = gonio_number_parse(value, &end);
    if (end == value || !(n == 0 || n == 1 || n == 2)) {
        return gonio_text_fail(&a->text, error, "VS: expected 0, 1 or 2, found '%.40s'", value);
    }
    a->segments = (int)n;
    return GONIO_OK;
}

static gonio_status read_word(alta *a, const char *key, const char *value, const char *words, int *choice,
                              gonio_error *error) {
    const size_t n = strlen(value);
    const char *one = words;
    for (*choice = 0; *one != 0; (*choice)++) {
        const size_t length = strcspn(one, "|");
        if (length == n && strncmp(one, value, n) == 0) {
            return GONIO_OK;
        }
        one += length + (one[length] == '|');
    }
    return gonio_text_fail(&a->text, error, "%s: expected %s, found '%.40s'", key, words, value);
}

static gonio_status read_line(alta *a, const char *line, gonio_error *error) {
    const char *value;
    int choice = 0;
    gonio_status status = GONIO_OK;
    if ((value = value_of(line, "DIM")) != NULL) {
        return read_dimensions(a, value, error);
    }
    if ((value = value_of(line, "PARAM_IN")) != NULL) {
        return read_coordinates(a, value, error);
    }
    if ((value = value_of(line, "PARAM_OUT")) != NULL) {
        return read_quantity(a, value, error);
    }
    if ((value = value_of(line, "VS")) != NULL) {
        return read_segments(a, value, error);
    }
    if ((value = value_of(line, "SAMPLE_COUNT")) != NULL) {
        return gonio_text_number(&a->text, value, "SAMPLE_COUNT", &a->count, error);
    }
    if ((value = value_of(line, "FORMAT")) != NULL) {
        status = read_word(a, "FORMAT", value, "binary|text", &choice, error);
        a->binary = choice == 0;
    } else if ((value = value_of(line, "ENDIAN")) != NULL) {
        status = read_word(a, "ENDIAN", value, "little|big", &choice, error);
        a->big = choice == 1;
    } else if ((value = value_of(line, "PRECISION")) != NULL) {
        status = read_word(a, "PRECISION", value, "ieee754-double", &choice, error);
    } else if ((value = value_of(line, "VERSION")) != NULL) {
        status = read_word(a, "VERSION", value, "0", &choice, error);
    }
    return status;
}

static gonio_status check_header(alta *a, bool quantity, gonio_error *error) {
    if (a->coordinates == 0 || a->in == NULL || !quantity) {
        return gonio_text_fail(&a->text, error, "the rows begin and there is no #%s",
                               a->coordinates == 0 ? "DIM"
                               : a->in == NULL     ? "PARAM_IN"
                                                   : "PARAM_OUT");
    }
    if (a->coordinates != a->in->coordinates) {
        return gonio_text_fail(&a->text, error, "DIM states %d coordinates, %s has %d", a->coordinates, a->in->name,
                               a->in->coordinates);
    }
    return !a->xyz || a->values == 3
               ? GONIO_OK
               : gonio_text_fail(&a->text, error, "XYZ_COLOR of %d values; 3 were expected", a->values);
}

// Up to the first row, of which *line is left, or the stream.
static gonio_status read_header(alta *a, const gonio_source *source, char **line, gonio_error *error) {
    bool quantity = false;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && (*line = gonio_text_line(&a->text)) != NULL) {
        if (strcmp(*line, "#BEGIN_STREAM") == 0) {
            a->stream = (size_t)(a->text.next - source->data); // beyond the end behind a line without one
            a->stream = a->stream < source->size ? a->stream : source->size;
            break;
        }
        if (**line != '#' && **line != 0) {
            break;
        }
        quantity = quantity || value_of(*line, "PARAM_OUT") != NULL;
        status = read_line(a, *line, error);
    }
    status = status == GONIO_OK ? check_header(a, quantity, error) : status;
    if (status == GONIO_OK && a->binary != (a->stream > 0)) {
        status =
            gonio_text_fail(&a->text, error,
                            a->binary ? "FORMAT binary without #BEGIN_STREAM" : "#BEGIN_STREAM without #FORMAT binary");
    }
    return status;
}

// ---- rows ----

static gonio_status name_channels(alta *a, gonio_error *error) {
    const bool colour = a->values == 3;
    const gonio_status status = gonio_row_collector_room(&a->collector, a->values, false, error);
    for (int c = 0; c < a->values && status == GONIO_OK; c++) {
        char *name = a->collector.samples->channel_names[c];
        if (a->values == 1) {
            snprintf(name, GONIO_CHANNEL_NAME_MAX, "value");
        } else if (colour) {
            snprintf(name, GONIO_CHANNEL_NAME_MAX, "%c", "rgb"[c]);
        } else {
            snprintf(name, GONIO_CHANNEL_NAME_MAX, "value%d", c + 1);
        }
    }
    return status;
}

static double angle(double rad) { return gonio_angle_canonical(rad); }

static gonio_status add_row(alta *a, const double *row, gonio_error *error) {
    gonio_vec3 wi, wo;
    double values[64];
    a->in->vectors(row, &wi, &wo);
    const double li = sqrt(dot(wi, wi)), lo = sqrt(dot(wo, wo));
    if (!(fabs(li - 1) < 1e-3 && fabs(lo - 1) < 1e-3)) {
        return gonio_text_fail(&a->text, error, "the coordinates are no pair of directions");
    }
    if (!a->text.transmission && (wi.z < -1e-6 || wo.z < -1e-6)) {
        a->below++;
        return GONIO_OK;
    }
    wi.z = wi.z < -1e-6 ? wi.z : fmax(wi.z, 0);
    wo.z = wo.z < -1e-6 ? wo.z : fmax(wo.z, 0);
    memcpy(values, row + a->coordinates, (size_t)a->values * sizeof *values);
    if (a->xyz) {
        gonio_xyz_to_rgb(row + a->coordinates, values);
    }
    const double most = a->text.transmission ? GONIO_PI : GONIO_PI / 2;
    const gonio_pair pair = {angle(fmin(gonio_direction_theta(wi), most)), angle(gonio_direction_phi(wi)),
                             angle(fmin(gonio_direction_theta(wo), most)), angle(gonio_direction_phi(wo))};
    return gonio_row_collector_add(&a->collector, &pair, values, NULL, NULL, error);
}

static gonio_status read_text(alta *a, char *line, gonio_error *error) {
    char *fields[COLUMNS_MAX];
    double row[COLUMNS_MAX];
    const int columns = a->coordinates + a->values;
    gonio_status status = GONIO_OK;
    for (; status == GONIO_OK && line != NULL; line = gonio_text_content(&a->text)) {
        const int n = gonio_text_split(line, ' ', fields, COLUMNS_MAX);
        // Segments stand behind the first value alone or behind all, as the writer had it.
        const bool right =
            n == columns || (a->segments > 0 && (n == columns + a->segments || n == columns + a->segments * a->values));
        status = right ? GONIO_OK
                       : gonio_text_fail(&a->text, error, "expected %d coordinates and %d values%s, found %d numbers",
                                         a->coordinates, a->values, a->segments > 0 ? " and their segments" : "", n);
        for (int k = 0; status == GONIO_OK && k < columns; k++) {
            status = k < a->coordinates ? gonio_text_number(&a->text, fields[k], "coordinate", &row[k], error)
                                        : gonio_row_collector_number(&a->collector, fields[k], "value", &row[k], error);
        }
        status = status == GONIO_OK ? add_row(a, row, error) : status;
    }
    return status;
}

static double number_at(const alta *a, const char *at) {
    uint64_t raw;
    double value;
    memcpy(&raw, at, sizeof raw);
    raw = a->big ? be64toh(raw) : le64toh(raw);
    memcpy(&value, &raw, sizeof value);
    return value;
}

static gonio_status read_stream(alta *a, const gonio_source *source, gonio_error *error) {
    const size_t columns = (size_t)(a->coordinates + a->values), wide = columns + (size_t)(a->segments * a->values);
    const size_t there = source->size - a->stream;
    if (!(a->count >= 1 && a->count == floor(a->count)) || a->count > (double)(there / (8 * wide))) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)source->size,
                               "SAMPLE_COUNT %g of %zu numbers a row; %zu bytes follow #BEGIN_STREAM", a->count, wide,
                               there);
    }
    const size_t end = a->stream + (size_t)a->count * wide * 8;
    const char *mark = source->data + end;
    mark += *mark == '\r';
    mark += *mark == '\n';
    if (strncmp(mark, "#END_STREAM", 11) != 0) {
        return gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)end,
                               "expected #END_STREAM behind the stream");
    }
    gonio_status status = GONIO_OK;
    double row[COLUMNS_MAX];
    for (size_t i = 0; i < (size_t)a->count && status == GONIO_OK; i++) {
        for (size_t k = 0; k < columns && status == GONIO_OK; k++) {
            const size_t at = a->stream + (i * wide + k) * 8;
            row[k] = number_at(a, source->data + at);
            status = isfinite(row[k]) ? GONIO_OK
                                      : gonio_fail_byte(error, GONIO_E_INPUT, source->path, (long long)at,
                                                        "expected a finite number, found %g", row[k]);
        }
        status = status == GONIO_OK ? add_row(a, row, error) : status;
    }
    return status;
}

// Where the light's azimuth never changes nobody turned the sample.
static void set_symmetry(alta *a) {
    gonio_samples *s = a->collector.samples;
    for (size_t i = 1; i < s->n && a->in->turns; i++) {
        if (fabs(remainder(s->pairs[i].phi_i - s->pairs[0].phi_i, 2 * GONIO_PI)) > 1e-6 && s->pairs[i].theta_i > 1e-6 &&
            s->pairs[0].theta_i > 1e-6) {
            s->isotropic = false;
        }
    }
}

static gonio_status read_rows(alta *a, const gonio_source *source, char *line, gonio_error *error) {
    gonio_status status = name_channels(a, error);
    if (status == GONIO_OK) {
        a->collector.declared.cosine = a->collector.declared.cosine || a->cosine;
        status = a->binary ? read_stream(a, source, error) : read_text(a, line, error);
    }
    if (status == GONIO_OK) {
        set_symmetry(a);
        a->collector.report.invalid += a->below;
        a->collector.report.rows += a->below;
        if (a->segments > 0) {
            gonio_text_append(a->collector.report.notes, sizeof a->collector.report.notes,
                              "vertical segments are no uncertainties and not read\n");
        }
    }
    return status;
}

// What the reader itself reads; the rest of the header are commands and notes.
static const gonio_declaration declarations[] = {{"DIM", NULL, GONIO_DECLARED_NOTHING},
                                                 {"PARAM_IN", NULL, GONIO_DECLARED_NOTHING},
                                                 {"PARAM_OUT", NULL, GONIO_DECLARED_NOTHING},
                                                 {"VS", NULL, GONIO_DECLARED_NOTHING},
                                                 {"FORMAT", NULL, GONIO_DECLARED_NOTHING},
                                                 {"VERSION", NULL, GONIO_DECLARED_NOTHING},
                                                 {"PRECISION", NULL, GONIO_DECLARED_NOTHING},
                                                 {"SAMPLE_COUNT", NULL, GONIO_DECLARED_NOTHING},
                                                 {"ENDIAN", NULL, GONIO_DECLARED_NOTHING},
                                                 {"BEGIN_STREAM", NULL, GONIO_DECLARED_NOTHING},
                                                 {"ALTA", NULL, GONIO_DECLARED_NOTHING},
                                                 {"CMD", NULL, GONIO_DECLARED_NOTHING},
                                                 {"radian", NULL, GONIO_DECLARED_NOTHING},
                                                 {"angle_units", "radian|radians|rad", GONIO_DECLARED_NOTHING},
                                                 {0}};

static gonio_status read_alta(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                              gonio_read_report *report, gonio_error *error) {
    alta a = {.text = gonio_text_begin(source->path, source->data, source->size), .count = -1};
    // Bytes of a stream declare nothing.
    const char *stream = strstr(source->data, "#BEGIN_STREAM");
    const gonio_source head = {.path = source->path,
                               .data = source->data,
                               .size = stream != NULL ? (size_t)(stream - source->data) : source->size};
    char *line = NULL;
    gonio_status status = gonio_row_collector_begin(&a.collector, &a.text, &head, values, declarations, "alta", error);
    status = status == GONIO_OK ? read_header(&a, source, &line, error) : status;
    if (a.binary) {
        a.collector.report.open_end = false; // its last word shows that it is whole
    }
    status = status == GONIO_OK ? read_rows(&a, source, line, error) : status;
    return gonio_row_collector_end(&a.collector, status, out, report, error);
}

static const gonio_format_option options[] = {GONIO_TEXT_OPTIONS, {0}};

const gonio_format gonio_format_alta = {.name = "alta",
                                        .summary = "ALTA data",
                                        .extensions = ".alta",
                                        .recognise = recognise,
                                        .read = read_alta,
                                        .options = options};
