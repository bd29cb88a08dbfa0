// SPDX-License-Identifier: BSD-3-Clause
// The light that comes to a place along one ray.
#ifndef GONIO_SCENE_WORLD_PATH_H
#define GONIO_SCENE_WORLD_PATH_H

#include "scene/world/world.h"

// One path: where its random numbers come from, and what it is counted for.
typedef struct world_path {
    const gonio_scene *scene;
    bool interreflection;
    int light;      // 1 + the number of the one that shines; 0: all
    uint32_t index; // of the path among those of its pixel
    uint64_t seed;  // of the pixel
    int pixel;
    double scale; // of the path's light in the pixel's value
    uint64_t rays;
    void (*use)(void *context, const gonio_scene_use *use); // see gonio_scene_options
    void *use_context;
} world_path;

// Two numbers of the path for purpose k (0: the place in the pixel), stratified over the pixel's paths.
void gonio_world_path_random(const world_path *path, int k, double u[2]);
// *met (may be NULL): did the ray meet a surface?
void gonio_world_path_trace(world_path *path, gonio_vec3 origin, gonio_vec3 direction, double rgb[3], bool *met);

#endif
