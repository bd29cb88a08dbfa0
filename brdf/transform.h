// SPDX-License-Identifier: BSD-3-Clause
// What a spline holds of a value: f_r = scale * inverse(spline), channel by channel.
//
// The scale is a power of two near the largest |value|: splines then hold numbers of order 1 whatever the unit, so a
// fit of k z is k times the fit of z over the whole range of double, bit for bit when k is a power of two.
//
// There are two logarithms. Multilevel B-splines average, so they overshoot little, and they store ln(y + eps), whose
// inverse is the cheapest. A least-squares spline swings where no sample holds it, and exp(v) - eps is negative down to
// -eps wherever it swings below ln(eps). Its "positive" transform is ln(y + eps) from y = eps on; below, it goes on
// with the same value and slope as ln(2 eps) + ln(y / eps) / 2, whose inverse eps exp(2 (v - ln 2 eps)) is positive for
// every v.
#ifndef GONIO_BRDF_TRANSFORM_H
#define GONIO_BRDF_TRANSFORM_H

#include <math.h>

typedef enum gonio_transform_kind {
    GONIO_TRANSFORM_LINEAR = 0, // v = y = z / scale
    GONIO_TRANSFORM_LOG = 1,    // v = ln(y + eps): of lattices
    GONIO_TRANSFORM_ASINH = 2,  // v = asinh(y / eps): a logarithm of both signs, linear within eps
    GONIO_TRANSFORM_POSITIVE,   // of least squares, for what cannot be negative
} gonio_transform_kind;

// One channel's, as it stands in a model file; eps in units of y.
typedef struct gonio_transform {
    double scale, eps;
} gonio_transform;

// Zeros are noise that was clamped: the positive transform counts them as a sixteenth of the noise level.
#define GONIO_POSITIVE_FLOOR (1.0 / 16)

static inline double gonio_transform_apply(gonio_transform_kind kind, const gonio_transform *t, double z) {
    const double y = z / t->scale;
    switch (kind) {
    case GONIO_TRANSFORM_LOG:
        // A negative value is noise about zero: it counts as zero.
        return log((y > 0 ? y : 0) + t->eps);
    case GONIO_TRANSFORM_ASINH:
        return asinh(y / t->eps);
    case GONIO_TRANSFORM_POSITIVE:
        return y >= t->eps ? log(y + t->eps) : log(2 * t->eps) + 0.5 * log(fmax(y / t->eps, GONIO_POSITIVE_FLOOR));
    case GONIO_TRANSFORM_LINEAR:
        break;
    }
    return y;
}

// y of the positive transform, and dy/dv in *slope. v is held within 60 of 0, e^60 = 1e26: beyond the range of any
// data, and never infinite.
static inline double gonio_positive_invert(double eps, double v, double *slope) {
    const double e = exp(fmin(fmax(v, -60), 60)), over = e / (2 * eps);
    const double y = over >= 1 ? e - eps : eps * over * over;
    *slope = over >= 1 ? e : 2 * y;
    return y;
}

static inline double gonio_transform_invert(gonio_transform_kind kind, const gonio_transform *t, double v) {
    double slope;
    switch (kind) {
    case GONIO_TRANSFORM_LOG:
        return t->scale * (exp(v) - t->eps);
    case GONIO_TRANSFORM_ASINH:
        return t->scale * (t->eps * sinh(v));
    case GONIO_TRANSFORM_POSITIVE:
        return t->scale * gonio_positive_invert(t->eps, v, &slope);
    case GONIO_TRANSFORM_LINEAR:
        break;
    }
    return t->scale * v;
}

// d f_r / d v.
static inline double gonio_transform_slope(gonio_transform_kind kind, const gonio_transform *t, double v) {
    double slope = 1;
    switch (kind) {
    case GONIO_TRANSFORM_LOG:
        return t->scale * exp(v);
    case GONIO_TRANSFORM_ASINH:
        return t->scale * (t->eps * cosh(v));
    case GONIO_TRANSFORM_POSITIVE:
        gonio_positive_invert(t->eps, v, &slope);
        break;
    case GONIO_TRANSFORM_LINEAR:
        break;
    }
    return t->scale * slope;
}

#endif
