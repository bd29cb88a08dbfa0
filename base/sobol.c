// SPDX-License-Identifier: BSD-3-Clause
// Sobol' 1967; direction numbers: Joe & Kuo, "Constructing Sobol sequences with better two-dimensional projections"
// (2008); scrambling: Owen 1995 by hashing, after Burley, "Practical hash-based Owen scrambling" (2020).
#include "base/sobol.h"

static uint32_t hashed(uint32_t x) {
    // Wellons, "hash-prospector" (2018), lowbias32.
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

static uint32_t bits_reversed(uint32_t x) {
    x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
    return (x >> 16) | (x << 16);
}

// Owen's nested scrambling: each bit is flipped by a hash of the bits above it (and of none below).
static uint32_t owen_scrambled(uint32_t x, uint32_t seed) {
    uint32_t y = 0, prefix = 1;
    for (int bit = 31; bit >= 0; bit--) {
        const uint32_t b = (x >> bit) & 1;
        y |= (b ^ (hashed(prefix ^ seed) & 1)) << bit;
        prefix = hashed(prefix + 0x9e3779b9u * (b + 1));
    }
    return y;
}

// Sobol's sequence in 4 dimensions: the first is the radical inverse, the others have primitive polynomials of degree
// 1 to 3 (coefficients a, initial m) from Joe & Kuo's table.
static uint32_t sobol(uint32_t index, int dimension) {
    static const struct {
        int degree;
        uint32_t a, m[3];
    } table[3] = {{1, 0, {1}}, {2, 1, {1, 3}}, {3, 1, {1, 3, 1}}};
    if (dimension == 0) {
        return bits_reversed(index);
    }
    const int degree = table[dimension - 1].degree;
    const uint32_t a = table[dimension - 1].a;
    uint32_t v[32], x = 0;
    for (int k = 0; k < 32 && index >> k != 0; k++) {
        if (k < degree) {
            v[k] = table[dimension - 1].m[k] << (31 - k);
        } else {
            v[k] = v[k - degree] ^ (v[k - degree] >> degree);
            for (int j = 1; j < degree; j++) {
                v[k] ^= ((a >> (degree - 1 - j)) & 1) * v[k - j];
            }
        }
        x ^= ((index >> k) & 1) * v[k];
    }
    return x;
}

static uint32_t key_of(int dimension, uint64_t seed) {
    return hashed((uint32_t)seed ^ hashed((uint32_t)(seed >> 32) + 0x51ed27u * (uint32_t)(dimension + 1)));
}

static double middle(uint32_t x) { return ((double)x + 0.5) / 4294967296.0; }

double gonio_sobol(uint32_t index, int dimension, uint64_t seed) {
    return middle(owen_scrambled(sobol(index, dimension), key_of(dimension, seed)));
}

double gonio_sobol_shifted(uint32_t index, int dimension, uint64_t seed) {
    return middle(sobol(index, dimension) ^ key_of(dimension, seed));
}
