// SPDX-License-Identifier: BSD-3-Clause
// One simulated pixel for tests and benches of the merge: Poisson electrons, Gaussian read noise, rounding to DN,
// clipping. Independent of sim/. Random numbers: SplitMix64 (Steele, Lea and Flood 2014).
#ifndef TESTS_PIXEL_H
#define TESTS_PIXEL_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "calib/radiance/merge.h"

#define PIXEL_EXPOSURES 9

// A 12-bit camera with a ladder of exposures, each 4 times the one before.
typedef struct pixel_camera {
    double e_per_dn, read_dn, dark_dn_per_s, bias_dn, full_dn;
    double exposure_s[PIXEL_EXPOSURES];
    int n;
} pixel_camera;

static inline pixel_camera pixel_camera_make(double e_per_dn, double read_dn, int n) {
    pixel_camera c = {
        .e_per_dn = e_per_dn, .read_dn = read_dn, .dark_dn_per_s = 0, .bias_dn = 64, .full_dn = 4095, .n = n};
    for (int j = 0; j < n; j++) {
        c.exposure_s[j] = pow(4, j);
    }
    return c;
}

static inline merge_noise pixel_noise(const pixel_camera *c) {
    const double well = c->full_dn - c->bias_dn, read = c->read_dn * c->read_dn;
    return (merge_noise){.dn_per_e = 1 / c->e_per_dn,
                         .read_variance = read,
                         .ceiling = well - fmax(0.05 * well, 6 * sqrt(well / c->e_per_dn + read))};
}

static inline double pixel_uniform(uint64_t *state) {
    uint64_t x = *state += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return ((double)((x ^ (x >> 31)) >> 11) + 0.5) * 0x1p-53;
}

static inline double pixel_normal(uint64_t *state) {
    return sqrt(-2 * log(pixel_uniform(state))) * cos(6.283185307179586 * pixel_uniform(state));
}

// Exact by inversion up to a mean of 400; above, the rounded normal with the Poisson's skewness (Cornish and Fisher).
static inline double pixel_poisson(uint64_t *state, double mean) {
    if (mean > 400) {
        const double z = pixel_normal(state);
        return floor(mean + sqrt(mean) * z + (z * z - 1) / 6 + 0.5);
    }
    double p = exp(-mean), u = pixel_uniform(state), k = 0;
    while (u > p && k < 1000) {
        u -= p;
        k++;
        p *= mean / k;
    }
    return k;
}

// Expose once for a radiance that gives `rate` DN/s.
static inline merge_term pixel_expose(const pixel_camera *c, uint64_t *state, double rate, double exposure_s) {
    const double dark = c->dark_dn_per_s * exposure_s;
    const double electrons = pixel_poisson(state, (rate * exposure_s + dark) * c->e_per_dn);
    double dn = floor(c->bias_dn + electrons / c->e_per_dn + c->read_dn * pixel_normal(state) + 0.5);
    dn = fmin(fmax(dn, 0), c->full_dn);
    return (merge_term){.signal = dn - c->bias_dn - dark,
                        .scale = exposure_s,
                        .dark = dark,
                        .quantum_variance = 1.0 / 12,
                        .clipped = dn >= c->full_dn};
}

// Fisher information about the rate in one exposure, exact for the rounded reading: sum over readings of P'^2 / P, with
// P a Poisson mixture of normal integrals and d/d mean of a Poisson probability = P(k - 1) - P(k).
static inline double pixel_fisher(const pixel_camera *c, double rate, double exposure_s) {
    const double mean = (rate * exposure_s + c->dark_dn_per_s * exposure_s) * c->e_per_dn;
    const double slope = exposure_s * c->e_per_dn; // d mean / d rate
    if (mean > 2000) { // normal by then, and the information in its variance is below 1e-3 of the mean's
        const double variance = mean / (c->e_per_dn * c->e_per_dn) + c->read_dn * c->read_dn + 1.0 / 12;
        return exposure_s * exposure_s / variance;
    }
    const double spread = 8 * sqrt(mean) + 8;
    const int k0 = (int)fmax(floor(mean - spread), 0), k1 = (int)ceil(mean + spread);
    const int n0 = (int)floor(k0 / c->e_per_dn - 8 * c->read_dn - 2),
              n1 = (int)ceil(k1 / c->e_per_dn + 8 * c->read_dn + 2);
    double information = 0;
    for (int n = n0; n <= n1; n++) {
        double p = 0, derivative = 0;
        for (int k = k0; k <= k1; k++) {
            const double centre = k / c->e_per_dn, half = 0.5, s = c->read_dn * sqrt(2);
            const double integral = 0.5 * (erf((n + half - centre) / s) - erf((n - half - centre) / s));
            const double q = exp(-mean + k * log(mean) - lgamma(k + 1.0));
            p += q * integral;
            derivative += q * (k / mean - 1) * integral;
        }
        information += p > 1e-300 ? derivative * derivative / p : 0;
    }
    return information * slope * slope;
}

#endif
