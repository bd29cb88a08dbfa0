// SPDX-License-Identifier: BSD-3-Clause
#include "io/format.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "base/number.h"
#include "io/declaration_words.h"

enum { LINE = 4000, NAME = 96 };

#define UNITS "1/sr|/sr|sr^-1|per sr|per steradian|inverse steradian|inv_steradian|1/steradian|steradian^-1"
#define POLARISATIONS "none|unpolarised|unpolarized|s|p|h|v|45|135|left|right"

const gonio_declaration gonio_declarations_common[] = {
    {"quantity", "f_r|fr|brdf|bsdf|absolute brdf", GONIO_DECLARED_NOTHING},
    {"quantity",
     "f_r cos|f_r cos(theta_o)|f_r cos(theta_r)|f_r cos(theta_s)|f_r cos(theta_v)|brdf cos|brdf cos(theta_o)|"
     "brdf cos(theta_r)|brdf cos(theta_s)|brdf cos(theta_v)|cos brdf|cos(theta_o) brdf|ccbrdf|cosine corrected brdf|"
     "cosine weighted brdf",
     GONIO_DECLARED_COSINE},
    {"quantity", "brf|reflectance factor|radiance factor|luminance factor|pi f_r|pi brdf|brdf pi|f_r pi",
     GONIO_DECLARED_FACTOR},
    {"units", UNITS, GONIO_DECLARED_NOTHING},
    {"value_units", UNITS, GONIO_DECLARED_NOTHING},
    {"symmetry", "isotropic", GONIO_DECLARED_ISOTROPIC},
    {"symmetry", "anisotropic|none", GONIO_DECLARED_ANISOTROPIC},
    {"isotropic", "yes|true|1", GONIO_DECLARED_ISOTROPIC},
    {"isotropic", "no|false|0", GONIO_DECLARED_ANISOTROPIC},
    {"anisotropic", "no|false|0", GONIO_DECLARED_ISOTROPIC},
    {"anisotropic", "yes|true|1|", GONIO_DECLARED_ANISOTROPIC},
    {"convention", "gonio", GONIO_DECLARED_NOTHING},
    {"mirror_at", "180|180 deg", GONIO_DECLARED_NOTHING},
    {"wavelength_units", "nm|nanometre|nanometres|nanometer|nanometers", GONIO_DECLARED_NOTHING},
    {"polarisation", "none|unpolarised|unpolarized|average|averaged|depolarised|depolarized", GONIO_DECLARED_KNOWN},
    // The values are f_r of these; a lone "polarisation = s" leaves open whose it is.
    {"light_polarisation", POLARISATIONS, GONIO_DECLARED_KNOWN},
    {"detector_polarisation", POLARISATIONS, GONIO_DECLARED_KNOWN},
    {"mueller", "absolute|f_r", GONIO_DECLARED_NOTHING},
    {"scale", "1|1.0|linear", GONIO_DECLARED_NOTHING},
    {"factor", "1|1.0", GONIO_DECLARED_NOTHING},
    {"offset", "0|0.0", GONIO_DECLARED_NOTHING},
    {"normalised", "no|none|false|0", GONIO_DECLARED_NOTHING},
    {"cosine", "no|none|false|0", GONIO_DECLARED_NOTHING},
    {"cosine", "yes|true|1", GONIO_DECLARED_COSINE},
    {"quantity", "btdf|f_t", GONIO_DECLARED_THROUGH},
    {"type", "brdf", GONIO_DECLARED_KNOWN},
    {"type", "btdf", GONIO_DECLARED_THROUGH},
    {"channels", NULL, GONIO_DECLARED_CHANNELS},
    {"halves", "reflection", GONIO_DECLARED_NOTHING},
    {"halves",
     "reflection,transmission|transmission,reflection|reflection and transmission|both|all|"
     "reflection,transmission,reflection-back,transmission-back",
     GONIO_DECLARED_HALVES},
    {"halves", "transmission", GONIO_DECLARED_THROUGH},
    {"missing", NULL, GONIO_DECLARED_MISSING},
    {"wavelength", NULL, GONIO_DECLARED_KNOWN},    // of a single channel: its name may say it too
    {"wavelengths", NULL, GONIO_DECLARED_NOTHING}, // how many
    {"columns", NULL, GONIO_DECLARED_NOTHING},     // the header says them
    {"light_solid_angle_sr", NULL, GONIO_DECLARED_FIGURE},
    {"light_half_angle_deg", NULL, GONIO_DECLARED_FIGURE},
    {"aperture_solid_angle_sr", NULL, GONIO_DECLARED_FIGURE},
    {"aperture_half_angle_deg", NULL, GONIO_DECLARED_FIGURE},
    {"spot_mm", NULL, GONIO_DECLARED_FIGURE},
    {"measured_mm", NULL, GONIO_DECLARED_FIGURE},
    {"light_distance_mm", NULL, GONIO_DECLARED_FIGURE},
    {"camera_distance_mm", NULL, GONIO_DECLARED_FIGURE},
    {"bandwidth_nm", NULL, GONIO_DECLARED_FIGURE},
    {"temperature_c", NULL, GONIO_DECLARED_FIGURE},
    {"humidity_percent", NULL, GONIO_DECLARED_FIGURE},
    {"reference_sigma_percent", NULL, GONIO_DECLARED_FIGURE},
    // Their words may hold what weighs in others: "at an angle of", "scale".
    {"reference", NULL, GONIO_DECLARED_KNOWN},
    {"reference_reflectance", NULL, GONIO_DECLARED_KNOWN},
    {"traceability", NULL, GONIO_DECLARED_KNOWN},
    {"sample", NULL, GONIO_DECLARED_KNOWN},
    {"instrument", NULL, GONIO_DECLARED_KNOWN},
    {"serials", NULL, GONIO_DECLARED_KNOWN},
    {"operator", NULL, GONIO_DECLARED_KNOWN},
    {"laboratory", NULL, GONIO_DECLARED_KNOWN},
    {"date", NULL, GONIO_DECLARED_KNOWN},
    {"notes", NULL, GONIO_DECLARED_KNOWN},
    {"session", NULL, GONIO_DECLARED_KNOWN},
    {"simulated", NULL, GONIO_DECLARED_KNOWN},
    {0}};

