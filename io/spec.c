// SPDX-License-Identifier: BSD-3-Clause
// "FORMULA:..." -> an analytic model; "sgd:NAME" and the like -> a published fit; "SPEC|SPEC" -> a thin sheet's halves,
// reflection first; "translucent:..." -> a sheet with two like faces; "file:PATH" -> a model file or a measured table.
// Each may be followed by keys of the sample's body, which the simulator takes and which mean nothing to a BRDF.
#include "io/spec.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "brdf/kind/analytic.h"
#include "gonio/io.h"
#include "io/published.h"

char *gonio_spec_take_body(char *text, const char **key) {
    static const char *const keys[] = {"shape", "radius_mm", "plate_mm"};
    char *comma = strrchr(text, ','), *start = comma != NULL ? comma : strchr(text, ':');
    for (size_t k = 0; start != NULL && k < sizeof keys / sizeof *keys; k++) {
        const size_t length = strlen(keys[k]);
        if (strncmp(start + 1, keys[k], length) == 0 && start[1 + length] == '=') {
            *key = keys[k];
            *start = 0;
            return start + 2 + length;
        }
    }
    return NULL;
}

static gonio_status check_body(const char *key, const char *value, gonio_error *error) {
    if (strcmp(key, "shape") == 0) {
        const bool known = strcmp(value, "flat") == 0 || strcmp(value, "sphere") == 0;
        return known ? GONIO_OK : gonio_fail(error, GONIO_E_USAGE, "shape=%s; expected flat or sphere", value);
    }
    char *end;
    const double mm = gonio_number_parse(value, &end);
    return end != value && *end == 0 && mm > 0 && mm <= 1e5
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE, "%s=%s; expected a number above 0, up to 100000", key, value);
}

static gonio_status parse_formula(const char *text, gonio_model **out, gonio_error *error) {
    return gonio_published_is(text) ? gonio_published_open(text, out, error)
                                    : gonio_analytic_from_spec(text, out, error);
}

// ---- thin sheets ----

// The same in `channels` channels, where it has one.
static gonio_status widen(gonio_model **model, int channels, gonio_error *error) {
    const gonio_analytic_term *terms;
    gonio_analytic_term wide[GONIO_ANALYTIC_TERMS_MAX];
    const int n = *model != NULL && (*model)->channels == 1 ? gonio_analytic_terms(*model, &terms) : 0;
    double *numbers =
        malloc((size_t)channels * GONIO_ANALYTIC_TERMS_MAX * GONIO_FORMULA_PARAMETERS_MAX * sizeof *numbers);
    if (n == 0 || channels == 1 || numbers == NULL) {
        free(numbers);
        return numbers != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a sheet");
    }
    double *to = numbers;
    for (int t = 0; t < n; t++) {
        const size_t count = (size_t)terms[t].formula->n;
        wide[t] = (gonio_analytic_term){terms[t].formula, to};
        for (int c = 0; c < channels; c++, to += count) {
            memcpy(to, terms[t].parameters, count * sizeof *to);
        }
    }
    gonio_model *made;
    const gonio_status status = gonio_analytic_new(wide, n, channels, NULL, &made, error);
    free(numbers);
    if (status == GONIO_OK) {
        gonio_model_free(*model);
        *model = made;
    }
    return status;
}

// "SPEC|SPEC|SPEC|SPEC": the halves in their order, of which any may be left out.
static gonio_status parse_halves(char *text, gonio_model **out, gonio_error *error) {
    gonio_model *models[GONIO_HALVES] = {NULL};
    gonio_status status = GONIO_OK;
    int h = 0, channels = 1;
    for (char *item; status == GONIO_OK && (item = strsep(&text, "|")) != NULL; h++) {
        if (h == GONIO_HALVES) {
            status = gonio_fail(error, GONIO_E_USAGE, "more than %d halves of a sheet", GONIO_HALVES);
        } else if (item[0] != 0) {
            status = parse_formula(item, &models[h], error);
            channels = status == GONIO_OK && models[h]->channels > channels ? models[h]->channels : channels;
        }
    }
    for (h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        status = widen(&models[h], channels, error);
    }
    status = status == GONIO_OK ? gonio_model_of_halves(models, out, error) : status;
    for (h = 0; h < GONIO_HALVES && status != GONIO_OK; h++) {
        gonio_model_free(models[h]);
    }
    return status;
}

