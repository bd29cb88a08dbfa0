// SPDX-License-Identifier: BSD-3-Clause
// Rays against a sphere or a mesh, by Embree.
#ifndef GONIO_SCENE_CASTER_H
#define GONIO_SCENE_CASTER_H

#include <stdbool.h>

#include "gonio/direction.h"
#include "gonio/status.h"
#include "scene/mesh.h"

typedef struct sim_caster sim_caster;

typedef struct sim_hit {
    gonio_vec3 point;
    gonio_vec3 facet;   // unit normal of the surface itself, toward the ray's origin
    gonio_vec3 normal;  // unit shading normal, on the same side
    gonio_vec3 tangent; // unit, perpendicular to normal: the sample's +x
} sim_hit;

// mesh NULL: the unit sphere. The mesh is borrowed until the caster is freed.
gonio_status gonio_sim_caster_new(const sim_mesh *mesh, sim_caster **out, gonio_error *error);
void gonio_sim_caster_free(sim_caster *caster); // NULL is allowed
// Both may be called from any number of threads at once.
bool gonio_sim_caster_hit(const sim_caster *caster, gonio_vec3 origin, gonio_vec3 direction, sim_hit *hit);
bool gonio_sim_caster_shadowed(const sim_caster *caster, const sim_hit *hit, gonio_vec3 toward_light);

#endif