// Other spellings of the keys.
static const char *const synonyms[][2] = {{"unit", "units"},
                                          {"valueunit", "valueunits"},
                                          {"unitsofvalues", "valueunits"},
                                          {"values", "quantity"},
                                          {"value", "quantity"},
                                          {"measurand", "quantity"},
                                          {"angleunit", "angleunits"},
                                          {"angles", "angleunits"},
                                          {"angle", "angleunits"},
                                          {"anglesin", "angleunits"},
                                          {"wavelengthunit", "wavelengthunits"},
                                          {"polarization", "polarisation"},
                                          {"lightpolarization", "lightpolarisation"},
                                          {"sourcepolarisation", "lightpolarisation"},
                                          {"sourcepolarization", "lightpolarisation"},
                                          {"incidentpolarisation", "lightpolarisation"},
                                          {"incidentpolarization", "lightpolarisation"},
                                          {"detectorpolarization", "detectorpolarisation"},
                                          {"solidangle", "aperturesolidanglesr"},
                                          {"solidanglesr", "aperturesolidanglesr"},
                                          {"detectorsolidanglesr", "aperturesolidanglesr"},
                                          {"sourcesolidanglesr", "lightsolidanglesr"},
                                          {"temperaturedegc", "temperaturec"},
                                          {"spotdiametermm", "spotmm"},
                                          {"laboratoryname", "laboratory"},
                                          {"normalized", "normalised"},
                                          {"normalisation", "normalised"},
                                          {"normalization", "normalised"},
                                          {"cosinefactor", "cosine"},
                                          {"half", "halves"},
                                          {"missingvalue", "missing"},
                                          {"nodata", "missing"},
                                          {"nodatavalue", "missing"},
                                          {"fillvalue", "missing"},
                                          {"missingvalues", "missing"},
                                          {"missingdata", "missing"},
                                          {"nanvalue", "missing"},
                                          {"nan", "missing"},
                                          {"blank", "missing"},
                                          {"blankvalue", "missing"},
                                          {"invalid", "missing"},
                                          {"invalidvalue", "missing"},
                                          {"badvalue", "missing"},
                                          {"undefined", "missing"},
                                          {"novalue", "missing"},
                                          {"fehlwert", "missing"},
                                          {"theta", "angleunits"},
                                          {"phi", "angleunits"},
                                          {"winkel", "angleunits"},
                                          {"winkeleinheit", "angleunits"},
                                          {"einheit", "units"},
                                          {"einheiten", "units"},
                                          {"unite", "units"},
                                          {"unidad", "units"},
                                          {"unita", "units"},
                                          {"messgroesse", "quantity"},
                                          {"groesse", "quantity"},
                                          {"grandeur", "quantity"},
                                          {"magnitud", "quantity"},
                                          {"lambda", "wavelengthunits"},
                                          {"wavelengthsin", "wavelengthunits"},
                                          {"wellenlaenge", "wavelength"},
                                          {"mirror", "mirrorat"},
                                          {"specularat", "mirrorat"}};

