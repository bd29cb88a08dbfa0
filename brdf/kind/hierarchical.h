// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "hierarchical": a coarse B-spline and overlays of finer ones where they are needed.
#ifndef GONIO_BRDF_KIND_HIERARCHICAL_H
#define GONIO_BRDF_KIND_HIERARCHICAL_H

#include "brdf/spline/lattice.h"
#include "brdf/spline/overlay.h"
#include "brdf/transform.h"
#include "gonio/model.h"

#define GONIO_OVERLAYS_MAX 8

typedef struct gonio_hierarchical_parts {
    gonio_lattice coarse;
    int overlays;
    gonio_overlay overlay[GONIO_OVERLAYS_MAX]; // of levels coarse.level + 1 on
    gonio_coordinates coordinates;
    gonio_transform_kind kind;
    const gonio_transform *transforms; // [channels]
    const char (*names)[32];
} gonio_hierarchical_parts;

// Takes over the coarse lattice's points and the overlays' tables and data, on success only. The caller frees the
// model.
gonio_status gonio_hierarchical_new(const gonio_hierarchical_parts *parts, gonio_model **out, gonio_error *error);

#endif
