// SPDX-License-Identifier: BSD-3-Clause
// He, Torrance, Sillion & Greenberg 1991 (Kameya 2002, 3.2; DeYoung 1996, 2.1): a Gaussian random surface of height
// sigma_0 and correlation length tau, both in wavelengths here, in the Kirchhoff approximation, unpolarised:
//   F G S D / (pi cos_i cos_o), with s = wi + wo,
//   D = (pi^2 tau^2 / 4) sum_m g^m e^-g / (m! m) exp(-pi^2 tau^2 |s_xy|^2 / m), g = (2 pi sigma (cos_i + cos_o))^2,
//   G = (|s|^2 / s_z)^2: their polarisation vectors span the plane across a ray, so that their eq. 76 comes to this,
//   S = S_i S_o, S_w = (1 - erfc(u) / 2) / (1 + Lambda(u)), u = tau cot(theta_w) / (2 sigma_0),
//   Lambda = (e^(-u^2) / (sqrt(pi) u) - erfc(u)) / 2,
//   sigma = sigma_0 / sqrt(1 + x^2), sqrt(pi/2) x = (K_i + K_o)/4 e^(-x^2/2), K_w = tan(theta_w) erfc(u): grazing rays
//   see a smoother surface.
// For a very rough surface D G becomes 4 cos_d^4 / (m^2 s_z^4) exp(-tan^2(theta_h) / m^2), m = 2 sigma/tau: Beckmann's.
//
// Lambda has e^(-u^2), which is Smith's and goes to 0 away from grazing; the paper prints 1 in its place. F is
// Schlick's. The mirror spike, a delta function, is left out: tables and fits cannot hold it.
#include "brdf/analytic/formula.h"
#include "brdf/dual.h"

enum { RHO_D, RHO_S, SIGMA, TAU, F0, COUNT };

typedef gonio_dual dual;

static dual erfc_of(dual u) { return gonio_dual_chain(u, erfc(u.v), -2 / sqrt(GONIO_PI) * exp(-u.v * u.v)); }

// Beyond it erfc is 0 in double, and nothing is shadowed.
#define U_MAX 26.0

static dual shadow(double cotangent, dual ratio) {
    const dual u = gonio_dual_scale(ratio, cotangent / 2);
    if (!(u.v < U_MAX)) {
        return gonio_dual_constant(1);
    }
    const dual gauss = gonio_dual_exp(gonio_dual_scale(gonio_dual_square(u), -1)), tail = erfc_of(u);
    const dual lambda =
        gonio_dual_scale(gonio_dual_sub(gonio_dual_div(gonio_dual_scale(gauss, 1 / sqrt(GONIO_PI)), u), tail), 0.5);
    return gonio_dual_div(gonio_dual_shift(gonio_dual_scale(tail, -0.5), 1), gonio_dual_shift(lambda, 1));
}

static dual grazing_slope(double cotangent, dual ratio) {
    const dual u = gonio_dual_scale(ratio, cotangent / 2);
    return u.v < U_MAX ? gonio_dual_scale(erfc_of(u), 1 / cotangent) : gonio_dual_constant(0);
}

// x of sqrt(pi/2) x = k/4 e^(-x^2/2): the left side grows and the right one falls, so Newton's steps from 0 go there.
static dual effective(dual k) {
    const double rise = sqrt(GONIO_PI / 2);
    double x = 0, slope = rise;
    for (int step = 0; step < 60; step++) {
        const double e = k.v / 4 * exp(-x * x / 2), miss = rise * x - e;
        slope = rise + x * e;
        x -= miss / slope;
        if (fabs(miss) <= 1e-15 * (rise * x + e)) {
            break;
        }
    }
    return gonio_dual_chain(k, x, exp(-x * x / 2) / 4 / (rise + x * k.v / 4 * exp(-x * x / 2)));
}

// ln m!, by Stirling's series from 16 on, where its third term is 1e-9.
static double log_factorial(double m) {
    double product = 1;
    if (m < 16) {
        for (double i = 2; i <= m; i++) {
            product *= i;
        }
        return log(product);
    }
    const double r = 1 / m;
    return (m + 0.5) * log(m) - m + 0.5 * log(2 * GONIO_PI) + r / 12 - r * r * r / 360 + r * r * r * r * r / 1260;
}

