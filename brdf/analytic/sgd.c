// SPDX-License-Identifier: BSD-3-Clause
// Bagher, Soler and Holzschuch 2012, the shifted gamma distribution:
//   rho_s / pi F(cos_d) G(theta_i) G(theta_o) D(theta_h) / (cos_i cos_o),
//   D = K e^-x / (pi x^p cos^4 theta_h), x = alpha + tan^2(theta_h) / alpha,
//   F = f0 - f1 cos_d + (1 - f0)(1 - cos_d)^5,
//   G(theta) = 1 + lambda (1 - exp(c max(0, theta - theta_0)^k)), held between 0 and 1.
// K makes the distribution's integral 1: 1/K = alpha Gamma(1 - p, alpha). It is a parameter, since published tables
// give it and libm has no incomplete gamma function.
#include "brdf/analytic/formula.h"

enum { RHO_D, RHO_S, ALPHA, P, F0, F1, SCALE, LAMBDA, C, K, THETA_0, COUNT };

typedef struct masking {
    double value, by_lambda, by_c, by_k, by_theta_0;
} masking;

static masking mask(double cosine, const double *p) {
    const double over = fmax(acos(fmin(cosine, 1)) - p[THETA_0], 0);
    // c over^k by logarithms: published rates go to 1e109, their powers to 900.
    const double far = over > 0 ? p[K] * log(over) : -INFINITY, power = exp(fmin(far, 600));
    const double product = p[C] > 0 ? exp(fmin(log(p[C]) + far, 600)) : 0, e = exp(fmin(product, 600));
    const double value = 1 + p[LAMBDA] * (1 - e);
    if (!(value > 0 && value < 1)) {
        return (masking){.value = fmin(fmax(value, 0), 1)};
    }
    const double rate = -p[LAMBDA] * e; // by the product
    return (masking){value, 1 - e, rate * (p[C] > 0 ? product / p[C] : power),
                     over > 0 ? rate * product * log(over) : 0, over > 0 ? -rate * product * p[K] / over : 0};
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const double a = p[ALPHA], x = a + g->tan2 / a;
    const double distribution = p[SCALE] * exp(-x - p[P] * log(x)) * gonio_square(1 + g->tan2) / GONIO_PI;
    const double grazing = gonio_fresnel_grazing(g->cos_d), raw = p[F0] - p[F1] * g->cos_d + (1 - p[F0]) * grazing;
    const double fresnel = fmax(raw, 0), bright = raw > 0;
    const masking i = mask(g->wi.z, p), o = mask(g->wo.z, p);
    const double bare = distribution / (GONIO_PI * g->wi.z * g->wo.z), facets = bare * fresnel;
    const double lobe = facets * i.value * o.value, s = p[RHO_S] * facets;
    d[RHO_D] = 1 / GONIO_PI;
    d[RHO_S] = lobe;
    d[ALPHA] = -p[RHO_S] * lobe * (1 + p[P] / x) * (1 - g->tan2 / (a * a));
    d[P] = -p[RHO_S] * lobe * log(x);
    d[F0] = p[RHO_S] * bare * bright * i.value * o.value * (1 - grazing);
    d[F1] = -p[RHO_S] * bare * bright * i.value * o.value * g->cos_d;
    d[SCALE] = p[RHO_S] * lobe / p[SCALE];
    d[LAMBDA] = s * (i.by_lambda * o.value + i.value * o.by_lambda);
    d[C] = s * (i.by_c * o.value + i.value * o.by_c);
    d[K] = s * (i.by_k * o.value + i.value * o.by_k);
    d[THETA_0] = s * (i.by_theta_0 * o.value + i.value * o.by_theta_0);
    return p[RHO_D] / GONIO_PI + p[RHO_S] * lobe;
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    double d[COUNT];
    return slope(g, p, d);
}

const gonio_formula gonio_formula_sgd = {
    .name = "sgd",
    .summary = "microfacets of a shifted gamma distribution",
    .source = "Bagher, Soler and Holzschuch, Accurate fitting of measured reflectances using a shifted gamma "
              "micro-facet distribution (2012)",
    .n = COUNT,
    .parameters = {GONIO_RHO_D,
                   GONIO_RHO_S,
                   {"alpha", 1e-6, 10, NAN, "width"},
                   {"p", 0, 10, NAN, "how long the tail is"},
                   {"f0", -100, 100, 1, "of the Fresnel term"},
                   {"f1", -100, 100, 0, "of the Fresnel term"},
                   {"scale", 1e-6, 1e6, NAN, "K, 1 / (alpha Gamma(1 - p, alpha))"},
                   {"lambda", 0, 1e8, 0, "depth of the masking"},
                   {"c", 0, 1e200, 0, "its rate"},
                   {"k", 0, 1e4, 1, "its power"},
                   {"theta_0", -GONIO_PI / 2, GONIO_PI / 2, 0, "where it begins, rad"}},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(RHO_D) | GONIO_LINEAR(RHO_S),
};
