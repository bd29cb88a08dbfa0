// SPDX-License-Identifier: BSD-3-Clause
// Philox4x32-10 of Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3" (SC 2011), and the
// distributions that the rig draws from it. A counter-based generator instead of a stateful one, because a pixel's
// noise must not depend on which pixels were drawn before it.
#include "sim/random.h"

#include <math.h>

#include "gonio/direction.h"

// Multipliers and Weyl constants of the paper's Philox4x32.
#define MULTIPLIER_0 0xD2511F53u
#define MULTIPLIER_1 0xCD9E8D57u
#define WEYL_0 0x9E3779B9u
#define WEYL_1 0xBB67AE85u
#define ROUNDS 10

sim_draw gonio_sim_random(uint64_t seed, sim_effect effect, int64_t pose, int32_t frame, uint32_t index) {
    uint32_t c0 = index, c1 = (uint32_t)frame, c2 = (uint32_t)pose;
    uint32_t c3 = (uint32_t)((uint64_t)pose >> 32) ^ ((uint32_t)effect << 24);
    uint32_t k0 = (uint32_t)seed, k1 = (uint32_t)(seed >> 32);
    for (int round = 0; round < ROUNDS; round++) {
        const uint64_t a = (uint64_t)MULTIPLIER_0 * c0, b = (uint64_t)MULTIPLIER_1 * c2;
        c0 = (uint32_t)(b >> 32) ^ c1 ^ k0;
        c1 = (uint32_t)b;
        c2 = (uint32_t)(a >> 32) ^ c3 ^ k1;
        c3 = (uint32_t)a;
        k0 += WEYL_0;
        k1 += WEYL_1;
    }
    return (sim_draw){{c0, c1, c2, c3}};
}

double gonio_sim_uniform(const sim_draw *draw, int k) {
    const uint64_t bits = ((uint64_t)draw->word[2 * k] << 32 | draw->word[2 * k + 1]) >> 12;
    return ((double)bits + 0.5) * 0x1p-52;
}

// Box and Muller (1958).
void gonio_sim_normals(const sim_draw *draw, double normals[2]) {
    const double radius = sqrt(-2 * log(gonio_sim_uniform(draw, 0)));
    const double angle = 2 * GONIO_PI * gonio_sim_uniform(draw, 1);
    normals[0] = radius * cos(angle);
    normals[1] = radius * sin(angle);
}

double gonio_sim_normal(uint64_t seed, sim_effect effect, int64_t pose, int32_t frame, uint32_t index) {
    const sim_draw draw = gonio_sim_random(seed, effect, pose, frame, index);
    double normals[2];
    gonio_sim_normals(&draw, normals);
    return normals[0];
}

double gonio_sim_poisson_small(double mean, double u) {
    double p = exp(-mean), sum = p, k = 0;
    while (u > sum) {
        k++;
        p *= mean / k;
        if (k > mean && sum + p == sum) {
            break; // u lies within rounding of 1: the sum will not grow any more
        }
        sum += p;
    }
    return k;
}

// The quantile of the Poisson distribution by its Cornish-Fisher expansion (Fisher and Cornish 1960) to order
// mean^-1/2: the z^2 - 1 term gives the skewness, the z - z^3 term the kurtosis; the variance is mean - 1/12, because
// rounding to whole counts adds 1/12 (Sheppard). Moments agree with the exact distribution's to 1e-3 already at
// mean 30.
double gonio_sim_poisson_large(double mean, double z) {
    const double s = sqrt(mean - 1.0 / 12);
    const double count = mean + s * z + (z * z - 1) / 6 + (z - z * z * z) / (72 * s);
    return fmax(0, floor(count + 0.5));
}
