// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "analytic": sums of terms, each a formula with its parameters.
#include "brdf/kind/analytic.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/kind.h"

typedef struct analytic_model {
    gonio_model head;
    int n_terms;
    gonio_analytic_term terms[GONIO_ANALYTIC_TERMS_MAX]; // their parameters point into `parameters`
    bool shared[GONIO_ANALYTIC_TERMS_MAX];               // see is_shared
    char (*names)[32];
    size_t count;
    double *parameters;
    double *sigmas; // of each parameter; NULL: unknown
    int n_proposals;
    gonio_proposal proposals[GONIO_PROPOSALS_MAX]; // of all terms and channels, to draw directions from
} analytic_model;
_Static_assert(GONIO_ANALYTIC_TERMS_MAX *GONIO_FORMULA_PROPOSALS_MAX <= GONIO_PROPOSALS_MAX, "room for every term");

// Do all channels have the same shapes, so that they differ by strengths alone?
static bool is_shared(const gonio_analytic_term *term, int channels) {
    const gonio_formula *formula = term->formula;
    bool same = channels > 1 && !formula->absolute; // one channel alone is quicker by its value
    for (int k = 0; k < formula->n && same; k++) {
        const bool shape = (formula->linear & GONIO_LINEAR(k)) == 0;
        for (int c = 1; c < channels && shape && same; c++) {
            same = term->parameters[c * formula->n + k] == term->parameters[k];
        }
    }
    return same;
}

// One lobe for all channels: f_r is the sum of strengths times its derivatives by them. Of channels first..first + n -
// 1, added to values; every channel is summed in the same order, however many are asked for.
static void add_shared(const gonio_analytic_term *term, const gonio_lobe_geometry *g, int first, int n,
                       double *values) {
    const gonio_formula *formula = term->formula;
    double d[GONIO_FORMULA_PARAMETERS_MAX];
    formula->slope(g, term->parameters, d);
    for (int k = 0; k < formula->n; k++) {
        for (int c = 0; c < n && (formula->linear & GONIO_LINEAR(k)) != 0; c++) {
            values[c] += term->parameters[(first + c) * formula->n + k] * d[k];
        }
    }
}

static void add_terms(const analytic_model *m, gonio_vec3 wi, gonio_vec3 wo, int first, int n, double *values) {
    const gonio_lobe_geometry g = gonio_lobe_geometry_of(wi, wo);
    memset(values, 0, (size_t)n * sizeof *values);
    for (int t = 0; t < m->n_terms; t++) {
        const gonio_analytic_term *term = &m->terms[t];
        if (m->shared[t]) {
            add_shared(term, &g, first, n, values);
            continue;
        }
        for (int c = 0; c < n; c++) {
            values[c] += term->formula->value(&g, term->parameters + (ptrdiff_t)(first + c) * term->formula->n);
        }
    }
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    add_terms((const analytic_model *)model, wi, wo, 0, model->channels, values);
}

static double eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    double value;
    add_terms((const analytic_model *)model, wi, wo, channel, 1, &value);
    return value;
}

static double sample(const gonio_model *model, gonio_vec3 wi, const double u[2], gonio_vec3 *wo) {
    const analytic_model *m = (const analytic_model *)model;
    return gonio_proposals_sample(m->proposals, m->n_proposals, wi, u, wo);
}

static double pdf(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    const analytic_model *m = (const analytic_model *)model;
    return gonio_proposals_pdf(m->proposals, m->n_proposals, wi, wo);
}

static void release(gonio_model *model) {
    analytic_model *m = (analytic_model *)model;
    free(m->parameters);
    free(m->sigmas);
    free(m->names);
    free(m);
}

// ---- the model file's section: the description, every parameter, perhaps their sigmas (docs/formats.md) ----

