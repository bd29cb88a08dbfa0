// SPDX-License-Identifier: BSD-3-Clause
#include "io/declaration_words.h"

#include <ctype.h>
#include <string.h>

#include "io/fold.h"

enum { LINE = 4000 };

// Stems of keys.
static const char *const stems[] = {
    "unit",    "quantity", "cosine",       "cos(",           "angle",      "convention", "symmetr",       "isotrop",
    "wavelen", "polari",   "scale",        "scaling",        "factor",     "percent",    "param",         "normali",
    "theta",   "phi",      "azimuth",      "zenith",         "coordinate", "half",       "halves",        "transm",
    "missing", "nodata",   "fillvalue",    "offset",         "mirrorat",   "specular",   "separator",     "delimiter",
    "decimal", "log10",    "mueller",      "referenceframe", "mirror",     "measurand",  "lambda",        "multipl",
    "einheit", "winkel",   "wellenlaenge", "faktor",         "groesse",    "kosinus",    "grandeur",      "facteur",
    "angulo",  "angolo",   "unidad",       "fattore",        "coseno",     "magnitud",   "longueurdonde", "fehlwert",
    NULL};
// Of remarks only what can hardly mean anything else; they are compared without blanks.
static const char *const phrases[] = {"cos(",
                                      "costheta",
                                      "timescos",
                                      "bycos",
                                      "cosinefactor",
                                      "cosineweight",
                                      "cosinecorr",
                                      "withcosine",
                                      "kosinus",
                                      "coseno",
                                      "inpercent",
                                      "percentof",
                                      "in%",
                                      "inprozent",
                                      "pourcent",
                                      "porcentaje",
                                      "percentuale",
                                      "log10",
                                      "logscale",
                                      "logarithm",
                                      "decibel",
                                      "indb",
                                      "multipliedby",
                                      "multiplyby",
                                      "tobedivided",
                                      "divideby",
                                      "scaledby",
                                      "scalefactor",
                                      "scalingfactor",
                                      "valuesx",
                                      "x10^",
                                      "x1e",
                                      "normalisedto",
                                      "normalizedto",
                                      "normalisedby",
                                      "normalizedby",
                                      "normiertauf",
                                      "relativeto",
                                      "relativzu",
                                      "arbitraryunit",
                                      "elevation",
                                      "fromthesurface",
                                      "fromsurface",
                                      "fromthehorizon",
                                      "fromhorizon",
                                      "abovethehorizon",
                                      "grazingangle",
                                      "glancingangle",
                                      "luminancefactor",
                                      "radiancefactor",
                                      "reflectancefactor",
                                      "luminancecoeff",
                                      "radiancecoeff",
                                      "strahldichte",
                                      "leuchtdichte",
                                      "pibrdf",
                                      "pi*brdf",
                                      "brdf*pi",
                                      "pifr",
                                      "pi*f",
                                      "polarised",
                                      "polarized",
                                      "polarisiert",
                                      "transmittance",
                                      "bilateralsymm",
                                      "planesymm",
                                      "mirrorsymm",
                                      "quadrantsymm",
                                      "missingvalue",
                                      "nodata",
                                      "fillvalue",
                                      "bogenmass",
                                      NULL};
// Words of their own.
static const char *const words[] = {"radian", "radians", "radiant",  "rad", "mrad", "gradian", "gradians",
                                    "gon",    "gons",    "angstrom", "btf", "brf",  "ccbrdf",  NULL};
// Remarks that are nothing else: a unit that stands alone.
static const char *const alone[] = {"db", "counts", "dn",  "adu", "%",     "percent", "a.u.",
                                    "au", "grad",   "log", "ln",  "volts", "v",       NULL};
static const char *const through[] = {"btdf", "transmission", "transmissive", "transmitted", NULL};

static const char *find_any(const char *const *list, const char *text) {
    for (int k = 0; list[k] != NULL; k++) {
        if (strstr(text, list[k]) != NULL) {
            return list[k];
        }
    }
    return NULL;
}

void gonio_declaration_plain(const char *from, size_t length, bool bare, char *to, size_t size) {
    char text[LINE], folded[LINE];
    size_t n = 0;
    const size_t kept = length < sizeof text - 1 ? length : sizeof text - 1;
    memcpy(text, from, kept);
    text[kept] = 0;
    gonio_fold(text, false, folded, sizeof folded);
    for (const char *c = folded; *c != 0 && n + 1 < size; c++) {
        if (strchr(bare ? " \t\r_-^*.\"'()[]{}" : " \t\r_-^*.\"'", *c) == NULL) {
            to[n++] = *c;
        }
    }
    to[n] = 0;
}

const char *gonio_declaration_key_weight(const char *plain_key) { return find_any(stems, plain_key); }

const char *gonio_declaration_weight(const char *name) {
    char text[96];
    gonio_declaration_plain(name, strlen(name), false, text, sizeof text);
    return gonio_declaration_key_weight(text);
}

// A whole word of the text that is one of the list.
static const char *find_word(const char *const *list, const char *text) {
    for (const char *from = text; *from != 0;) {
        from += strspn(from, " \t,;:=()[]/\"'");
        const size_t n = strcspn(from, " \t,;:=()[]/\"'");
        for (int k = 0; list[k] != NULL; k++) {
            if (strlen(list[k]) == n && strncmp(from, list[k], n) == 0) {
                return list[k];
            }
        }
        from += n;
    }
    return NULL;
}

const char *gonio_declaration_remark_weight(const char *remark) {
    char folded[LINE], all[LINE];
    size_t n = 0;
    gonio_fold(remark, false, folded, sizeof folded);
    for (const char *c = folded; *c != 0; c++) {
        if (strchr(" \t\r_-\"'", *c) == NULL) {
            all[n++] = *c;
        }
    }
    all[n] = 0;
    for (int k = 0; alone[k] != NULL; k++) {
        if (strcmp(folded + strspn(folded, " \t"), alone[k]) == 0) {
            return alone[k];
        }
    }
    const char *weight = find_any(phrases, all);
    weight = weight != NULL ? weight : find_word(words, folded);
    // A header in a comment: "theta_i phi_i BRDF[%]".
    return weight != NULL                                                             ? weight
           : strstr(all, "brdf") != NULL && strpbrk(strstr(all, "brdf"), "%") != NULL ? "%"
                                                                                      : NULL;
}

bool gonio_declaration_speaks_of_transmission(const char *remark) {
    char folded[LINE];
    gonio_fold(remark, false, folded, sizeof folded);
    return find_word(through, folded) != NULL;
}
