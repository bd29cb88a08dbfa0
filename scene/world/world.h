// SPDX-License-Identifier: BSD-3-Clause
// What an open scene holds.
#ifndef GONIO_SCENE_WORLD_WORLD_H
#define GONIO_SCENE_WORLD_WORLD_H

#include "gonio/scene.h"
#include "io/colour.h"
#include "scene/caster.h"
#include "scene/mesh.h"
#include "scene/world/environment.h"
#include "scene/world/settings.h"

typedef struct world_material {
    gonio_model *model;
    gonio_colour_weights colour;
    double albedo[3];
    gonio_picture *map; // over uv, by which it is multiplied as well; NULL: none
    bool constant;      // Lambert: f is the same in every direction
    double f[3];        // that
} world_material;

// Which of the materials lies where, by the codes of a picture.
typedef struct world_material_map {
    int width, height;
    uint16_t *materials; // rows from the top; NULL: no map
} world_material_map;

typedef struct world_mesh {
    size_t first, triangles, vertices; // the mesh's share of all triangles, and how many vertices it has
    bool has_uv;
    world_material_map map;
} world_mesh;

struct gonio_scene {
    scene_settings *settings;
    scene_mesh *mesh; // all meshes in the scene's place; uvs and tangents are 0 where a mesh has none
    uint16_t *triangle_material, *triangle_mesh;
    world_material *materials;
    world_mesh *meshes;
    world_environment *environment; // NULL: none
    scene_caster *caster;
    gonio_scene_facts facts;
};

// A place of a surface, as a path meets it.
typedef struct world_place {
    scene_hit hit;
    gonio_vec3 bitangent;
    int material;
    double uv[2];
    double albedo[3]; // of the material there, of its maps
} world_place;

void gonio_world_place(const gonio_scene *scene, const scene_hit *hit, world_place *place);
// A direction in the place's frame.
gonio_vec3 gonio_world_local(const world_place *place, gonio_vec3 w);
gonio_vec3 gonio_world_outward(const world_place *place, gonio_vec3 local);
// f_r of red, green and blue between directions of the frame, without the place's albedo.
void gonio_world_eval(const gonio_scene *scene, int material, gonio_vec3 wi, gonio_vec3 wo, double rgb[3]);

#endif
