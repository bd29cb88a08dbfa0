// SPDX-License-Identifier: BSD-3-Clause
// Duer 2005: Ward's Gaussian of slopes (ward.c) over cos_i cos_o in place of its root,
//   exp(-(tan_x / alpha_x)^2 - (tan_y / alpha_y)^2) / (4 pi alpha_x alpha_y cos_i cos_o),
// which keeps the lobe's albedo up to grazing incidence, where Ward's loses it.
#include "brdf/analytic/formula.h"

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double lobe = gonio_lobe_gaussian(g, p[2], p[3], d + 2);
    return gonio_diffuse_and_lobe(p, lobe, 1 / (g->wi.z * g->wo.z), d);
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    double d[4];
    return slope(g, p, d);
}

static bool isotropic(const double *p) { return p[2] == p[3]; }

const gonio_formula gonio_formula_ward_duer = {
    .name = "ward-duer",
    .summary = "Ward's lobe with Duer's division by both cosines",
    .source = "Duer, On the Ward model for global illumination (2005)",
    .n = 4,
    .parameters = {GONIO_RHO_D, GONIO_RHO_S, GONIO_ALPHA("alpha_x"), GONIO_ALPHA("alpha_y")},
    .alias = {"alpha", 2, 3, 1},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
    .isotropic = isotropic,
};
