// SPDX-License-Identifier: BSD-3-Clause
// Drawing directions from a model: by its table, its kind's lobes, or what stands in for them.
#include <math.h>

#include "brdf/lobe_sampling.h"
#include "brdf/sampler.h"
#include "gonio/model.h"

static double sample_lobes(const gonio_model *model, gonio_vec3 wi, const double u[2], gonio_vec3 *wo) {
    if (model->ops->sample != NULL) {
        return model->ops->sample(model, wi, u, wo);
    }
    gonio_proposal proposals[GONIO_PROPOSALS_MAX];
    return gonio_proposals_sample(proposals, gonio_proposals_standard(proposals), wi, u, wo);
}

static double pdf_lobes(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    if (model->ops->pdf != NULL) {
        return model->ops->pdf(model, wi, wo);
    }
    gonio_proposal proposals[GONIO_PROPOSALS_MAX];
    return gonio_proposals_pdf(proposals, gonio_proposals_standard(proposals), wi, wo);
}

double gonio_model_sample(const gonio_model *model, gonio_vec3 wi, const double u[2], gonio_vec3 *wo, double *values) {
    const double pdf =
        model->sampler != NULL ? gonio_sampler_sample(model->sampler, wi, u, wo) : sample_lobes(model, wi, u, wo);
    if (values != NULL) {
        model->ops->eval(model, wi, *wo, values);
    }
    return pdf;
}

double gonio_model_pdf(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    return model->sampler != NULL ? gonio_sampler_pdf(model->sampler, wi, wo) : pdf_lobes(model, wi, wo);
}

// Relative variances of the albedo's estimates at wi, drawn from the table and from the lobes, by the table's draws.
static void compare(const gonio_model *model, const gonio_sampler *sampler, gonio_vec3 wi, double variance[2]) {
    enum { SIDE = 24 };
    double values[model->channels], sum = 0, squares[2] = {0};
    for (int k = 0; k < SIDE * SIDE; k++) {
        const double u[2] = {(k % SIDE + 0.5) / SIDE, (k / SIDE + 0.5) / SIDE}; // NOLINT(bugprone-integer-division)
        gonio_vec3 wo;
        const double pdf = gonio_sampler_sample(sampler, wi, u, &wo);
        double f = 0;
        gonio_model_eval(model, wi, wo, values);
        for (int c = 0; c < model->channels; c++) {
            f += fmax(values[c], 0);
        }
        const double weight = f * wo.z / pdf;
        sum += weight / (SIDE * SIDE);
        squares[0] += weight * weight / (SIDE * SIDE);
        squares[1] += weight * f * wo.z / pdf_lobes(model, wi, wo) / (SIDE * SIDE);
    }
    for (int k = 0; k < 2 && sum > 0; k++) {
        variance[k] += squares[k] / (sum * sum) - 1;
    }
}

// Mean variances of the table's and the lobes' estimates, between the table's own incident directions.
static void compare_all(const gonio_model *model, const gonio_sampler *sampler, double variance[2]) {
    enum { TILTS = 8 };
    variance[0] = variance[1] = 0;
    for (int k = 0; k < TILTS; k++) {
        compare(model, sampler, gonio_direction(0.05 + 0.19 * k, 2.4 * k), variance);
    }
    variance[0] /= TILTS;
    variance[1] /= TILTS;
}

// Of twice as many incident tilts, where f_r changes so fast with them that the first table is a poor one.
static void refine(const gonio_model *model, gonio_sampler_size size, gonio_sampler **sampler, double variance[2]) {
    double finer_variance[2];
    gonio_sampler *finer;
    size.tilts *= 2;
    if (gonio_sampler_new(model, &size, &finer, NULL) != GONIO_OK) {
        return;
    }
    compare_all(model, finer, finer_variance);
    if (finer_variance[0] < variance[0]) {
        gonio_sampler *coarse = *sampler;
        *sampler = finer;
        variance[0] = finer_variance[0];
        finer = coarse;
    }
    gonio_sampler_free(finer);
}

#define POOR 1e-3 // relative variance of one draw; of most models it is a tenth of that and less

gonio_status gonio_model_prepare_sampling(gonio_model *model, gonio_error *error) {
    if (model->sampler != NULL) {
        return GONIO_OK;
    }
    gonio_sampler *sampler;
    const gonio_sampler_size size = gonio_sampler_standard(model);
    const gonio_status status = gonio_sampler_new(model, &size, &sampler, error);
    if (status != GONIO_OK) {
        return status;
    }
    double variance[2];
    compare_all(model, sampler, variance);
    if (variance[0] > POOR && model->isotropic) { // of others it would take seconds
        refine(model, size, &sampler, variance);
    }
    if (variance[0] > variance[1] && model->ops->sample != NULL) {
        gonio_sampler_free(sampler);
    } else {
        model->sampler = sampler;
    }
    return GONIO_OK;
}
