// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "bvb": a tensor-product B-spline over the angles of a direction pair, with knots where it needs them.
#ifndef GONIO_BRDF_KIND_BVB_H
#define GONIO_BRDF_KIND_BVB_H

#include "brdf/transform.h"
#include "gonio/model.h"

// The axes, each from 0 to 1 linear in its angle; the last one of anisotropic models alone.
enum { GONIO_BVB_THETA_I, GONIO_BVB_THETA_O, GONIO_BVB_PHI_D, GONIO_BVB_PHI_I, GONIO_BVB_AXES };

#define GONIO_BVB_ORDER_MIN 2
#define GONIO_BVB_ORDER_MAX 4
#define GONIO_BVB_GAP 1e-6 // knots inside an axis are at least so far apart
#define GONIO_BVB_PAD 4    // zeros behind the last control point, so that rows are read four numbers at a time

// What a model is made of. The arrays come from malloc; a model takes them over.
typedef struct gonio_bvb_parts {
    int dims, order, channels;     // order: degree + 1, of every axis
    size_t count[GONIO_BVB_AXES];  // control points along each axis; 1 along one that is not there
    double *knots[GONIO_BVB_AXES]; // count + order each, the first and the last `order` of them 0 and 1
    // [phi_i][theta_i][theta_o][phi_d][channel], then GONIO_BVB_PAD zeros.
    float *points;
} gonio_bvb_parts;

static inline size_t gonio_bvb_points(const gonio_bvb_parts *p) {
    return p->count[0] * p->count[1] * p->count[2] * p->count[3];
}

// Make a model; takes over parts' arrays (and empties them) on success. What the spline says of a channel is held
// within range[2 channel .. 2 channel + 1] before the transform is inverted. Transforms, range and names are copied.
gonio_status gonio_bvb_model_new(gonio_bvb_parts *parts, gonio_transform_kind kind, const gonio_transform *transforms,
                                 const double *range, const char (*channel_names)[32], gonio_model **out,
                                 gonio_error *error);
// The parts of a model of kind "bvb", borrowed from it; NULL for other kinds.
const gonio_bvb_parts *gonio_bvb_model_parts(const gonio_model *model);
void gonio_bvb_parts_release(gonio_bvb_parts *parts);
// Every basis function of `order` on the knots that is not 0 at x in [0, 1]: its first index comes back.
size_t gonio_bvb_basis(const double *knots, size_t count, int order, double x, double *basis);

#endif
