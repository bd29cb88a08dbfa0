// SPDX-License-Identifier: BSD-3-Clause
// The simplified mesh M_1 that carries the texels, and where on it the original's places lie.
#ifndef GONIO_SCENE_CPM_SURFACE_H
#define GONIO_SCENE_CPM_SURFACE_H

#include "gonio/direction.h"
#include "scene/mesh.h"

typedef struct cpm_surface cpm_surface;

// A place of M_1.
typedef struct cpm_spot {
    size_t triangle;
    double u, v;      // of the triangle
    double s, t;      // of the texture, 0 to 1
    gonio_vec3 point; // the place itself
} cpm_spot;

// Of a mesh, by quadric simplification to about that share of its triangles. Its texture coordinates become the charts
// where the file has some that lie within the unit square and it is asked for; else charts are made for texels of that
// resolution. GONIO_E_INPUT where nothing is left of the mesh.
typedef struct cpm_surface_options {
    double share;    // of the triangles
    bool own_charts; // never the file's
    int resolution;  // texels a side
} cpm_surface_options;
gonio_status gonio_cpm_surface_new(const scene_mesh *mesh, bool has_uv, const cpm_surface_options *options,
                                   cpm_surface **out, gonio_error *error);
void gonio_cpm_surface_free(cpm_surface *surface); // NULL is allowed
// As bytes, and from them (NULL: no memory, or not such bytes).
size_t gonio_cpm_surface_bytes(const cpm_surface *surface);
void gonio_cpm_surface_pack(const cpm_surface *surface, void *bytes);
cpm_surface *gonio_cpm_surface_unpack(const void *bytes, size_t size);
size_t gonio_cpm_surface_triangles(const cpm_surface *surface);
bool gonio_cpm_surface_has_file_charts(const cpm_surface *surface);
// The place of M_1 that is nearest to a point. Any number of threads. near: a triangle that may be near it (below the
// number of triangles), so that little needs to be looked at; it changes no result.
void gonio_cpm_surface_nearest(const cpm_surface *surface, gonio_vec3 point, size_t near, cpm_spot *spot);
// Where a ray meets it, and the unit normal there, toward the ray's origin; and does it stop one that leaves it?
bool gonio_cpm_surface_hit(const cpm_surface *surface, gonio_vec3 origin, gonio_vec3 direction, gonio_vec3 *point,
                           gonio_vec3 *normal);
bool gonio_cpm_surface_blocked(const cpm_surface *surface, gonio_vec3 point, gonio_vec3 normal, gonio_vec3 direction,
                               double distance);
// How fast the texture runs along the surface there: d(s, t) for a step in space, which is taken along the triangle.
void gonio_cpm_surface_gradient(const cpm_surface *surface, const cpm_spot *spot, gonio_vec3 step, double *ds,
                                double *dt);
gonio_vec3 gonio_cpm_surface_normal(const cpm_surface *surface, size_t triangle);

// Charts for a mesh without texture coordinates: uv of every corner of every triangle (triangles x 6), in the unit
// square, a texel apart. false: no memory.
bool gonio_cpm_charts(const float *positions, const unsigned *indices, size_t triangles, int resolution, float *uv);

#endif
