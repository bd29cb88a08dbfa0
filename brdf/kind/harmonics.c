// SPDX-License-Identifier: BSD-3-Clause
// Westin, Arvo and Torrance 1992, Kameya 2002, eq. 3.4: real spherical harmonics in both directions, of f_r cos_i
// cos_o,
//   f_r cos_i cos_o = sum_jk m_jk Y_j(wi) Y_k(wo), m_jk symmetric, so that f_r is reciprocal.
//
// On a hemisphere the harmonics of both parities are twice too many. f_r cos_i cos_o is 0 at the horizon, so it goes on
// below as an odd function with a continuous slope: the harmonics Y_lm with l - m odd hold it, they are orthogonal on
// the hemisphere, and each has a factor cos(theta), which is divided out: nothing is infinite at the horizon.
// Isotropic: the terms of m and -m come as cos(m dphi). Order 8 has 40 isotropic terms and 666 others.
//
// Normalised Legendre functions by the usual recurrence in l, with q = P / cos where l - m is odd and without the
// factor sin^m, which the powers of x + i y carry:
//   P_l = a (cos P_{l-1} - b P_{l-2}), a^2 = (4 l^2 - 1) / (l^2 - m^2), b^2 = ((l - 1)^2 - m^2) / (4 (l - 1)^2 - 1).
#include "brdf/kind/linear.h"

#include <math.h>

#define ORDER_MAX 20
#define ORDER_MAX_4D 8
#define FUNCTIONS_MAX (ORDER_MAX_4D * (ORDER_MAX_4D + 1) / 2)

static int functions(int order) { return order * (order + 1) / 2; }

static int terms(int order, bool isotropic) {
    if (!isotropic) {
        return functions(order) * (functions(order) + 1) / 2;
    }
    int count = 0;
    for (int m = 0; m < order; m++) {
        const int degrees = (order - m + 1) / 2;
        count += degrees * (degrees + 1) / 2;
    }
    return count;
}

// q[k] of l = m + 1, m + 3 .. order; returns how many. start: P_m^m / sin^m.
static int legendre(int order, int m, double start, double z, double *q) {
    double even = start, odd = sqrt(2 * m + 3) * start;
    int n = 0;
    q[n++] = odd;
    for (int l = m + 2; l <= order; l++) {
        const double a = sqrt((4.0 * l * l - 1) / (l * l - m * m));
        const double b = sqrt(((l - 1.0) * (l - 1) - m * m) / (4.0 * (l - 1) * (l - 1) - 1));
        if ((l - m) % 2 == 0) {
            even = a * (z * z * odd - b * even);
        } else {
            odd = a * (even - b * odd);
            q[n++] = odd;
        }
    }
    return n;
}

// P_m^m / sin^m from that of m - 1; P_0^0 = sqrt(1 / (2 pi)), normalised on the hemisphere.
static double diagonal(int m, double before) {
    return m == 0 ? sqrt(1 / (2 * GONIO_PI)) : before * sqrt((2.0 * m + 1) / (2 * m)) * (m == 1 ? sqrt(2) : 1);
}

static void isotropic_row(int order, gonio_vec3 wi, gonio_vec3 wo, double *out) {
    const double along = wi.x * wo.x + wi.y * wo.y, across = wi.y * wo.x - wi.x * wo.y;
    double real = 1, imaginary = 0, start = 0, at_i[ORDER_MAX], at_o[ORDER_MAX];
    for (int m = 0; m < order; m++) {
        start = diagonal(m, start);
        const int n = legendre(order, m, start, wi.z, at_i);
        legendre(order, m, start, wo.z, at_o);
        for (int j = 0; j < n; j++) {
            for (int k = 0; k <= j; k++) {
                *out++ = (at_i[j] * at_o[k] + at_i[k] * at_o[j]) * real;
            }
        }
        const double next = real * along - imaginary * across;
        imaginary = real * across + imaginary * along;
        real = next;
    }
}

// Every Y_lm / cos with l - m odd at one direction.
static void all_functions(int order, gonio_vec3 w, double *out) {
    double real = 1, imaginary = 0, start = 0, q[ORDER_MAX];
    for (int m = 0; m < order; m++) {
        start = diagonal(m, start);
        const int n = legendre(order, m, start, w.z, q);
        for (int k = 0; k < n; k++) {
            *out++ = q[k] * real;
            if (m > 0) {
                *out++ = q[k] * imaginary;
            }
        }
        const double next = real * w.x - imaginary * w.y;
        imaginary = real * w.y + imaginary * w.x;
        real = next;
    }
}

static void row(int order, bool isotropic, gonio_vec3 wi, gonio_vec3 wo, double *out) {
    if (isotropic) {
        isotropic_row(order, wi, wo, out);
        return;
    }
    double at_i[FUNCTIONS_MAX], at_o[FUNCTIONS_MAX];
    all_functions(order, wi, at_i);
    all_functions(order, wo, at_o);
    for (int j = 0; j < functions(order); j++) {
        for (int k = 0; k <= j; k++) {
            *out++ = at_i[j] * at_o[k] + at_i[k] * at_o[j];
        }
    }
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    return gonio_linear_read(&gonio_basis_harmonics, mapped, out, error);
}

static const gonio_model_ops ops = GONIO_LINEAR_OPS("harmonics", gonio_linear_sigma);
static const gonio_model_ops plain = GONIO_LINEAR_OPS("harmonics", NULL);

const gonio_linear_basis gonio_basis_harmonics = {.kind = &gonio_kind_harmonics,
                                                  .plain = &plain,
                                                  .order_min = 1,
                                                  .order_max = {ORDER_MAX_4D, ORDER_MAX},
                                                  .order_usual = {4, 8},
                                                  .terms = terms,
                                                  .row = row};

const gonio_kind gonio_kind_harmonics = {
    .name = "harmonics",
    .summary = "spherical harmonics of both directions, of f_r cos cos",
    .ops = &ops,
    .read = read_model,
};
