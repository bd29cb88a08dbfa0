// SPDX-License-Identifier: BSD-3-Clause
// Cook-Torrance in the form that Ngan et al. 2005 fitted, and that Kameya 2002 prints as eq. 3.2:
//   D G F / (pi cos_i cos_o), where cook_torrance.c has 4 in place of pi.
#include "brdf/analytic/formula.h"

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double lobe = gonio_lobe_cook_torrance_slope(g, p[2], p[3], d + 2);
    return gonio_diffuse_and_lobe(p, lobe, 4 / GONIO_PI, d);
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    return p[0] / GONIO_PI + p[1] * (4 / GONIO_PI) * gonio_lobe_cook_torrance(g, p[2], p[3]);
}

const gonio_formula gonio_formula_ngan = {
    .name = "ngan",
    .summary = "Cook-Torrance over pi in place of 4, as published fits have it",
    .source = "Ngan, Durand and Matusik, Experimental analysis of BRDF models (2005); Kameya 2002, eq. 3.2",
    .n = 4,
    .parameters = {GONIO_RHO_D, GONIO_RHO_S, GONIO_ALPHA("m"), GONIO_F0},
    .alias = {"alpha", 2, 2, 1},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
};
