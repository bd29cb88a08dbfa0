// SPDX-License-Identifier: BSD-3-Clause
// Does a symmetry hold of scattered samples, as far as sigma and the interpolation between them can tell?
//
// No sample stands where the symmetry takes another, and to interpolate there errs by more than the noise. So the
// symmetry is tested without interpolating a value: y = s(u) + X b + error. s is any smooth function of coordinates u
// that the symmetry leaves alone (exchanged images share their u), X are a few functions that the symmetry changes. A
// local linear regression over neighbours in u takes s out of y and of X alike, and what is left of y is regressed on
// what is left of X (Robinson 1988, "Root-n-consistent semiparametric regression"; Speckman 1988). b is 0 where the
// symmetry holds; its covariance comes from the residuals (White 1980), which hold the noise and what the interpolation
// leaves, and is raised to what sigma alone makes where that is more. b^T C^-1 b is chi-square with as many degrees of
// freedom as X has columns.
#ifndef GONIO_FIT_CHECK_PARTIAL_H
#define GONIO_FIT_CHECK_PARTIAL_H

#include "gonio/check.h"

typedef enum gonio_symmetry_test { GONIO_TEST_RECIPROCITY, GONIO_TEST_ISOTROPY } gonio_symmetry_test;

// *test: NaN where there are too few samples, or none that the symmetry connects. *part: the rms of X b, the smooth
// part of the violation, relative to f; NULL: not wanted.
gonio_status gonio_partial_test(const gonio_samples *samples, gonio_symmetry_test symmetry, int threads,
                                gonio_check_test *test, double *part, gonio_error *error);

#endif