typedef struct description {
    uint32_t n_terms, has_sigmas;
    struct {
        char formula[GONIO_FORMULA_FILE_NAME_MAX]; // zero-filled
    } terms[GONIO_ANALYTIC_TERMS_MAX];
} description;
_Static_assert(sizeof(description) == 8 + 16 * GONIO_ANALYTIC_TERMS_MAX, "the description is written as it stands");

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const analytic_model *m = (const analytic_model *)model;
    description about = {.n_terms = (uint32_t)m->n_terms, .has_sigmas = m->sigmas != NULL};
    for (int t = 0; t < m->n_terms; t++) {
        strncpy(about.terms[t].formula, m->terms[t].formula->name, sizeof about.terms[t].formula - 1);
    }
    const gonio_file_part parts[3] = {{&about, sizeof about},
                                      {m->parameters, m->count * sizeof *m->parameters},
                                      {m->sigmas, m->count * sizeof *m->parameters}};
    return gonio_model_file_write(model, stream, parts, m->sigmas != NULL ? 3 : 2, error);
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0, count = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    if (about == NULL || about->n_terms < 1 || about->n_terms > GONIO_ANALYTIC_TERMS_MAX || about->has_sigmas > 1) {
        return gonio_mapped_fail(mapped, 0, "expected 1 to 8 terms of an analytic model", error);
    }
    gonio_analytic_term terms[GONIO_ANALYTIC_TERMS_MAX];
    for (uint32_t t = 0; t < about->n_terms; t++) {
        terms[t].formula = gonio_formula_of_file(about->terms[t].formula);
        if (terms[t].formula == NULL) {
            return gonio_mapped_fail(mapped, 0, "an unknown kind of analytic BRDF", error);
        }
        count += (size_t)mapped->channels * (size_t)terms[t].formula->n;
    }
    const size_t begin = at;
    const double *parameters = gonio_mapped_take(mapped, &at, count * sizeof *parameters), *sigmas = NULL;
    if (parameters != NULL && about->has_sigmas != 0) {
        sigmas = gonio_mapped_take(mapped, &at, count * sizeof *sigmas);
    }
    if (parameters == NULL || (about->has_sigmas != 0 && sigmas == NULL)) {
        return gonio_mapped_fail(mapped, begin, "fewer parameters than its terms and channels need", error);
    }
    for (uint32_t t = 0; t < about->n_terms; t++) {
        terms[t].parameters = parameters;
        parameters += (size_t)mapped->channels * (size_t)terms[t].formula->n;
    }
    if (gonio_analytic_new(terms, (int)about->n_terms, mapped->channels, mapped->names, out, error) != GONIO_OK) {
        return gonio_mapped_fail(mapped, begin, "a parameter is outside its bounds", error);
    }
    if (sigmas != NULL && gonio_analytic_set_sigmas(*out, sigmas, error) != GONIO_OK) {
        gonio_model_free(*out);
        *out = NULL;
        return gonio_mapped_fail(mapped, begin, "a parameter's sigma is negative, or there is no memory for it", error);
    }
    gonio_mapped_release(mapped); // everything was copied
    *mapped = (gonio_mapped){0};
    return GONIO_OK;
}

static const gonio_model_ops ops = {
    .kind = "analytic",
    .save = save,
    .eval = eval,
    .eval_channel = eval_channel,
    .sample = sample,
    .pdf = pdf,
    .free = release,
};

static gonio_status check_term(const gonio_analytic_term *term, int channels, gonio_error *error) {
    const gonio_formula *formula = term->formula;
    for (int c = 0; c < channels; c++) {
        for (int k = 0; k < formula->n; k++) {
            const gonio_formula_parameter *p = &formula->parameters[k];
            const double value = term->parameters[c * formula->n + k];
            const bool strength = !formula->absolute && (formula->linear & GONIO_LINEAR(k)) != 0;
            if (!(value >= p->minimum && value <= (strength ? GONIO_STRENGTH_MAX : p->maximum))) {
                return gonio_fail(error, GONIO_E_RANGE, "%s: %s=%g; expected %g to %g (%s)", formula->name, p->name,
                                  value, p->minimum, p->maximum, p->text);
            }
        }
    }
    return GONIO_OK;
}

// What one term's channels propose: the same shapes, each of the channels' mean strength. Of different widths it takes
// the widest, beyond which no channel's lobe reaches; a power's exponent is a width's inverse.
static int propose(const gonio_analytic_term *term, int channels, gonio_proposal *out) {
    const gonio_formula *formula = term->formula;
    int n = 0;
    for (int c = 0; c < channels; c++) {
        gonio_proposal one[GONIO_FORMULA_PROPOSALS_MAX];
        n = formula->proposals != NULL ? formula->proposals(term->parameters + (ptrdiff_t)c * formula->n, one)
                                       : gonio_proposals_standard(one);
        for (int k = 0; k < n; k++) {
            one[k].strength /= channels;
            if (c > 0) {
                const bool power = one[k].shape == GONIO_PROPOSE_POWER;
                one[k].alpha_x = (power ? fmin : fmax)(one[k].alpha_x, out[k].alpha_x);
                one[k].alpha_y = (power ? fmin : fmax)(one[k].alpha_y, out[k].alpha_y);
                one[k].strength += out[k].strength;
            }
            out[k] = one[k];
        }
    }
    return n;
}