// A sheet with two like faces: on either side a diffuse part and a lobe, about the mirror direction and about the way
// straight through.
enum { SHEET_RHO, SHEET_RHO_S, SHEET_TAU, SHEET_TAU_S, SHEET_ALPHA, SHEET_ALPHA_T, SHEET_KEYS };
static const char *const sheet_keys[SHEET_KEYS] = {"rho", "rho_s", "tau", "tau_s", "alpha", "alpha_t"};

// What leaves the sheet can be no more than what arrives: the sum over the first four keys, a channel each.
static gonio_status check_sheet(const char *const values[SHEET_KEYS], gonio_error *error) {
    enum { MOST = 64 };
    double sums[MOST] = {0};
    for (int k = 0; k <= SHEET_TAU_S; k++) {
        const char *at = values[k];
        double value = 0;
        for (int c = 0; c < MOST; c++) {
            char *end = NULL;
            if (at != NULL) {
                value = gonio_number_parse(at, &end);
                at = *end == '/' ? end + 1 : NULL; // the last stands for the channels behind it; the terms check it
            }
            sums[c] += value;
        }
    }
    for (int c = 0; c < MOST; c++) {
        if (!(sums[c] <= 1)) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "translucent: rho + rho_s + tau + tau_s = %g in channel %d; expected at most 1", sums[c],
                              c + 1);
        }
    }
    return GONIO_OK;
}

static gonio_status parse_sheet(char *text, gonio_model **out, gonio_error *error) {
    const char *values[SHEET_KEYS] = {"0", "0", "0", "0", "0.2", NULL};
    char *rest;
    for (char *item = strtok_r(text, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        char *equals = strchr(item, '=');
        const size_t length = equals != NULL ? (size_t)(equals - item) : 0;
        int k = 0;
        while (k < SHEET_KEYS && (strncmp(sheet_keys[k], item, length) != 0 || sheet_keys[k][length] != 0)) {
            k++;
        }
        if (equals == NULL || k == SHEET_KEYS) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "translucent: '%s'; expected rho, rho_s, tau, tau_s, alpha or alpha_t=NUMBER", item);
        }
        values[k] = equals + 1;
    }
    values[SHEET_ALPHA_T] = values[SHEET_ALPHA_T] != NULL ? values[SHEET_ALPHA_T] : values[SHEET_ALPHA];
    gonio_status status = check_sheet(values, error);
    char *halves = NULL;
    if (status == GONIO_OK && asprintf(&halves,
                                       "ward:rho_d=%s,rho_s=%s,alpha=%s|ward:rho_d=%s,rho_s=%s,alpha=%s|"
                                       "ward:rho_d=%s,rho_s=%s,alpha=%s|ward:rho_d=%s,rho_s=%s,alpha=%s",
                                       values[0], values[1], values[4], values[2], values[3], values[5], values[0],
                                       values[1], values[4], values[2], values[3], values[5]) < 0) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a sheet");
        halves = NULL;
    }
    status = status == GONIO_OK ? parse_halves(halves, out, error) : status;
    free(halves);
    return status;
}

static gonio_status parse(char *text, gonio_model **out, gonio_error *error) {
    const char *key;
    for (const char *value; (value = gonio_spec_take_body(text, &key)) != NULL;) {
        const gonio_status status = check_body(key, value, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    if (strncmp(text, "translucent:", 12) == 0) {
        return parse_sheet(text + 12, out, error);
    }
    if (strncmp(text, "file:", 5) != 0 && strcmp(text, "file") != 0) {
        return strchr(text, '|') != NULL ? parse_halves(text, out, error) : parse_formula(text, out, error);
    }
    const char *path = text + strlen("file") + (text[4] == ':');
    if (path[0] == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "file: the path is missing");
    }
    return gonio_model_file_is(path) ? gonio_model_open(path, out, error) : gonio_read_table(path, out, error);
}

gonio_status gonio_model_from_spec(const char *spec, gonio_model **out, gonio_error *error) {
    *out = NULL;
    char *text = strdup(spec);
    if (text == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a spec");
    }
    const gonio_status status = parse(text, out, error);
    free(text);
    return status;
}
