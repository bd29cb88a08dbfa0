// SPDX-License-Identifier: BSD-3-Clause
#include "gonio/sample.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"

gonio_status gonio_samples_new(int channels, bool with_sigma, gonio_samples **out, gonio_error *error) {
    *out = NULL;
    if (channels < 1 || channels > GONIO_CHANNELS_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "%d channels; 1 to %d are possible", channels, GONIO_CHANNELS_MAX);
    }
    gonio_samples *samples = calloc(1, sizeof *samples);
    if (samples == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a sample set");
    }
    samples->channels = channels;
    samples->isotropic = true;
    samples->channel_names = calloc((size_t)channels, sizeof *samples->channel_names);
    if (samples->channel_names == NULL) {
        gonio_samples_free(samples);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a sample set");
    }
    if (with_sigma) {
        // One element marks "carries sigma" until the first reserve.
        samples->sigma_random = calloc(1, sizeof(double));
        samples->sigma_systematic = calloc(1, sizeof(double));
        if (samples->sigma_random == NULL || samples->sigma_systematic == NULL) {
            gonio_samples_free(samples);
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a sample set");
        }
    }
    *out = samples;
    return GONIO_OK;
}

void gonio_samples_free(gonio_samples *samples) {
    if (samples == NULL) {
        return;
    }
    free(samples->pairs);
    free(samples->values);
    free(samples->sigma_random);
    free(samples->sigma_systematic);
    free(samples->channel_names);
    free(samples->group);
    free(samples->head);
    free(samples);
}

static bool grow(void **array, size_t count, size_t size) {
    void *larger = realloc(*array, count * size);
    if (larger == NULL) {
        return false;
    }
    *array = larger;
    return true;
}

gonio_status gonio_samples_reserve(gonio_samples *samples, size_t capacity, gonio_error *error) {
    if (capacity <= samples->capacity) {
        return GONIO_OK;
    }
    const size_t row = (size_t)samples->channels * sizeof(double);
    const bool fits = capacity <= SIZE_MAX / 4 / row;
    if (!fits || !grow((void **)&samples->pairs, capacity, sizeof *samples->pairs) ||
        !grow((void **)&samples->values, capacity, row) ||
        (samples->sigma_random != NULL && (!grow((void **)&samples->sigma_random, capacity, row) ||
                                           !grow((void **)&samples->sigma_systematic, capacity, row))) ||
        (samples->group != NULL && !grow((void **)&samples->group, capacity, sizeof *samples->group))) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples of %d channels (%.3g GB)", capacity,
                          samples->channels, (double)capacity * ((double)row * 3 + 32) / 1e9);
    }
    samples->capacity = capacity;
    return GONIO_OK;
}

