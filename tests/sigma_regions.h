// SPDX-License-Identifier: BSD-3-Clause
// Samples and probes of the sigma tests: outgoing directions dense below 45 deg, sparse from there to 70, none beyond.
#ifndef TESTS_SIGMA_REGIONS_H
#define TESTS_SIGMA_REGIONS_H

#include "tests/simulate.h"

static inline double sigma_theta(uint64_t *state, double low_deg, double high_deg) {
    const double a = cos(low_deg * GONIO_PI / 180), b = cos(high_deg * GONIO_PI / 180);
    return acos(b + (a - b) * simulate_uniform(state));
}

static inline double sigma_normal(uint64_t *state) {
    double sum = -6; // Irwin-Hall
    for (int k = 0; k < 12; k++) {
        sum += simulate_uniform(state);
    }
    return sum;
}

// A pair of a region (0 dense, 1 sparse, 2 empty); mirror: about the mirror direction, where plans put more.
static inline gonio_pair sigma_pair(uint64_t *state, int region, int mirror) {
    static const double edges[] = {0, 45, 70, 88};
    const double theta_o = sigma_theta(state, edges[region], edges[region + 1]);
    double theta_i = sigma_theta(state, 0, 70), phi = 2 * GONIO_PI * simulate_uniform(state);
    if (mirror) {
        const double spread = 0.2 * sigma_normal(state) * simulate_uniform(state);
        theta_i = fmin(fabs(theta_o + spread), 70 * GONIO_PI / 180);
        phi = GONIO_PI + 0.3 * sigma_normal(state) * simulate_uniform(state);
    }
    return (gonio_pair){theta_i, 0, theta_o, phi};
}

// n samples with a relative noise, which their sigma tells (0: none, and no sigma): nine of ten dense, the tenth
// sparse, a third about the mirror direction.
static inline gonio_samples *sigma_samples(const gonio_model *truth, size_t n, double noise, uint64_t *state) {
    gonio_samples *samples;
    gonio_error error = {0};
    if (gonio_samples_new(1, noise > 0, &samples, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    samples->isotropic = true;
    for (size_t i = 0; i < n; i++) {
        const gonio_pair pair = sigma_pair(state, i % 10 == 9, i % 3 == 2);
        double value, sigma, zero = 0;
        gonio_model_eval_pair(truth, &pair, &value);
        sigma = noise * value;
        value += sigma * sigma_normal(state);
        const bool told = noise > 0;
        if (gonio_samples_add(samples, &pair, &value, told ? &sigma : NULL, told ? &zero : NULL, &error) != GONIO_OK) {
            simulate_die(&error);
        }
    }
    return samples;
}

#endif
