// SPDX-License-Identifier: BSD-3-Clause
// What an open patch holds.
#ifndef GONIO_SCENE_PATCH_PATCH_H
#define GONIO_SCENE_PATCH_PATCH_H

#include "gonio/model.h"
#include "gonio/patch.h"
#include "scene/patch/settings.h"
#include "scene/patch/tile.h"

typedef struct patch_material {
    gonio_model *model; // NULL: no triangle has it
    bool lambert;
    double *constant; // [channels of the patch] Lambert: the same in every direction; NULL: it is not
} patch_material;

struct gonio_patch {
    patch_mesh mesh;
    patch_tile *tile;
    patch_material materials[PATCH_MATERIALS_MAX];
    int channels;
    const char (*channel_names)[32]; // of the model with the most channels
};

// f_r of a material on a facet of that normal, in all the patch's channels, which of a model of one are alike. The
// facet's x is the patch's x as far as the facet has it.
void gonio_patch_material_eval(const gonio_patch *patch, int material, gonio_vec3 normal, gonio_vec3 wi, gonio_vec3 wo,
                               double *values);
gonio_vec3 gonio_patch_tangent(gonio_vec3 normal); // that x

#endif
