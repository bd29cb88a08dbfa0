// SPDX-License-Identifier: BSD-3-Clause
// Ashikhmin & Shirley 2000: a power of the half vector's cosine whose exponent turns with its azimuth (their eq. 4),
//   sqrt((n_u + 1)(n_v + 1)) / (8 pi) cos_h^(n_u cos^2 phi_h + n_v sin^2 phi_h) / (cos_d max(cos_i, cos_o)) F(cos_d),
// over a diffuse term that gives way to it towards grazing (their eq. 5),
//   28 rho_d / (23 pi) (1 - f0) (1 - (1 - cos_i / 2)^5) (1 - (1 - cos_o / 2)^5).
#include "brdf/analytic/formula.h"

static double diffuse(const gonio_lobe_geometry *g) {
    return 28 / (23 * GONIO_PI) * (1 - pow(1 - g->wi.z / 2, 5)) * (1 - pow(1 - g->wo.z / 2, 5));
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double n_u = p[2], n_v = p[3], f0 = p[4];
    // ln cos_h = -log1p(tan^2) / 2, and cos^2 phi_h = tan_x^2 / tan^2.
    const double fall = g->tan2 > 0 ? 0.5 * log1p(g->tan2) / g->tan2 : 0.5;
    const double u = fall * g->tan_x * g->tan_x, v = fall * g->tan_y * g->tan_y;
    const double bare =
        sqrt((n_u + 1) * (n_v + 1)) / (8 * GONIO_PI) * exp(-(n_u * u + n_v * v)) / (g->cos_d * fmax(g->wi.z, g->wo.z));
    const double grazing = gonio_fresnel_grazing(g->cos_d), lobe = bare * (f0 + (1 - f0) * grazing);
    const double under = diffuse(g);
    d[0] = under * (1 - f0);
    d[1] = lobe;
    d[2] = p[1] * lobe * (0.5 / (n_u + 1) - u);
    d[3] = p[1] * lobe * (0.5 / (n_v + 1) - v);
    d[4] = p[1] * bare * (1 - grazing) - p[0] * under;
    return p[0] * d[0] + p[1] * lobe;
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    double d[5];
    return slope(g, p, d);
}

static bool isotropic(const double *p) { return p[2] == p[3]; }

const gonio_formula gonio_formula_ashikhmin_shirley = {
    .name = "ashikhmin-shirley",
    .summary = "an anisotropic power of the half vector's cosine over a diffuse term that gives way to it",
    .source = "Ashikhmin and Shirley, An anisotropic Phong BRDF model (2000), eq. 4 and 5",
    .n = 5,
    .parameters = {GONIO_RHO_D,
                   {"rho_s", 0, 1e6, 1, "strength of the lobe; 1: as published"},
                   {"n_u", 0, 1e9, NAN, "exponent along x"},
                   {"n_v", 0, 1e9, NAN, "exponent along y"},
                   {"f0", 0, 1, NAN, "reflectance at normal incidence (Schlick)"}},
    .alias = {"n", 2, 3, 1},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
    .isotropic = isotropic,
};