static bool is_one_of(const char *value, const char *words) {
    for (const char *word = words;; word++) {
        const size_t n = strcspn(word, "|");
        char one[NAME];
        gonio_declaration_plain(word, n, true, one, sizeof one);
        if (strcmp(one, value) == 0) {
            return true;
        }
        word += n;
        if (*word == 0) {
            return false;
        }
    }
}

// *known: whether the table has the key at all.
static const gonio_declaration *look_up(const gonio_declaration *table, const char *key, const char *value,
                                        bool *known) {
    for (const gonio_declaration *d = table; d != NULL && d->key != NULL; d++) {
        char name[NAME];
        gonio_declaration_plain(d->key, strlen(d->key), false, name, sizeof name);
        if (strcmp(name, key) == 0) {
            *known = true;
            if (d->values == NULL || is_one_of(value, d->values)) {
                return d;
            }
        }
    }
    return NULL;
}

static void apply(const gonio_declaration *d, const char *value, gonio_declared *declared) {
    char *end;
    switch (d->effect) {
    case GONIO_DECLARED_NOTHING:
    case GONIO_DECLARED_KNOWN:
    case GONIO_DECLARED_FIGURE:
        break;
    case GONIO_DECLARED_ISOTROPIC:
        declared->isotropic = true;
        break;
    case GONIO_DECLARED_ANISOTROPIC:
        declared->anisotropic = true;
        break;
    case GONIO_DECLARED_COSINE:
        declared->cosine = true;
        break;
    case GONIO_DECLARED_FACTOR:
        declared->factor = GONIO_PI;
        break;
    case GONIO_DECLARED_MISSING:
        declared->missing = gonio_number_parse(value, &end);
        declared->has_missing = end != value && *end == 0;
        break;
    case GONIO_DECLARED_THROUGH:
        declared->through = true;
        declared->transmission = true;
        break;
    case GONIO_DECLARED_HALVES:
        declared->transmission = true;
        break;
    case GONIO_DECLARED_CHANNELS:
        free(declared->channels);
        declared->channels = strdup(value);
        break;
    }
}

static gonio_status refuse(const gonio_source *source, long long line, const char *comment, const char *what,
                           gonio_error *error) {
    return gonio_fail_line(error, GONIO_E_INPUT, source->path, line,
                           "the file declares '%.120s', which could change its values and is not known here (%s); "
                           "docs/formats.md lists what is, --declared ignore takes it for a remark",
                           comment, what);
}

// A word in capitals and its value, as CEA's files declare: "PARAM_OUT INV_STERADIAN".
static size_t capital_key(const char *comment) {
    const size_t n = strspn(comment, "ABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789");
    return n >= 2 && (comment[n] == ' ' || comment[n] == '\t' || comment[n] == 0) ? n : 0;
}

// The comment as a line of what is known of the measurement, where it has the form of one: a key of letters, digits and
// what stands between words.
static gonio_status keep(const char *comment, size_t length, const char *rest, const gonio_declaration *d,
                         gonio_declared *declared, gonio_error *error) {
    char key[GONIO_HEAD_KEY_MAX];
    size_t n = 0;
    if (!gonio_text_is_printable(rest)) {
        return GONIO_OK; // without its control characters it would be another text
    }
    if (d != NULL) {
        snprintf(key, sizeof key, "%s", d->key);
    } else {
        for (; n < length && n + 1 < sizeof key; n++) {
            const unsigned char c = (unsigned char)comment[n];
            key[n] = (char)(c == ' ' || c == '-' || c == '.' ? '_' : tolower(c));
            if (!isalnum(c) && strchr(" -._", c) == NULL) {
                return GONIO_OK;
            }
        }
        key[n] = 0;
        if (n == 0 || !isalpha((unsigned char)key[0])) {
            return GONIO_OK;
        }
        while (key[n - 1] == '_') {
            key[--n] = 0;
        }
    }
    return gonio_head_add(&declared->head, key, rest, error);
}

