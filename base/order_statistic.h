// SPDX-License-Identifier: BSD-3-Clause
// The k-th smallest of many values, in linear time.
#ifndef GONIO_BASE_ORDER_STATISTIC_H
#define GONIO_BASE_ORDER_STATISTIC_H

#include <stddef.h>

// values[n], reordered so that values[k] is the k-th, those before it are at most it, those behind it at least;
// k < n. 0 where n is 0. Hoare, "Algorithm 65: Find", 1961.
double gonio_order_statistic(double *values, size_t n, size_t k);
float gonio_order_statistic_f32(float *values, size_t n, size_t k);

#endif
