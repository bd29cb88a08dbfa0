// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "table": values, or a spline's control points, at the nodes of a grid of angles.
#ifndef GONIO_BRDF_KIND_TABLE_H
#define GONIO_BRDF_KIND_TABLE_H

#include "brdf/grid/grid.h"
#include "brdf/transform.h"
#include "gonio/model.h"

typedef struct gonio_table_parts {
    gonio_grid grid;
    gonio_grid_degree degree;
    int channels;
    gonio_transform_kind kind;
    const gonio_transform *transforms; // [channels]
    const char (*names)[32];
    float *points; // [nodes][channels], transformed
    float *spread; // standard uncertainty of what is transformed, at the nodes, straight lines between; NULL: none
} gonio_table_parts;

// Takes over points and spread, on success only; the rest is copied. The caller frees the model.
gonio_status gonio_table_new(const gonio_table_parts *parts, gonio_model **out, gonio_error *error);

#endif
