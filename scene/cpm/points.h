// SPDX-License-Identifier: BSD-3-Clause
// The dense points of the original mesh, by the texel that each belongs to.
#ifndef GONIO_SCENE_CPM_POINTS_H
#define GONIO_SCENE_CPM_POINTS_H

#include "gonio/cpm.h"
#include "scene/cpm/surface.h"
#include "scene/world/world.h"

typedef struct cpm_point {
    uint32_t triangle;
    float u, v;
    float s, t;     // of the texture
    uint32_t texel; // of the finest level, by Morton's code
} cpm_point;

// Ordered by texel; those of a texel of any level follow each other.
typedef struct cpm_points {
    size_t n;
    cpm_point *points;
    double area; // that each stands for
} cpm_points;

// About n of them, stratified over the surface's area; each belongs to the texel of its own texture coordinates where
// those are the charts, else of its nearest place on M_1.
// resolution: texels a side, a power of two.
gonio_status gonio_cpm_points_new(const gonio_scene *scene, const cpm_surface *surface, size_t n, int resolution,
                                  int threads, uint64_t seed, cpm_points *points, gonio_error *error);
// The mesh's own texture coordinates at a place of it.
void gonio_cpm_texture(const scene_mesh *mesh, size_t triangle, double u, double v, double *s, double *t);
void gonio_cpm_points_free(cpm_points *points);
uint32_t gonio_cpm_morton(uint32_t x, uint32_t y);

// The points that a texel is made from, and the area that each stands for there.
typedef struct cpm_dense {
    size_t n;
    cpm_point *points;
    double *areas;
} cpm_dense;
// Of a texel of a level (0: the finest), at most that many: every so many-th. A box takes its own; a tent, twice as
// wide, its neighbours' as well, by their distance from its middle. false: no memory.
bool gonio_cpm_dense_new(const cpm_points *points, gonio_cpm_filter filter, int level, int resolution, uint32_t texel,
                         size_t most, cpm_dense *dense);
void gonio_cpm_dense_free(cpm_dense *dense);

#endif
