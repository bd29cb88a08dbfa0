// SPDX-License-Identifier: BSD-3-Clause
// Blinn 1977 with the factor that makes the lobe's albedo at normal incidence exactly 1:
//   (n + 2)(n + 4) / (8 pi (n + 2^(-n/2))) cos^n(theta_h).
#include "brdf/analytic/formula.h"

static double value(const gonio_lobe_geometry *g, const double *p) {
    const double n = p[2];
    const double scale = (n + 2) * (n + 4) / (8 * GONIO_PI * (n + exp2(-n / 2)));
    // cos^n from tan^2: for n = 1e6 the cosine itself is 1 minus rounding.
    const double lobe = scale * exp(-0.5 * n * log1p(g->tan2));
    return p[0] / GONIO_PI + p[1] * lobe;
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double n = p[2], half = exp2(-n / 2), fall = 0.5 * log1p(g->tan2);
    const double lobe = (n + 2) * (n + 4) / (8 * GONIO_PI * (n + half)) * exp(-n * fall);
    const double scale = 1 / (n + 2) + 1 / (n + 4) - (1 - 0.5 * log(2) * half) / (n + half);
    d[0] = 1 / GONIO_PI;
    d[1] = lobe;
    d[2] = p[1] * lobe * (scale - fall);
    return p[0] / GONIO_PI + p[1] * lobe;
}

static int proposals(const double *p, gonio_proposal *out) {
    return gonio_propose_diffuse_and_lobe(out, p[0], (gonio_proposal){GONIO_PROPOSE_POWER, p[2], p[2], p[1], 1});
}

const gonio_formula gonio_formula_blinn_phong = {
    .name = "blinn-phong",
    .summary = "a power of the half vector's cosine, normalised at normal incidence",
    .source = "Blinn, Models of light reflection for computer synthesized pictures (1977)",
    .n = 3,
    .parameters = {GONIO_RHO_D, GONIO_RHO_S, {"n", 0, 1e9, NAN, "exponent"}},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(0) | GONIO_LINEAR(1),
    .proposals = proposals,
};
