// SPDX-License-Identifier: BSD-3-Clause
// The uncertainty of small sets: everything left out that can be, in closed form.
//
// The error of a prediction is made of the samples' noise, passed on by the fit, and of what smoothing and gaps leave
// unknown. The Gaussian process behind the smoothing prior (fit/smooth/posterior.c) tells how much of each there is at
// a place, but not how rough this material is: neither the prior's scale nor the rate at which errors grow with a gap.
// Both are learnt from predictions of samples, neighbourhoods and ranges of angles that were left out
// (fit/sigma/blocks.c, fit/sigma/law.c). What the samples' own uncertainty explains of those residuals is
// noise in them, not an error of the model.
#include "fit/sigma/sigma.h"

#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "fit/sigma/blocks.h"
#include "fit/sigma/field.h"

// Leave-one-out residuals of every channel with its own lambda.
static gonio_status leave_one_out(const gonio_smooth_dense *dense, const gonio_dataset *data,
                                  const gonio_smooth_base *base, const double *lambdas, double *out,
                                  gonio_error *error) {
    const size_t c = (size_t)data->channels;
    double *target = malloc(2 * data->n * sizeof *target);
    if (target == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    }
    double *residual = target + data->n;
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < c && status == GONIO_OK; k++) {
        for (size_t i = 0; i < data->n; i++) {
            target[i] = base->rest[i * c + k];
        }
        status = gonio_smooth_dense_loo(dense, target, 1, 1, &lambdas[k], &residual, error);
        for (size_t i = 0; i < data->n; i++) {
            out[i * c + k] = residual[i];
        }
    }
    free(target);
    return status;
}

static double middle_of(const double *values, size_t n, double *work) {
    memcpy(work, values, n * sizeof *work);
    return gonio_upper_median(work, n);
}

// The variance that the law gives the probes, and what the added places pass on to them, in the channels' factors.
static gonio_status fill_probes(const gonio_influence *f, const gonio_sigma_law *law, const double *factor,
                                gonio_dataset *probes, gonio_error *error) {
    const size_t m = probes->n, d = (size_t)probes->dims;
    double *noise = malloc((1 + GONIO_SIGMA_SIGNS + d) * m * sizeof *noise),
           *work = malloc(4 * (law->records->n + 1) * sizeof *work);
    gonio_status status =
        noise != NULL && work != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    if (status == GONIO_OK) {
        double *signs = noise + m, *x = signs + GONIO_SIGMA_SIGNS * m;
        gonio_dataset_locate(probes, gonio_smooth_dense_form(f->dense)->coordinates, x);
        status = gonio_influence_at(f, factor, m, probes->pairs, x, noise, signs, probes->values, error);
        for (size_t i = 0; i < m && status == GONIO_OK; i++) {
            double place[2];
            gonio_sigma_place(&probes->pairs[i], place);
            const double learnt = gonio_sigma_law_variance(law, place, noise[i], signs + GONIO_SIGMA_SIGNS * i, work);
            probes->targets[i] = learnt + gonio_sigma_held_back(f->data, &f->base->lobes, factor, &probes->pairs[i]);
        }
    }
    free(noise);
    free(work);
    return status;
}

gonio_status gonio_sigma_dense(const gonio_smooth_dense *dense, const gonio_dataset *data,
                               const gonio_smooth_base *base, const double *lambdas, gonio_prior *prior,
                               gonio_lobe_spline_parts *parts, gonio_error *error) {
    const size_t n = data->n, c = (size_t)data->channels;
    double *residuals = calloc(n * c, sizeof *residuals), *work = malloc((n + c) * sizeof *work);
    double *factor = malloc(c * sizeof *factor);
    gonio_influence f = {0};
    gonio_sigma_records records = {0};
    gonio_sigma_law law;
    gonio_dataset probes = {0};
    gonio_status status = residuals != NULL && work != NULL && factor != NULL
                              ? leave_one_out(dense, data, base, lambdas, residuals, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty");
    if (status == GONIO_OK) {
        gonio_sigma_factors(data->measured, c, residuals, factor, work);
        status = gonio_influence_init(&f, dense, data, base, middle_of(lambdas, c, work), factor[c / 2], prior, error);
    }
    status = status == GONIO_OK ? gonio_influence_records(&f, factor, &records, error) : status;
    if (status == GONIO_OK) {
        status = gonio_sigma_law_fit(&records, gonio_sample_noise_variance(data, factor), &law, error);
    }
    status = status == GONIO_OK ? gonio_sigma_probes(&probes, &prior->data, error) : status;
    status = status == GONIO_OK ? fill_probes(&f, &law, factor, &probes, error) : status;
    status = status == GONIO_OK ? gonio_sigma_attach(&probes, prior, factor, parts, error) : status;
    if (status != GONIO_OK) {
        free(factor);
    }
    free(residuals);
    free(work);
    gonio_influence_release(&f);
    gonio_sigma_records_release(&records);
    gonio_dataset_release(&probes);
    return status;
}
