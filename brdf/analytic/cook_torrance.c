// SPDX-License-Identifier: BSD-3-Clause
// Cook & Torrance 1982: D G F / (4 cos_i cos_o), with Beckmann's distribution of facets of slope m,
//   D = exp(-tan^2(theta_h) / m^2) / (pi m^2 cos^4(theta_h)),
// their shadowing G = min(1, 2 cos_h cos_i / cos_d, 2 cos_h cos_o / cos_d), and Schlick's F(f0).
#include "brdf/analytic/formula.h"

double gonio_lobe_cook_torrance(const gonio_lobe_geometry *g, double m, double f0) {
    // 1/cos^4 = (1 + tan^2)^2 stays below 1e25, so where exp() underflows the product is 0, not NaN.
    const double d = exp(-g->tan2 / (m * m)) * gonio_square(1 + g->tan2) / (GONIO_PI * m * m);
    const double side = 2 * g->h.z / g->cos_d;
    const double shadow = fmin(1, side * fmin(g->wi.z, g->wo.z));
    return d * shadow * gonio_fresnel_schlick(g->cos_d, f0) / (4 * g->wi.z * g->wo.z);
}

double gonio_lobe_cook_torrance_slope(const gonio_lobe_geometry *g, double m, double f0, double d[2]) {
    const double bare = gonio_lobe_cook_torrance(g, m, 1), grazing = gonio_fresnel_grazing(g->cos_d);
    const double lobe = bare * (f0 + (1 - f0) * grazing);
    d[0] = lobe * (2 * g->tan2 / (m * m) - 2) / m;
    d[1] = bare * (1 - grazing);
    return lobe;
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    return p[0] / GONIO_PI + p[1] * gonio_lobe_cook_torrance(g, p[2], p[3]);
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double lobe = gonio_lobe_cook_torrance_slope(g, p[2], p[3], d + 2);
    return gonio_diffuse_and_lobe(p, lobe, 1, d);
}

static int proposals(const double *p, gonio_proposal *out) {
    return gonio_propose_diffuse_and_lobe(out, p[0], (gonio_proposal){GONIO_PROPOSE_BECKMANN, p[2], p[2], p[1], p[3]});
}

const gonio_formula gonio_formula_cook_torrance = {
    .name = "cook-torrance",
    .summary = "microfacets with Beckmann's slopes",
    .source = "Cook and Torrance, A reflectance model for computer graphics (1982)",
    .n = 4,
    .parameters = {GONIO_RHO_D, GONIO_RHO_S, GONIO_ALPHA("m"), GONIO_F0},
    .alias = {"alpha", 2, 2, 1},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
    .proposals = proposals,
};
