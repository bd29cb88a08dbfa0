// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "separable": sums of products of two tables.
#ifndef GONIO_BRDF_KIND_SEPARABLE_H
#define GONIO_BRDF_KIND_SEPARABLE_H

#include "brdf/grid/grid.h"
#include "brdf/transform.h"
#include "gonio/model.h"

#define GONIO_SEPARABLE_TERMS_MAX 64

typedef struct gonio_separable_parts {
    gonio_grid grid;
    int terms, channels;
    gonio_transform_kind kind;
    const gonio_transform *transforms; // [channels]
    const char (*names)[32];
    const float *left;  // [rows][terms][channels]
    const float *right; // [columns][terms][channels]
} gonio_separable_parts;

// Everything is copied. The caller frees the model.
gonio_status gonio_separable_new(const gonio_separable_parts *parts, gonio_model **out, gonio_error *error);

#endif
