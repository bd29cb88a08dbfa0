// SPDX-License-Identifier: BSD-3-Clause
// Medians and their like. Each reorders what it is given unless it says otherwise, and gives 0 for no values.
#ifndef GONIO_BASE_STATISTICS_H
#define GONIO_BASE_STATISTICS_H

#include <stddef.h>

#include "gonio/status.h"

// Median of |x| of a normal distribution of standard deviation 1.
#define GONIO_MEDIAN_OF_NORMAL 0.6744897501960817

// Ascending; for several quantiles of the same values.
void gonio_sort(double *values, size_t n);
// The mean of the middle two where n is even, and the upper one of them.
double gonio_median(double *values, size_t n);
double gonio_upper_median(double *values, size_t n);
// The q-quantile (0..1), the nearest of the values.
float gonio_quantile_f32(float *values, size_t n, double q);
// Median and 1.4826 x median absolute deviation (sigma of a normal distribution) of n >= 1 values, left as they are.
gonio_status gonio_median_mad_f32(const float *values, size_t n, double *median, double *sigma, gonio_error *error);

#endif
