// SPDX-License-Identifier: BSD-3-Clause
// Elementary functions of four doubles at a time, for evaluation: exp, ln, asinh, arctangent, square root.
//
// Why not libm's: they take one number at a time, and glibc picks versions with or without FMA by the processor, which
// differ in the last bit. These consist of additions, multiplications, divisions and square roots alone, which IEEE 754
// rounds in one way only, so every machine and every clone (brdf/spline/clones.h) gives the same bits.
//
// Errors. The series are cut where what is left out lies below 1e-17 of the result (derived at each), so that the
// rounding of the operations, a few units of 2^-53, is all there is: rounded to float, each result is within 0.50001
// units in the last place of the exact one. tests/unit/test_exp_log.c holds them to that over every exponent of float.
#ifndef GONIO_BRDF_EXP_LOG_H
#define GONIO_BRDF_EXP_LOG_H

#include <math.h>
#include <stdint.h>

#include "brdf/spline/clones.h"

typedef int64_t gonio_l4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef uint64_t gonio_w4 __attribute__((vector_size(32), aligned(8), may_alias));

// Vectors by value have no calling convention on processors without AVX, not even where everything is inlined: so these
// are macros, and the functions below replace what they are given.
#define GONIO_ALL4(x) ((gonio_d4){(x), (x), (x), (x)})
// mask (of a comparison) ? a : b, lane by lane.
#define GONIO_SELECT4(mask, a, b) ((gonio_d4)(((gonio_l4)(a) & (mask)) | ((gonio_l4)(b) & ~(mask))))
// Of a NaN and a number, the number, where the NaN is a.
#define GONIO_MIN4(a, b) GONIO_SELECT4((a) < (b), a, b)
#define GONIO_MAX4(a, b) GONIO_SELECT4((a) > (b), a, b)

GONIO_INLINE void gonio_sqrt4(gonio_d4 *x) {
    *x = (gonio_d4){sqrt((*x)[0]), sqrt((*x)[1]), sqrt((*x)[2]), sqrt((*x)[3])};
}

// The upper 33 bits of ln 2, whose product with an exponent is exact, and the rest.
#define GONIO_LN2_HIGH 0x1.62e42feep-1
#define GONIO_LN2_LOW 0x1.a39ef35793c76p-33
// Between 2^52 and 2^53 doubles are the integers: adding this rounds, and leaves the integer in the low bits.
#define GONIO_ROUNDER 0x1.8p52

// e^x; x is held between -708 and 709, where e^x is a normal number. NaN counts as -708.
//
// x = n ln 2 + r, |r| <= ln(2)/2: e^x = 2^n times the Taylor series of e^r up to r^13. The next term is 0.3466^14 / 14!
// = 4e-18.
GONIO_INLINE void gonio_exp4(gonio_d4 *argument) {
    gonio_d4 x = *argument;
    x = GONIO_MAX4(x, GONIO_ALL4(-708.0));
    x = GONIO_MIN4(x, GONIO_ALL4(709.0));
    const gonio_d4 moved = x * 0x1.71547652b82fep0 + GONIO_ROUNDER, n = moved - GONIO_ROUNDER;
    const gonio_d4 r = (x - n * GONIO_LN2_HIGH) - n * GONIO_LN2_LOW;
    const gonio_d4 r2 = r * r, r4 = r2 * r2;
    const gonio_d4 p0 = (1 + r) + r2 * (0.5 + r * (1.0 / 6));
    const gonio_d4 p4 = (1.0 / 24 + r * (1.0 / 120)) + r2 * (1.0 / 720 + r * (1.0 / 5040));
    const gonio_d4 p8 = (1.0 / 40320 + r * (1.0 / 362880)) + r2 * (1.0 / 3628800 + r * (1.0 / 39916800));
    const gonio_d4 p12 = 1.0 / 479001600 + r * (1.0 / 6227020800);
    const gonio_d4 p = (p0 + r4 * p4) + r4 * r4 * (p8 + r4 * p12);
    *argument = p * (gonio_d4)(((gonio_w4)moved + 1023) << 52);
}

