// SPDX-License-Identifier: BSD-3-Clause
// Ward 1992, as in Kameya 2002, eq. 3.3: a Gaussian of the facets' slopes,
//   exp(-tan^2(theta_h) / alpha^2) / (4 pi alpha^2 sqrt(cos_i cos_o)),
// elliptical for alpha_x != alpha_y: (tan_x / alpha_x)^2 + (tan_y / alpha_y)^2 in the exponent, alpha_x alpha_y below.
#include "brdf/analytic/formula.h"

double gonio_lobe_gaussian(const gonio_lobe_geometry *g, double alpha_x, double alpha_y, double d[2]) {
    const double x = gonio_square(g->tan_x / alpha_x), y = gonio_square(g->tan_y / alpha_y);
    const double lobe = exp(-(x + y)) / (4 * GONIO_PI * alpha_x * alpha_y);
    d[0] = lobe * (2 * x - 1) / alpha_x;
    d[1] = lobe * (2 * y - 1) / alpha_y;
    return lobe;
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    const double alpha_x = p[2], alpha_y = p[3];
    const double exponent = gonio_square(g->tan_x / alpha_x) + gonio_square(g->tan_y / alpha_y);
    const double lobe = exp(-exponent) / (4 * GONIO_PI * alpha_x * alpha_y * sqrt(g->wi.z * g->wo.z));
    return p[0] / GONIO_PI + p[1] * lobe;
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double lobe = gonio_lobe_gaussian(g, p[2], p[3], d + 2);
    return gonio_diffuse_and_lobe(p, lobe, 1 / sqrt(g->wi.z * g->wo.z), d);
}

static bool isotropic(const double *p) { return p[2] == p[3]; }

static int proposals(const double *p, gonio_proposal *out) {
    return gonio_propose_diffuse_and_lobe(out, p[0], (gonio_proposal){GONIO_PROPOSE_BECKMANN, p[2], p[3], p[1], 1});
}

const gonio_formula gonio_formula_ward = {
    .name = "ward",
    .summary = "a Gaussian lobe of slopes, without Fresnel or shadowing",
    .source = "Ward, Measuring and modeling anisotropic reflection (1992); Kameya 2002, eq. 3.3",
    .n = 4,
    .parameters = {GONIO_RHO_D, GONIO_RHO_S, GONIO_ALPHA("alpha_x"), GONIO_ALPHA("alpha_y")},
    .alias = {"alpha", 2, 3, 1},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
    .proposals = proposals,
    .isotropic = isotropic,
};
