// SPDX-License-Identifier: BSD-3-Clause
// The triangles of one tile.
#ifndef GONIO_SCENE_PATCH_PATCH_MESH_H
#define GONIO_SCENE_PATCH_PATCH_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Triangles may reach beyond the tile [0, width] x [0, height]; they repeat as it does.
typedef struct patch_mesh {
    size_t vertices, triangles;
    float *positions;   // vertices x 3
    unsigned *corners;  // triangles x 3
    uint8_t *materials; // [triangles]
    double width, height;
} patch_mesh;

// Room for as many; false: no memory. gonio_patch_mesh_free takes an empty mesh, too.
bool gonio_patch_mesh_reserve(patch_mesh *mesh, size_t vertices, size_t triangles);
void gonio_patch_mesh_free(patch_mesh *mesh);
// The next vertex, whose number comes back, and the next triangle. There must be room.
unsigned gonio_patch_mesh_vertex(patch_mesh *mesh, double x, double y, double z);
void gonio_patch_mesh_triangle(patch_mesh *mesh, unsigned a, unsigned b, unsigned c, int material);

#endif
