// SPDX-License-Identifier: BSD-3-Clause
// Samples of an exact BRDF at random directions, for tests and benches: the same seed gives the same samples.
#ifndef TESTS_SIMULATE_H
#define TESTS_SIMULATE_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/random.h"
#include "gonio/model.h"
#include "gonio/sample.h"

static inline double simulate_uniform(uint64_t *state) { return gonio_random_next(state); }

// Directions uniform in solid angle up to 85 deg; isotropic: phi_i = 0.
static inline gonio_pair simulate_pair(uint64_t *state, int isotropic) {
    const double below = 1 - cos(85 * GONIO_PI / 180);
    const double a = simulate_uniform(state), b = simulate_uniform(state), c = simulate_uniform(state);
    const double d = isotropic ? 0 : simulate_uniform(state);
    return (gonio_pair){acos(1 - a * below), 2 * GONIO_PI * d, acos(1 - b * below), 2 * GONIO_PI * c};
}

static inline _Noreturn void simulate_die(const gonio_error *error) {
    fprintf(stderr, "%s\n", error->message);
    abort();
}

static inline gonio_model *simulate_truth(const char *spec) {
    gonio_model *truth;
    gonio_error error = {0};
    if (gonio_model_from_spec(spec, &truth, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return truth;
}

// n samples of `channels` channels: channel c is the BRDF times 1 + c/100. The caller frees them.
static inline gonio_samples *simulate_samples(const char *spec, size_t n, int channels, uint64_t seed) {
    gonio_model *truth = simulate_truth(spec);
    gonio_samples *samples;
    gonio_error error = {0};
    if (gonio_samples_new(channels, 0, &samples, &error) != GONIO_OK ||
        gonio_samples_reserve(samples, n, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    samples->isotropic = truth->isotropic;
    double values[GONIO_CHANNELS_MAX];
    for (size_t i = 0; i < n; i++) {
        const gonio_pair pair = simulate_pair(&seed, truth->isotropic);
        gonio_model_eval_pair(truth, &pair, values);
        for (int c = channels - 1; c >= 0; c--) {
            values[c] = values[0] * (1 + 0.01 * c);
        }
        if (gonio_samples_add(samples, &pair, values, NULL, NULL, &error) != GONIO_OK) {
            simulate_die(&error);
        }
    }
    for (int c = 0; c < channels; c++) {
        snprintf(samples->channel_names[c], sizeof samples->channel_names[c], "%dnm", 400 + 10 * c);
    }
    gonio_model_free(truth);
    return samples;
}

// One channel, the mean of all; frees what it is given. Ends the program where it cannot.
static inline gonio_samples *simulate_channel_mean(gonio_samples *samples) {
    gonio_samples *mean;
    gonio_error error = {0};
    if (gonio_samples_channel(samples, 0, &mean, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    const size_t c = (size_t)samples->channels;
    for (size_t i = 0; i < samples->n; i++) {
        mean->values[i] = 0;
        for (size_t k = 0; k < c; k++) {
            mean->values[i] += samples->values[i * c + k] / (double)c;
        }
    }
    gonio_samples_free(samples);
    return mean;
}

#endif
