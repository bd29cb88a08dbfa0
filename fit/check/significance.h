// SPDX-License-Identifier: BSD-3-Clause
// How likely chance alone goes as far.
#ifndef GONIO_FIT_CHECK_SIGNIFICANCE_H
#define GONIO_FIT_CHECK_SIGNIFICANCE_H

#include "gonio/check.h"

// That a chi-square of dof degrees of freedom (any number above 0) exceeds x, and a standard normal number z.
double gonio_chi_square_beyond(double dof, double x);
double gonio_normal_beyond(double z);

extern const gonio_check_test gonio_check_no_test; // NaN: nothing to test with
// The test of the least p of several, which any dependence between them leaves valid: its p times their number
// (Bonferroni), at most 1. more joins *one, of which `joined` are there already.
void gonio_check_join(gonio_check_test *one, int *joined, const gonio_check_test *more);

#endif
