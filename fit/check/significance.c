// SPDX-License-Identifier: BSD-3-Clause
// The regularised incomplete gamma function: its series below a + 1, a continued fraction (Lentz) above, as in
// Abramowitz & Stegun 6.5.29 and 6.5.31.
#include "fit/check/significance.h"

#include <math.h>

#define TERMS 100000 // the series needs about 6 sqrt(a) of them

const gonio_check_test gonio_check_no_test = {NAN, NAN, NAN, -1, NAN};

// lgamma itself writes a variable of the process.
static double log_gamma(double a) {
    int sign;
    return lgamma_r(a, &sign);
}

static double lower_series(double a, double x) {
    double term = 1 / a, sum = term;
    for (int k = 1; k < TERMS && term > 1e-17 * sum; k++) {
        term *= x / (a + k);
        sum += term;
    }
    return sum * exp(a * log(x) - x - log_gamma(a));
}

static double upper_fraction(double a, double x) {
    const double tiny = 1e-300;
    double b = x + 1 - a, c = 1 / tiny, d = 1 / b, h = d;
    for (int k = 1; k < TERMS; k++) {
        const double an = -k * (k - a);
        b += 2;
        d = an * d + b;
        d = 1 / (fabs(d) < tiny ? tiny : d);
        c = b + an / c;
        c = fabs(c) < tiny ? tiny : c;
        h *= d * c;
        if (fabs(d * c - 1) < 1e-15) {
            break;
        }
    }
    return h * exp(a * log(x) - x - log_gamma(a));
}

double gonio_chi_square_beyond(double dof, double x) {
    const double a = dof / 2, half = x / 2;
    if (!(dof > 0) || isnan(x)) {
        return NAN;
    }
    if (half <= 0) {
        return 1;
    }
    return half < a + 1 ? fmin(fmax(1 - lower_series(a, half), 0), 1) : fmin(fmax(upper_fraction(a, half), 0), 1);
}

double gonio_normal_beyond(double z) { return 0.5 * erfc(z / sqrt(2)); }

void gonio_check_join(gonio_check_test *one, int *joined, const gonio_check_test *more) {
    if (!isfinite(more->p)) {
        return;
    }
    // *one holds the least p times the number that is joined, unless that was cut at 1.
    const double least = *joined > 0 ? one->least : INFINITY;
    if (more->p < least) {
        *one = *more;
        one->least = more->p;
    }
    *joined += 1;
    one->p = fmin(1, one->least * *joined);
}
