// SPDX-License-Identifier: BSD-3-Clause
// A column is a channel only if it can be one: names of other things are never taken for a BRDF.
#include "io/column_names.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "io/fold.h"

// What can be a channel: of its words each is one of these, or a number with or without a letter before and a unit
// behind it.
static const char *const values[] = {
    "brdf",  "bsdf",   "fr",      "f",        "value", "values", "val",  "wert",   "messwert", "mittelwert", "valeur",
    "valor", "r",      "g",       "b",        "red",   "green",  "blue", "white",  "yellow",   "cyan",       "magenta",
    "amber", "orange", "grey",    "gray",     "mono",  "rgb",    "srgb", "cie",    "nir",      "swir",       "ir",
    "uv",    "vis",    "visible", "pan",      "mean",  "avg",    "edge", "rot",    "gruen",    "blau",       "grau",
    "rouge", "vert",   "bleu",    "photopic", "nm",    "um",     "m",    "mittel", "average",  NULL};
static const char *const wavelengths[] = {
    "wavelength",    "wavelengths", "lambda", "wl", "wvl", "wave", "wavelen", "wellenlaenge",
    "longueurdonde", "lambdanm",    "nm",     "um", "lam", "wlen", NULL};
static const char *const sigmas[] = {"std",
                                     "stdev",
                                     "stddev",
                                     "sd",
                                     "unc",
                                     "uncert",
                                     "uncertainty",
                                     "err",
                                     "error",
                                     "sigma",
                                     "u",
                                     "sem",
                                     "se",
                                     "standarddeviation",
                                     "standarduncertainty",
                                     "standarderror",
                                     "stderr",
                                     "unsicherheit",
                                     "standardabweichung",
                                     "incertitude",
                                     "ecarttype",
                                     "incertidumbre",
                                     "incertezza",
                                     NULL};
// Beside the words above, or by themselves.
static const char *const other_sigmas[] = {"relative", "rel",        "percent", "pct", "expanded",
                                           "relativ",  "erweiterte", "relatif", NULL};
static const char *const lone_sigmas[] = {"variance", "var",    "varianz", "u95", "ci",         "ci95",
                                          "sigma2",   "2sigma", "3sigma",  "uk2", "covariance", NULL};
static const char *const asides[] = {
    "id",         "index",    "idx",        "no",        "nr",          "row",       "sample",      "name",
    "date",       "time",     "utc",        "stamp",     "timestamp",   "temp",      "temperature", "humidity",
    "rh",         "operator", "comment",    "note",      "notes",       "remark",    "run",         "repeat",
    "scan",       "step",     "frame",      "file",      "filename",    "exposure",  "gain",        "flag",
    "flags",      "quality",  "instrument", "detector",  "count",       "weight",    "dphi",        "phi",
    "theta",      "azimuth",  "zenith",     "aspecular", "scattering",  "pressure",  "lamp",        "current",
    "num",        "number",   "line",       "rep",       "replicate",   "image",     "integration", "shutter",
    "valid",      "mask",     "sensor",     "device",    "monitor",     "mon",       "reference",   "dark",
    "background", "position", "distance",   "dist",      "rotation",    "tilt",      "solid",       "phase",
    "angle",      "aoi",      "cycle",      "snr",       "lauf",        "zeit",      "temperatur",  "feuchte",
    "datum",      "probe",    "bemerkung",  "messung",   "nummer",      "kommentar", "belichtung",  "verstaerkung",
    "lampe",      "druck",    "bediener",   "heure",     "echantillon", "operateur", "commentaire", "numero",
    "mesure",     "fecha",    "hora",       "muestra",   "campione",    "winkel",    "serial",      "user",
    NULL};
