// SPDX-License-Identifier: BSD-3-Clause
// "FORMULA:key=value,key=a/b/c+FORMULA:..." -> an analytic model.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "brdf/kind/analytic.h"

#define CHANNELS_MAX 64 // of a tuple a/b/c...

// One term while it is read: a value a channel for each parameter, with the count that was given (0: none yet).
typedef struct term_text {
    const gonio_formula *formula;
    double values[GONIO_FORMULA_PARAMETERS_MAX][CHANNELS_MAX];
    int given[GONIO_FORMULA_PARAMETERS_MAX];
} term_text;

typedef struct spec_text {
    term_text terms[GONIO_ANALYTIC_TERMS_MAX];
    int n_terms;
} spec_text;

static void append(char *text, size_t size, const char *more) {
    const size_t used = strlen(text);
    snprintf(text + used, size - used, "%s", more);
}

static gonio_status unknown_formula(const char *found, gonio_error *error) {
    char list[512] = "";
    for (const gonio_formula *const *k = gonio_formulae(); *k != NULL; k++) {
        append(list, sizeof list, (*k)->name);
        append(list, sizeof list, ", ");
    }
    return gonio_fail(error, GONIO_E_USAGE, "unknown BRDF '%s'; expected one of %stranslucent, file:PATH", found, list);
}

static gonio_status unknown_key(const gonio_formula *formula, const char *found, gonio_error *error) {
    char list[512] = "";
    for (int k = 0; k < formula->n; k++) {
        append(list, sizeof list, formula->parameters[k].name);
        append(list, sizeof list, ", ");
    }
    if (formula->alias.name != NULL) {
        append(list, sizeof list, formula->alias.name);
        append(list, sizeof list, ", ");
    }
    return gonio_fail(error, GONIO_E_USAGE,
                      "%s: unknown key '%s'; expected one of %sat the end also shape, radius_mm, plate_mm",
                      formula->name, found, list);
}

// "a/b/c" -> values; returns how many, 0 where the text is no such list.
static int parse_tuple(const char *text, double *values) {
    int n = 0;
    for (;;) {
        char *end;
        const double value = gonio_number_parse(text, &end);
        if (end == text || !isfinite(value) || n == CHANNELS_MAX) {
            return 0;
        }
        values[n++] = value;
        if (*end == 0) {
            return n;
        }
        if (*end != '/') {
            return 0;
        }
        text = end + 1;
    }
}

static gonio_status set_parameter(term_text *term, int k, double scale, const double *values, int n,
                                  gonio_error *error) {
    const gonio_formula_parameter *p = &term->formula->parameters[k];
    if (term->given[k] > 0) {
        return gonio_fail(error, GONIO_E_USAGE, "%s: %s is given twice", term->formula->name, p->name);
    }
    for (int c = 0; c < n; c++) {
        const double value = values[c] * scale;
        if (!(value >= p->minimum && value <= p->maximum)) {
            return gonio_fail(error, GONIO_E_USAGE, "%s: %s=%g; expected %g to %g (%s)", term->formula->name, p->name,
                              value, p->minimum, p->maximum, p->text);
        }
        term->values[k][c] = value;
    }
    term->given[k] = n;
    return GONIO_OK;
}

static gonio_status set_key(term_text *term, const char *key, const char *text, gonio_error *error) {
    const gonio_formula *formula = term->formula;
    double values[CHANNELS_MAX];
    int first = -1, last = -1;
    double scale = 1;
    for (int k = 0; k < formula->n; k++) {
        if (strcmp(formula->parameters[k].name, key) == 0) {
            first = last = k;
        }
    }
    if (formula->alias.name != NULL && strcmp(formula->alias.name, key) == 0) {
        first = formula->alias.first;
        last = formula->alias.last;
        scale = formula->alias.scale;
    }
    if (first < 0) {
        return unknown_key(formula, key, error);
    }
    const int n = parse_tuple(text, values);
    if (n == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "%s: %s=%s; expected a number, or one a channel as 0.3/0.2/0.1",
                          formula->name, key, text);
    }
    gonio_status status = GONIO_OK;
    for (int k = first; k <= last && status == GONIO_OK; k++) {
        status = set_parameter(term, k, scale, values, n, error);
    }
    return status;
}

