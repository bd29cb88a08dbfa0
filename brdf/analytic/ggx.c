// SPDX-License-Identifier: BSD-3-Clause
// Walter et al. 2007: D G F / (4 cos_i cos_o) with the distribution
//   D = 1 / (pi alpha_x alpha_y ((h_x / alpha_x)^2 + (h_y / alpha_y)^2 + h_z^2)^2)
// (elliptical: Heitz, "Understanding the masking-shadowing function in microfacet-based BRDFs", 2014), Smith's G as the
// product of two G1, and Schlick's F(f0).
#include "brdf/analytic/formula.h"

// 1 / (cos + sqrt(cos^2 + (alpha sin)^2)) = G1 / (2 cos): finite at the horizon.
static double smith(gonio_vec3 w, double alpha_x, double alpha_y) {
    return 1 / (w.z + sqrt(w.z * w.z + gonio_square(alpha_x * w.x) + gonio_square(alpha_y * w.y)));
}

double gonio_lobe_ggx(const gonio_lobe_geometry *g, double alpha_x, double alpha_y, double f0) {
    const double q = gonio_square(g->h.x / alpha_x) + gonio_square(g->h.y / alpha_y) + gonio_square(g->h.z);
    const double d = 1 / (GONIO_PI * alpha_x * alpha_y * q * q);
    return d * smith(g->wi, alpha_x, alpha_y) * smith(g->wo, alpha_x, alpha_y) * gonio_fresnel_schlick(g->cos_d, f0);
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    return p[0] / GONIO_PI + p[1] * gonio_lobe_ggx(g, p[2], p[3], p[4]);
}

static bool isotropic(const double *p) { return p[2] == p[3]; }

const gonio_formula gonio_formula_ggx = {
    .name = "ggx",
    .summary = "microfacets with GGX's long tails",
    .source = "Walter et al., Microfacet models for refraction through rough surfaces (2007)",
    .n = 5,
    .parameters = {GONIO_RHO_D, GONIO_RHO_S, GONIO_ALPHA("alpha_x"), GONIO_ALPHA("alpha_y"), GONIO_F0},
    .alias = {"alpha", 2, 3, 1},
    .value = value,
    .isotropic = isotropic,
};
