// SPDX-License-Identifier: BSD-3-Clause
// The direct solver's profile: sums over the products of two axes' modes, as fit/smooth/dense.c has them over three.
#include "fit/smooth/profile.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/spline/profile.h"
#include "fit/smooth/matrix.h"
#include "fit/smooth/modes.h"

struct gonio_smooth_profile {
    size_t n;
    gonio_coordinates coordinates; // the solver's
    gonio_smooth_axis axis;        // of both dimensions
    double stretch[2];
    double *feature[2]; // m x n, mode-major, at the samples
    double *columns;    // m^2 x n: all modes at the samples, times their root prior and the samples' root weight
    double *kernel;     // n x n, lower triangle
};

void gonio_smooth_profile_free(gonio_smooth_profile *profile) {
    if (profile != NULL) {
        gonio_smooth_axis_release(&profile->axis);
        free(profile->feature[0]);
        free(profile->feature[1]);
        free(profile->columns);
        free(profile->kernel);
        free(profile);
    }
}

static double root_prior(const gonio_smooth_profile *profile, size_t p, size_t q) {
    const double *s = profile->axis.stiffness;
    return 1 / sqrt(GONIO_SMOOTH_RIDGE + profile->stretch[0] * s[p] + profile->stretch[1] * s[q]);
}

// columns[m^2 x points], point fastest; scale (NULL: 1) a point.
static void fill_columns(const gonio_smooth_profile *profile, size_t points, double *const feature[2],
                         const double *scale, double *columns) {
    const size_t m = profile->axis.m;
    for (size_t p = 0; p < m; p++) {
        for (size_t q = 0; q < m; q++) {
            const double root = root_prior(profile, p, q), *a = feature[0] + p * points, *b = feature[1] + q * points;
            double *out = columns + (p * m + q) * points;
            for (size_t i = 0; i < points; i++) {
                out[i] = root * a[i] * b[i] * (scale != NULL ? scale[i] : 1);
            }
        }
    }
}

// feature[2][m x points] at positions in the solver's coordinates.
static gonio_status fill_features(const gonio_smooth_profile *profile, size_t points, const double *at,
                                  double *const feature[2], gonio_error *error) {
    double *y = malloc(2 * points * sizeof *y);
    if (y == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu positions", points);
    }
    for (size_t i = 0; i < points; i++) {
        gonio_profile_locate(profile->coordinates, at + 3 * i, y + 2 * i);
    }
    for (size_t k = 0; k < 2; k++) {
        gonio_smooth_axis_features(&profile->axis, points, y + k, 2, feature[k]);
    }
    free(y);
    return GONIO_OK;
}

static gonio_status locate_samples(gonio_smooth_profile *profile, const gonio_smooth_dense *dense, gonio_error *error) {
    double *x = malloc(3 * profile->n * sizeof *x);
    if (x == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu positions", profile->n);
    }
    gonio_dataset_locate(dense->data, dense->form.coordinates, x);
    const gonio_status status = fill_features(profile, profile->n, x, profile->feature, error);
    free(x);
    return status;
}

static gonio_status make(const gonio_smooth_dense *dense, gonio_smooth_profile **out, gonio_error *error) {
    gonio_smooth_profile *profile = calloc(1, sizeof *profile);
    if (profile == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a profile");
    }
    const size_t n = profile->n = dense->n;
    profile->coordinates = dense->form.coordinates;
    gonio_status status = gonio_smooth_axis_init(&profile->axis, dense->form.profile_level, error);
    if (status == GONIO_OK) {
        const size_t m = profile->axis.m;
        bool all = (profile->columns = malloc(m * m * n * sizeof(double))) != NULL;
        all = (profile->kernel = malloc(n * n * sizeof(double))) != NULL && all;
        for (int k = 0; k < 2; k++) {
            all = (profile->feature[k] = malloc(m * n * sizeof(double))) != NULL && all;
        }
        status = all ? locate_samples(profile, dense, error)
                     : gonio_fail(error, GONIO_E_MEMORY, "no memory for the profile of %zu samples", n);
    }
    if (status != GONIO_OK) {
        gonio_smooth_profile_free(profile);
        return status;
    }
    *out = profile;
    return GONIO_OK;
}