static bool is_figure(const gonio_declaration *d, const char *text) {
    char *end;
    const double figure = gonio_number_parse(text, &end);
    return end != text && *end == 0 && isfinite(figure) && (figure >= 0 || strcmp(d->key, "temperature_c") == 0);
}

static gonio_status check_figure(const gonio_source *source, long long line, const gonio_declaration *d,
                                 const char *value, gonio_error *error) {
    const char *text = value + strspn(value, " \t");
    return is_figure(d, text) ? GONIO_OK
                              : gonio_fail_line(error, GONIO_E_INPUT, source->path, line,
                                                "%s: expected a number of 0 or more, found '%.60s'", d->key, text);
}

static void take_synonym(char key[NAME], const char *value) {
    for (size_t k = 0; k < sizeof synonyms / sizeof *synonyms; k++) {
        // "values: 1200" counts them.
        if (strcmp(key, synonyms[k][0]) == 0 && (key[0] != 'v' || !isdigit((unsigned char)value[0]))) {
            snprintf(key, NAME, "%s", synonyms[k][1]);
        }
    }
}

// "brdf in 1/sr", "brdf (sr^-1)": a quantity with its unit.
static void strip_unit(char value[NAME]) {
    static const char *const units[] = {"in1/sr", "insr1", "1/sr", "/sr", "sr1", "persr", "persteradian"};
    for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
        const size_t n = strlen(value), unit = strlen(units[k]);
        if (n > unit && strcmp(value + n - unit, units[k]) == 0) {
            value[n - unit] = 0;
            return;
        }
    }
}

// A comment as key and value. A remark without a sign between them, "angles in rad" or "values are brf", is one too
// where its first part is a key that is known.
typedef struct statement {
    const char *comment, *rest; // rest: the value as written
    size_t length;              // of the key
    bool capital, pair;
    char key[NAME], value[NAME];
} statement;

static bool is_key(const gonio_declaration *own, const char *key) {
    bool known = false;
    look_up(own, key, "", &known);
    look_up(gonio_declarations_common, key, "", &known);
    return known;
}

static void cut_remark(const gonio_declaration *own, statement *s) {
    static const char *const verbs[] = {" in ", " are ", " is ", " sind ", " en "};
    for (size_t k = 0; k < sizeof verbs / sizeof *verbs; k++) {
        const char *at = strstr(s->comment, verbs[k]);
        char key[NAME];
        if (at == NULL || at == s->comment || at - s->comment >= 40) {
            continue;
        }
        gonio_declaration_plain(s->comment, (size_t)(at - s->comment), false, key, sizeof key);
        take_synonym(key, at + strlen(verbs[k]));
        if (is_key(own, key)) {
            s->length = (size_t)(at - s->comment);
            s->rest = at + strlen(verbs[k]);
            s->pair = true;
            return;
        }
    }
}

static statement cut(const char *comment, const gonio_declaration *own) {
    const size_t mark = strcspn(comment, "=:"), capital = capital_key(comment);
    statement s = {.comment = comment, .capital = capital > 0, .pair = capital == 0 && comment[mark] != 0 && mark < 40};
    s.length = capital > 0 ? capital : s.pair ? mark : strlen(comment);
    s.rest = comment + s.length + (comment[s.length] != 0);
    if (!s.pair && !s.capital) {
        cut_remark(own, &s);
    }
    gonio_declaration_plain(comment, s.length, false, s.key, sizeof s.key);
    gonio_declaration_plain(s.rest, strlen(s.rest), true, s.value, sizeof s.value);
    take_synonym(s.key, s.value);
    if (strcmp(s.key, "quantity") == 0) {
        strip_unit(s.value);
    }
    return s;
}

// The weight of a comment that no table knows; NULL: it has none.
static const char *weigh(const statement *s, const gonio_declaration *own) {
    const char *weight = s->capital || s->pair ? gonio_declaration_key_weight(s->key) : NULL;
    if (weight != NULL) {
        return weight;
    }
    weight = gonio_declaration_remark_weight(s->comment);
    for (const gonio_declaration *p = own; weight != NULL && p != NULL && p->key != NULL; p++) {
        // It says what this format is anyway.
        weight = strncmp(p->key, weight, strlen(p->key) < strlen(weight) ? strlen(p->key) : strlen(weight)) == 0
                     ? NULL
                     : weight;
    }
    return weight;
}

