// SPDX-License-Identifier: BSD-3-Clause
// How the direct solver's predictions depend on its samples, and how far they may be wrong.
//
// The smoothing prior makes the fit a Gaussian process (Rasmussen & Williams 2006, "Gaussian processes for machine
// learning", eqs. 2.25 and 2.26): at a point with prior covariances k to the samples the prediction is h^T t,
// h = (K + lambda)^-1 k, and its variance in units of the noise's is (k(x, x) - k^T h) / lambda. Of that, h^T h is
// the samples' noise passed on, and the rest what smoothing and gaps leave unknown.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/smooth/matrix.h"
#include "fit/smooth/modes.h"

// out (n x m) = V diag(g) V^T in (n x m), sample fastest; in and out must not overlap, work: n x m.
static void filtered(const gonio_smooth_dense *dense, const double *gain, size_t m, const double *in, double *work,
                     double *out) {
    const size_t n = dense->n;
    const gonio_matrix vectors = gonio_matrix_of(dense->vectors, n, n), middle = gonio_matrix_of(work, n, m);
    gonio_multiply(1, gonio_matrix_transposed(vectors), gonio_matrix_of(in, n, m), 0, middle);
    for (size_t i = 0; i < m; i++) {
        for (size_t j = 0; j < n; j++) {
            work[i * n + j] *= gain[j];
        }
    }
    gonio_multiply(1, vectors, middle, 0, gonio_matrix_of(out, n, m));
}

gonio_status gonio_smooth_dense_spread(const gonio_smooth_dense *dense, double lambda, size_t m, const double *at,
                                       const double *shares, double *weights, double *variance, gonio_error *error) {
    const size_t n = dense->n, d = (size_t)dense->dims;
    double *feature[4] = {NULL, NULL, NULL, NULL};
    double *cross = malloc(n * m * sizeof *cross), *work = malloc((m + 1) * n * sizeof *work);
    bool all = cross != NULL && work != NULL;
    for (size_t k = 0; k < d; k++) {
        all = (feature[k] = malloc(dense->m * m * sizeof(double))) != NULL && all;
    }
    gonio_status status =
        all ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for the spread at %zu points", m);
    for (size_t k = 0; k < d && status == GONIO_OK; k++) {
        gonio_smooth_axis_features(&dense->axis, m, at + k, d, feature[k]);
    }
    status = status == GONIO_OK ? gonio_smooth_covariance(dense, m, at, feature, NULL, cross, variance, error) : status;
    if (status == GONIO_OK && dense->form.profile > 0) {
        status = gonio_smooth_profile_cross(dense->profile, dense->form.profile, m, at, cross, variance, error);
    }
    if (status == GONIO_OK && dense->shares != NULL) {
        gonio_multiply(1, gonio_matrix_of(dense->shares, n, GONIO_SMOOTH_SHARES),
                       gonio_matrix_transposed(gonio_matrix_of(shares, m, GONIO_SMOOTH_SHARES)), 1,
                       gonio_matrix_of(cross, n, m));
        for (size_t k = 0; k < m * GONIO_SMOOTH_SHARES; k++) {
            variance[k % m] += shares[k] * shares[k];
        }
    }
    if (status == GONIO_OK) {
        double *gain = work + n * m;
        for (size_t j = 0; j < n; j++) {
            gain[j] = 1 / (dense->values[j] + lambda);
        }
        filtered(dense, gain, m, cross, work, weights);
        for (size_t i = 0; i < m; i++) {
            const double known = gonio_dot(n, cross + i * n, weights + i * n);
            variance[i] = fmax(variance[i] - known, 0) / lambda;
        }
    }
    for (size_t k = 0; k < d; k++) {
        free(feature[k]);
    }
    free(cross);
    free(work);
    return status;
}

gonio_status gonio_smooth_dense_influence(const gonio_smooth_dense *dense, double lambda, double *out,
                                          gonio_error *error) {
    const size_t n = dense->n;
    double *scaled = malloc(n * n * sizeof *scaled);
    if (scaled == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the influence of %zu samples", n);
    }
    for (size_t j = 0; j < n; j++) {
        const double root = sqrt(lambda / (dense->values[j] + lambda));
        for (size_t i = 0; i < n; i++) {
            scaled[j * n + i] = dense->vectors[j * n + i] * root;
        }
    }
    const gonio_matrix vectors = gonio_matrix_of(scaled, n, n), whole = gonio_matrix_of(out, n, n);
    gonio_multiply_lower(1, vectors, gonio_matrix_transposed(vectors), 0, whole);
    gonio_matrix_mirror(whole);
    free(scaled);
    return GONIO_OK;
}

const double *gonio_smooth_dense_roots(const gonio_smooth_dense *dense) { return dense->root; }
