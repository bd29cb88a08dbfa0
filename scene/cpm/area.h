// SPDX-License-Identifier: BSD-3-Clause
// The visible projected area of a texel as a function of the direction: over the six faces of a cube, as the largest of
// its Haar coefficients.
#ifndef GONIO_SCENE_CPM_AREA_H
#define GONIO_SCENE_CPM_AREA_H

#include <stddef.h>
#include <stdint.h>

#include "gonio/direction.h"

#define CPM_FACE_MAX 64

typedef struct cpm_coefficient {
    uint16_t index; // of 6 side^2: face, row, column of the transform
    int16_t value;  // times the scale
} cpm_coefficient;

gonio_vec3 gonio_cpm_area_direction(int side, size_t pixel); // of a pixel's middle, of 6 side^2
// Orthonormal, per face and in place; side is a power of two.
void gonio_cpm_haar(float *values, int side);
void gonio_cpm_haar_back(float *values, int side);
// The `keep` largest coefficients, by their index; returns how many there are (0 is none), and what they are times.
size_t gonio_cpm_area_keep(const float *transformed, int side, size_t keep, cpm_coefficient *kept, float *scale);
// The values again.
void gonio_cpm_area_restore(const cpm_coefficient *kept, size_t n, float scale, int side, float *values);
// Between the middles of pixels, within a face: of the values, and of the coefficients that they come from.
double gonio_cpm_area_at(const float *values, int side, gonio_vec3 direction);
double gonio_cpm_area_of(const cpm_coefficient *kept, size_t n, float scale, int side, gonio_vec3 direction);

#endif
