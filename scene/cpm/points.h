// SPDX-License-Identifier: BSD-3-Clause
// The dense points of the original mesh, by the texel that each belongs to.
#ifndef GONIO_SCENE_CPM_POINTS_H
#define GONIO_SCENE_CPM_POINTS_H

#include "scene/cpm/surface.h"
#include "scene/world/world.h"

typedef struct cpm_point {
    uint32_t triangle;
    float u, v;
    uint32_t texel; // of the finest level, by Morton's code
} cpm_point;

// Ordered by texel; those of a texel of any level follow each other.
typedef struct cpm_points {
    size_t n;
    cpm_point *points;
    double area; // that each stands for
} cpm_points;

// About n of them, stratified over the surface's area; each belongs to the texel of its nearest place on M_1.
// resolution: texels a side, a power of two.
gonio_status gonio_cpm_points_new(const gonio_scene *scene, const cpm_surface *surface, size_t n, int resolution,
                                  int threads, uint64_t seed, cpm_points *points, gonio_error *error);
void gonio_cpm_points_free(cpm_points *points);
uint32_t gonio_cpm_morton(uint32_t x, uint32_t y);
// The points of a texel of a level (0: the finest).
void gonio_cpm_points_of(const cpm_points *points, int level, uint32_t texel, size_t *first, size_t *n);

#endif