// "key=value,key=value" of one term; text is cut up.
static gonio_status parse_keys(term_text *term, char *text, gonio_error *error) {
    char *rest;
    for (char *item = strtok_r(text, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        char *equals = strchr(item, '=');
        if (equals == NULL) {
            return gonio_fail(error, GONIO_E_USAGE, "%s: '%s'; expected key=value", term->formula->name, item);
        }
        *equals = 0;
        const gonio_status status = set_key(term, item, equals + 1, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    for (int k = 0; k < term->formula->n; k++) {
        const gonio_formula_parameter *p = &term->formula->parameters[k];
        if (term->given[k] == 0 && isnan(p->initial)) {
            return gonio_fail(error, GONIO_E_USAGE, "%s: %s is missing (%s)", term->formula->name, p->name, p->text);
        }
        if (term->given[k] == 0) {
            term->given[k] = 1;
            term->values[k][0] = p->initial;
        }
    }
    return GONIO_OK;
}

static gonio_status parse_term(spec_text *spec, char *text, gonio_error *error) {
    if (spec->n_terms == GONIO_ANALYTIC_TERMS_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "more than %d terms", GONIO_ANALYTIC_TERMS_MAX);
    }
    char *colon = strchr(text, ':');
    if (colon != NULL) {
        *colon = 0;
    }
    term_text *term = &spec->terms[spec->n_terms++];
    term->formula = gonio_formula_find(text);
    if (term->formula == NULL) {
        return unknown_formula(text, error);
    }
    return parse_keys(term, colon != NULL ? colon + 1 : text + strlen(text), error);
}

// A '+' joins two terms where a letter follows; in a number ("1e+3") a digit does.
static char *next_term(char *text) {
    for (char *plus = strchr(text, '+'); plus != NULL; plus = strchr(plus + 1, '+')) {
        if (plus[1] >= 'a' && plus[1] <= 'z') {
            return plus;
        }
    }
    return NULL;
}

// The common length of the tuples; single numbers stand for every channel.
static gonio_status count_channels(const spec_text *spec, int *channels, gonio_error *error) {
    *channels = 1;
    for (int t = 0; t < spec->n_terms; t++) {
        for (int k = 0; k < spec->terms[t].formula->n; k++) {
            const int n = spec->terms[t].given[k];
            if (n > 1 && *channels > 1 && n != *channels) {
                return gonio_fail(error, GONIO_E_USAGE, "%s: %s has %d values, another key has %d",
                                  spec->terms[t].formula->name, spec->terms[t].formula->parameters[k].name, n,
                                  *channels);
            }
            *channels = n > *channels ? n : *channels;
        }
    }
    return GONIO_OK;
}

static gonio_status build(const spec_text *spec, gonio_model **out, gonio_error *error) {
    int channels;
    gonio_status status = count_channels(spec, &channels, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t stride = CHANNELS_MAX * GONIO_FORMULA_PARAMETERS_MAX;
    double *parameters = calloc((size_t)spec->n_terms * stride, sizeof *parameters);
    if (parameters == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for an analytic model");
    }
    gonio_analytic_term terms[GONIO_ANALYTIC_TERMS_MAX];
    for (int t = 0; t < spec->n_terms; t++) {
        const term_text *text = &spec->terms[t];
        double *to = parameters + (size_t)t * stride;
        terms[t] = (gonio_analytic_term){text->formula, to};
        for (int c = 0; c < channels; c++) {
            for (int k = 0; k < text->formula->n; k++) {
                *to++ = text->values[k][text->given[k] > 1 ? c : 0];
            }
        }
    }
    status = gonio_analytic_new(terms, spec->n_terms, channels, NULL, out, error);
    free(parameters);
    return status;
}

static gonio_status parse_terms(char *text, spec_text *spec, gonio_model **model, gonio_error *error) {
    for (char *term = text; term != NULL;) {
        char *next = next_term(term);
        if (next != NULL) {
            *next++ = 0;
        }
        const gonio_status status = parse_term(spec, term, error);
        if (status != GONIO_OK) {
            return status;
        }
        term = next;
    }
    return build(spec, model, error);
}

gonio_status gonio_analytic_from_spec(const char *spec, gonio_model **out, gonio_error *error) {
    *out = NULL;
    char *text = strdup(spec);
    spec_text *parsed = calloc(1, sizeof *parsed);
    const gonio_status status = text != NULL && parsed != NULL
                                    ? parse_terms(text, parsed, out, error)
                                    : gonio_fail(error, GONIO_E_MEMORY, "no memory for a spec");
    free(parsed);
    free(text);
    return status;
}
