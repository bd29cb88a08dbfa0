// SPDX-License-Identifier: BSD-3-Clause
// The rays of one outgoing direction, which all incident directions share.
#ifndef GONIO_SCENE_PATCH_RAYS_H
#define GONIO_SCENE_PATCH_RAYS_H

#include "scene/patch/patch.h"

// Independent sets of rays, each stratified in itself: their spread is the standard error.
#define PATCH_REPLICATES 16

typedef struct patch_counts {
    uint64_t camera, shadow, bounces, fell;
} patch_counts;

typedef struct patch_rays {
    const gonio_patch *patch;
    const gonio_virtual_options *options;
    uint64_t seed;
    gonio_vec3 wo;
    size_t n;             // incident directions
    const gonio_vec3 *wi; // [n]
    const bool *done;     // [n]: these need no more
    const double *table;  // classes x n x channels: f_r (n.wi) of what the camera sees; NULL: evaluated for each ray
    double *sums;         // n x replicates x channels: radiance for unit irradiance across the beam
    uint32_t from, to;    // rays of each replicate to trace now; from is 0 or a power of two, to = 2 from
    patch_counts counts[PATCH_REPLICATES];
} patch_rays;

// f_r (n.wi) of every class for light from each wi, for patch_rays.table (classes x n x channels).
void gonio_patch_rays_table(const patch_rays *rays, double *table);
// Work of a thread pool: one replicate. The context is a patch_rays.
void gonio_patch_rays_trace(void *context, size_t replicate);

#endif
