// SPDX-License-Identifier: BSD-3-Clause
// What a lattice stores of a value: f_r = scale * inverse(spline), channel by channel.
//
// The scale is a power of two near the largest |value|: lattices then hold numbers of order 1 whatever the unit, so a
// fit of k z is k times the fit of z over the whole range of double, bit for bit when k is a power of two.
#ifndef GONIO_BRDF_TRANSFORM_H
#define GONIO_BRDF_TRANSFORM_H

#include <math.h>

typedef enum gonio_transform_kind {
    GONIO_TRANSFORM_LINEAR = 0, // v = z / scale
    GONIO_TRANSFORM_LOG = 1,    // v = ln(z / scale + eps): no value below -eps * scale can come back
    GONIO_TRANSFORM_ASINH = 2,  // v = asinh(z / scale / eps): the log of both signs, linear within eps
} gonio_transform_kind;

// One channel's; as it stands in a model file.
typedef struct gonio_transform {
    double scale, eps;
} gonio_transform;

static inline double gonio_transform_apply(gonio_transform_kind kind, const gonio_transform *t, double z) {
    const double y = z / t->scale;
    switch (kind) {
    case GONIO_TRANSFORM_LOG:
        // A negative value is noise about zero: it counts as zero.
        return log((y > 0 ? y : 0) + t->eps);
    case GONIO_TRANSFORM_ASINH:
        return asinh(y / t->eps);
    case GONIO_TRANSFORM_LINEAR:
        break;
    }
    return y;
}

static inline double gonio_transform_invert(gonio_transform_kind kind, const gonio_transform *t, double v) {
    switch (kind) {
    case GONIO_TRANSFORM_LOG:
        return t->scale * (exp(v) - t->eps);
    case GONIO_TRANSFORM_ASINH:
        return t->scale * (t->eps * sinh(v));
    case GONIO_TRANSFORM_LINEAR:
        break;
    }
    return t->scale * v;
}

// d f_r / d v.
static inline double gonio_transform_slope(gonio_transform_kind kind, const gonio_transform *t, double v) {
    switch (kind) {
    case GONIO_TRANSFORM_LOG:
        return t->scale * exp(v);
    case GONIO_TRANSFORM_ASINH:
        return t->scale * (t->eps * cosh(v));
    case GONIO_TRANSFORM_LINEAR:
        break;
    }
    return t->scale;
}

#endif
