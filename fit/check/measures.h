// SPDX-License-Identifier: BSD-3-Clause
// What the measures of tables, of scattered samples and of models share.
#ifndef GONIO_FIT_CHECK_MEASURES_H
#define GONIO_FIT_CHECK_MEASURES_H

#include "fit/check/table.h"
#include "gonio/plan.h"

// Relative differences as they come in; the medians are those of the first GONIO_CHECK_KEPT.
#define GONIO_CHECK_KEPT ((size_t)200000)
typedef struct gonio_differences {
    gonio_check_range range; // mean: the sum so far
    double *kept;            // NULL: no median is asked for
    size_t kept_n, room, stride;
} gonio_differences;

// expected: how many will come. False: no memory.
bool gonio_differences_begin(gonio_differences *d, size_t expected);
// a and b ought to be equal.
void gonio_differences_add(gonio_differences *d, double a, double b, const gonio_pair *where, int channel);
// The range in per cent, and the median of 2|a - b| / (|a| + |b| + 2e-3) as a fraction. Releases.
gonio_check_range gonio_differences_end(gonio_differences *d, double *median);

// Sums of each channel over what was compared: squares, chi-square and its degrees of freedom, and what sigma alone
// makes of the squares. Free square.
typedef struct gonio_check_sums {
    double *square, *chi2, *dof, *expected; // [channels]
} gonio_check_sums;
bool gonio_check_sums_begin(gonio_check_sums *sums, size_t channels); // false: no memory
gonio_check_test gonio_check_sums_test(const gonio_check_sums *sums, int channels);
double gonio_check_mean(const double *values, size_t n);

// The albedos of the report are there: excess, albedo, energy and their range from them.
void gonio_check_sum_up_albedos(gonio_check_report *report);
// Does one of the albedos exceed 1 by more than sigma and the sum's own error explain?
void gonio_check_test_energy(gonio_check_report *report, int channels);

// gonio_check_model and gonio_check_samples of one half, in front of the surface.
gonio_status gonio_check_half_model(const gonio_model *model, int threads, gonio_check_report *report,
                                    gonio_error *error);
gonio_status gonio_check_half_samples(const gonio_samples *samples, int threads, gonio_check_report *report,
                                      gonio_error *error);

// Albedos[azimuths][channels] of a model for light at theta_i, the sample turned to each azimuth, by adaptive
// quadrature held against an albedo by importance; *gap: their relative error.
gonio_status gonio_check_albedo_exactly(const gonio_model *model, double theta_i, int azimuths, double *albedos,
                                        double *gap, gonio_error *error);

// The albedo of n samples of one incidence into point: sum weight f, and the same by other weights, whose difference is
// what the sum may be off. value[channels], sigma: what the test takes, by the better weights. point: its place and
// what is covered are set; below this part of the hemisphere there is no figure.
#define GONIO_CHECK_COVERED 0.5
void gonio_check_integrate(const gonio_samples *samples, size_t n, const size_t *sample, const double *weight,
                           const double *other, bool other_is_better, double *value, double *sigma,
                           gonio_check_albedo_point *point);

// A grid of thetas x 4 thetas azimuths in cells that fill the hemisphere: no pole, no horizon. isotropic: light at
// azimuth 0. The caller frees it.
gonio_status gonio_check_cell_plan(int thetas, bool isotropic, gonio_plan **out, gonio_error *error);
#define GONIO_CHECK_TURNS 8 // azimuths at which (4.8) and (4.9) take the interpolant of scattered samples
// The one on which P_s of models and of scattered samples is measured.
gonio_status gonio_check_grid_plan(bool isotropic, gonio_plan **out, gonio_error *error);
// P_s^(k) of a model from a table of it, cell-centred at equal steps of theta and azimuth.
gonio_status gonio_check_gridded_ranks(const gonio_model *model, int threads, gonio_check_report *report,
                                       gonio_error *error);
// Figures into the report of samples as they lie, those of the bits in `what`.
enum {
    GONIO_CHECK_OF_RECIPROCITY = 1,
    GONIO_CHECK_OF_ISOTROPY = 2,
    GONIO_CHECK_OF_ENERGY = 4,
    GONIO_CHECK_OF_RANKS = 8,
};
gonio_status gonio_check_interpolated(const gonio_samples *samples, unsigned what, int threads,
                                      gonio_check_report *report, gonio_error *error);

// All of a table's figures into the report, which was set to zeros.
gonio_status gonio_check_table(const gonio_table *table, int threads, gonio_check_report *report, gonio_error *error);
// The singular values' part of it.
gonio_status gonio_check_table_ranks(const gonio_table *table, int threads, gonio_check_report *report,
                                     gonio_error *error);

#endif
