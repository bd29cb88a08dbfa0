// SPDX-License-Identifier: BSD-3-Clause
// Samples: as a table where they are one, else as they lie; and what changes a set as a whole.
#include "fit/check/change.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/head.h"

static gonio_status copy(const gonio_samples *in, bool twice, gonio_samples **out, gonio_error *error) {
    const bool sigma = in->sigma_random != NULL;
    const size_t c = (size_t)in->channels;
    gonio_status status = gonio_samples_new(in->channels, sigma, out, error);
    if (status != GONIO_OK) {
        return status;
    }
    (*out)->isotropic = in->isotropic;
    (*out)->transmission = in->transmission;
    memcpy((*out)->channel_names, in->channel_names, c * sizeof *in->channel_names);
    status = gonio_head_copy(in->head, &(*out)->head, error);
    for (size_t i = 0; i < in->n && status == GONIO_OK; i++) {
        for (int k = 0; k < (twice ? 2 : 1) && status == GONIO_OK; k++) {
            const gonio_pair p = k == 0 ? in->pairs[i] : gonio_pair_mirrored(in->pairs[i]);
            status = gonio_samples_add(*out, &p, in->values + i * c, sigma ? in->sigma_random + i * c : NULL,
                                       sigma ? in->sigma_systematic + i * c : NULL, error);
            if (status == GONIO_OK && in->group != NULL) {
                status = gonio_samples_set_group(*out, (*out)->n - 1, in->group[i], error);
            }
        }
    }
    return status;
}

gonio_status gonio_check_change(const gonio_samples *samples, const gonio_change *change, int threads,
                                gonio_samples **out, gonio_error *error) {
    *out = NULL;
    gonio_table *table = NULL;
    gonio_status status = gonio_change_check(change, error);
    status = status == GONIO_OK ? gonio_samples_check(samples, error) : status;
    const bool by_sample = change->kind == GONIO_CHANGE_MIRROR || change->kind == GONIO_CHANGE_CLAMP;
    if (status == GONIO_OK && !by_sample && gonio_samples_halves(samples) != 1u << GONIO_REFLECTION) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "%s changes reflection from the front alone; these samples have others",
                          gonio_change_name(change->kind));
    }
    status = status == GONIO_OK ? copy(samples, change->kind == GONIO_CHANGE_MIRROR, out, error) : status;
    if (status == GONIO_OK && change->kind == GONIO_CHANGE_CLAMP) {
        for (size_t k = 0; k < (*out)->n * (size_t)(*out)->channels; k++) {
            (*out)->values[k] = fmax((*out)->values[k], 0);
        }
    } else if (status == GONIO_OK && !by_sample) {
        status = gonio_table_of(samples, &table, error);
        if (status == GONIO_OK) {
            status = table != NULL ? gonio_change_table(table, change, threads, *out, error)
                                   : gonio_change_scattered(samples, change, threads, *out, error);
        }
        gonio_table_free(table);
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}
