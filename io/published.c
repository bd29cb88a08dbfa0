// SPDX-License-Identifier: BSD-3-Clause
// Tables of published fits. A line is a material:
//   NAME = Aggregate(Lambertian(albedo = [r, g, b]), MODEL(key = number or [r, g, b] or [[r, g, b], [r, g, b]], ..))
//
//   sgd                 Bagher, Soler & Holzschuch 2012: 100 MERL materials
//   ngan-ward, ngan-blinn-phong, ngan-cook-torrance, ngan-lafortune
//                       Ngan, Durand & Matusik 2005: 86 of them
// Ngan's Blinn-Phong and Lafortune have the factor (n + 2) / (2 pi), Lafortune's over the largest value that the
// bracket reaches: both go into rho_s, since the formulae here have another or none.
#include "io/published.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "brdf/kind/analytic.h"

enum { CHANNELS = 3, KEYS_MAX = 12, LINE_MAX_BYTES = 4096 };

typedef struct form {
    const char *name, *file;
    const gonio_formula *formula;
    // Where each parameter of the formula stands: a key, and which of its lists; NULL: the formula's own value.
    struct {
        const char *key;
        int list;
    } from[GONIO_FORMULA_PARAMETERS_MAX];
    void (*finish)(double *p); // of one channel; NULL: nothing more
} form;

static void finish_blinn_phong(double *p) {
    const double n = p[2];
    p[1] *= 4 * (n + exp2(-n / 2)) / (n + 4);
}

static void finish_lafortune(double *p) {
    const double largest = fmax(fabs(p[2]), fabs(p[4]));
    p[1] *= (p[5] + 2) / (2 * GONIO_PI);
    for (int k = 2; k <= 4; k++) {
        p[k] /= largest;
    }
}

extern const gonio_formula gonio_formula_sgd, gonio_formula_ward, gonio_formula_blinn_phong, gonio_formula_ngan,
    gonio_formula_lafortune;

#define DIFFUSE                                                                                                        \
    { "diffuse", 0 }
#define ALBEDO                                                                                                         \
    { "albedo", 0 }
static const form forms[] = {
    {"sgd",
     "bagher_sgd.fit",
     &gonio_formula_sgd,
     {DIFFUSE,
      ALBEDO,
      {"alpha", 0},
      {"p", 0},
      {"eta", 0},
      {"eta", 1},
      {"K", 0},
      {"Lambda", 0},
      {"c", 0},
      {"k", 0},
      {"theta0", 0}},
     NULL},
    {"ngan-ward", "ngan_ward.fit", &gonio_formula_ward, {DIFFUSE, ALBEDO, {"roughness", 0}, {"roughness", 0}}, NULL},
    {"ngan-blinn-phong",
     "ngan_blinnphong.fit",
     &gonio_formula_blinn_phong,
     {DIFFUSE, ALBEDO, {"sharpness", 0}},
     finish_blinn_phong},
    {"ngan-cook-torrance",
     "ngan_cooktorrance.fit",
     &gonio_formula_ngan,
     {DIFFUSE, ALBEDO, {"roughness", 0}, {"eta", 0}},
     NULL},
    {"ngan-lafortune",
     "ngan_lafortune.fit",
     &gonio_formula_lafortune,
     {DIFFUSE, ALBEDO, {"Cxy", 0}, {"Cxy", 0}, {"Cz", 0}, {"sharpness", 0}},
     finish_lafortune},
};
#define FORMS (sizeof forms / sizeof *forms)

static const form *form_of(const char *spec) {
    for (size_t k = 0; k < FORMS; k++) {
        const size_t length = strlen(forms[k].name);
        if (strncmp(spec, forms[k].name, length) == 0 && spec[length] == ':') {
            return &forms[k];
        }
    }
    return NULL;
}

bool gonio_published_is(const char *spec) { return form_of(spec) != NULL && strchr(spec, '=') == NULL; }

// "key = " in a line, not a part of another key.
static const char *find_key(const char *text, const char *key) {
    const size_t length = strlen(key);
    for (const char *at = strstr(text, key); at != NULL; at = strstr(at + 1, key)) {
        if ((at[-1] == '(' || at[-1] == ' ') && strncmp(at + length, " = ", 3) == 0) {
            return at + length + 3;
        }
    }
    return NULL;
}

// The three numbers of a list behind a key, or one for all.
static bool parse(const char *text, const char *key, int list, double values[CHANNELS]) {
    const char *at = find_key(text, key);
    for (int skip = 0; at != NULL && skip < list; skip++) {
        at = strchr(at, ']');
        at = at != NULL ? strchr(at, '[') : NULL;
    }
    if (at == NULL) {
        return false;
    }
    const bool many = *at == '[';
    at += strspn(at, "[");
    for (int c = 0; c < CHANNELS; c++) {
        char *end;
        values[c] = c > 0 && !many ? values[0] : gonio_number_parse(at, &end);
        if (c == 0 || many) {
            if (end == at || !isfinite(values[c])) {
                return false;
            }
            at = end + strspn(end, ", ");
        }
    }
    return true;
}

static bool fill(const form *f, const char *line, double *parameters) {
    const char *body = strstr(line, "), "); // behind the diffuse part
    if (body == NULL) {
        return false;
    }
    for (int k = 0; k < f->formula->n; k++) {
        double values[CHANNELS];
        const bool diffuse = strcmp(f->from[k].key, "diffuse") == 0;
        if (!parse(diffuse ? line : body + 1, diffuse ? "albedo" : f->from[k].key, f->from[k].list, values)) {
            return false;
        }
        for (int c = 0; c < CHANNELS; c++) {
            parameters[c * f->formula->n + k] = values[c];
        }
    }
    for (int c = 0; c < CHANNELS && f->finish != NULL; c++) {
        f->finish(parameters + c * f->formula->n);
    }
    return true;
}

// The line of the material; line 0: there is none, and `names` has the first of those that there are.
static long find_line(FILE *file, const char *name, char *line, char *names, size_t size) {
    const size_t length = strlen(name);
    names[0] = 0;
    for (long number = 1; fgets(line, LINE_MAX_BYTES, file) != NULL; number++) {
        if (strncmp(line, name, length) == 0 && strncmp(line + length, " = ", 3) == 0) {
            return number;
        }
        const size_t used = strlen(names), word = strcspn(line, " ");
        if (line[0] != '#' && used + word + 3 < size) {
            snprintf(names + used, size - used, "%s%.*s", used > 0 ? ", " : "", (int)word, line);
        }
    }
    return 0;
}

gonio_status gonio_published_open(const char *spec, gonio_model **out, gonio_error *error) {
    *out = NULL;
    const form *f = form_of(spec);
    const char *name = strchr(spec, ':') + 1, *folder = getenv("GONIO_DATA");
    char path[4096], line[LINE_MAX_BYTES], names[300];
    if (folder == NULL) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "%s: the published fits are looked for in $GONIO_DATA/fits/%s, and "
                          "GONIO_DATA is not set",
                          f->name, f->file);
    }
    snprintf(path, sizeof path, "%s/fits/%s", folder, f->file);
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot open it: %s", strerror(errno));
    }
    const long number = find_line(file, name, line, names, sizeof names);
    fclose(file);
    if (number == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "%s: no material '%s'; there are %s ..", f->name, name, names);
    }
    double parameters[CHANNELS * GONIO_FORMULA_PARAMETERS_MAX];
    if (!fill(f, line, parameters)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, number, "not a fit of '%s' in three channels", f->name);
    }
    const gonio_analytic_term term = {f->formula, parameters};
    return gonio_analytic_new(&term, 1, CHANNELS, NULL, out, error);
}
