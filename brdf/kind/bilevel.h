// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "cbmba": a coarse dense lattice for the diffuse part and a sparse fine one for the specular part.
#ifndef GONIO_BRDF_KIND_BILEVEL_H
#define GONIO_BRDF_KIND_BILEVEL_H

#include "brdf/spline/lattice.h"
#include "brdf/spline/sparse.h"
#include "brdf/transform.h"
#include "gonio/model.h"

// What a model is made of; arrays of malloc that the model takes over.
typedef struct gonio_bilevel_parts {
    gonio_coordinates coordinates;
    gonio_transform_kind kind;
    int diffuse_level;
    float *diffuse; // (2^D + 3)^dims x channels; sparse has the dimensions
    gonio_sparse sparse;
    size_t kept; // specular control points kept
    // Two channels, ln of the standard uncertainty of the transformed value: where all control points of a place are
    // kept, and what comes to it, in square, where none is. points NULL: no uncertainty.
    gonio_lattice sigma;
} gonio_bilevel_parts;

// Make a model; takes over parts' arrays (and empties them) on success. Transforms and names are copied.
gonio_status gonio_bilevel_model_new(gonio_bilevel_parts *parts, const gonio_transform *transforms,
                                     const char (*channel_names)[32], gonio_model **out, gonio_error *error);
void gonio_bilevel_parts_release(gonio_bilevel_parts *parts);

#endif
