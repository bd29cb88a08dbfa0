// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "geodesic": for each of a row of incidences an adaptive geodesic hemisphere.
#ifndef GONIO_BRDF_KIND_GEODESIC_H
#define GONIO_BRDF_KIND_GEODESIC_H

#include "base/vector.h"
#include "brdf/grid/grid.h"
#include "brdf/transform.h"
#include "gonio/model.h"

#define GONIO_GEODESIC_LEAF 0x80000000U
#define GONIO_GEODESIC_DEPTH_MAX 9

// A facet of the hemisphere by its corners, unit vectors.
typedef struct gonio_facet {
    gonio_vec3 corner[3];
} gonio_facet;

static inline gonio_vec3 gonio_facet_towards(gonio_vec3 v) { return scaled(v, 1 / sqrt(dot(v, v))); }

static inline gonio_vec3 gonio_facet_centre(const gonio_facet *f) {
    return gonio_facet_towards(sum(sum(f->corner[0], f->corner[1]), f->corner[2]));
}

// One of the four facets that the middles of its sides make: at its corners, 0 to 2, and between them, 3.
static inline gonio_facet gonio_facet_part(const gonio_facet *f, int part) {
    gonio_facet middles;
    for (int k = 0; k < 3; k++) { // across from corner k
        middles.corner[k] = gonio_facet_towards(sum(f->corner[(k + 1) % 3], f->corner[(k + 2) % 3]));
    }
    if (part < 3) {
        const gonio_vec3 corner = f->corner[part];
        middles.corner[part] = corner;
    }
    return middles;
}

// Hemispheres are quarters of an octahedron's; of isotropic, mirrored materials those of y >= 0 alone.
static inline size_t gonio_geodesic_roots(int dims) { return dims == 3 ? 2 : 4; }

static inline gonio_facet gonio_geodesic_root(size_t index) {
    return (gonio_facet){{{index % 2 == 0 ? 1 : -1, 0, 0}, {0, index < 2 ? 1 : -1, 0}, {0, 0, 1}}};
}

typedef struct gonio_geodesic_parts {
    gonio_grid grid; // of angles: its rows are the incidences
    int channels;
    gonio_transform_kind kind;
    const gonio_transform *transforms; // [channels]
    const char (*names)[32];
    size_t nodes, leaves;
    // [nodes]: the number of the first of a facet's four parts, which stand together and behind it; or
    // GONIO_GEODESIC_LEAF + the number of its sample. First the roots, incidence after incidence.
    const uint32_t *node;
    const float *values; // [leaves][channels]
} gonio_geodesic_parts;

// Everything is copied. The caller frees the model.
gonio_status gonio_geodesic_new(const gonio_geodesic_parts *parts, gonio_model **out, gonio_error *error);

#endif