// ln x of positive normal doubles; every positive float is one.
//
// x = 2^e m, sqrt(1/2) <= m < sqrt(2); ln m = 2 artanh(s), s = (m - 1)/(m + 1), by its Taylor series up to s^21: with
// s^2 <= 0.0295 the next term is 0.0295^11 / 23 = 6e-19 of the first.
GONIO_INLINE void gonio_log4(gonio_d4 *argument) {
    const gonio_w4 bits = (gonio_w4)*argument;
    // The exponent field of x / sqrt(1/2), 1024 larger than e.
    const gonio_w4 field = (bits - 0x3fe6a09e667f3bcdu + ((uint64_t)1024 << 52)) >> 52;
    const gonio_d4 m = (gonio_d4)(bits - (field << 52) + ((uint64_t)1024 << 52));
    const gonio_d4 e = (gonio_d4)(field + 0x4338000000000000u) - (GONIO_ROUNDER + 1024);
    const gonio_d4 s = (m - 1) / (m + 1), z = s * s, z2 = z * z, z4 = z2 * z2;
    const gonio_d4 q1 = (1.0 / 3 + z * (1.0 / 5)) + z2 * (1.0 / 7 + z * (1.0 / 9));
    const gonio_d4 q5 = (1.0 / 11 + z * (1.0 / 13)) + z2 * (1.0 / 15 + z * (1.0 / 17));
    const gonio_d4 q9 = 1.0 / 19 + z * (1.0 / 21);
    const gonio_d4 rest = z * (q1 + z4 * (q5 + z4 * q9));
    *argument = e * GONIO_LN2_HIGH + (2 * s + (2 * s * rest + e * GONIO_LN2_LOW));
}

// asinh x of 0 <= x < 1e150, to 1e-16 absolute below 1.
GONIO_INLINE void gonio_asinh4(gonio_d4 *x) {
    gonio_d4 root = *x * *x + 1;
    gonio_sqrt4(&root);
    *x += root;
    gonio_log4(x);
}

// (2/pi) atan2(s, c) of a sine and a cosine >= 0.
//
// theta = 2 atan(t) with t = tan(theta/2) = s/(1 + c) <= 1, and atan(t) = pi/4 + atan((t - 1)/(t + 1)) above tan(pi/8),
// so that |q| <= tan(pi/8) in atan(q) = q P(q^2). P interpolates at the 12 Chebyshev nodes of [0, tan^2(pi/8)]; in
// arithmetic of 50 digits it is within 4e-18 of atan(q)/q.
GONIO_INLINE void gonio_quarter_turns4(const gonio_d4 *sine, const gonio_d4 *cosine, gonio_d4 *out) {
    const gonio_d4 s = *sine, c = *cosine;
    const gonio_d4 r = 1 + c;
    const gonio_l4 far = s > 0.41421356237309503 * r;
    const gonio_d4 q = GONIO_SELECT4(far, s - r, s) / GONIO_SELECT4(far, s + r, r);
    const gonio_d4 u = q * q, u2 = u * u, u4 = u2 * u2;
    const gonio_d4 p0 = (1 - u * 0.3333333333333312) + u2 * (0.19999999999940893 - u * 0.14285714279250245);
    const gonio_d4 p4 =
        (0.11111110744919658 - u * 0.09090896809064027) + u2 * (0.07692045330902225 - u * 0.06662951813629191);
    const gonio_d4 p8 =
        (0.05846878297330872 - u * 0.05035102456601552) + u2 * (0.03796525745386593 - u * 0.017805397205419446);
    const gonio_d4 turns = q * (4 / 3.14159265358979323846) * (p0 + u4 * (p4 + u4 * p8));
    *out = GONIO_SELECT4(far, 1 + turns, turns);
}

// sinh t for |t| <= 100: near 0, where e^t - e^-t cancels, the Taylor series up to t^17 (the next term, 1/19!, is 8e-18
// of the result at 1).
GONIO_INLINE void gonio_sinh4(gonio_d4 *argument) {
    const gonio_d4 t = *argument, u = t * t, u2 = u * u, u4 = u2 * u2;
    const gonio_d4 p0 = (1 + u * (1.0 / 6)) + u2 * (1.0 / 120 + u * (1.0 / 5040));
    const gonio_d4 p4 = (1.0 / 362880 + u * (1.0 / 39916800)) + u2 * (1.0 / 6227020800 + u * (1.0 / 1307674368000));
    const gonio_d4 near = t * (p0 + u4 * (p4 + u4 * (1.0 / 355687428096000)));
    gonio_d4 e = t;
    gonio_exp4(&e);
    *argument = GONIO_SELECT4(u < 1, near, 0.5 * (e - 1 / e));
}

#endif
