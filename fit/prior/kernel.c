// SPDX-License-Identifier: BSD-3-Clause
// The covariance of a material's deviations from physics (fit/prior/kernel.h), and what samples tell of them.
#include "fit/prior/kernel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/prepare/scatter.h"
#include "fit/smooth/matrix.h"

// Correlation lengths in half-vector coordinates: the tilt's, 0.08, is half of the way from the peak to tan(theta_h) =
// 1/4; the difference angle's is 27 deg of 90 (4-D: as much about the normal). tests/bench/fit_support chose them.
#define TILT_LENGTH 0.08
#define DIFFERENCE_LENGTH 0.3
#define DIFFERENCE_LENGTH_4D 0.2
#define NUGGET 0.01 // of the prior variance: what no neighbour tells

static double length_of(int dims, int axis) {
    return axis < 2 ? TILT_LENGTH : dims == 3 ? DIFFERENCE_LENGTH : DIFFERENCE_LENGTH_4D;
}

void gonio_prior_kernel_place(const gonio_prior_kernel *k, const gonio_pair *pair, double *x) {
    const int dims = k->dims;
    gonio_scatter_locate(GONIO_HALF_VECTOR, dims, pair, x);
    for (int d = 0; d < dims; d++) {
        x[d] = d == 2 && dims == 3 ? x[d] / length_of(dims, d) : (x[d] - 0.5) / length_of(dims, d);
    }
}

double gonio_prior_kernel_covariance(const gonio_prior_kernel *k, const double *x, const double *y, double times) {
    const double scale = -0.5 / (times * times);
    double sum = 0;
    for (int g = 0; g < k->images_n; g++) {
        double distance2 = 0;
        for (int d = 0; d < k->dims; d++) {
            const double by = x[d] - (k->images[g] >> d & 1 ? -y[d] : y[d]);
            distance2 += by * by;
        }
        sum += exp(scale * distance2);
    }
    return sum;
}

static double covariance(const gonio_prior_kernel *k, const double *x, const double *y) {
    return gonio_prior_kernel_covariance(k, x, y, 1);
}

void gonio_prior_kernel_release(gonio_prior_kernel *kernel) {
    free(kernel->x);
    free(kernel->norm);
    free(kernel->factor);
    *kernel = (gonio_prior_kernel){0};
}

void gonio_prior_kernel_start(gonio_prior_kernel *k, int dims, bool mirror) {
    *k = (gonio_prior_kernel){.dims = dims};
    const unsigned swap = gonio_coordinates_swap_axes(GONIO_HALF_VECTOR, k->dims);
    const unsigned flip = gonio_coordinates_mirror_axes(GONIO_HALF_VECTOR, k->dims);
    k->images[k->images_n++] = 0;
    k->images[k->images_n++] = swap;
    if (mirror) {
        k->images[k->images_n++] = flip;
        k->images[k->images_n++] = flip ^ swap;
    }
}

gonio_status gonio_prior_kernel_init(gonio_prior_kernel *k, const gonio_dataset *data, gonio_error *error) {
    const size_t n = data->n, d = (size_t)data->dims;
    gonio_prior_kernel_start(k, data->dims, data->mirror);
    k->n = n;
    k->x = malloc(n * d * sizeof(double));
    k->norm = malloc(n * sizeof(double));
    k->factor = malloc(n * n * sizeof(double));
    if (k->x == NULL || k->norm == NULL || k->factor == NULL) {
        gonio_prior_kernel_release(k);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the support of %zu samples", n);
    }
    for (size_t i = 0; i < n; i++) {
        gonio_prior_kernel_place(k, &data->pairs[i], k->x + i * d);
        k->norm[i] = 1 / sqrt(covariance(k, k->x + i * d, k->x + i * d));
        for (size_t j = 0; j <= i; j++) {
            k->factor[j * n + i] =
                covariance(k, k->x + i * d, k->x + j * d) * k->norm[i] * k->norm[j] + (i == j ? NUGGET : 0);
        }
    }
    if (!gonio_cholesky(n, k->factor)) {
        gonio_prior_kernel_release(k);
        return gonio_fail(error, GONIO_E_CONVERGENCE, "the support of %zu samples was not found", n);
    }
    return GONIO_OK;
}

// k^T (L L^T)^-1 k = |L^-1 k|^2.
double gonio_prior_kernel_support(const gonio_prior_kernel *k, const gonio_pair *pair, double *work) {
    double x[GONIO_DIMS_MAX];
    gonio_prior_kernel_place(k, pair, x);
    const double norm = 1 / sqrt(covariance(k, x, x));
    for (size_t i = 0; i < k->n; i++) {
        work[i] = covariance(k, k->x + i * (size_t)k->dims, x) * k->norm[i] * norm;
    }
    for (size_t j = 0; j < k->n; j++) {
        const double *column = k->factor + j * k->n;
        work[j] /= column[j];
        gonio_add_scaled(k->n - j - 1, -work[j], column + j + 1, work + j + 1);
    }
    return fmin(gonio_dot(k->n, work, work), 1);
}

// L^-T of it.
void gonio_prior_kernel_weights(const gonio_prior_kernel *k, double *work) {
    for (size_t j = k->n; j-- > 0;) {
        const double *column = k->factor + j * k->n;
        work[j] = (work[j] - gonio_dot(k->n - j - 1, column + j + 1, work + j + 1)) / column[j];
    }
}

// trace K (K + nugget)^-1 = n - nugget trace (K + nugget)^-1
gonio_status gonio_prior_kernel_freedom(const gonio_prior_kernel *k, double *freedom, gonio_error *error) {
    double *inverse = malloc(2 * k->n * k->n * sizeof *inverse);
    if (inverse == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the support of %zu samples", k->n);
    }
    memcpy(inverse, k->factor, k->n * k->n * sizeof *inverse);
    gonio_cholesky_invert(k->n, inverse, inverse + k->n * k->n);
    *freedom = (double)k->n;
    for (size_t i = 0; i < k->n; i++) {
        *freedom -= NUGGET * inverse[i * k->n + i];
    }
    free(inverse);
    return GONIO_OK;
}
