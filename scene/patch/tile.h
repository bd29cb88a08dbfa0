// SPDX-License-Identifier: BSD-3-Clause
// Rays against the endless repetition of a tile, sixteen at a time, by Embree.
//
// Embree holds a few copies of the tile, all flat in one scene (its instances with coherent, robust packets hang in
// 3.13). A ray that leaves them goes on from the same place of the tile in the middle, so nothing is cut off, however
// flat it comes in.
#ifndef GONIO_SCENE_PATCH_TILE_H
#define GONIO_SCENE_PATCH_TILE_H

#include <stdbool.h>

#include "gonio/direction.h"
#include "gonio/status.h"
#include "scene/patch/patch_mesh.h"

#define PATCH_PACKET 16

typedef struct patch_tile patch_tile;

typedef struct patch_packet {
    gonio_vec3 origin[PATCH_PACKET], direction[PATCH_PACKET];
    long triangle[PATCH_PACKET]; // what was hit; PATCH_OUT, PATCH_FELL
    bool coherent;               // they run nearly alike
} patch_packet;
enum { PATCH_OUT = -1, PATCH_FELL = -2 };

// The mesh is borrowed. GONIO_E_INPUT where it has no area, GONIO_E_MEMORY.
gonio_status gonio_patch_tile_new(const patch_mesh *mesh, patch_tile **out, gonio_error *error);
void gonio_patch_tile_free(patch_tile *tile); // NULL is allowed

// All by any number of threads at once; bit k of `active` is ray k. After a hit, origin is the place in the tile.
void gonio_patch_tile_hit(const patch_tile *tile, patch_packet *packet, unsigned active);
// Bits of the rays that something stops.
unsigned gonio_patch_tile_shadowed(const patch_tile *tile, patch_packet *packet, unsigned active);

gonio_vec3 gonio_patch_tile_normal(const patch_tile *tile, long triangle); // unit, by the corners' order
// Triangles of one orientation and material have one class.
int gonio_patch_tile_class(const patch_tile *tile, long triangle);
int gonio_patch_tile_classes(const patch_tile *tile);
long gonio_patch_tile_member(const patch_tile *tile, int class); // the first triangle of a class
// How far rays start off a surface.
double gonio_patch_tile_lift(const patch_tile *tile);
void gonio_patch_tile_heights(const patch_tile *tile, double *low, double *high);

#endif