static const char *const foreign[] = {"percent",
                                      "pct",
                                      "cos",
                                      "cosine",
                                      "ccbrdf",
                                      "cosbrdf",
                                      "brdfcos",
                                      "btdf",
                                      "brf",
                                      "log",
                                      "log10",
                                      "ln",
                                      "db",
                                      "counts",
                                      "dn",
                                      "adu",
                                      "raw",
                                      "lnbrdf",
                                      "logbrdf",
                                      "reflectance",
                                      "reflectivity",
                                      "refl",
                                      "radiance",
                                      "irradiance",
                                      "luminance",
                                      "intensity",
                                      "albedo",
                                      "gloss",
                                      "transmittance",
                                      "absorbance",
                                      "hdrf",
                                      "brrf",
                                      "ars",
                                      "dsf",
                                      "signal",
                                      "norm",
                                      "normalised",
                                      "normalized",
                                      "relative",
                                      "rel",
                                      "arb",
                                      "au",
                                      "pibrdf",
                                      "brdfpi",
                                      "pi",
                                      "kosinus",
                                      "prozent",
                                      "faktor",
                                      "factor",
                                      "facteur",
                                      "wavenumber",
                                      "frequency",
                                      "freq",
                                      "ev",
                                      "energy",
                                      "power",
                                      "leuchtdichte",
                                      "strahldichte",
                                      "remission",
                                      "reflexionsgrad",
                                      "volt",
                                      "volts",
                                      "voltage",
                                      NULL};

static bool is_in(const char *const *words, const char *word) {
    for (int k = 0; words[k] != NULL; k++) {
        if (strcmp(words[k], word) == 0) {
            return true;
        }
    }
    return false;
}

#define BETWEEN "_-. /*:#'"

// The name's words as gonio_fold has them, what stands in brackets or behind a stroke as the unit, and all in one.
typedef struct words {
    char text[96], unit[32], joined[96];
    char *items[8];
    int n;
} words;

static bool is_unit(const char *word) {
    static const char *const units[] = {"nm", "um", "deg", "rad", "c", "k", "s", "ms", "celsius", "sr", NULL};
    return is_in(units, word);
}

static void cut(const char *name, words *w) {
    char folded[96];
    gonio_fold(name, true, folded, sizeof folded);
    *w = (words){.n = 0};
    size_t end = strcspn(folded, "([,"); // "BRDF, 1/sr"
    if (folded[end] != 0 && end > 0) {
        const char *unit = folded + end + 1 + strspn(folded + end + 1, " ");
        snprintf(w->unit, sizeof w->unit, "%.*s", (int)strcspn(unit, ")]"), unit);
    } else if (strchr(folded, '/') != NULL) { // "lambda / nm"
        const char *unit = strchr(folded, '/') + 1;
        unit += strspn(unit, " ");
        if (is_unit(unit)) {
            snprintf(w->unit, sizeof w->unit, "%.31s", unit);
            end = strcspn(folded, "/");
        }
    }
    snprintf(w->text, sizeof w->text, "%.*s", (int)end, folded);
    char *rest;
    for (char *item = strtok_r(w->text, BETWEEN, &rest); item != NULL && w->n < 8;
         item = strtok_r(NULL, BETWEEN, &rest)) {
        w->items[w->n++] = item;
        const size_t n = strlen(w->joined);
        snprintf(w->joined + n, sizeof w->joined - n, "%s", item);
    }
}

static bool any_in(const words *w, const char *const *list) {
    for (int k = 0; k < w->n; k++) {
        if (is_in(list, w->items[k])) {
            return true;
        }
    }
    return is_in(list, w->joined);
}

// "550", "550nm", "r11", "ch2"
static bool is_numbered(const char *word) {
    static const char *const before[] = {"",  "r", "m",  "s",    "f",       "c",     "ch",
                                         "b", "v", "fr", "band", "channel", "kanal", NULL};
    static const char *const behind[] = {"", "nm", "um", NULL};
    char stem[16] = "";
    const size_t letters = strcspn(word, "0123456789"), digits = strspn(word + letters, "0123456789");
    snprintf(stem, sizeof stem, "%.*s", (int)(letters < 15 ? letters : 15), word);
    return digits > 0 && is_in(before, stem) && is_in(behind, word + letters + digits);
}

