// SPDX-License-Identifier: BSD-3-Clause
// What a set of needs holds.
#ifndef GONIO_FIT_NEEDS_NEEDS_H
#define GONIO_FIT_NEEDS_NEEDS_H

#include <stdint.h>

#include "gonio/needs.h"

// Nodes along each axis of the half-vector coordinates where the density stands, by dimensions - 3.
#define GONIO_NEEDS_NODES(isotropic) ((isotropic) ? 33 : 17)

typedef struct needs_material {
    char name[GONIO_NEEDS_NAME_MAX];
    bool isotropic;
    int resolution;
    double codes, squares, behind;
    size_t cells;
    gonio_need *cell;
    double *density; // [nodes^dims]: squares spread by tents, over the mean
} needs_material;

struct gonio_needs {
    char *scene; // path
    uint64_t scene_checksum;
    int width, height, samples;
    bool interreflection;
    int frames, materials;
    gonio_needs_frame *frame;
    needs_material *material;
};

// Empty, with room for so many materials and frames.
gonio_status gonio_needs_new(int materials, int frames, gonio_needs **out, gonio_error *error);
// Sums and densities of the cells, once they are there.
gonio_status gonio_needs_finish(gonio_needs *needs, gonio_error *error);
// A pair as cells have it: isotropic ones are turned to phi_i = 0 and mirrored to 0 <= phi_o <= 180 deg.
void gonio_needs_normal_pair(bool isotropic, gonio_vec3 *wi, gonio_vec3 *wo);
// The cell of a pair that is so, among resolution^dims of the half-vector-narrow coordinates.
uint64_t gonio_needs_key(bool isotropic, int resolution, gonio_vec3 wi, gonio_vec3 wo);
// The pair at x[dims] of the coordinates; false: none in front of the surface is there.
bool gonio_needs_pair_at(gonio_coordinates coordinates, bool isotropic, const double *x, gonio_vec3 *wi,
                         gonio_vec3 *wo);
// Checksum of a file's bytes.
gonio_status gonio_needs_checksum(const char *path, uint64_t *sum, gonio_error *error);

#endif
