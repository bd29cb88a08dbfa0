// SPDX-License-Identifier: BSD-3-Clause
// Scrambled Sobol points: every power-of-two block from a multiple of its size on is stratified in each coordinate.
#ifndef GONIO_BASE_SOBOL_H
#define GONIO_BASE_SOBOL_H

#include <stdint.h>

#define GONIO_SOBOL_DIMENSIONS 4

// A coordinate (dimension 0 to 3) of a point, in (0, 1): the middle of its 2^-32 cell. Seeds scramble independently.
double gonio_sobol(uint32_t index, int dimension, uint64_t seed);
// The same with a random shift (by XOR) in place of Owen's scrambling: as stratified and unbiased, a third of the time;
// errors fall a little less fast.
double gonio_sobol_shifted(uint32_t index, int dimension, uint64_t seed);

#endif
