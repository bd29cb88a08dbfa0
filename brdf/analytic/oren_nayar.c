// SPDX-License-Identifier: BSD-3-Clause
// Oren & Nayar 1994, the qualitative model (their eq. 30): diffuse facets of slope angle sigma,
//   rho/pi (A + B max(0, cos(phi_i - phi_o)) sin(max theta) tan(min theta)),
//   A = 1 - 0.5 sigma^2 / (sigma^2 + 0.33), B = 0.45 sigma^2 / (sigma^2 + 0.09).
#include "brdf/analytic/formula.h"

static double value(const gonio_lobe_geometry *g, const double *p) {
    const double s2 = p[1] * p[1];
    const double a = 1 - 0.5 * s2 / (s2 + 0.33), b = 0.45 * s2 / (s2 + 0.09);
    // sin(larger theta) tan(smaller theta) cos(phi difference) = (horizontal dot product) / (larger cosine).
    const double dot = g->wi.x * g->wo.x + g->wi.y * g->wo.y;
    return p[0] / GONIO_PI * (a + b * fmax(dot, 0) / fmax(g->wi.z, g->wo.z));
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double s2 = p[1] * p[1], f = value(g, p);
    const double a = -p[1] * 0.33 / gonio_square(s2 + 0.33), b = 0.9 * p[1] * 0.09 / gonio_square(s2 + 0.09);
    const double reach = fmax(gonio_lobe_planar(g), 0) / fmax(g->wi.z, g->wo.z);
    d[0] = value(g, (const double[]){1, p[1]});
    d[1] = p[0] / GONIO_PI * (a + b * reach);
    return f;
}

static int proposals(const double *p, gonio_proposal *out) {
    out[0] = (gonio_proposal){.shape = GONIO_PROPOSE_COSINE, .strength = p[0], .f0 = 1};
    return 1;
}

const gonio_formula gonio_formula_oren_nayar = {
    .name = "oren-nayar",
    .summary = "rough diffuse facets",
    .source = "Oren and Nayar, Generalization of Lambert's reflectance model (1994), eq. 30",
    .n = 2,
    .parameters = {{"rho", 0, 1, NAN, "albedo"}, {"sigma", 0, GONIO_PI / 2, NAN, "facets' slope, rad"}},
    .alias = {"sigma_deg", 1, 1, GONIO_PI / 180},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0),
    .proposals = proposals,
};
