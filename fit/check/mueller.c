// SPDX-License-Identifier: BSD-3-Clause
// Are sets of sixteen Mueller elements matrices of any sample at all?
//
// S. R. Cloude, "Conditions for the physical realisability of matrix operators in polarimetry" (Proc. SPIE 1166, 1989):
// a Mueller matrix M is a sum of those of pure media, and none other, where its coherency matrix
//   H = 1/4 sum_jk m_jk (sigma_j (x) conj(sigma_k)),  sigma: the unit matrix and Pauli's, in the order of Stokes'
//   parameters
// has no negative eigenvalue. Their sum is m_11. H is Hermitian, 4 x 4; the real symmetric 8 x 8 matrix [[Re, -Im],
// [Im, Re]] has each of its eigenvalues twice.
#include <math.h>
#include <string.h>

#include "base/mueller.h"
#include "fit/smooth/matrix.h"
#include "gonio/check.h"

// Of the sum of the eigenvalues: printed figures and the instrument's own errors come to about so much.
#define TOLERANCE 0.01
// Standard deviations of the set's own uncertainty.
#define SIGMAS 5

// sigma_0 to sigma_3, [parameter][row][column][real, imaginary].
static const double pauli[4][2][2][2] = {
    {{{1, 0}, {0, 0}}, {{0, 0}, {1, 0}}},
    {{{1, 0}, {0, 0}}, {{0, 0}, {-1, 0}}},
    {{{0, 0}, {1, 0}}, {{1, 0}, {0, 0}}},
    {{{0, 0}, {0, -1}}, {{0, 1}, {0, 0}}},
};

static void coherency(const double m[16], double a[64]) {
    memset(a, 0, 64 * sizeof *a);
    for (int e = 0; e < 16; e++) {
        for (int at = 0; at < 16; at++) {
            const int row = at / 4, column = at % 4;
            const double *s = pauli[e / 4][row / 2][column / 2], *t = pauli[e % 4][row % 2][column % 2];
            const double real = 0.25 * m[e] * (s[0] * t[0] + s[1] * t[1]); // s conj(t)
            const double imaginary = 0.25 * m[e] * (s[1] * t[0] - s[0] * t[1]);
            a[8 * row + column] += real;
            a[8 * (row + 4) + column + 4] += real;
            a[8 * row + column + 4] -= imaginary;
            a[8 * (row + 4) + column] += imaginary;
        }
    }
}

// The smallest eigenvalue over their sum; NaN where there is none.
static double smallest(const double m[16]) {
    double scaled[16], a[64], values[8], low = INFINITY;
    if (!(m[0] > 0) || !isfinite(m[0])) {
        return m[0] == 0 ? 0 : -INFINITY; // nothing comes back; or less than nothing
    }
    for (int e = 0; e < 16; e++) {
        scaled[e] = m[e] / m[0];
        if (!(fabs(scaled[e]) < 1e6)) {
            return -INFINITY;
        }
    }
    coherency(scaled, a);
    if (!gonio_eigen(8, a, values)) {
        return NAN;
    }
    for (int k = 0; k < 8; k++) {
        low = fmin(low, values[k]);
    }
    return low;
}

static void judge(const gonio_samples *s, const gonio_mueller_set *set, size_t i, gonio_mueller_report *report) {
    double m[16], variance = 0;
    for (int e = 0; e < 16; e++) {
        const double sigma = gonio_samples_sigma(s, i, set->channel[e]);
        m[e] = s->values[i * (size_t)s->channels + (size_t)set->channel[e]];
        variance += sigma * sigma;
    }
    // No eigenvalue of H moves by more than the norm of what is added to H, which is half of that of the elements.
    const double allowed = fmax(TOLERANCE, m[0] > 0 ? SIGMAS * 0.5 * sqrt(variance) / m[0] : 0);
    const double low = smallest(m);
    report->matrices++;
    report->unphysical += low < -allowed;
    if (low < report->worst) {
        report->worst = low;
        report->worst_pair = s->pairs[i];
        memcpy(report->worst_channel, s->channel_names[set->channel[0]], sizeof report->worst_channel);
    }
}

void gonio_check_mueller(const gonio_samples *samples, gonio_mueller_report *report) {
    gonio_mueller_set set;
    *report = (gonio_mueller_report){.worst = INFINITY, .tolerance = TOLERANCE};
    for (int c = 0; c < samples->channels; c++) {
        if (gonio_mueller_find((const char(*)[GONIO_CHANNEL_NAME_MAX])samples->channel_names, samples->channels, c,
                               &set)) {
            for (size_t i = 0; i < samples->n; i++) {
                judge(samples, &set, i, report);
            }
        }
    }
}
