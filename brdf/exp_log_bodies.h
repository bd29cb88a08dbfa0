// SPDX-License-Identifier: BSD-3-Clause
// Included by brdf/exp_log.h once for each GONIO_WIDTH, the number of doubles in a vector.
GONIO_INLINE void GONIO_LANED(gonio_sqrt)(GONIO_D *x) {
#if GONIO_WIDTH == 4
    *x = (GONIO_D){sqrt((*x)[0]), sqrt((*x)[1]), sqrt((*x)[2]), sqrt((*x)[3])};
#else
    *x = (GONIO_D){sqrt((*x)[0]), sqrt((*x)[1]), sqrt((*x)[2]), sqrt((*x)[3]),
                   sqrt((*x)[4]), sqrt((*x)[5]), sqrt((*x)[6]), sqrt((*x)[7])};
#endif
}

// e^x; x is held between -708 and 709, where e^x is a normal number. NaN counts as -708.
//
// x = n ln 2 + r, |r| <= ln(2)/2: e^x = 2^n times the Taylor series of e^r up to r^13. The next term is 0.3466^14 / 14!
// = 4e-18.
GONIO_INLINE void GONIO_LANED(gonio_exp)(GONIO_D *argument) {
    GONIO_D x = *argument;
    x = GONIO_MAX(x, GONIO_ALL(-708.0));
    x = GONIO_MIN(x, GONIO_ALL(709.0));
    const GONIO_D moved = x * 0x1.71547652b82fep0 + GONIO_ROUNDER, n = moved - GONIO_ROUNDER;
    const GONIO_D r = (x - n * GONIO_LN2_HIGH) - n * GONIO_LN2_LOW;
    const GONIO_D r2 = r * r, r4 = r2 * r2;
    const GONIO_D p0 = (1 + r) + r2 * (0.5 + r * (1.0 / 6));
    const GONIO_D p4 = (1.0 / 24 + r * (1.0 / 120)) + r2 * (1.0 / 720 + r * (1.0 / 5040));
    const GONIO_D p8 = (1.0 / 40320 + r * (1.0 / 362880)) + r2 * (1.0 / 3628800 + r * (1.0 / 39916800));
    const GONIO_D p12 = 1.0 / 479001600 + r * (1.0 / 6227020800);
    const GONIO_D p = (p0 + r4 * p4) + r4 * r4 * (p8 + r4 * p12);
    *argument = p * (GONIO_D)(((GONIO_W)moved + 1023) << 52);
}

// ln x of positive normal doubles; every positive float is one.
//
// x = 2^e m, sqrt(1/2) <= m < sqrt(2); ln m = 2 artanh(s), s = (m - 1)/(m + 1), by its Taylor series up to s^21: with
// s^2 <= 0.0295 the next term is 0.0295^11 / 23 = 6e-19 of the first.
GONIO_INLINE void GONIO_LANED(gonio_log)(GONIO_D *argument) {
    const GONIO_W bits = (GONIO_W)*argument;
    // The exponent field of x / sqrt(1/2), 1024 larger than e.
    const GONIO_W field = (bits - 0x3fe6a09e667f3bcdu + ((uint64_t)1024 << 52)) >> 52;
    const GONIO_D m = (GONIO_D)(bits - (field << 52) + ((uint64_t)1024 << 52));
    const GONIO_D e = (GONIO_D)(field + 0x4338000000000000u) - (GONIO_ROUNDER + 1024);
    const GONIO_D s = (m - 1) / (m + 1), z = s * s, z2 = z * z, z4 = z2 * z2;
    const GONIO_D q1 = (1.0 / 3 + z * (1.0 / 5)) + z2 * (1.0 / 7 + z * (1.0 / 9));
    const GONIO_D q5 = (1.0 / 11 + z * (1.0 / 13)) + z2 * (1.0 / 15 + z * (1.0 / 17));
    const GONIO_D q9 = 1.0 / 19 + z * (1.0 / 21);
    const GONIO_D rest = z * (q1 + z4 * (q5 + z4 * q9));
    *argument = e * GONIO_LN2_HIGH + (2 * s + (2 * s * rest + e * GONIO_LN2_LOW));
}

// asinh x of 0 <= x < 1e150, to 1e-16 absolute below 1.
GONIO_INLINE void GONIO_LANED(gonio_asinh)(GONIO_D *x) {
    GONIO_D root = *x * *x + 1;
    GONIO_LANED(gonio_sqrt)(&root);
    *x += root;
    GONIO_LANED(gonio_log)(x);
}

// (2/pi) atan2(s, c) of a sine and a cosine >= 0.
//
// theta = 2 atan(t) with t = tan(theta/2) = s/(1 + c) <= 1, and atan(t) = pi/4 + atan((t - 1)/(t + 1)) above tan(pi/8),
// so that |q| <= tan(pi/8) in atan(q) = q P(q^2). P interpolates at the 12 Chebyshev nodes of [0, tan^2(pi/8)]; in
// arithmetic of 50 digits it is within 4e-18 of atan(q)/q.
GONIO_INLINE void GONIO_LANED(gonio_quarter_turns)(const GONIO_D *sine, const GONIO_D *cosine, GONIO_D *out) {
    const GONIO_D s = *sine, c = *cosine;
    const GONIO_D r = 1 + c;
    const GONIO_L far = s > 0.41421356237309503 * r;
    const GONIO_D q = GONIO_SELECT(far, s - r, s) / GONIO_SELECT(far, s + r, r);
    const GONIO_D u = q * q, u2 = u * u, u4 = u2 * u2;
    const GONIO_D p0 = (1 - u * 0.3333333333333312) + u2 * (0.19999999999940893 - u * 0.14285714279250245);
    const GONIO_D p4 =
        (0.11111110744919658 - u * 0.09090896809064027) + u2 * (0.07692045330902225 - u * 0.06662951813629191);
    const GONIO_D p8 =
        (0.05846878297330872 - u * 0.05035102456601552) + u2 * (0.03796525745386593 - u * 0.017805397205419446);
    const GONIO_D turns = q * (4 / 3.14159265358979323846) * (p0 + u4 * (p4 + u4 * p8));
    *out = GONIO_SELECT(far, 1 + turns, turns);
}

// sinh t for |t| <= 100: near 0, where e^t - e^-t cancels, the Taylor series up to t^17 (the next term, 1/19!, is 8e-18
// of the result at 1).
GONIO_INLINE void GONIO_LANED(gonio_sinh)(GONIO_D *argument) {
    const GONIO_D t = *argument, u = t * t, u2 = u * u, u4 = u2 * u2;
    const GONIO_D p0 = (1 + u * (1.0 / 6)) + u2 * (1.0 / 120 + u * (1.0 / 5040));
    const GONIO_D p4 = (1.0 / 362880 + u * (1.0 / 39916800)) + u2 * (1.0 / 6227020800 + u * (1.0 / 1307674368000));
    const GONIO_D near = t * (p0 + u4 * (p4 + u4 * (1.0 / 355687428096000)));
    GONIO_D e = t;
    GONIO_LANED(gonio_exp)(&e);
    *argument = GONIO_SELECT(u < 1, near, 0.5 * (e - 1 / e));
}
