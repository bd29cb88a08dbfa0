// SPDX-License-Identifier: BSD-3-Clause
// The transforms of samples of a thin sheet. Energy takes one factor for all that an incidence gives off, reflected and
// transmitted; isotropy and separability are of each half by itself, and so is reciprocity of what is reflected. Light
// on the way back of transmission begins on the other side: transmission stays as it is.
#include <string.h>

#include "fit/check/change.h"

static gonio_status append(const gonio_samples *part, gonio_half half, gonio_samples *out, gonio_error *error) {
    const size_t c = (size_t)part->channels;
    const bool with = part->sigma_random != NULL;
    gonio_status status = GONIO_OK;
    for (size_t i = 0; i < part->n && status == GONIO_OK; i++) {
        const gonio_pair pair = gonio_pair_lowered(part->pairs[i], half);
        status = gonio_samples_add(out, &pair, part->values + i * c, with ? part->sigma_random + i * c : NULL,
                                   with ? part->sigma_systematic + i * c : NULL, error);
        if (status == GONIO_OK && part->group != NULL) {
            status = gonio_samples_set_group(out, out->n - 1, part->group[i], error);
        }
    }
    return status;
}

static gonio_status change_half(const gonio_samples *in, gonio_half half, const gonio_change *change, int threads,
                                gonio_samples *out, gonio_error *error) {
    gonio_samples *raised, *changed = NULL;
    const bool stays = change->kind == GONIO_CHANGE_RECIPROCITY && (half & GONIO_TRANSMISSION) != 0;
    gonio_status status = gonio_samples_half(in, half, NULL, &raised, error);
    if (status == GONIO_OK && !stays) {
        status = gonio_change_copy(raised, false, &changed, error);
        status = status == GONIO_OK ? gonio_change_half(raised, change, threads, &changed, error) : status;
    }
    if (status == GONIO_OK) {
        const gonio_samples *part = stays ? raised : changed;
        out->isotropic = out->isotropic && part->isotropic;
        status = append(part, half, out, error);
    }
    gonio_samples_free(changed);
    gonio_samples_free(raised);
    return status;
}

gonio_status gonio_change_sheet(const gonio_samples *in, const gonio_change *change, int threads, gonio_samples *out,
                                gonio_error *error) {
    if (change->kind == GONIO_CHANGE_ENERGY) {
        return gonio_change_conserve(change, threads, out, error);
    }
    const unsigned halves = gonio_samples_halves(in);
    gonio_status status = GONIO_OK;
    out->n = 0;
    out->isotropic = true;
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        status = halves >> h & 1 ? change_half(in, (gonio_half)h, change, threads, out, error) : GONIO_OK;
    }
    return status;
}