gonio_status gonio_smooth_profile_set(gonio_smooth_profile **profile, const gonio_smooth_dense *dense,
                                      gonio_error *error) {
    const gonio_smooth_form *form = &dense->form;
    gonio_smooth_profile *p = *profile;
    if (p != NULL && p->axis.level == form->profile_level &&
        memcmp(p->stretch, form->profile_stretch, sizeof p->stretch) == 0) {
        return GONIO_OK;
    }
    gonio_smooth_profile_free(p);
    *profile = NULL;
    const gonio_status status = make(dense, &p, error);
    if (status != GONIO_OK) {
        return status;
    }
    memcpy(p->stretch, form->profile_stretch, sizeof p->stretch);
    fill_columns(p, p->n, p->feature, dense->root, p->columns);
    const gonio_matrix columns = gonio_matrix_of(p->columns, p->n, p->axis.m * p->axis.m);
    gonio_multiply_lower(1, columns, gonio_matrix_transposed(columns), 0, gonio_matrix_of(p->kernel, p->n, p->n));
    *profile = p;
    return GONIO_OK;
}

void gonio_smooth_profile_add(const gonio_smooth_profile *profile, double weight, double *out) {
    for (size_t j = 0; j < profile->n; j++) {
        for (size_t i = j; i < profile->n; i++) {
            out[j * profile->n + i] += weight * profile->kernel[j * profile->n + i];
        }
    }
}

gonio_status gonio_smooth_profile_cross(const gonio_smooth_profile *profile, double weight, size_t m, const double *at,
                                        double *cross, double *prior, gonio_error *error) {
    const size_t modes = profile->axis.m * profile->axis.m;
    double *feature[2] = {malloc(profile->axis.m * m * sizeof(double)), malloc(profile->axis.m * m * sizeof(double))};
    double *theirs = malloc(modes * m * sizeof *theirs);
    gonio_status status = feature[0] != NULL && feature[1] != NULL && theirs != NULL
                              ? fill_features(profile, m, at, feature, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for the profile at %zu points", m);
    if (status == GONIO_OK) {
        fill_columns(profile, m, feature, NULL, theirs);
        gonio_multiply(weight, gonio_matrix_of(profile->columns, profile->n, modes),
                       gonio_matrix_transposed(gonio_matrix_of(theirs, m, modes)), 1,
                       gonio_matrix_of(cross, profile->n, m));
        for (size_t k = 0; k < modes; k++) {
            for (size_t i = 0; i < m; i++) {
                prior[i] += weight * theirs[k * m + i] * theirs[k * m + i];
            }
        }
    }
    free(feature[0]);
    free(feature[1]);
    free(theirs);
    return status;
}

gonio_status gonio_smooth_profile_solve(const gonio_smooth_profile *profile, double weight, const double *weights,
                                        int channels, gonio_lattice *lattice, gonio_error *error) {
    const size_t m = profile->axis.m, modes = m * m, c = (size_t)channels;
    gonio_status status = gonio_lattice_init(lattice, 2, profile->axis.level, channels, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *spectrum = malloc(modes * c * sizeof *spectrum), *half = malloc(modes * c * sizeof *half);
    if (spectrum == NULL || half == NULL) {
        gonio_lattice_release(lattice);
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu modes", modes);
    } else {
        // (modes x channels, channel fastest) = columns^T weights.
        gonio_multiply(weight, gonio_matrix_transposed(gonio_matrix_of(profile->columns, profile->n, modes)),
                       gonio_matrix_of(weights, profile->n, c), 0,
                       gonio_matrix_transposed(gonio_matrix_of(spectrum, c, modes)));
        for (size_t k = 0; k < modes; k++) {
            for (size_t j = 0; j < c; j++) {
                spectrum[k * c + j] *= root_prior(profile, k / m, k % m);
            }
        }
        gonio_smooth_axis_transform(&profile->axis, 1, m * c, spectrum, half);
        gonio_smooth_axis_transform(&profile->axis, m, c, half, spectrum);
        for (size_t i = 0; i < modes * c; i++) {
            lattice->points[i] = (float)spectrum[i];
        }
    }
    free(spectrum);
    free(half);
    return status;
}
