// SPDX-License-Identifier: BSD-3-Clause
#include "io/format.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "base/number.h"

enum { LINE = 4000, NAME = 96 };

#define POLARISATIONS "none|unpolarised|unpolarized|s|p|h|v|45|135|left|right"

const gonio_declaration gonio_declarations_common[] = {
    {"quantity", "f_r|fr|brdf|bsdf|f_r in 1/sr|brdf in 1/sr|brdf (1/sr)|f_r (1/sr)", GONIO_DECLARED_NOTHING},
    {"quantity", "f_r cos|f_r cos(theta_o)|f_r_cos|brdf cos|brdf cos(theta_o)|cos brdf|ccbrdf|cosine corrected brdf",
     GONIO_DECLARED_COSINE},
    {"quantity", "brf|reflectance factor|radiance factor|pi f_r|pi brdf", GONIO_DECLARED_FACTOR},
    {"units", "1/sr|/sr|sr^-1|sr-1|per sr|per steradian|inverse steradian|inv_steradian", GONIO_DECLARED_NOTHING},
    {"value_units", "1/sr|/sr|sr^-1|sr-1|per sr|per steradian|inverse steradian|inv_steradian", GONIO_DECLARED_NOTHING},
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
    {"quantity", "btdf|f_t|btdf in 1/sr|btdf (1/sr)", GONIO_DECLARED_THROUGH},
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
                                          {"mirror", "mirrorat"},
                                          {"specularat", "mirrorat"}};

// Lower case, without blanks and the characters that spellings differ by.
static void plain(const char *from, size_t length, char *to, size_t size) {
    size_t n = 0;
    for (size_t i = 0; i < length && n + 1 < size; i++) {
        if (strchr(" \t\r_-^*.\"'", from[i]) == NULL) {
            to[n++] = (char)tolower((unsigned char)from[i]);
        }
    }
    to[n] = 0;
}

// Stems of what can change a value, and of lines of prose only the phrases that can hardly mean anything else.
static const char *const stems[] = {
    "unit",    "quantity", "cosine",    "cos(",           "angle",      "convention", "symmetr",   "isotrop",
    "wavelen", "polari",   "scale",     "scaling",        "factor",     "percent",    "param",     "normali",
    "theta",   "phi",      "azimuth",   "zenith",         "coordinate", "half",       "halves",    "transm",
    "missing", "nodata",   "fillvalue", "offset",         "mirrorat",   "specularat", "separator", "delimiter",
    "decimal", "log10",    "mueller",   "referenceframe", "mirror",     "measurand",  NULL};
static const char *const phrases[] = {"cos(",         "costheta",      "timescos",  "bycos", "cosinefactor",
                                      "cosineweight", "radian",        "inpercent", "log10", "polarised",
                                      "polarized",    "transmittance", NULL};

static const char *find_any(const char *const *words, const char *text) {
    for (int k = 0; words[k] != NULL; k++) {
        if (strstr(text, words[k]) != NULL) {
            return words[k];
        }
    }
    return NULL;
}

const char *gonio_declaration_weight(const char *name) {
    char text[NAME];
    plain(name, strlen(name), text, sizeof text);
    return find_any(stems, text);
}

static bool is_one_of(const char *value, const char *words) {
    for (const char *word = words;; word++) {
        const size_t n = strcspn(word, "|");
        char one[NAME];
        plain(word, n, one, sizeof one);
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
        plain(d->key, strlen(d->key), name, sizeof name);
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
    }
}

static gonio_status refuse(const gonio_source *source, long long line, const char *comment, const char *what,
                           gonio_error *error) {
    return gonio_fail_line(error, GONIO_E_INPUT, source->path, line,
                           "the file declares '%.120s', which could change its values and is not known here (%s); "
                           "docs/formats.md lists what is",
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

static gonio_status heed(const gonio_source *source, long long line, const char *comment, const gonio_declaration *own,
                         gonio_declared *declared, gonio_error *error) {
    const size_t mark = strcspn(comment, "=:"), capital = capital_key(comment);
    const bool pair = capital == 0 && comment[mark] != 0 && mark < 40;
    const size_t length = capital > 0 ? capital : pair ? mark : strlen(comment);
    const char *rest = comment + length + (comment[length] != 0);
    char key[NAME], value[NAME];
    plain(comment, length, key, sizeof key);
    plain(rest, strlen(rest), value, sizeof value);
    take_synonym(key, value);
    bool known = false;
    const gonio_declaration *d = look_up(own, key, value, &known);
    d = d != NULL || known ? d : look_up(gonio_declarations_common, key, value, &known);
    if (d != NULL) {
        apply(d, rest, declared);
        const bool kept = d->effect == GONIO_DECLARED_FIGURE || d->effect == GONIO_DECLARED_KNOWN;
        const gonio_status status =
            d->effect == GONIO_DECLARED_FIGURE ? check_figure(source, line, d, rest, error) : GONIO_OK;
        return status == GONIO_OK && kept ? keep(comment, length, rest, d, declared, error) : status;
    }
    if (known) {
        return refuse(source, line, comment, "the value", error);
    }
    const char *weight = capital > 0 || pair ? find_any(stems, key) : NULL;
    if (weight == NULL) {
        char all[LINE];
        plain(comment, strlen(comment), all, sizeof all);
        weight = find_any(phrases, all);
        for (const gonio_declaration *p = own; weight != NULL && p != NULL && p->key != NULL; p++) {
            weight = strcmp(p->key, weight) == 0 ? NULL : weight; // it says what this format is anyway
        }
    }
    return weight != NULL        ? refuse(source, line, comment, weight, error)
           : capital > 0 || pair ? keep(comment, length, rest, NULL, declared, error)
                                 : GONIO_OK;
}

bool gonio_declaration_holds(const char *key, const char *value) {
    char name[NAME], text[NAME];
    bool known = false;
    plain(key, strlen(key), name, sizeof name);
    plain(value, strlen(value), text, sizeof text);
    const gonio_declaration *d = look_up(gonio_declarations_common, name, text, &known);
    return d != NULL && (d->effect != GONIO_DECLARED_FIGURE || is_figure(d, value));
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
        if (at < last && *at == '#') {
            char comment[LINE];
            snprintf(comment, sizeof comment, "%.*s", (int)(last - at < LINE ? last - at : LINE), at);
            char *text = gonio_text_trim(comment + strspn(comment, "#"));
            status = text[0] != 0 ? heed(source, line, text, own, declared, error) : GONIO_OK;
        }
        at = last + 1;
    }
    if (status == GONIO_OK && declared->isotropic && declared->anisotropic) {
        status = gonio_fail_line(error, GONIO_E_INPUT, source->path, -1, "it declares both isotropic and anisotropic");
    }
    if (status != GONIO_OK) { // nobody takes what was told of a file that is refused
        free(declared->head);
        declared->head = NULL;
    }
    return status;
}