// sum_m g^m e^-g / (m! m) exp(-c / m), and its derivatives by g and c. Terms from the largest Poisson weight outwards,
// until they are 1e-17 of it.
static double series(double g, double c, double *by_g, double *by_c) {
    const double peak = fmax(floor(g), 1), first = exp(peak * log(g) - g - log_factorial(peak));
    double sum = 0;
    *by_g = *by_c = 0;
    for (int way = 0; way < 2; way++) {
        double weight = first;
        for (double m = peak; m >= 1; m += way == 0 ? 1 : -1) {
            if (way == 0 || m < peak) {
                const double term = weight * exp(-c / m) / m;
                sum += term;
                *by_g += term * (m / g - 1);
                *by_c -= term / m;
            }
            weight *= way == 0 ? g / (m + 1) : m / g;
            if (weight < 1e-17 * first) {
                break;
            }
        }
    }
    return sum;
}

static dual lobe(const gonio_lobe_geometry *g, const double *p) {
    const dual sigma_0 = gonio_dual_variable(p[SIGMA], 0), tau = gonio_dual_variable(p[TAU], 1);
    const dual f0 = gonio_dual_variable(p[F0], 2), ratio = gonio_dual_div(tau, sigma_0);
    const double i = g->wi.z, o = g->wo.z, sum = i + o;
    // Straight down the cotangent is without bound; 1e9 is beyond every u.
    const double cot_i = i / fmax(sqrt(fmax(1 - i * i, 0)), 1e-9), cot_o = o / fmax(sqrt(fmax(1 - o * o, 0)), 1e-9);
    const dual x = effective(gonio_dual_add(grazing_slope(cot_i, ratio), grazing_slope(cot_o, ratio)));
    const dual sigma = gonio_dual_div(sigma_0, gonio_dual_sqrt(gonio_dual_shift(gonio_dual_square(x), 1)));
    const dual rough = gonio_dual_square(gonio_dual_scale(sigma, 2 * GONIO_PI * sum));
    const double side2 = gonio_square(g->tan_x * sum) + gonio_square(g->tan_y * sum);
    const dual tau2 = gonio_dual_square(gonio_dual_scale(tau, GONIO_PI));
    const dual spread = gonio_dual_scale(tau2, side2);
    double by_g, by_c;
    const double terms = series(rough.v, spread.v, &by_g, &by_c);
    const dual d = gonio_dual_mul(gonio_dual_scale(tau2, 0.25), gonio_dual_join(rough, spread, terms, by_g, by_c));
    const double geometric = gonio_square(4 * g->cos_d * g->cos_d / sum), grazing = gonio_fresnel_grazing(g->cos_d);
    const dual fresnel = gonio_dual_shift(gonio_dual_scale(f0, 1 - grazing), grazing);
    const dual shadowed = gonio_dual_mul(shadow(cot_i, ratio), shadow(cot_o, ratio));
    return gonio_dual_scale(gonio_dual_mul(gonio_dual_mul(fresnel, shadowed), d), geometric / (GONIO_PI * i * o));
}

static double slope(const gonio_lobe_geometry *g, const double *p, double *d) {
    const dual f = lobe(g, p);
    d[RHO_D] = 1 / GONIO_PI;
    d[RHO_S] = f.v;
    for (int k = 0; k < 3; k++) {
        d[SIGMA + k] = p[RHO_S] * f.d[k];
    }
    return p[RHO_D] / GONIO_PI + p[RHO_S] * f.v;
}

static double value(const gonio_lobe_geometry *g, const double *p) {
    return p[RHO_D] / GONIO_PI + p[RHO_S] * lobe(g, p).v;
}

const gonio_formula gonio_formula_he = {
    .name = "he",
    .summary = "a Gaussian random surface in wave optics, without its mirror spike",
    .source = "He, Torrance, Sillion and Greenberg, A comprehensive physical model for light reflection (1991)",
    .n = COUNT,
    .parameters = {GONIO_RHO_D,
                   {"rho_s", 0, 1e6, 1, "strength of the lobe; 1: as published"},
                   {"sigma", 1e-3, 4, NAN, "rms height, wavelengths"},
                   {"tau", 0.05, 100, NAN, "correlation length, wavelengths"},
                   GONIO_F0},
    .value = value,
    .slope = slope,
    .linear = GONIO_LINEAR(RHO_D) | GONIO_LINEAR(RHO_S),
};
