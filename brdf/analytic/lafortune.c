// SPDX-License-Identifier: BSD-3-Clause
// Lafortune et al. 1997, Kameya 2002, eq. A.4-A.5: one generalised cosine lobe,
//   rho_s max(0, cx x_i x_o + cy y_i y_o + cz cos_i cos_o)^n,
// both directions pointing away from the surface, so cx = cy = -1, cz = 1 is Phong's. cx = cy: isotropic. Several lobes
// are several terms. The published tables put the strength into the coefficients (rho_s = 1); it is a parameter of its
// own here, since channels then share the others. Kameya's A.5 leaves out the constant, rho_d.
#include "brdf/analytic/formula.h"

// Coefficients above 1 and a large exponent overflow; no lobe of data comes near.
#define POWER_MAX 300.0

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double x = g->wi.x * g->wo.x, y = g->wi.y * g->wo.y, z = g->wi.z * g->wo.z, n = p[5];
    const double base = p[2] * x + p[3] * y + p[4] * z;
    const double fall = base > 0 ? log(base) : 0, lobe = base > 0 ? exp(fmin(n * fall, POWER_MAX)) : 0;
    const double by_base = base > 0 ? p[1] * n * lobe / base : 0;
    d[0] = 1 / GONIO_PI;
    d[1] = lobe;
    d[2] = by_base * x;
    d[3] = by_base * y;
    d[4] = by_base * z;
    d[5] = p[1] * lobe * fall;
    return p[0] / GONIO_PI + p[1] * lobe;
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    double d[6];
    return slope(g, p, d);
}

static bool isotropic(const double *p) { return p[2] == p[3]; }

const gonio_formula gonio_formula_lafortune = {
    .name = "lafortune",
    .summary = "a generalised cosine lobe",
    .source = "Lafortune et al., Non-linear approximation of reflectance functions (1997); Kameya 2002, eq. A.5",
    .n = 6,
    .parameters = {GONIO_RHO_D,
                   {"rho_s", 0, 1e6, 1, "strength of the lobe; 1: within the coefficients"},
                   {"cx", -10, 10, -1, "of the product of the x; below 0: a lobe about the mirror direction"},
                   {"cy", -10, 10, -1, "of the product of the y"},
                   {"cz", -10, 10, 1, "of the product of the cosines"},
                   {"n", 0, 1e6, NAN, "exponent"}},
    .alias = {"cxy", 2, 3, 1},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
    .isotropic = isotropic,
};
