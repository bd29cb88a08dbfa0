// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "homomorphic": a product of functions of either direction and of the half vector.
#ifndef GONIO_BRDF_KIND_HOMOMORPHIC_H
#define GONIO_BRDF_KIND_HOMOMORPHIC_H

#include "brdf/grid/grid.h"
#include "brdf/transform.h"
#include "gonio/model.h"

typedef struct gonio_homomorphic_parts {
    int dims, level, channels;
    gonio_transform_kind kind;
    const gonio_transform *transforms; // [channels]
    const char (*names)[32];
    const float *factors; // [2 rows][channels]: p, then q
} gonio_homomorphic_parts;

// Rows of the grids: unknowns of p, and of q.
size_t gonio_homomorphic_rows(int dims, int level);
// The unknowns whose weighted sum is the transformed value of a pair; returns how many (up to 12).
int gonio_homomorphic_row(int dims, int level, gonio_vec3 wi, gonio_vec3 wo, size_t at[12], double weights[12]);
// Everything is copied. The caller frees the model.
gonio_status gonio_homomorphic_new(const gonio_homomorphic_parts *parts, gonio_model **out, gonio_error *error);

#endif
