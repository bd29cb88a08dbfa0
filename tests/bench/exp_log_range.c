// SPDX-License-Identifier: BSD-3-Clause
// The largest error of evaluation's exp and ln over every float of their range, in units in the last place of float.
// The reference is libm's in double, whose own error is below 2e-9 of that unit.
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "brdf/exp_log.h"

#define BOUND 2.0

typedef void function(gonio_d4 *x);

GONIO_CLONES static void exp_range_exp(gonio_d4 *x) { gonio_exp4(x); }
GONIO_CLONES static void exp_range_log(gonio_d4 *x) { gonio_log4(x); }

static float float_of(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint32_t bits_of(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

// 2^-exponent of the last place of the float nearest to `exact`, subnormal ones among them.
static double per_unit(double exact) {
    uint64_t bits;
    memcpy(&bits, &exact, sizeof bits);
    const int exponent = (int)(bits >> 52 & 0x7ff) - 1023 - 23, held = exponent < -149 ? -149 : exponent;
    bits = (uint64_t)(1023 - held) << 52;
    double unit;
    memcpy(&unit, &bits, sizeof unit);
    return unit;
}

// Floats whose bits are first .. last.
static double largest(function *f, double (*exact)(double), uint32_t first, uint32_t last) {
    double most = 0;
    for (uint64_t bits = first; bits <= last; bits += 4) {
        double x[4];
        for (int k = 0; k < 4; k++) {
            const uint64_t at = bits + (uint64_t)k;
            x[k] = (double)float_of(at <= last ? (uint32_t)at : last);
        }
        gonio_d4 y = {x[0], x[1], x[2], x[3]};
        f(&y);
        for (int k = 0; k < 4; k++) {
            const double want = exact(x[k]), off = fabs((double)(float)y[k] - want) * per_unit(want);
            most = off <= most ? most : off; // a NaN stays
        }
    }
    return most;
}

static int report(const char *name, double error, uint64_t count) {
    const int missed = !(error <= BOUND);
    printf("  %-28s %10llu floats: at most %.6f units in the last place (<= %g)%s\n", name, (unsigned long long)count,
           error, BOUND, missed ? " MISSED" : "");
    fflush(stdout);
    return missed;
}

int main(void) {
    // e^-103.97 is half the least subnormal float, e^88.722 the largest float.
    const uint32_t low = bits_of(103.97F), high = bits_of(88.722F), sign = 0x80000000u;
    int missed = report("exp of 0 to 88.722", largest(exp_range_exp, exp, 0, high), (uint64_t)high + 1);
    missed += report("exp of -103.97 to -0", largest(exp_range_exp, exp, sign, sign | low), (uint64_t)low + 1);
    missed += report("ln of all positive floats", largest(exp_range_log, log, 1, 0x7f7fffff), 0x7f7fffff);
    return missed;
}