static void set_name(char name[32], int channel, int channels) {
    if (channels == 1) {
        snprintf(name, 32, "value");
    } else if (channels == 3) {
        snprintf(name, 32, "%c", "rgb"[channel]);
    } else {
        snprintf(name, 32, "c%d", channel + 1);
    }
}

// Copy terms, names and parameters into m, whose arrays are allocated.
static void fill(analytic_model *m, const gonio_analytic_term *terms, int n_terms, int channels,
                 const char (*names)[32]) {
    m->n_terms = n_terms;
    m->head.isotropic = true;
    double *at = m->parameters;
    for (int t = 0; t < n_terms; t++) {
        const gonio_formula *formula = terms[t].formula;
        const size_t count = (size_t)channels * (size_t)formula->n;
        memcpy(at, terms[t].parameters, count * sizeof *at);
        m->terms[t] = (gonio_analytic_term){formula, at};
        m->shared[t] = is_shared(&m->terms[t], channels);
        for (int c = 0; c < channels && formula->isotropic != NULL; c++) {
            m->head.isotropic = m->head.isotropic && formula->isotropic(at + c * formula->n);
        }
        at += count;
        m->n_proposals += propose(&m->terms[t], channels, m->proposals + m->n_proposals);
    }
    for (int c = 0; c < channels; c++) {
        if (names != NULL) {
            memcpy(m->names[c], names[c], sizeof m->names[c]);
        } else {
            set_name(m->names[c], c, channels);
        }
    }
    m->head.ops = &ops;
    m->head.channels = channels;
    m->head.channel_names = (const char(*)[32])m->names;
    m->head.control_points = m->count / (size_t)channels;
    m->head.bytes = m->count * sizeof *m->parameters;
}

gonio_status gonio_analytic_new(const gonio_analytic_term *terms, int n_terms, int channels, const char (*names)[32],
                                gonio_model **out, gonio_error *error) {
    *out = NULL;
    if (n_terms < 1 || n_terms > GONIO_ANALYTIC_TERMS_MAX || channels < 1 || channels > 1024) {
        return gonio_fail(error, GONIO_E_RANGE, "%d terms of %d channels; 1 to %d terms of 1 to 1024 are possible",
                          n_terms, channels, GONIO_ANALYTIC_TERMS_MAX);
    }
    size_t count = 0;
    for (int t = 0; t < n_terms; t++) {
        const gonio_status status = check_term(&terms[t], channels, error);
        if (status != GONIO_OK) {
            return status;
        }
        count += (size_t)channels * (size_t)terms[t].formula->n;
    }
    analytic_model *m = calloc(1, sizeof *m);
    if (m != NULL) {
        m->count = count;
        m->parameters = malloc(count * sizeof *m->parameters);
        m->names = calloc((size_t)channels, sizeof *m->names);
    }
    if (m == NULL || m->parameters == NULL || m->names == NULL) {
        if (m != NULL) {
            release(&m->head);
        }
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for an analytic model");
    }
    fill(m, terms, n_terms, channels, names);
    *out = &m->head;
    return GONIO_OK;
}

int gonio_analytic_terms(const gonio_model *model, const gonio_analytic_term **terms) {
    const bool is = model->ops == &ops;
    *terms = is ? ((const analytic_model *)model)->terms : NULL;
    return is ? ((const analytic_model *)model)->n_terms : 0;
}

double *gonio_analytic_parameters(gonio_model *model, size_t *count) {
    analytic_model *m = model->ops == &ops ? (analytic_model *)model : NULL;
    *count = m != NULL ? m->count : 0;
    return m != NULL ? m->parameters : NULL;
}

gonio_status gonio_analytic_set_sigmas(gonio_model *model, const double *sigmas, gonio_error *error) {
    analytic_model *m = (analytic_model *)model;
    for (size_t k = 0; k < m->count; k++) {
        if (!(sigmas[k] >= 0)) {
            return gonio_fail(error, GONIO_E_RANGE, "a sigma of %g; expected 0 or more, or infinity", sigmas[k]);
        }
    }
    if (m->sigmas == NULL && (m->sigmas = malloc(m->count * sizeof *sigmas)) == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for an analytic model");
    }
    memcpy(m->sigmas, sigmas, m->count * sizeof *sigmas);
    return GONIO_OK;
}

const double *gonio_analytic_sigmas(const gonio_model *model) {
    return model->ops == &ops ? ((const analytic_model *)model)->sigmas : NULL;
}

const gonio_kind gonio_kind_analytic = {
    .name = "analytic",
    .summary = "a sum of analytic formulae, each channel with its own parameters",
    .ops = &ops,
    .read = read_model,
};