static bool is_value(const words *w, const char *name) {
    bool all = w->n > 0;
    for (int k = 0; k < w->n; k++) {
        all = all && (is_in(values, w->items[k]) || is_numbered(w->items[k]));
    }
    return all || strcmp(name, "X") == 0 || strcmp(name, "Y") == 0 || strcmp(name, "Z") == 0;
}

// A unit of values that is not 1/sr, where one is told.
static bool is_foreign_unit(const words *w) {
    static const char *const own[] = {"1/sr",        "/sr",        "sr1", "persr", "1/ster",
                                      "1/steradian", "steradian1", "nm",  "um",    NULL};
    char plain[32];
    size_t n = 0;
    for (const char *c = w->unit; *c != 0; c++) {
        if (strchr(" ^*-.()", *c) == NULL) {
            plain[n++] = *c;
        }
    }
    plain[n] = 0;
    return n > 0 && !is_in(own, plain);
}

static bool is_other_sigma(const words *w, const char *name) {
    const bool uncertainty = any_in(w, sigmas);
    return is_in(lone_sigmas, w->joined) || (w->n > 0 && is_in(lone_sigmas, w->items[w->n - 1])) ||
           (uncertainty && (any_in(w, other_sigmas) || strpbrk(w->unit, "%2359") != NULL)) ||
           // A capital U is the expanded one (GUM 6.2.1).
           strcmp(name, "U") == 0 || (name[0] == 'U' && strchr("([_ ", name[1]) != NULL);
}

// "lambda", "wave_length", "wavelength_nm", "wavelength_A"
static bool is_wavelength(const words *w) {
    return is_in(wavelengths, w->joined) || (w->n == 2 && is_in(wavelengths, w->items[0]) && strlen(w->items[1]) < 9) ||
           (w->n == 3 && strcmp(w->items[0], "wave") == 0 && strcmp(w->items[1], "length") == 0);
}

gonio_column_role gonio_column_role_of(const char *name) {
    words w;
    cut(name, &w);
    if (is_other_sigma(&w, name)) {
        return GONIO_COLUMN_OTHER_SIGMA;
    }
    if (strchr(name, '%') != NULL) {
        return GONIO_COLUMN_FOREIGN;
    }
    if (is_wavelength(&w)) {
        return GONIO_COLUMN_WAVELENGTH;
    }
    if (is_in(sigmas, w.joined)) {
        return GONIO_COLUMN_SIGMA;
    }
    if (w.n > 0 && (is_in(asides, w.items[0]) || is_in(asides, w.items[w.n - 1]))) {
        return GONIO_COLUMN_ASIDE;
    }
    if (any_in(&w, foreign) || is_foreign_unit(&w)) {
        return GONIO_COLUMN_FOREIGN;
    }
    return is_value(&w, name) ? GONIO_COLUMN_CHANNEL : GONIO_COLUMN_UNKNOWN;
}

const char *gonio_column_sigma_of(const char *name, size_t *length) {
    words w;
    cut(name, &w);
    const char *first = strpbrk(name, "_ -"), *last = first;
    for (const char *next = first; next != NULL; next = strpbrk(next + 1, "_ -")) {
        last = next;
    }
    if (first == NULL || w.n < 2) {
        return NULL;
    }
    if (is_in(sigmas, w.items[0])) {
        *length = strlen(first + 1);
        return first + 1;
    }
    *length = (size_t)(last - name);
    return is_in(sigmas, w.items[w.n - 1]) ? name : NULL;
}

double gonio_column_um(const char *name, char *unit, size_t size) {
    words w;
    cut(name, &w);
    const char *told = w.unit[0] != 0 ? w.unit : w.n > 1 || (w.n == 1 && is_unit(w.items[0])) ? w.items[w.n - 1] : "";
    snprintf(unit, size, "%s", told);
    return told[0] == 0 || strcmp(told, "length") == 0 ? 0
           : strcmp(told, "nm") == 0                   ? 1e-3
           : strcmp(told, "um") == 0                   ? 1
                                                       : (double)NAN;
}
