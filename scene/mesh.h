// SPDX-License-Identifier: BSD-3-Clause
// Triangle meshes from files, ready for the ray caster.
#ifndef GONIO_SCENE_MESH_H
#define GONIO_SCENE_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/status.h"

#define SCENE_MATERIAL_NAME_MAX 64

// positions, normals, tangents: vertices x 3; uvs: vertices x 2; tangents and uvs NULL where the file has no texture
// coordinates; indices: triangles x 3, each below vertices.
typedef struct scene_mesh {
    size_t vertices, triangles;
    float *positions, *normals, *tangents, *uvs;
    unsigned *indices;
    uint16_t *materials; // [triangles]: which of the file's own materials each has
    int material_count;
    char (*material_names)[SCENE_MATERIAL_NAME_MAX]; // [material_count]
} scene_mesh;

// PLY, OBJ or glTF by the file's name, as it stands there; faces become triangles, missing normals are made
// (normals.h). GONIO_E_INPUT names the file and what is wrong with it. The caller frees it.
gonio_status gonio_scene_mesh_load(const char *path, bool z_up, scene_mesh **out, gonio_error *error);
// The same, moved and scaled into the unit sphere about the origin.
gonio_status gonio_scene_mesh_read(const char *path, bool z_up, scene_mesh **out, gonio_error *error);
void gonio_scene_mesh_free(scene_mesh *mesh); // NULL is allowed

#endif