gonio_status gonio_samples_add(gonio_samples *samples, const gonio_pair *pair, const double *values,
                               const double *sigma_random, const double *sigma_systematic, gonio_error *error) {
    if (samples->n == samples->capacity) {
        const size_t larger = samples->capacity < 64 ? 64 : samples->capacity + samples->capacity / 2;
        const gonio_status status = gonio_samples_reserve(samples, larger, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    const size_t c = (size_t)samples->channels, at = samples->n * c, row = c * sizeof(double);
    samples->pairs[samples->n] = *pair;
    memcpy(samples->values + at, values, row);
    if (samples->sigma_random != NULL) {
        if (sigma_random != NULL) {
            memcpy(samples->sigma_random + at, sigma_random, row);
        } else {
            memset(samples->sigma_random + at, 0, row);
        }
        if (sigma_systematic != NULL) {
            memcpy(samples->sigma_systematic + at, sigma_systematic, row);
        } else {
            memset(samples->sigma_systematic + at, 0, row);
        }
    }
    if (samples->group != NULL) {
        samples->group[samples->n] = samples->n > 0 ? samples->group[samples->n - 1] : 1;
    }
    samples->n++;
    return GONIO_OK;
}

gonio_status gonio_samples_set_group(gonio_samples *samples, size_t index, uint16_t group, gonio_error *error) {
    if (samples->group == NULL) {
        samples->group = malloc((samples->capacity + 1) * sizeof *samples->group);
        if (samples->group == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for the groups of %zu samples", samples->n);
        }
        for (size_t i = 0; i < samples->n; i++) {
            samples->group[i] = 1;
        }
    }
    samples->group[index] = group;
    return GONIO_OK;
}

// An empty set with the same description.
static gonio_status like(const gonio_samples *samples, int channels, int first_channel, gonio_samples **out,
                         gonio_error *error) {
    const gonio_status status = gonio_samples_new(channels, samples->sigma_random != NULL, out, error);
    if (status != GONIO_OK) {
        return status;
    }
    (*out)->isotropic = samples->isotropic;
    (*out)->transmission = samples->transmission;
    memcpy((*out)->channel_names, samples->channel_names + first_channel,
           (size_t)channels * sizeof *samples->channel_names);
    return gonio_head_copy(samples->head, &(*out)->head, error);
}

gonio_status gonio_samples_select(const gonio_samples *samples, const bool *keep, gonio_samples **out,
                                  gonio_error *error) {
    size_t kept = 0;
    for (size_t i = 0; i < samples->n; i++) {
        kept += keep[i];
    }
    gonio_status status = like(samples, samples->channels, 0, out, error);
    if (status == GONIO_OK) {
        status = gonio_samples_reserve(*out, kept, error);
    }
    const size_t c = (size_t)samples->channels;
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        if (keep[i]) {
            const bool sigma = samples->sigma_random != NULL;
            status = gonio_samples_add(*out, &samples->pairs[i], samples->values + i * c,
                                       sigma ? samples->sigma_random + i * c : NULL,
                                       sigma ? samples->sigma_systematic + i * c : NULL, error);
        }
        if (keep[i] && status == GONIO_OK && samples->group != NULL) {
            status = gonio_samples_set_group(*out, (*out)->n - 1, samples->group[i], error);
        }
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}

gonio_status gonio_samples_channel(const gonio_samples *samples, int channel, gonio_samples **out, gonio_error *error) {
    if (channel < 0 || channel >= samples->channels) {
        *out = NULL;
        return gonio_fail(error, GONIO_E_RANGE, "channel %d; the set has %d", channel, samples->channels);
    }
    gonio_status status = like(samples, 1, channel, out, error);
    if (status == GONIO_OK) {
        status = gonio_samples_reserve(*out, samples->n, error);
    }
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        const size_t at = i * (size_t)samples->channels + (size_t)channel;
        const bool sigma = samples->sigma_random != NULL;
        status =
            gonio_samples_add(*out, &samples->pairs[i], &samples->values[at], sigma ? &samples->sigma_random[at] : NULL,
                              sigma ? &samples->sigma_systematic[at] : NULL, error);
        if (status == GONIO_OK && samples->group != NULL) {
            status = gonio_samples_set_group(*out, i, samples->group[i], error);
        }
    }
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}

// ---- halves ----

static bool at_horizon(double theta) { return fabs(theta - GONIO_PI / 2) <= 1e-9; }

unsigned gonio_samples_halves(const gonio_samples *samples) {
    unsigned inside = 0, horizon = 0;
    for (size_t i = 0; i < samples->n && samples->transmission; i++) {
        const gonio_pair *p = &samples->pairs[i];
        *(at_horizon(p->theta_o) ? &horizon : &inside) |= 1u << gonio_pair_half(*p);
    }
    return !samples->transmission ? 1u << GONIO_REFLECTION : inside != 0 ? inside : horizon;
}

// The half of a sample among those that the set has: one at the horizon is reflected where that is there, or else
// transmitted.
static gonio_half half_among(unsigned halves, gonio_pair pair) {
    unsigned half = gonio_pair_half(pair);
    if (at_horizon(pair.theta_o)) {
        const unsigned light = half & GONIO_REFLECTION_BACK;
        for (unsigned k = GONIO_HALVES; k-- > 0;) {
            half = halves >> (light ^ k) & 1 ? light ^ k : half;
        }
    }
    return (gonio_half)half;
}

gonio_status gonio_samples_half(const gonio_samples *samples, gonio_half half, bool *which, gonio_samples **out,
                                gonio_error *error) {
    *out = NULL;
    bool *keep = which != NULL ? which : malloc((samples->n + 1) * sizeof *keep);
    if (keep == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", samples->n);
    }
    const unsigned halves = gonio_samples_halves(samples);
    for (size_t i = 0; i < samples->n; i++) {
        keep[i] = (samples->transmission ? half_among(halves, samples->pairs[i]) : GONIO_REFLECTION) == half;
    }
    const gonio_status status = gonio_samples_select(samples, keep, out, error);
    for (size_t i = 0; status == GONIO_OK && samples->transmission && i < (*out)->n; i++) {
        (*out)->pairs[i] = gonio_pair_raised((*out)->pairs[i]);
    }
    if (status == GONIO_OK) {
        (*out)->transmission = false;
    }
    if (which == NULL) {
        free(keep);
    }
    return status;
}

gonio_status gonio_samples_check(const gonio_samples *samples, gonio_error *error) {
    if (samples->n == 0) {
        return gonio_fail(error, GONIO_E_INPUT, "no samples: at least one is needed");
    }
    const size_t c = (size_t)samples->channels;
    const double largest = (samples->transmission ? GONIO_PI : GONIO_PI / 2) + 1e-9; // 1e-9 rad is rounding
    for (size_t i = 0; i < samples->n; i++) {
        const gonio_pair *p = &samples->pairs[i];
        // Written so that NaN fails.
        const bool inside = p->theta_i >= -1e-9 && p->theta_i <= largest && p->theta_o >= -1e-9 &&
                            p->theta_o <= largest && isfinite(p->phi_i) && isfinite(p->phi_o);
        if (!inside) {
            return gonio_fail(error, GONIO_E_INPUT,
                              "sample %zu: theta_i %g, phi_i %g, theta_o %g, phi_o %g deg; thetas must be 0 to %s",
                              i + 1, p->theta_i * 180 / GONIO_PI, p->phi_i * 180 / GONIO_PI,
                              p->theta_o * 180 / GONIO_PI, p->phi_o * 180 / GONIO_PI,
                              samples->transmission ? "180" : "90");
        }
        for (size_t k = 0; k < c; k++) {
            if (!isfinite(samples->values[i * c + k])) {
                return gonio_fail(error, GONIO_E_INPUT, "sample %zu, channel %s: the value is %g", i + 1,
                                  samples->channel_names[k], samples->values[i * c + k]);
            }
        }
    }
    return GONIO_OK;
}

double gonio_samples_sigma(const gonio_samples *samples, size_t index, int channel) {
    if (samples->sigma_random == NULL) {
        return 0;
    }
    const size_t at = index * (size_t)samples->channels + (size_t)channel;
    return hypot(samples->sigma_random[at], samples->sigma_systematic[at]);
}
