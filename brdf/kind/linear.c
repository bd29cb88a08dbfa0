// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/kind/linear.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct linear_model {
    gonio_model head;
    const gonio_linear_basis *basis;
    int order, terms;
    double *coefficients; // [channels][terms]
    float *matrix;        // [terms][terms]; NULL: without uncertainty
    double *factors;      // [channels]
    char (*names)[32];
} linear_model;

static double sum(const linear_model *m, const double *row, int channel) {
    const double *a = m->coefficients + (ptrdiff_t)channel * m->terms;
    double value = 0;
    for (int k = 0; k < m->terms; k++) {
        value += a[k] * row[k];
    }
    return value;
}

void gonio_linear_eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const linear_model *m = (const linear_model *)model;
    double row[GONIO_LINEAR_TERMS_MAX];
    m->basis->row(m->order, model->isotropic, wi, wo, row);
    for (int c = 0; c < model->channels; c++) {
        values[c] = sum(m, row, c);
    }
}

double gonio_linear_eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    const linear_model *m = (const linear_model *)model;
    double row[GONIO_LINEAR_TERMS_MAX];
    m->basis->row(m->order, model->isotropic, wi, wo, row);
    return sum(m, row, channel);
}

void gonio_linear_sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *sigma) {
    const linear_model *m = (const linear_model *)model;
    double row[GONIO_LINEAR_TERMS_MAX], square = 0;
    m->basis->row(m->order, model->isotropic, wi, wo, row);
    for (int j = 0; j < m->terms; j++) {
        const float *at = m->matrix + (ptrdiff_t)j * m->terms;
        double part = 0;
        for (int k = 0; k < m->terms; k++) {
            part += (double)at[k] * row[k];
        }
        square += part * part;
    }
    for (int c = 0; c < model->channels; c++) {
        sigma[c] = m->factors[c] * sqrt(square);
    }
}

void gonio_linear_free(gonio_model *model) {
    linear_model *m = (linear_model *)model;
    free(m->coefficients);
    free(m->matrix);
    free(m->factors);
    free(m->names);
    free(m);
}

gonio_status gonio_linear_new(const gonio_linear_basis *basis, int order, bool isotropic, int channels,
                              const double *coefficients, const gonio_linear_spread *spread, const char (*names)[32],
                              gonio_model **out, gonio_error *error) {
    *out = NULL;
    if (order < basis->order_min || order > basis->order_max[isotropic]) {
        return gonio_fail(error, GONIO_E_RANGE, "order %d of a model of kind '%s'; %d to %d are possible", order,
                          basis->kind->name, basis->order_min, basis->order_max[isotropic]);
    }
    const size_t terms = (size_t)basis->terms(order, isotropic), count = terms * (size_t)channels;
    linear_model *m = calloc(1, sizeof *m);
    if (m != NULL) {
        m->coefficients = malloc(count * sizeof *coefficients);
        m->names = calloc((size_t)channels, sizeof *m->names);
        m->matrix = spread != NULL ? malloc(terms * terms * sizeof *m->matrix) : NULL;
        m->factors = spread != NULL ? malloc((size_t)channels * sizeof *m->factors) : NULL;
    }
    if (m == NULL || m->coefficients == NULL || m->names == NULL ||
        (spread != NULL && (m->matrix == NULL || m->factors == NULL))) {
        if (m != NULL) {
            gonio_linear_free(&m->head);
        }
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu coefficients", count);
    }
    memcpy(m->coefficients, coefficients, count * sizeof *coefficients);
    memcpy(m->names, names, (size_t)channels * sizeof *m->names);
    if (spread != NULL) {
        memcpy(m->matrix, spread->matrix, terms * terms * sizeof *m->matrix);
        memcpy(m->factors, spread->factors, (size_t)channels * sizeof *m->factors);
    }
    m->basis = basis;
    m->order = order;
    m->terms = (int)terms;
    m->head = (gonio_model){.ops = spread != NULL ? basis->kind->ops : basis->plain,
                            .channels = channels,
                            .isotropic = isotropic,
                            .channel_names = (const char(*)[32])m->names,
                            .control_points = terms,
                            .bytes = count * sizeof *coefficients};
    *out = &m->head;
    return GONIO_OK;
}

const double *gonio_linear_coefficients(const gonio_model *model, const gonio_linear_basis *basis) {
    return model->ops == basis->kind->ops || model->ops == basis->plain ? ((const linear_model *)model)->coefficients
                                                                        : NULL;
}

// ---- the model file's section: the order, the coefficients, perhaps the spread (docs/formats.md) ----

typedef struct description {
    uint32_t order, has_spread;
} description;

gonio_status gonio_linear_save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const linear_model *m = (const linear_model *)model;
    const description about = {.order = (uint32_t)m->order, .has_spread = m->matrix != NULL};
    const size_t terms = (size_t)m->terms;
    const gonio_file_part parts[4] = {{&about, sizeof about},
                                      {m->coefficients, m->head.bytes},
                                      {m->factors, (size_t)model->channels * sizeof *m->factors},
                                      {m->matrix, terms * terms * sizeof *m->matrix}};
    return gonio_model_file_write(model, stream, parts, m->matrix != NULL ? 4 : 2, error);
}

gonio_status gonio_linear_read(const gonio_linear_basis *basis, gonio_mapped *mapped, gonio_model **out,
                               gonio_error *error) {
    size_t at = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    if (about == NULL || about->order < (uint32_t)basis->order_min ||
        about->order > (uint32_t)basis->order_max[mapped->isotropic] || about->has_spread > 1) {
        return gonio_mapped_fail(mapped, 0, "an impossible order of a linear basis", error);
    }
    const int order = (int)about->order;
    const size_t terms = (size_t)basis->terms(order, mapped->isotropic), channels = (size_t)mapped->channels;
    const size_t begin = at, count = terms * channels;
    const double *coefficients = gonio_mapped_take(mapped, &at, count * sizeof *coefficients);
    gonio_linear_spread spread = {NULL, NULL};
    if (coefficients != NULL && about->has_spread != 0) {
        spread.factors = gonio_mapped_take(mapped, &at, channels * sizeof *spread.factors);
        spread.matrix =
            spread.factors != NULL ? gonio_mapped_take(mapped, &at, terms * terms * sizeof *spread.matrix) : NULL;
    }
    if (coefficients == NULL || (about->has_spread != 0 && spread.matrix == NULL)) {
        return gonio_mapped_fail(mapped, begin, "fewer coefficients than its order and channels need", error);
    }
    // A product of one and a basis function is finite then, and so is a sum of them.
    for (size_t k = 0; k < count; k++) {
        if (!(fabs(coefficients[k]) <= 0x1p500)) {
            return gonio_mapped_fail(mapped, begin, "a coefficient is not finite", error);
        }
    }
    for (size_t c = 0; c < channels && spread.matrix != NULL; c++) {
        if (!(spread.factors[c] >= 0 && spread.factors[c] <= 0x1p500)) {
            return gonio_mapped_fail(mapped, begin, "a factor of the uncertainty is negative or not finite", error);
        }
    }
    const gonio_status status = gonio_linear_new(basis, order, mapped->isotropic, mapped->channels, coefficients,
                                                 spread.matrix != NULL ? &spread : NULL, mapped->names, out, error);
    if (status == GONIO_OK) {
        gonio_mapped_release(mapped); // everything was copied
        *mapped = (gonio_mapped){0};
    }
    return status;
}
