// SPDX-License-Identifier: BSD-3-Clause
// Schlick 1994: rational functions in place of the exponential and the roots of microfacet models (his eq. 15, 27-29),
//   F(cos_d) Z(cos_h) A(phi_h) / (4 pi) G(cos_i) G(cos_o) / (cos_i cos_o),
//   Z(t) = r / (1 + r t^2 - t^2)^2, A(w) = sqrt(p / (p^2 + w^2 (1 - p^2))), w = cos phi_h, G(v) = v / (r - r v + v),
// r the roughness (0 a mirror, 1 diffuse), p the isotropy factor: 1 isotropic; p and 1/p are the same lobe turned by 90
// deg. The light that shadowed facets give back (the term 1 - G G') is left to the diffuse albedo.
#include "brdf/analytic/formula.h"

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double r = p[2], s = p[3], f0 = p[4], i = g->wi.z, o = g->wo.z;
    // At the mirror direction the azimuth is undefined; the mean over it is near that of 45 deg.
    const double w2 = g->tan2 > 0 ? g->tan_x * g->tan_x / g->tan2 : 0.5;
    const double below = s * s + w2 * (1 - s * s), masked_i = r * (1 - i) + i, masked_o = r * (1 - o) + o;
    // 1 + r t^2 - t^2 = (tan^2 + r) / (1 + tan^2).
    const double z = r * gonio_square((1 + g->tan2) / (g->tan2 + r));
    const double bare = z * sqrt(s / below) / (4 * GONIO_PI * masked_i * masked_o);
    const double grazing = gonio_fresnel_grazing(g->cos_d), lobe = bare * (f0 + (1 - f0) * grazing);
    d[0] = 1 / GONIO_PI;
    d[1] = lobe;
    d[2] = p[1] * lobe * (1 / r - 2 / (g->tan2 + r) - (1 - i) / masked_i - (1 - o) / masked_o);
    d[3] = p[1] * lobe * (0.5 / s - s * (1 - w2) / below);
    d[4] = p[1] * bare * (1 - grazing);
    return p[0] / GONIO_PI + p[1] * lobe;
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    double d[5];
    return slope(g, p, d);
}

static bool isotropic(const double *p) { return p[3] == 1; }

const gonio_formula gonio_formula_schlick = {
    .name = "schlick",
    .summary = "rational approximations of a microfacet lobe",
    .source = "Schlick, An inexpensive BRDF model for physically-based rendering (1994)",
    .n = 5,
    .parameters = {GONIO_RHO_D,
                   GONIO_RHO_S,
                   {"r", 1e-10, 1, NAN, "roughness, about the square of a slope"},
                   {"p", 1e-3, 1e3, 1, "isotropy factor; 1: isotropic"},
                   GONIO_F0},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
    .isotropic = isotropic,
};
