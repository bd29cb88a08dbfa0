// SPDX-License-Identifier: BSD-3-Clause
// Lambert 1760, *Photometria*: the same radiance in every direction, f_r = rho / pi, of albedo rho.
#include "brdf/analytic/formula.h"

static double value(const gonio_lobe_geometry *g, const double *p) {
    (void)g;
    return p[0] / GONIO_PI;
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    d[0] = 1 / GONIO_PI;
    return value(g, p);
}

static int proposals(const double *p, gonio_proposal *out) {
    out[0] = (gonio_proposal){.shape = GONIO_PROPOSE_COSINE, .strength = p[0], .f0 = 1};
    return 1;
}

const gonio_formula gonio_formula_lambert = {
    .name = "lambert",
    .summary = "perfectly diffuse",
    .source = "Lambert, Photometria (1760)",
    .n = 1,
    .parameters = {{"rho", 0, 1, NAN, "albedo"}},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0),
    .proposals = proposals,
};
