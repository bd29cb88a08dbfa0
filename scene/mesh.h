// SPDX-License-Identifier: BSD-3-Clause
// Triangle meshes from files, ready for the ray caster.
#ifndef GONIO_SCENE_MESH_H
#define GONIO_SCENE_MESH_H

#include <stdbool.h>
#include <stddef.h>

#include "gonio/status.h"

// Moved and scaled into the unit sphere about the origin. positions, normals, tangents: vertices x 3; tangents NULL
// where the file has no texture coordinates; indices: triangles x 3, each below vertices.
typedef struct scene_mesh {
    size_t vertices, triangles;
    float *positions, *normals, *tangents;
    unsigned *indices;
} scene_mesh;

// PLY or OBJ by the file's name; faces become triangles, missing normals are made (normals.h).
// GONIO_E_INPUT names the file and what is wrong with it. The caller frees it.
gonio_status gonio_scene_mesh_read(const char *path, bool z_up, scene_mesh **out, gonio_error *error);
void gonio_scene_mesh_free(scene_mesh *mesh); // NULL is allowed

#endif
