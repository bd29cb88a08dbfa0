// SPDX-License-Identifier: BSD-3-Clause
// Numbers with their derivatives by four variables: exact gradients by the rules of calculus, operation by operation.
#ifndef GONIO_BRDF_DUAL_H
#define GONIO_BRDF_DUAL_H

#include <math.h>

typedef struct gonio_dual {
    double v, d[4];
} gonio_dual;

static inline gonio_dual gonio_dual_constant(double v) { return (gonio_dual){v, {0}}; }

static inline gonio_dual gonio_dual_variable(double v, int k) {
    gonio_dual x = {v, {0}};
    x.d[k] = 1;
    return x;
}

// f(a) with f = v and f' = slope there.
static inline gonio_dual gonio_dual_chain(gonio_dual a, double v, double slope) {
    return (gonio_dual){v, {slope * a.d[0], slope * a.d[1], slope * a.d[2], slope * a.d[3]}};
}

// f(a, b) with its two partial derivatives.
static inline gonio_dual gonio_dual_join(gonio_dual a, gonio_dual b, double v, double by_a, double by_b) {
    gonio_dual out = {v, {0}};
    for (int k = 0; k < 4; k++) {
        out.d[k] = by_a * a.d[k] + by_b * b.d[k];
    }
    return out;
}

static inline gonio_dual gonio_dual_add(gonio_dual a, gonio_dual b) { return gonio_dual_join(a, b, a.v + b.v, 1, 1); }
static inline gonio_dual gonio_dual_sub(gonio_dual a, gonio_dual b) { return gonio_dual_join(a, b, a.v - b.v, 1, -1); }
static inline gonio_dual gonio_dual_mul(gonio_dual a, gonio_dual b) {
    return gonio_dual_join(a, b, a.v * b.v, b.v, a.v);
}
static inline gonio_dual gonio_dual_div(gonio_dual a, gonio_dual b) {
    const double q = a.v / b.v;
    return gonio_dual_join(a, b, q, 1 / b.v, -q / b.v);
}
static inline gonio_dual gonio_dual_shift(gonio_dual a, double by) { return gonio_dual_chain(a, a.v + by, 1); }
static inline gonio_dual gonio_dual_scale(gonio_dual a, double by) { return gonio_dual_chain(a, a.v * by, by); }
static inline gonio_dual gonio_dual_square(gonio_dual a) { return gonio_dual_chain(a, a.v * a.v, 2 * a.v); }

// At 0, where the root of a square has no derivative, it counts as 0: all that is multiplied by such a root here is 0.
static inline gonio_dual gonio_dual_sqrt(gonio_dual a) {
    const double root = sqrt(a.v);
    return gonio_dual_chain(a, root, root > 0 ? 0.5 / root : 0);
}
static inline gonio_dual gonio_dual_norm(gonio_dual a, gonio_dual b) {
    return gonio_dual_sqrt(gonio_dual_add(gonio_dual_square(a), gonio_dual_square(b)));
}
static inline gonio_dual gonio_dual_sin(gonio_dual a) { return gonio_dual_chain(a, sin(a.v), cos(a.v)); }
static inline gonio_dual gonio_dual_cos(gonio_dual a) { return gonio_dual_chain(a, cos(a.v), -sin(a.v)); }
static inline gonio_dual gonio_dual_log(gonio_dual a) { return gonio_dual_chain(a, log(a.v), 1 / a.v); }
static inline gonio_dual gonio_dual_asinh(gonio_dual a) {
    return gonio_dual_chain(a, asinh(a.v), 1 / sqrt(1 + a.v * a.v));
}
static inline gonio_dual gonio_dual_exp(gonio_dual a) {
    const double e = exp(a.v);
    return gonio_dual_chain(a, e, e);
}
static inline gonio_dual gonio_dual_atan2(gonio_dual s, gonio_dual c) {
    const double r2 = s.v * s.v + c.v * c.v;
    return r2 > 0 ? gonio_dual_join(s, c, atan2(s.v, c.v), c.v / r2, -s.v / r2) : gonio_dual_constant(0);
}
static inline gonio_dual gonio_dual_min(gonio_dual a, gonio_dual b) { return a.v < b.v ? a : b; }
static inline gonio_dual gonio_dual_max(gonio_dual a, gonio_dual b) { return a.v > b.v ? a : b; }
// Held between two numbers.
static inline gonio_dual gonio_dual_hold(gonio_dual a, double low, double high) {
    return gonio_dual_min(gonio_dual_max(a, gonio_dual_constant(low)), gonio_dual_constant(high));
}

#endif
