// SPDX-License-Identifier: BSD-3-Clause
// Phong 1975, Kameya 2002, eq. 2.8: a power of the cosine of the angle between the outgoing and the mirror direction,
// with Lewis' factor (1993) that keeps its albedo at 1 at most,
//   (n + 2) / (2 pi) max(0, cos_i cos_o - x_i x_o - y_i y_o)^n.
#include "brdf/analytic/formula.h"

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double n = p[2], c = g->wi.z * g->wo.z - gonio_lobe_planar(g);
    const double fall = c > 0 ? log(c) : 0, power = c > 0 ? exp(n * fall) : 0;
    d[0] = 1 / GONIO_PI;
    d[1] = (n + 2) / (2 * GONIO_PI) * power;
    d[2] = p[1] * (power / (2 * GONIO_PI) + d[1] * fall);
    return p[0] / GONIO_PI + p[1] * d[1];
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    double d[3];
    return slope(g, p, d);
}

const gonio_formula gonio_formula_phong = {
    .name = "phong",
    .summary = "a power of the cosine about the mirror direction",
    .source = "Phong, Illumination for computer generated pictures (1975); Kameya 2002, eq. 2.8; Lewis, Making shaders "
              "more physically plausible (1993)",
    .n = 3,
    .parameters = {GONIO_RHO_D, GONIO_RHO_S, {"n", 0, 1e9, NAN, "exponent"}},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
};
