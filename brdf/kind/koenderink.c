// SPDX-License-Identifier: BSD-3-Clause
// Koenderink, van Doorn and Stavridi 1996, as Kameya 2002, eq. A.1-A.3 prints it (the second line of A.1 lacks a_nml):
//   f_r = sum a_nml [Th_n^l(theta_i) Th_m^l(theta_o) + Th_m^l(theta_i) Th_n^l(theta_o)] cos(l (phi_i - phi_o)),
//   Th_n^l(theta) = sqrt((n + 1) / (2 pi)) R_n^l(r), r = sqrt(2) sin(theta / 2),
// 0 <= l <= m <= n, n - l and n - m even: order 8 has 55 terms, order 20 has 506. r maps the hemisphere to the unit
// disc with equal areas, where Zernike's R_n^l are orthogonal; the sum is reciprocal, and isotropic, by construction.
//
// R_n^l as Kameya's A.3 has it is a sum of factorials with alternating signs, whose terms outgrow the sum tenfold every
// four orders: near r = 1 it misses by 3e-10 at order 20 in double and by 10 % in float,
// and 13! is no 32-bit integer (tests/unit/test_linear.c). Kintner's recurrence ("On the mathematical properties of the
// Zernike polynomials", 1976) loses nothing:
//   k1 R_n = (k2 r^2 + k3) R_{n-2} + k4 R_{n-4}, k1 = (n + l)(n - l)(n - 2)/2, k2 = 2 n (n - 1)(n - 2),
//   k3 = -l^2 (n - 1) - n (n - 1)(n - 2), k4 = -n (n + l - 2)(n - l - 2)/2.
// R_n^l / r^l follows the same one. With u = (x, y) / sqrt(1 + z), |u| = r, the powers r_i^l r_o^l cos(l dphi) are the
// real part of (u_i conj(u_o))^l: nothing divides at the pole.
#include "brdf/kind/linear.h"

#include <math.h>

#define ORDER_MAX 20

static int terms(int order, bool isotropic) {
    (void)isotropic;
    int count = 0;
    for (int n = 0; n <= order; n++) {
        for (int m = n % 2; m <= n; m += 2) {
            count += m / 2 + 1; // l = m, m - 2 .. down to 0 or 1
        }
    }
    return count;
}

// R_n^l(r) / r^l times sqrt((n + 1) / (2 pi)), for n - l even.
static void radial(int order, double r2, double out[ORDER_MAX + 1][ORDER_MAX + 1]) {
    for (int l = 0; l <= order; l++) {
        double far = 1, near = (l + 2) * r2 - (l + 1);
        for (int n = l; n <= order; n += 2) {
            double value = n == l ? far : near;
            if (n >= l + 4) {
                const double k1 = (n + l) * (n - l) * (n - 2) / 2.0, k2 = 2.0 * n * (n - 1) * (n - 2);
                const double k3 = -(double)l * l * (n - 1) - (double)n * (n - 1) * (n - 2);
                const double k4 = -n * (n + l - 2) * (n - l - 2) / 2.0;
                value = ((k2 * r2 + k3) * near + k4 * far) / k1;
                far = near;
                near = value;
            }
            out[n][l] = sqrt((n + 1) / (2 * GONIO_PI)) * value;
        }
    }
}

static void row(int order, bool isotropic, gonio_vec3 wi, gonio_vec3 wo, double *out) {
    (void)isotropic;
    double at_i[ORDER_MAX + 1][ORDER_MAX + 1], at_o[ORDER_MAX + 1][ORDER_MAX + 1], turn[ORDER_MAX + 1];
    radial(order, (wi.x * wi.x + wi.y * wi.y) / (1 + wi.z), at_i);
    radial(order, (wo.x * wo.x + wo.y * wo.y) / (1 + wo.z), at_o);
    const double scale = 1 / sqrt((1 + wi.z) * (1 + wo.z));
    const double along = (wi.x * wo.x + wi.y * wo.y) * scale, across = (wi.y * wo.x - wi.x * wo.y) * scale;
    double real = 1, imaginary = 0;
    for (int l = 0; l <= order; l++) {
        turn[l] = real;
        const double next = real * along - imaginary * across;
        imaginary = real * across + imaginary * along;
        real = next;
    }
    for (int n = 0; n <= order; n++) {
        for (int m = n % 2; m <= n; m += 2) {
            for (int l = n % 2; l <= m; l += 2) {
                *out++ = (at_i[n][l] * at_o[m][l] + at_i[m][l] * at_o[n][l]) * turn[l];
            }
        }
    }
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    return gonio_linear_read(&gonio_basis_koenderink, mapped, out, error);
}

static const gonio_model_ops ops = GONIO_LINEAR_OPS("koenderink", gonio_linear_sigma);
static const gonio_model_ops plain = GONIO_LINEAR_OPS("koenderink", NULL);

const gonio_linear_basis gonio_basis_koenderink = {.kind = &gonio_kind_koenderink,
                                                   .plain = &plain,
                                                   .order_max = {0, ORDER_MAX},
                                                   .order_usual = {0, 8},
                                                   .terms = terms,
                                                   .row = row};

const gonio_kind gonio_kind_koenderink = {
    .name = "koenderink",
    .summary = "products of Zernike polynomials of both directions",
    .ops = &ops,
    .read = read_model,
};
