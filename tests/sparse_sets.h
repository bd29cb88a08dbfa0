// SPDX-License-Identifier: BSD-3-Clause
// Sets that leave most directions without samples: one incidence, two planes, a quadrant, a gap, a handful of poses.
#ifndef TESTS_SPARSE_SETS_H
#define TESTS_SPARSE_SETS_H

#include "tests/sigma_regions.h"

typedef enum sparse_design {
    SPARSE_PLANE,      // 171 directions of one incidence in its plane, a degree apart
    SPARSE_INCIDENCE,  // one incidence, the whole hemisphere
    SPARSE_TWO_PLANES, // four incidences, the plane of incidence and the one across
    SPARSE_QUADRANT,   // forward directions on one side
    SPARSE_GAP,        // all but 20 deg about the light
    SPARSE_TWENTY,     // random poses
    SPARSE_FIVE,
    SPARSE_ONE,
    SPARSE_DESIGNS,
} sparse_design;

static const char *const sparse_names[SPARSE_DESIGNS] = {
    "one plane", "one incidence", "two planes", "one quadrant", "backscatter gap", "20 poses", "5 poses", "1 pose"};

static inline double sparse_cosine_between(const gonio_pair *p) {
    const gonio_vec3 a = gonio_direction(p->theta_i, p->phi_i), b = gonio_direction(p->theta_o, p->phi_o);
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline void sparse_add(gonio_samples *s, const gonio_model *truth, gonio_pair p, double noise, uint64_t *state) {
    double value[GONIO_CHANNELS_MAX];
    gonio_error error = {0};
    gonio_model_eval_pair(truth, &p, value);
    for (int c = 0; c < truth->channels && noise > 0; c++) {
        value[c] *= 1 + noise * sigma_normal(state);
    }
    if (gonio_samples_add(s, &p, value, NULL, NULL, &error) != GONIO_OK) {
        simulate_die(&error);
    }
}

// every: of the larger designs, every so many of their directions.
static inline gonio_samples *sparse_samples(const gonio_model *truth, sparse_design design, size_t every, double noise,
                                            uint64_t *state) {
    gonio_samples *s;
    gonio_error error = {0};
    if (gonio_samples_new(truth->channels, false, &s, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    s->isotropic = true;
    const double deg = GONIO_PI / 180, one = deg * floor(15 + 50 * simulate_uniform(state));
    static const size_t counts[SPARSE_DESIGNS] = {171, 200, 280, 200, 300, 20, 5, 1};
    for (size_t i = 0; i < counts[design]; i += design < SPARSE_TWENTY ? every : 1) {
        gonio_pair p = simulate_pair(state, 1);
        if (design == SPARSE_PLANE) {
            const double theta = (double)i - 85;
            p = (gonio_pair){one, 0, fabs(theta) * deg, theta < 0 ? 0 : GONIO_PI};
        } else if (design == SPARSE_INCIDENCE) {
            p.theta_i = one;
        } else if (design == SPARSE_TWO_PLANES) {
            const double theta = (double)(i / 8) * 5 - 85;
            p = (gonio_pair){(double)(i % 4) * 20 * deg, 0, fabs(theta) * deg,
                             (theta < 0 ? 0 : GONIO_PI) + (i / 4 % 2 == 0 ? 0 : GONIO_PI / 2)};
        } else if (design == SPARSE_QUADRANT) {
            p.phi_o = GONIO_PI / 2 + p.phi_o / 4;
        }
        while (design == SPARSE_GAP && sparse_cosine_between(&p) > cos(20 * deg)) {
            p = simulate_pair(state, 1);
        }
        sparse_add(s, truth, p, noise, state);
    }
    return s;
}

#endif
