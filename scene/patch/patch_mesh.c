// SPDX-License-Identifier: BSD-3-Clause
#include "scene/patch/patch_mesh.h"

#include <stdlib.h>
#include <string.h>

void gonio_patch_mesh_free(patch_mesh *mesh) {
    free(mesh->positions);
    free(mesh->corners);
    free(mesh->materials);
    memset(mesh, 0, sizeof *mesh);
}

bool gonio_patch_mesh_reserve(patch_mesh *mesh, size_t vertices, size_t triangles) {
    mesh->positions = malloc((vertices + 1) * 3 * sizeof(float)); // Embree reads 4 bytes beyond
    mesh->corners = malloc(triangles * 3 * sizeof(unsigned));
    mesh->materials = malloc(triangles);
    return mesh->positions != NULL && mesh->corners != NULL && mesh->materials != NULL;
}

unsigned gonio_patch_mesh_vertex(patch_mesh *mesh, double x, double y, double z) {
    float *to = mesh->positions + 3 * mesh->vertices;
    to[0] = (float)x;
    to[1] = (float)y;
    to[2] = (float)z;
    return (unsigned)mesh->vertices++;
}

void gonio_patch_mesh_triangle(patch_mesh *mesh, unsigned a, unsigned b, unsigned c, int material) {
    memcpy(mesh->corners + 3 * mesh->triangles, (const unsigned[3]){a, b, c}, 3 * sizeof a);
    mesh->materials[mesh->triangles++] = (uint8_t)material;
}
