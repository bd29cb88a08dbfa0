// SPDX-License-Identifier: BSD-3-Clause
// SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014) by its counter: the n-th
// number needs no other, so that order, threads and subsets change none.
#ifndef GONIO_BASE_RANDOM_H
#define GONIO_BASE_RANDOM_H

#include <stdint.h>

#define GONIO_RANDOM_STEP 0x9e3779b97f4a7c15u // 2^64 / golden ratio, odd

// 64 bits that depend on every bit of x: a hash, and the number that a generator in state x gives.
static inline uint64_t gonio_random(uint64_t x) {
    x += GONIO_RANDOM_STEP;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

// Uniform in [0, 1), a multiple of 2^-53.
static inline double gonio_random_uniform(uint64_t x) { return (double)(gonio_random(x) >> 11) * 0x1p-53; }

// The same as a stream.
static inline double gonio_random_next(uint64_t *state) {
    const uint64_t x = *state;
    *state += GONIO_RANDOM_STEP;
    return gonio_random_uniform(x);
}

#endif
