// SPDX-License-Identifier: BSD-3-Clause
// What a least-squares spline is fitted to: a monotone function of the value, so that errors are weighed as the domain
// asks and, for the positive link, no answer can be negative.
//
// The positive link is ln(y + eps) from y = eps on. Below, it goes on with the same value and slope as
// ln(2 eps) + ln(y / eps) / 2, whose inverse eps exp(2 (t - ln 2 eps)) is positive for every t. The usual
// inverse of ln(y + eps), exp(t) - eps, is negative down to -eps wherever a spline swings below ln(eps).
#ifndef GONIO_BRDF_LINK_H
#define GONIO_BRDF_LINK_H

#include <math.h>
#include <stddef.h>

typedef enum gonio_link_kind {
    GONIO_LINK_LINEAR = 0,
    GONIO_LINK_POSITIVE = 1,
    GONIO_LINK_ASINH = 2, // logarithm of both signs, linear within eps
} gonio_link_kind;

// One channel's. scale is a power of two near the largest |value|, so that k z is fitted as k times the fit of z.
typedef struct gonio_link {
    double scale, eps; // y = z / scale; eps in units of y
} gonio_link;

// Zeros are noise that was clamped: they count as a sixteenth of the noise level.
#define GONIO_LINK_FLOOR (1.0 / 16)

static inline double gonio_link_apply(gonio_link_kind kind, const gonio_link *link, double z) {
    const double y = z / link->scale, eps = link->eps;
    if (kind == GONIO_LINK_LINEAR) {
        return y;
    }
    if (kind == GONIO_LINK_ASINH) {
        return asinh(y / eps);
    }
    if (y >= eps) {
        return log(y + eps);
    }
    return log(2 * eps) + 0.5 * log(fmax(y / eps, GONIO_LINK_FLOOR));
}

// z for a link value t, and dz/dt in *slope (may be NULL).
static inline double gonio_link_invert(gonio_link_kind kind, const gonio_link *link, double t, double *slope) {
    double y, d;
    if (kind == GONIO_LINK_LINEAR) {
        y = t;
        d = 1;
    } else if (kind == GONIO_LINK_ASINH) {
        y = link->eps * sinh(t);
        d = link->eps * cosh(t);
    } else {
        // t is held within 60 of the middle, e^60 = 1e26: beyond the range of any data, and never infinite.
        const double e = exp(fmin(fmax(t, -60), 60));
        const double over = e / (2 * link->eps);
        y = over >= 1 ? e - link->eps : link->eps * over * over;
        d = over >= 1 ? e : 2 * y;
    }
    if (slope != NULL) {
        *slope = d * link->scale;
    }
    return y * link->scale;
}

#endif
