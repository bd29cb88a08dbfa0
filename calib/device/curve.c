// SPDX-License-Identifier: BSD-3-Clause
// Families of response curves: Grossberg and Nayar's EMoR basis, made monotone, and a monotone spline.
#include "calib/device/curve.h"

#include <math.h>
#include <string.h>

// Where EMoR's f may fall, a slope this small is put in its place, and the fall is penalised.
#define SLOPE_MIN 1e-5
#define SMOOTHNESS 20
#define LN_FLOOR (-14) // ln relative exposure of value 0: below any reading that is used

void gonio_curve_start(const curve_family *family, double *p) {
    for (int k = 0; k < family->parameters; k++) {
        // Spline: log increments of ln exposure. A gamma of 1.5 has ln E = 1.5 ln v.
        const double a = (k + 1.0) / family->parameters, b = (double)k / family->parameters;
        const double low = fmax(family->low, 1e-3);
        const double va = low + (1 - low) * a, vb = low + (1 - low) * b;
        p[k] = family->basis != NULL ? 0 : log(1.5 * log(va / vb));
    }
}

// f = f0 + sum p h on even exposures, raised where it falls, then inverted.
static void emor_curve(const curve_family *family, const double *p, double *ln_exposure, double *penalty) {
    const int n = family->samples;
    double f[n];
    double fall = 0;
    for (int i = 0; i < n; i++) {
        f[i] = family->basis[i];
        for (int k = 0; k < family->parameters; k++) {
            f[i] += p[k] * family->basis[(k + 1) * n + i];
        }
        if (i > 0 && f[i] < f[i - 1] + SLOPE_MIN) {
            fall = f[i - 1] + SLOPE_MIN - f[i];
            f[i] = f[i - 1] + SLOPE_MIN;
        } else {
            fall = 0;
        }
        penalty[CURVE_PARAMETERS_MAX + i * 64 / n] += 1e3 * fall;
    }
    int i = 0;
    for (int j = 0; j < CURVE_POINTS; j++) {
        const double v = f[0] + (f[n - 1] - f[0]) * j / (CURVE_POINTS - 1);
        while (i < n - 2 && f[i + 1] < v) {
            i++;
        }
        const double exposure = (i + (v - f[i]) / (f[i + 1] - f[i])) / (n - 1);
        ln_exposure[j] = exposure > 0 ? fmax(log(exposure), LN_FLOOR) : LN_FLOOR;
    }
    for (int k = 0; k < family->parameters; k++) {
        penalty[k] = 0.1 * p[k]; // a weak prior: real cameras' coefficients are of order 1
    }
}

// ln exposure rises by exp(p) from knot to knot, linear between; below the lowest knot proportional to the value.
static void spline_curve(const curve_family *family, const double *p, double *ln_exposure, double *penalty) {
    const int n = family->parameters;
    double knot[CURVE_PARAMETERS_MAX + 1];
    knot[n] = 0;
    for (int k = n - 1; k >= 0; k--) {
        knot[k] = knot[k + 1] - exp(p[k]);
    }
    for (int j = 0; j < CURVE_POINTS; j++) {
        const double v = (double)j / (CURVE_POINTS - 1), x = (v - family->low) / (1 - family->low) * n;
        const int k = (int)fmin(fmax(floor(x), 0), n - 1);
        ln_exposure[j] = x >= 0 ? knot[k] + (knot[k + 1] - knot[k]) * (x - k)
                                : fmax(knot[0] + log(fmax(v, 1e-9) / family->low), LN_FLOOR);
    }
    for (int k = 1; k + 1 < n; k++) {
        // Against residuals in units of one 8-bit step: a response bends over several knots, not from one to the next.
        penalty[k] = SMOOTHNESS * (p[k - 1] - 2 * p[k] + p[k + 1]);
    }
}

void gonio_curve_make(const curve_family *family, const double *p, double ln_exposure[CURVE_POINTS], double *penalty) {
    memset(penalty, 0, CURVE_PENALTIES * sizeof *penalty);
    if (family->basis != NULL) {
        emor_curve(family, p, ln_exposure, penalty);
    } else {
        spline_curve(family, p, ln_exposure, penalty);
    }
}
