// SPDX-License-Identifier: BSD-3-Clause
// An open map.
#ifndef GONIO_SCENE_CPM_MAP_H
#define GONIO_SCENE_CPM_MAP_H

#include "scene/cpm/store.h"

struct gonio_cpm {
    const gonio_scene *scene;
    cpm_store store;
    uint64_t most_points; // of any texel
};

// What the scene's meshes and materials are; lights, cameras and sizes do not count.
uint64_t gonio_cpm_scene_fingerprint(const gonio_scene *scene);
// The texel's mean radiance toward the eye, by its characteristic points. sky: directions of an environment, which its
// points share. false: next to nothing of it is seen from there.
bool gonio_cpm_texel_light(const gonio_cpm *cpm, const cpm_record *record, gonio_vec3 eye, int sky, uint64_t seed,
                           double rgb[3]);

#endif
