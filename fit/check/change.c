// SPDX-License-Identifier: BSD-3-Clause
// Samples: as a table where they are one, else as they lie; and what changes a set as a whole.
#include "fit/check/change.h"

#include <math.h>

gonio_status gonio_check_change(const gonio_samples *samples, const gonio_change *change, int threads,
                                gonio_samples **out, gonio_error *error) {
    *out = NULL;
    gonio_status status = gonio_change_check(change, error);
    status = status == GONIO_OK ? gonio_samples_check(samples, error) : status;
    const bool by_sample = change->kind == GONIO_CHANGE_MIRROR || change->kind == GONIO_CHANGE_CLAMP;
    const bool sheet = status == GONIO_OK && gonio_samples_halves(samples) != 1u << GONIO_REFLECTION;
    status = status == GONIO_OK ? gonio_change_copy(samples, change->kind == GONIO_CHANGE_MIRROR, out, error) : status;
    if (status == GONIO_OK && change->kind == GONIO_CHANGE_CLAMP) {
        for (size_t k = 0; k < (*out)->n * (size_t)(*out)->channels; k++) {
            (*out)->values[k] = fmax((*out)->values[k], 0);
        }
    } else if (!by_sample && status == GONIO_OK) {
        status = sheet ? gonio_change_sheet(samples, change, threads, *out, error)
                       : gonio_change_half(samples, change, threads, out, error);
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}
