// SPDX-License-Identifier: BSD-3-Clause
// What physics says beside the samples (fit/prior/extend.h).
#include "fit/prior/extend.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/order_statistic.h"
#include "fit/prior/passive.h"
#include "fit/prior/places.h"

#define PLACES 96       // that are looked at, spread over all pairs and about the mirror direction
#define FEWEST_PLACES 8 // unsupported ones: below, the samples are the set
#define FEWEST_SAMPLES 15
#define THETA_MAX 1.5  // 86 deg: nearer to the horizon every formula is an extrapolation
#define CERTAIN 0.02   // a relative standard deviation that counts as a sample: no model interpolates better
#define BEYOND_MAX 5.0 // e^5: what the sigma of a value is held to
#define QUANTILE 0.95  // of the materials lies within two sigma

typedef struct additions {
    gonio_pair pairs[PLACES];
    double weights[PLACES];
    double *values; // n x channels
    size_t n;
} additions;

double gonio_prior_variance(double off[GONIO_PRIOR_MATERIALS]) {
    const size_t rank = (size_t)(QUANTILE * GONIO_PRIOR_MATERIALS);
    for (size_t k = 0; k < GONIO_PRIOR_MATERIALS; k++) {
        off[k] = fabs(off[k]);
    }
    const double most = gonio_order_statistic(off, GONIO_PRIOR_MATERIALS, rank);
    return most * most / 4;
}

static double variance_about(const double *ln, double middle) {
    double off[GONIO_PRIOR_MATERIALS];
    for (size_t k = 0; k < GONIO_PRIOR_MATERIALS; k++) {
        off[k] = expm1(fmin(ln[k] - middle, BEYOND_MAX));
    }
    return gonio_prior_variance(off);
}

static void find_places(gonio_prior *p, additions *a) {
    for (size_t i = 0; i < PLACES; i++) {
        const gonio_pair pair = gonio_prior_place(i, p->data.dims == 3, THETA_MAX);
        if (gonio_prior_support(p, &pair) < GONIO_PRIOR_SUPPORTED) {
            a->pairs[a->n++] = pair;
        }
    }
}

static void fill_place(gonio_prior *p, const double *factor, additions *a, size_t i) {
    const gonio_pair *pair = &a->pairs[i];
    double out[GONIO_PRIOR_MATERIALS], colour[GONIO_CHANNELS_MAX];
    gonio_prior_at(p, pair, out, colour);
    const double middle = gonio_order_statistic(out, GONIO_PRIOR_MATERIALS, GONIO_PRIOR_MATERIALS / 2);
    const double variance = variance_about(out, middle);
    const double passive = gonio_passive_factor(factor, pair);
    for (int c = 0; c < p->data.channels; c++) {
        a->values[i * (size_t)p->data.channels + (size_t)c] =
            p->data.transforms[c].scale * exp(middle + colour[c]) * passive;
    }
    a->weights[i] = CERTAIN * CERTAIN / (CERTAIN * CERTAIN + variance);
}

gonio_status gonio_prior_extend(gonio_prior *p, gonio_dataset *data, gonio_error *error) {
    if (p->materials_n == 0 || data->measured < FEWEST_SAMPLES) {
        return GONIO_OK;
    }
    additions a = {.n = 0};
    find_places(p, &a);
    if (a.n < FEWEST_PLACES) {
        return GONIO_OK;
    }
    a.values = malloc(a.n * (size_t)data->channels * sizeof *a.values);
    if (a.values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what the samples leave open");
    }
    double factor[GONIO_PASSIVE_INCIDENCES];
    gonio_passive_factors(p, GONIO_PRIOR_SUPPORTED, factor);
    for (size_t i = 0; i < a.n; i++) {
        fill_place(p, factor, &a, i);
    }
    const gonio_status status = gonio_dataset_append(data, a.n, a.pairs, a.values, a.weights, error);
    free(a.values);
    return status;
}

void gonio_prior_errors(gonio_prior *p, const gonio_dataset *data, double *errors) {
    const size_t places = data->n - data->measured, c = (size_t)data->channels, channel = c / 2;
    const gonio_transform *t = &data->transforms[channel];
    for (size_t i = 0; i < places; i++) {
        const size_t at = (data->measured + i) * c + channel;
        double out[GONIO_PRIOR_MATERIALS], ordered[GONIO_PRIOR_MATERIALS];
        gonio_prior_at(p, &data->pairs[data->measured + i], out, NULL);
        memcpy(ordered, out, sizeof ordered);
        const double middle = gonio_order_statistic(ordered, GONIO_PRIOR_MATERIALS, GONIO_PRIOR_MATERIALS / 2);
        for (size_t k = 0; k < GONIO_PRIOR_MATERIALS; k++) {
            const double value = data->values[at] * exp(fmin(out[k] - middle, BEYOND_MAX));
            errors[k * places + i] = gonio_transform_apply(data->kind, t, value) - data->targets[at];
        }
    }
}

double gonio_prior_spread(gonio_prior *p, const gonio_pair *pair, const double *value) {
    double out[GONIO_PRIOR_MATERIALS], middle = 0;
    gonio_prior_at(p, pair, out, NULL);
    for (int c = 0; c < p->data.channels; c++) {
        const gonio_transform *t = &p->data.transforms[c];
        middle += log(fmax(value[c] / t->scale, t->eps)) / p->data.channels;
    }
    return variance_about(out, middle);
}
