// SPDX-License-Identifier: BSD-3-Clause
#include "base/statistics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/order_statistic.h"

static int by_value(const void *left, const void *right) {
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

void gonio_sort(double *values, size_t n) { qsort(values, n, sizeof *values, by_value); }

double gonio_upper_median(double *values, size_t n) { return gonio_order_statistic(values, n, n / 2); }

double gonio_median(double *values, size_t n) {
    const double upper = gonio_upper_median(values, n);
    if (n % 2 == 1 || n == 0) {
        return upper;
    }
    return 0.5 * (gonio_order_statistic(values, n / 2, n / 2 - 1) + upper);
}

float gonio_quantile_f32(float *values, size_t n, double q) {
    return gonio_order_statistic_f32(values, n, n > 0 ? (size_t)(q * (double)(n - 1) + 0.5) : 0);
}

gonio_status gonio_median_mad_f32(const float *values, size_t n, double *median, double *sigma, gonio_error *error) {
    float *copy = malloc(n * sizeof *copy);
    if (copy == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the median of %zu values", n);
    }
    memcpy(copy, values, n * sizeof *copy);
    *median = gonio_quantile_f32(copy, n, 0.5);
    for (size_t i = 0; i < n; i++) {
        copy[i] = (float)fabs((double)values[i] - *median);
    }
    *sigma = 1.4826 * gonio_quantile_f32(copy, n, 0.5);
    free(copy);
    return GONIO_OK;
}
