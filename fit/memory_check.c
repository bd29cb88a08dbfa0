// SPDX-License-Identifier: BSD-3-Clause
// Is there memory for a fit? The bound of its method against what the machine or the caller gives.
#include <stdio.h>

#include "fit/memory.h"

double gonio_fit_memory(const gonio_fit_size *size) {
    const char *name = size->method;
    const gonio_method *method = gonio_method_find(&name);
    return gonio_fit_memory_of(size, method != NULL ? method->memory : gonio_lattice_fit_memory);
}

// The samples that fit at level 0.
static size_t fitting_samples(gonio_fit_size size, double limit) {
    size_t least = 0, most = size.samples; // least fits, most does not
    size.level = 0;
    while (most - least > 1) {
        size.samples = least + (most - least) / 2;
        *(gonio_fit_memory(&size) <= limit ? &least : &most) = size.samples;
    }
    return least;
}

gonio_status gonio_fit_check_memory(const gonio_fit_size *size, double limit, gonio_error *error) {
    limit = limit > 0 ? limit : gonio_available_memory();
    const double needed = gonio_fit_memory(size);
    if (needed <= limit) {
        return GONIO_OK;
    }
    gonio_fit_size fits = *size;
    while (fits.level >= 0 && gonio_fit_memory(&fits) > limit) {
        fits.level--;
    }
    char enough[64];
    if (fits.level >= 0) {
        snprintf(enough, sizeof enough, "enough for level %d", fits.level);
    } else {
        snprintf(enough, sizeof enough, "enough for %zu samples at level 0", fitting_samples(*size, limit));
    }
    return gonio_fail(error, GONIO_E_MEMORY,
                      "%zu samples of %d channels at level %d need %.3g GB; there are %.3g GB, %s", size->samples,
                      size->channels, size->level, needed / 1e9, limit / 1e9, enough);
}

gonio_status gonio_fit_check_options(const gonio_samples *samples, const gonio_fit_options *options, int level,
                                     gonio_error *error) {
    const gonio_fit_size size = gonio_fit_size_of(samples, options, level);
    return gonio_fit_check_memory(&size, gonio_fit_memory_limit(samples, options), error);
}
