// The analytic lobes' formulae. Each is in double and finite for every pair of directions (brdf/kind/analytic.h:
// grazing).
#include <math.h>

#include "brdf/kind/analytic.h"

static gonio_vec3 raised(gonio_vec3 v) { return (gonio_vec3){v.x, v.y, fmax(v.z, GONIO_LOBE_COSINE_MIN)}; }

gonio_lobe_geometry gonio_lobe_geometry_of(gonio_vec3 wi, gonio_vec3 wo) {
    gonio_lobe_geometry g = {.wi = raised(wi), .wo = raised(wo)};
    const gonio_vec3 sum = {g.wi.x + g.wo.x, g.wi.y + g.wo.y, g.wi.z + g.wo.z};
    // sum.z >= 2e-6, so nothing below divides by zero.
    const double length = sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    g.h = (gonio_vec3){sum.x / length, sum.y / length, sum.z / length};
    // |wi + wo| = 2 cos(theta_d) for unit vectors; unlike the dot product it keeps its digits toward 90 deg.
    g.cos_d = fmin(length / 2, 1);
    g.tan_x = sum.x / sum.z;
    g.tan_y = sum.y / sum.z;
    g.tan2 = g.tan_x * g.tan_x + g.tan_y * g.tan_y;
    return g;
}

static double square(double x) { return x * x; }

// Schlick, "An inexpensive BRDF model for physically-based rendering" (1994), eq. 15.
static double fresnel(double cos_d, double f0) { return f0 + (1 - f0) * pow(1 - cos_d, 5); }

double gonio_lobe_ward(const gonio_lobe_geometry *g, double alpha_x, double alpha_y) {
    const double exponent = square(g->tan_x / alpha_x) + square(g->tan_y / alpha_y);
    return exp(-exponent) / (4 * GONIO_PI * alpha_x * alpha_y * sqrt(g->wi.z * g->wo.z));
}

double gonio_lobe_blinn_phong(const gonio_lobe_geometry *g, double n) {
    const double scale = (n + 2) * (n + 4) / (8 * GONIO_PI * (n + exp2(-n / 2)));
    // cos^n from tan^2: for n = 1e6 the cosine itself is 1 minus rounding.
    return scale * exp(-0.5 * n * log1p(g->tan2));
}

double gonio_lobe_cook_torrance(const gonio_lobe_geometry *g, double m, double f0) {
    // 1/cos^4 = (1 + tan^2)^2 stays below 1e25, so where exp() underflows the product is 0, not NaN.
    const double d = exp(-g->tan2 / (m * m)) * square(1 + g->tan2) / (GONIO_PI * m * m);
    const double side = 2 * g->h.z / g->cos_d;
    const double shadow = fmin(1, side * fmin(g->wi.z, g->wo.z));
    return d * shadow * fresnel(g->cos_d, f0) / (4 * g->wi.z * g->wo.z);
}

// 1 / (cos + sqrt(cos^2 + (alpha sin)^2)) = G1 / (2 cos): finite at the horizon.
static double smith_ggx(gonio_vec3 w, double alpha_x, double alpha_y) {
    return 1 / (w.z + sqrt(w.z * w.z + square(alpha_x * w.x) + square(alpha_y * w.y)));
}

double gonio_lobe_ggx(const gonio_lobe_geometry *g, double alpha_x, double alpha_y, double f0) {
    const double q = square(g->h.x / alpha_x) + square(g->h.y / alpha_y) + square(g->h.z);
    const double d = 1 / (GONIO_PI * alpha_x * alpha_y * q * q);
    return d * smith_ggx(g->wi, alpha_x, alpha_y) * smith_ggx(g->wo, alpha_x, alpha_y) * fresnel(g->cos_d, f0);
}

double gonio_lobe_oren_nayar(const gonio_lobe_geometry *g, double sigma_rad) {
    const double s2 = sigma_rad * sigma_rad;
    const double a = 1 - 0.5 * s2 / (s2 + 0.33), b = 0.45 * s2 / (s2 + 0.09);
    // sin(larger theta) tan(smaller theta) cos(phi difference) = (horizontal dot product) / (larger cosine).
    const double dot = g->wi.x * g->wo.x + g->wi.y * g->wo.y;
    return a + b * fmax(dot, 0) / fmax(g->wi.z, g->wo.z);
}
