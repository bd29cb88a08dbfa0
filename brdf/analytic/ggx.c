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

// d ln smith / d alpha along one axis, w the direction's part along it.
static double smith_slope(gonio_vec3 w, double part, double alpha, double smith_value) {
    return -alpha * part * part * smith_value / (1 / smith_value - w.z);
}

double gonio_lobe_ggx_slope(const gonio_lobe_geometry *g, double alpha_x, double alpha_y, double f0, double d[3]) {
    const double q = gonio_square(g->h.x / alpha_x) + gonio_square(g->h.y / alpha_y) + gonio_square(g->h.z);
    const double i = smith(g->wi, alpha_x, alpha_y), o = smith(g->wo, alpha_x, alpha_y);
    const double bare = i * o / (GONIO_PI * alpha_x * alpha_y * q * q), grazing = gonio_fresnel_grazing(g->cos_d);
    const double lobe = bare * (f0 + (1 - f0) * grazing);
    d[0] = lobe * ((4 * gonio_square(g->h.x / alpha_x) / q - 1) / alpha_x + smith_slope(g->wi, g->wi.x, alpha_x, i) +
                   smith_slope(g->wo, g->wo.x, alpha_x, o));
    d[1] = lobe * ((4 * gonio_square(g->h.y / alpha_y) / q - 1) / alpha_y + smith_slope(g->wi, g->wi.y, alpha_y, i) +
                   smith_slope(g->wo, g->wo.y, alpha_y, o));
    d[2] = bare * (1 - grazing);
    return lobe;
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    return p[0] / GONIO_PI + p[1] * gonio_lobe_ggx(g, p[2], p[3], p[4]);
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double lobe = gonio_lobe_ggx_slope(g, p[2], p[3], p[4], d + 2);
    d[0] = 1 / GONIO_PI;
    d[1] = lobe;
    for (int k = 2; k < 5; k++) {
        d[k] *= p[1];
    }
    return p[0] / GONIO_PI + p[1] * lobe;
}

static bool isotropic(const double *p) { return p[2] == p[3]; }

static int proposals(const double *p, gonio_proposal *out) {
    return gonio_propose_diffuse_and_lobe(out, p[0], (gonio_proposal){GONIO_PROPOSE_GGX, p[2], p[3], p[1], p[4]});
}

const gonio_formula gonio_formula_ggx = {
    .name = "ggx",
    .summary = "microfacets with GGX's long tails",
    .source = "Walter et al., Microfacet models for refraction through rough surfaces (2007)",
    .n = 5,
    .parameters = {GONIO_RHO_D, GONIO_RHO_S, GONIO_ALPHA("alpha_x"), GONIO_ALPHA("alpha_y"), GONIO_F0},
    .alias = {"alpha", 2, 3, 1},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
    .proposals = proposals,
    .isotropic = isotropic,
};
