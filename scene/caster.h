// SPDX-License-Identifier: BSD-3-Clause
// Rays against a sphere or a mesh, by Embree.
#ifndef GONIO_SCENE_CASTER_H
#define GONIO_SCENE_CASTER_H

#include <stdbool.h>

#include <math.h>

#include "base/vector.h"
#include "gonio/status.h"
#include "scene/mesh.h"

typedef struct scene_caster scene_caster;

typedef struct scene_hit {
    gonio_vec3 point;
    gonio_vec3 facet;   // unit normal of the surface itself, toward the ray's origin
    gonio_vec3 normal;  // unit shading normal, on the same side
    gonio_vec3 tangent; // unit, perpendicular to normal: the sample's +x
    double distance;    // from the ray's origin
    size_t triangle;    // of the mesh
    double u, v;        // the place in it, which is (1 - u - v) a + u b + v c of its corners
} scene_hit;

// mesh NULL: the unit sphere. The mesh is borrowed until the caster is freed.
gonio_status gonio_scene_caster_new(const scene_mesh *mesh, scene_caster **out, gonio_error *error);
void gonio_scene_caster_free(scene_caster *caster); // NULL is allowed
// Both may be called from any number of threads at once.
bool gonio_scene_caster_hit(const scene_caster *caster, gonio_vec3 origin, gonio_vec3 direction, scene_hit *hit);
// The same without normal and tangent.
bool gonio_scene_caster_find(const scene_caster *caster, gonio_vec3 origin, gonio_vec3 direction, scene_hit *hit);
// Does anything lie on the way from a point of a surface, which it leaves on either side of the facet?
bool gonio_scene_caster_blocked(const scene_caster *caster, gonio_vec3 point, gonio_vec3 facet, gonio_vec3 direction,
                                double distance);
// Where a ray that leaves a surface starts.
gonio_vec3 gonio_scene_caster_leave(const scene_caster *caster, gonio_vec3 point, gonio_vec3 facet,
                                    gonio_vec3 direction);
// A place of a mesh as a ray from that side would find it.
void gonio_scene_caster_surface(const scene_caster *caster, size_t triangle, double u, double v, gonio_vec3 toward_eye,
                                scene_hit *hit);
#define SCENE_CASTER_PACKET 16
// Of up to SCENE_CASTER_PACKET rays the bits of those that something stops; origins have left their surfaces. Within:
// nearer than these distances.
unsigned gonio_scene_caster_stopped(const scene_caster *caster, int n, const gonio_vec3 *origins,
                                    const gonio_vec3 *directions);
unsigned gonio_scene_caster_stopped_within(const scene_caster *caster, int n, const gonio_vec3 *origins,
                                           const gonio_vec3 *directions, const double *distances);
bool gonio_scene_caster_shadowed(const scene_caster *caster, const scene_hit *hit, gonio_vec3 toward_light);
// The direction in the sample's frame.
static inline gonio_vec3 scene_into_frame(const scene_hit *hit, gonio_vec3 w) {
    const gonio_vec3 n = hit->normal, t = hit->tangent;
    const gonio_vec3 local = {dot(t, w), dot(cross(n, t), w), dot(n, w)};
    const double length = sqrt(dot(local, local));
    return (gonio_vec3){local.x / length, local.y / length, local.z / length};
}

#endif
