#include "calib/internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Hoare's selection with the middle as pivot: linear on average, no random numbers, so the same result everywhere.
static void select_nth(float *v, size_t n, size_t k) {
    size_t low = 0, high = n - 1;
    while (low < high) {
        const float pivot = v[low + (high - low) / 2];
        size_t i = low, j = high;
        for (;;) {
            while (v[i] < pivot) {
                i++;
            }
            while (v[j] > pivot) {
                j--;
            }
            if (i >= j) {
                break;
            }
            const float t = v[i];
            v[i++] = v[j];
            v[j--] = t;
        }
        if (k <= j) {
            high = j;
        } else {
            low = j + 1;
        }
    }
}

float statistics_quantile(float *values, size_t n, double q) {
    const size_t k = (size_t)(q * (double)(n - 1) + 0.5);
    select_nth(values, n, k);
    return values[k];
}

gonio_status statistics_robust(const float *values, size_t n, double *median, double *sigma, gonio_error *error) {
    float *copy = malloc(n * sizeof *copy);
    if (copy == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the median of %zu values", n);
    }
    memcpy(copy, values, n * sizeof *copy);
    *median = statistics_quantile(copy, n, 0.5);
    for (size_t i = 0; i < n; i++) {
        copy[i] = (float)fabs((double)values[i] - *median);
    }
    *sigma = 1.4826 * statistics_quantile(copy, n, 0.5);
    free(copy);
    return GONIO_OK;
}
