// SPDX-License-Identifier: BSD-3-Clause
// Inside the kind "bvb": the basis functions of each axis, a polynomial between any two of its knots.
#ifndef GONIO_BRDF_KIND_BVB_AXIS_H
#define GONIO_BRDF_KIND_BVB_AXIS_H

#include "brdf/kind/bvb.h"
#include "brdf/spline/clones.h"

#define GONIO_BVB_BUCKETS 1024 // of an axis, in which spans are looked up

// The distinct knots of an axis, and the basis functions between them.
typedef struct gonio_bvb_axis {
    double *begin;   // [spans + 1], the last one infinite
    double *inverse; // [spans]: 1 / length
    gonio_f4 *basis; // [spans][power]: the coefficients of `order` functions, 0 in lanes beyond them
    uint16_t *span;  // [BUCKETS]: the one at the bucket's begin
} gonio_bvb_axis;

static inline size_t gonio_bvb_spans(const gonio_bvb_parts *p, int d) { return p->count[d] + 1 - (size_t)p->order; }

// Fill the axes of the parts' knots, in one block of memory, which axes[0].begin names; the caller frees it.
gonio_status gonio_bvb_axes_fill(const gonio_bvb_parts *parts, gonio_bvb_axis axes[GONIO_BVB_AXES], gonio_error *error);

#endif