static gonio_status heed(const gonio_source *source, long long line, const char *comment, const gonio_declaration *own,
                         bool marked, gonio_declared *declared, gonio_error *error) {
    statement s = cut(comment, own);
    bool known = false;
    const gonio_declaration *d = look_up(own, s.key, s.value, &known);
    d = d != NULL || known ? d : look_up(gonio_declarations_common, s.key, s.value, &known);
    if (d != NULL) {
        apply(d, s.rest, declared);
        const bool kept = d->effect == GONIO_DECLARED_FIGURE || d->effect == GONIO_DECLARED_KNOWN;
        const gonio_status status =
            d->effect == GONIO_DECLARED_FIGURE ? check_figure(source, line, d, s.rest, error) : GONIO_OK;
        return status == GONIO_OK && kept ? keep(comment, s.length, s.rest, d, declared, error) : status;
    }
    // Of text before a table only what is about the values: "angle of incidence: 30" is no declaration.
    const bool heavy = marked || strcmp(s.key, "quantity") == 0 || strstr(s.key, "unit") != NULL;
    if (known && heavy && strcmp(s.key, "type") != 0 && (marked || !isdigit((unsigned char)s.value[0]))) {
        return refuse(source, line, comment, "the value", error);
    }
    s.pair = s.pair && marked;
    const char *weight = weigh(&s, own);
    if (weight != NULL) {
        return refuse(source, line, comment, weight, error);
    }
    if (declared->through_line == 0 && gonio_declaration_speaks_of_transmission(comment)) {
        declared->through_line = line;
        snprintf(declared->through_remark, sizeof declared->through_remark, "%.*s", 100, comment);
    }
    return (s.capital || s.pair) && marked ? keep(comment, s.length, s.rest, NULL, declared, error) : GONIO_OK;
}

bool gonio_declaration_holds(const char *key, const char *value) {
    char name[NAME], text[NAME];
    bool known = false;
    gonio_declaration_plain(key, strlen(key), false, name, sizeof name);
    gonio_declaration_plain(value, strlen(value), true, text, sizeof text);
    const gonio_declaration *d = look_up(gonio_declarations_common, name, text, &known);
    return d != NULL && (d->effect != GONIO_DECLARED_FIGURE || is_figure(d, value));
}

gonio_status gonio_declarations_transmit(const gonio_source *source, const gonio_declared *declared,
                                         gonio_error *error) {
    return declared->through_line == 0 || declared->transmission
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_INPUT, source->path, declared->through_line,
                                 "the file speaks of transmission, '%.100s', and does not declare it: '# halves = "
                                 "reflection,transmission' or '# quantity = btdf' does, as --transmission; --declared "
                                 "ignore takes it for a remark",
                                 declared->through_remark);
}

gonio_status gonio_declarations_read(const gonio_source *source, const gonio_declaration *own, gonio_declared *declared,
                                     gonio_error *error) {
    *declared = (gonio_declared){.factor = 1};
    const char *at = source->data, *end = source->data + source->size;
    at += source->size >= 3 && memcmp(at, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
    gonio_status status = GONIO_OK;
    for (long long line = 1; at < end && status == GONIO_OK; line++) {
        const char *last = memchr(at, '\n', (size_t)(end - at));
        last = last != NULL ? last : end;
        while (at < last && (*at == ' ' || *at == '\t')) {
            at++;
        }
        if (at < last && (*at == '#' || line <= source->preamble)) {
            char comment[LINE];
            snprintf(comment, sizeof comment, "%.*s", (int)(last - at < LINE ? last - at : LINE), at);
            char *text = gonio_text_trim(comment + strspn(comment, "#"));
            status = text[0] != 0 ? heed(source, line, text, own, *at == '#', declared, error) : GONIO_OK;
        }
        at = last + 1;
    }
    if (status == GONIO_OK && declared->isotropic && declared->anisotropic) {
        status = gonio_fail_line(error, GONIO_E_INPUT, source->path, -1, "it declares both isotropic and anisotropic");
    }
    if (status != GONIO_OK) { // nobody takes what was told of a file that is refused
        free(declared->head);
        free(declared->channels);
        declared->head = declared->channels = NULL;
    }
    return status;
}
