// SPDX-License-Identifier: BSD-3-Clause
// Is a BRDF physical, and how simple is it: reciprocity, energy, isotropy, separability; and transforms that make
// samples so.
#ifndef GONIO_CHECK_H
#define GONIO_CHECK_H

#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/sample.h"

GONIO_BEGIN

#define GONIO_CHECK_RANKS 8

typedef struct gonio_check_report {
    // Medians over 4,000 pairs of directions (theta <= 80 deg) and the channels of 2|a - b| / (|a| + |b| + 2e-3 /sr):
    double reciprocity; // a, b: with incident and outgoing exchanged
    double isotropy;    // a, b: with the sample turned by half a golden angle
    // The largest directional-hemispherical reflectance of any channel over theta_i = 0, 5 ... 85 deg, and where.
    double energy, energy_theta_rad;
    int energy_channel;
    // Kautz & McCool, "Interactive rendering with arbitrary BRDFs using separable approximations" (1999): of the matrix
    // f(half vector; difference vector), the relative Frobenius error of the best approximation by k = 1, 2 ...
    // products; rms over the channels.
    double separability[GONIO_CHECK_RANKS];
    size_t negative, not_finite; // values among the 4,000 pairs
} gonio_check_report;

// Measure a model. Deterministic: any thread count (0: all) gives the same figures. The report is the caller's and owns
// nothing. GONIO_E_FAILED where a value is not finite.
gonio_status gonio_check_model(const gonio_model *model, int threads, gonio_check_report *report, gonio_error *error);
// Measure samples. They cannot be integrated or exchanged as they lie, so a fit stands for them: multilevel B-splines
// with mirrored samples, the level chosen with the seed's split. threads: 0 all; equal figures for any number.
gonio_status gonio_check_samples(const gonio_samples *samples, uint64_t seed, int threads, gonio_check_report *report,
                                 gonio_error *error);
// Directional-hemispherical reflectance of every channel (albedo: channels values) for light at theta_i, phi_i = 0, to
// about 1e-3 of it.
void gonio_check_albedo(const gonio_model *model, double theta_i_rad, double *albedo);

// Transforms of samples, joined by |.
#define GONIO_APPLY_MIRROR 1      // add f(-phi) = f(phi)
#define GONIO_APPLY_RECIPROCITY 2 // add f(o, i) = f(i, o)
#define GONIO_APPLY_ISOTROPY 4    // turn every pair to phi_i = 0 and declare the set isotropic
#define GONIO_APPLY_CLAMP 8       // raise negative values to 0
#define GONIO_APPLY_ENERGY 16     // divide by `energy` where it exceeds 1
// A new set, which the caller frees; `samples` stays as it is. energy: as reported; used by GONIO_APPLY_ENERGY alone.
gonio_status gonio_check_apply(const gonio_samples *samples, int transforms, double energy, gonio_samples **out,
                               gonio_error *error);

typedef struct gonio_mueller_report {
    size_t matrices;   // sets of sixteen elements that were looked at, one a sample and matrix of channels
    size_t unphysical; // of no sample whatever
    double tolerance;  // an eigenvalue below minus this, of their sum, is none; or 5 standard uncertainties, if that is
                       // more
    double worst;      // the smallest eigenvalue over their sum, and where
    gonio_pair worst_pair;
    char worst_channel[GONIO_CHANNEL_NAME_MAX]; // of the matrix' element 11
} gonio_mueller_report;
// Channels f_r11 to f_r44 (or any sixteen names that end so) are a Mueller matrix: is each physically realisable
// (Cloude 1989)? No matrices: there are no such channels.
void gonio_check_mueller(const gonio_samples *samples, gonio_mueller_report *report);

GONIO_END
#endif
