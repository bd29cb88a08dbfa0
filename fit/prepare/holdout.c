// SPDX-License-Identifier: BSD-3-Clause
#include "fit/prepare/holdout.h"

#include <stdlib.h>
#include <string.h>

#include "base/random.h"

#define FOLDS 5

void gonio_holdout_release(gonio_holdout *in) {
    gonio_dataset_release(&in->train);
    gonio_dataset_release(&in->held);
    free(in->residuals);
    free(in->work);
}

double gonio_holdout_noise(uint64_t i) {
    double sum = -6;
    for (uint64_t k = 0; k < 12; k++) {
        sum += gonio_random_uniform(12 * i + k);
    }
    return sum;
}

static gonio_status split(const gonio_dataset *some, const bool *given, gonio_holdout *in, gonio_error *error) {
    bool *keep = malloc(some->n * sizeof *keep);
    if (keep == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to hold samples out");
    }
    // Geometries are in order, so a draw from each five neighbours holds out a stratified fifth.
    for (size_t i = 0; i < some->n; i++) {
        keep[i] = given != NULL ? given[i] : gonio_random(i / FOLDS) % FOLDS != i % FOLDS;
        keep[i] = keep[i] || i >= some->measured; // what physics says is no judge
    }
    gonio_status status = gonio_dataset_select(some, keep, &in->train, error);
    for (size_t i = 0; i < some->n; i++) {
        keep[i] = !keep[i];
    }
    status = status == GONIO_OK ? gonio_dataset_select(some, keep, &in->held, error) : status;
    free(keep);
    return status;
}

gonio_status gonio_holdout_init(gonio_holdout *in, const gonio_dataset *data, const bool *keep, gonio_error *error) {
    *in = (gonio_holdout){.channels = data->channels < GONIO_SMOOTH_CHANNELS_TRIED ? data->channels
                                                                                   : GONIO_SMOOTH_CHANNELS_TRIED};
    for (int k = 0; k < in->channels; k++) {
        in->which[k] = (int)((2 * k + 1) * data->channels / (2 * in->channels));
    }
    gonio_dataset some;
    gonio_status status = gonio_dataset_channels(data, in->which, in->channels, &some, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = split(&some, keep, in, error);
    gonio_dataset_release(&some);
    if (status == GONIO_OK) {
        in->residuals = malloc(in->held.n * (size_t)in->channels * sizeof *in->residuals);
        in->work = malloc(in->held.n * sizeof *in->work);
        if (in->residuals == NULL || in->work == NULL) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory to score held-out samples");
        }
    }
    if (status != GONIO_OK) {
        gonio_holdout_release(in);
    }
    return status;
}

gonio_status gonio_holdout_lobes(const gonio_holdout *in, const gonio_lobe_base *lobes, gonio_lobe_base *out,
                                 gonio_error *error) {
    const size_t row = 1 + GONIO_LOBES_MAX;
    *out = *lobes;
    out->strength = NULL;
    if (lobes->lobes == 0) {
        return GONIO_OK;
    }
    out->strength = malloc((size_t)in->channels * row * sizeof *out->strength);
    if (out->strength == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for lobes");
    }
    for (int k = 0; k < in->channels; k++) {
        memcpy(out->strength + (size_t)k * row, lobes->strength + (size_t)in->which[k] * row, row * sizeof(double));
    }
    return GONIO_OK;
}
