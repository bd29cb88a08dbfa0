// SPDX-License-Identifier: BSD-3-Clause
// The direct least-squares solver (fit/smooth/dense.h).
//
// Sums over the lattice's modes run in blocks: all products of the last two axes' modes for one choice of the leading
// axes' modes, which is a rank-k update. Modes of the wrong parity under the mirror are left out, which is what sharing
// control points means here; the variance of modes that change sign when the directions are swapped is what reciprocity
// leaves of it.
#include "fit/smooth/dense.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/spline/bspline.h"
#include "fit/smooth/matrix.h"
#include "fit/smooth/modes.h"

#define SHARES GONIO_SMOOTH_SHARES
#include "fit/prepare/scatter.h"

gonio_smooth_form gonio_smooth_form_default(gonio_coordinates coordinates, int level, bool mirror) {
    return (gonio_smooth_form){.coordinates = coordinates, .level = level, .mirror = mirror, .stretch = {1, 1, 1, 1}};
}

void gonio_smooth_dense_free(gonio_smooth_dense *dense) {
    if (dense == NULL) {
        return;
    }
    gonio_smooth_axis_release(&dense->axis);
    gonio_smooth_profile_free(dense->profile);
    free(dense->shares);
    for (int d = 0; d < 4; d++) {
        free(dense->feature[d]);
    }
    free(dense->root);
    free(dense->vectors);
    free(dense->values);
    free(dense);
}

const gonio_smooth_form *gonio_smooth_dense_form(const gonio_smooth_dense *dense) { return &dense->form; }

// ---- blocks of modes ----

// The columns of a choice of leading modes that have a variance.
static void fill_block(const gonio_smooth_dense *dense, size_t lead, gonio_smooth_modes *b) {
    const size_t m = dense->m, d = (size_t)dense->dims;
    size_t mode[4];
    b->lead[0] = mode[0] = d == 3 ? lead : lead / m;
    b->lead[1] = mode[1] = lead % m; // 3-D: overwritten below
    b->count = 0;
    for (size_t p = 0; p < m; p++) {
        for (size_t q = 0; q < m; q++) {
            mode[d - 2] = p;
            mode[d - 1] = q;
            const double variance = gonio_smooth_modes_variance(dense, mode);
            if (variance > 0) {
                b->last[0][b->count] = (uint16_t)p;
                b->last[1][b->count] = (uint16_t)q;
                b->root_prior[b->count++] = sqrt(variance);
            }
        }
    }
}

static size_t leads(const gonio_smooth_dense *dense) { return dense->dims == 3 ? dense->m : dense->m * dense->m; }

// columns[count x n], sample fastest: the block's modes at the samples, times their root weight.
static void fill_columns(const gonio_smooth_dense *dense, const gonio_smooth_modes *b, double *columns) {
    const size_t n = dense->n;
    const int d = dense->dims;
    double *const *feature = dense->feature;
    const double *f0 = feature[0] + b->lead[0] * n, *f1 = d == 4 ? feature[1] + b->lead[1] * n : NULL;
    for (size_t k = 0; k < b->count; k++) {
        const double *p = feature[d - 2] + b->last[0][k] * n, *q = feature[d - 1] + b->last[1][k] * n;
        double *out = columns + k * n;
        for (size_t i = 0; i < n; i++) {
            out[i] = b->root_prior[k] * f0[i] * p[i] * q[i] * dense->root[i];
        }
        for (size_t i = 0; f1 != NULL && i < n; i++) {
            out[i] *= f1[i];
        }
    }
}

static gonio_status modes_init(const gonio_smooth_dense *dense, gonio_smooth_modes *b, gonio_error *error) {
    const size_t most = dense->m * dense->m;
    *b = (gonio_smooth_modes){.last = {malloc(most * sizeof(uint16_t)), malloc(most * sizeof(uint16_t))},
                              .root_prior = malloc(most * sizeof(double))};
    return b->last[0] != NULL && b->last[1] != NULL && b->root_prior != NULL
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu modes", most);
}

static void modes_release(gonio_smooth_modes *b) {
    free(b->last[0]);
    free(b->last[1]);
    free(b->root_prior);
}

// ---- building ----

static gonio_status sum_modes(gonio_smooth_dense *dense, double *kernel, gonio_error *error) {
    const size_t n = dense->n;
    gonio_smooth_modes b;
    gonio_status status = modes_init(dense, &b, error);
    double *columns = malloc(dense->m * dense->m * n * sizeof *columns);
    if (status == GONIO_OK && columns == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu modes of %zu samples", dense->m * dense->m, n);
    }
    for (size_t lead = 0; lead < leads(dense) && status == GONIO_OK; lead++) {
        fill_block(dense, lead, &b);
        fill_columns(dense, &b, columns);
        const gonio_matrix block = gonio_matrix_of(columns, n, b.count);
        gonio_multiply_lower(1, block, gonio_matrix_transposed(block), lead > 0, gonio_matrix_of(kernel, n, n));
    }
    modes_release(&b);
    free(columns);
    return status;
}

// K: mode by mode n^2/2 products a mode; by splines d m a mode and sample (fit/smooth/covariance.c), which take about
// three times as long each.
static gonio_status sum_kernel(gonio_smooth_dense *dense, double *kernel, gonio_error *error) {
    return dense->n > 6 * (size_t)dense->dims * dense->m
               ? gonio_smooth_covariance(dense, dense->n, NULL, dense->feature, dense->root, kernel, NULL, error)
               : sum_modes(dense, kernel, error);
}

static gonio_status decompose(gonio_smooth_dense *dense, gonio_error *error) {
    const size_t n = dense->n;
    if (dense->form.profile > 0) {
        gonio_smooth_profile_add(dense->profile, dense->form.profile, dense->vectors);
    }
    if (dense->shares != NULL) {
        const gonio_matrix shares = gonio_matrix_of(dense->shares, n, SHARES);
        gonio_multiply_lower(1, shares, gonio_matrix_transposed(shares), 1, gonio_matrix_of(dense->vectors, n, n));
    }
    if (!gonio_eigen(n, dense->vectors, dense->values)) {
        return gonio_fail(error, GONIO_E_CONVERGENCE, "the eigenvectors of %zu samples were not found", n);
    }
    for (size_t j = 0; j < n; j++) {
        dense->values[j] = fmax(dense->values[j], 0);
    }
    return GONIO_OK;
}

static gonio_status set_profile(gonio_smooth_dense *dense, const gonio_smooth_form *form, gonio_error *error) {
    const bool possible = dense->dims == 3 && gonio_coordinates_are_half_vector(dense->form.coordinates);
    dense->form.profile = possible ? form->profile : 0;
    return dense->form.profile > 0 ? gonio_smooth_profile_set(&dense->profile, dense, error) : GONIO_OK;
}

void gonio_smooth_shares(const gonio_lobe_base *lobes, int channels, size_t n, const gonio_pair *pairs, double *out) {
    double mean[SHARES], unit[SHARES], share[SHARES];
    gonio_lobe_mean_strengths(lobes, channels, mean);
    for (size_t i = 0; i < n; i++) {
        const gonio_pair *p = &pairs[i];
        gonio_lobe_base_units(lobes, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o),
                              unit);
        gonio_lobe_shares(lobes, mean, unit, share);
        for (size_t j = 0; j < SHARES; j++) {
            out[j * n + i] = share[j];
        }
    }
}

static gonio_status set_shares(gonio_smooth_dense *dense, const gonio_lobe_base *lobes, gonio_error *error) {
    const size_t n = dense->n;
    dense->form.shares = lobes != NULL;
    if (lobes == NULL) {
        return GONIO_OK;
    }
    dense->shares = malloc(n * SHARES * sizeof *dense->shares);
    if (dense->shares == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the lobes' shares at %zu samples", n);
    }
    gonio_smooth_shares(lobes, dense->data->channels, n, dense->data->pairs, dense->shares);
    for (size_t k = 0; k < n * SHARES; k++) {
        dense->shares[k] *= dense->root[k % n];
    }
    return GONIO_OK;
}

static bool allocate(gonio_smooth_dense *dense) {
    const size_t n = dense->n, m = dense->m;
    bool all = true;
    for (int d = 0; d < dense->dims; d++) {
        all = (dense->feature[d] = malloc(m * n * sizeof(double))) != NULL && all;
    }
    all = (dense->root = malloc(n * sizeof(double))) != NULL && all;
    all = (dense->vectors = malloc(n * n * sizeof(double))) != NULL && all;
    return (dense->values = malloc(n * sizeof(double))) != NULL && all;
}

static gonio_status fill_sample_features(gonio_smooth_dense *dense, gonio_error *error) {
    const size_t d = (size_t)dense->dims;
    double *x = malloc(dense->n * d * sizeof *x);
    if (x == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu positions", dense->n);
    }
    gonio_dataset_locate(dense->data, dense->form.coordinates, x);
    for (size_t k = 0; k < d; k++) {
        gonio_smooth_axis_features(&dense->axis, dense->n, x + k, d, dense->feature[k]);
    }
    free(x);
    for (size_t i = 0; i < dense->n; i++) {
        dense->root[i] = sqrt(dense->data->weights[i]);
    }
    return GONIO_OK;
}

gonio_status gonio_smooth_dense_new(const gonio_dataset *data, const gonio_smooth_form *form,
                                    const gonio_lobe_base *shares, gonio_smooth_dense **out, gonio_error *error) {
    *out = NULL;
    gonio_smooth_dense *dense = calloc(1, sizeof *dense);
    if (dense == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a solver");
    }
    dense->data = data;
    dense->form = *form;
    dense->n = data->n;
    dense->dims = data->dims;
    dense->m = gonio_bspline_size(form->level);
    dense->mirror_axes = form->mirror ? gonio_coordinates_mirror_axes(form->coordinates, data->dims) : 0;
    dense->swap_axes = gonio_coordinates_swap_axes(form->coordinates, data->dims);
    dense->form.reciprocity = dense->swap_axes != 0 ? form->reciprocity : 0;
    gonio_status status = allocate(dense)
                              ? GONIO_OK
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory to solve %zu samples (%.3g GB)", data->n,
                                           2 * 8e-9 * (double)data->n * (double)data->n);
    status = status == GONIO_OK ? gonio_smooth_axis_init(&dense->axis, form->level, error) : status;
    status = status == GONIO_OK ? fill_sample_features(dense, error) : status;
    status = status == GONIO_OK ? sum_kernel(dense, dense->vectors, error) : status;
    status = status == GONIO_OK ? set_profile(dense, form, error) : status;
    status = status == GONIO_OK ? set_shares(dense, shares, error) : status;
    status = status == GONIO_OK ? decompose(dense, error) : status;
    if (status != GONIO_OK) {
        gonio_smooth_dense_free(dense);
        return status;
    }
    *out = dense;
    return GONIO_OK;
}

// ---- answers ----

// V^T W^1/2 t: n x channels, sample fastest.
static gonio_status project(const gonio_smooth_dense *dense, const double *targets, int channels, double **out,
                            gonio_error *error) {
    const size_t n = dense->n, c = (size_t)channels;
    double *weighted = malloc(n * c * sizeof *weighted);
    *out = malloc(n * c * sizeof **out);
    if (weighted == NULL || *out == NULL) {
        free(weighted);
        free(*out);
        *out = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to solve %zu samples", n);
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < c; k++) {
            weighted[k * n + i] = targets[i * c + k] * dense->root[i];
        }
    }
    gonio_multiply(1, gonio_matrix_transposed(gonio_matrix_of(dense->vectors, n, n)), gonio_matrix_of(weighted, n, c),
                   0, gonio_matrix_of(*out, n, c));
    free(weighted);
    return GONIO_OK;
}

// diagonal[l n + i] = sum_j V_ij^2 lambda_l / (s_j + lambda_l): of I - H.
static void fill_diagonals(const gonio_smooth_dense *dense, int count, const double *lambdas, double *diagonal) {
    const size_t n = dense->n;
    memset(diagonal, 0, (size_t)count * n * sizeof *diagonal);
    for (size_t j = 0; j < n; j++) {
        const double *v = dense->vectors + j * n;
        for (int l = 0; l < count; l++) {
            const double g = lambdas[l] / (dense->values[j] + lambdas[l]);
            double *out = diagonal + (size_t)l * n;
            for (size_t i = 0; i < n; i++) {
                out[i] += v[i] * v[i] * g;
            }
        }
    }
}

gonio_status gonio_smooth_dense_loo(const gonio_smooth_dense *dense, const double *targets, int channels, int count,
                                    const double *lambdas, double *const *residuals, gonio_error *error) {
    const size_t n = dense->n, c = (size_t)channels;
    double *projected = NULL, *damped = malloc(n * c * sizeof *damped), *residual = malloc(n * c * sizeof *residual);
    double *diagonal = malloc((size_t)count * n * sizeof *diagonal);
    gonio_status status = damped != NULL && residual != NULL && diagonal != NULL
                              ? GONIO_OK
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for leave-one-out errors");
    status = status == GONIO_OK ? project(dense, targets, channels, &projected, error) : status;
    if (status == GONIO_OK) {
        fill_diagonals(dense, count, lambdas, diagonal);
    }
    for (int l = 0; l < count && status == GONIO_OK; l++) {
        for (size_t k = 0; k < c; k++) {
            for (size_t j = 0; j < n; j++) {
                damped[k * n + j] = projected[k * n + j] * lambdas[l] / (dense->values[j] + lambdas[l]);
            }
        }
        gonio_multiply(1, gonio_matrix_of(dense->vectors, n, n), gonio_matrix_of(damped, n, c), 0,
                       gonio_matrix_of(residual, n, c));
        for (size_t i = 0; i < n; i++) {
            const double own = diagonal[(size_t)l * n + i] * dense->root[i];
            for (size_t k = 0; k < c; k++) {
                residuals[l][i * c + k] = residual[k * n + i] / own;
            }
        }
    }
    free(projected);
    free(damped);
    free(residual);
    free(diagonal);
    return status;
}

// W^1/2 (K + lambda)^-1 W^1/2 t per channel, sample fastest: the representer weights.
static gonio_status representers(const gonio_smooth_dense *dense, const double *targets, int channels,
                                 const double *lambdas, double **out, gonio_error *error) {
    const size_t n = dense->n, c = (size_t)channels;
    double *projected;
    const gonio_status status = project(dense, targets, channels, &projected, error);
    if (status != GONIO_OK) {
        return status;
    }
    *out = malloc(n * c * sizeof **out);
    if (*out == NULL) {
        free(projected);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to solve %zu samples", n);
    }
    for (size_t k = 0; k < c; k++) {
        for (size_t j = 0; j < n; j++) {
            projected[k * n + j] /= dense->values[j] + lambdas[k];
        }
    }
    gonio_multiply(1, gonio_matrix_of(dense->vectors, n, n), gonio_matrix_of(projected, n, c), 0,
                   gonio_matrix_of(*out, n, c));
    free(projected);
    return GONIO_OK;
}

// spectrum[mode of the lattice x channels], channel fastest, from the representer weights.
static gonio_status mode_amplitudes(const gonio_smooth_dense *dense, const double *weights, size_t c, double *spectrum,
                                    gonio_error *error) {
    const size_t n = dense->n, m = dense->m;
    gonio_smooth_modes b;
    gonio_status status = modes_init(dense, &b, error);
    double *columns = malloc(m * m * n * sizeof *columns), *part = malloc(m * m * c * sizeof *part);
    if (status == GONIO_OK && (columns == NULL || part == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu modes of %zu samples", m * m, n);
    }
    for (size_t lead = 0; lead < leads(dense) && status == GONIO_OK; lead++) {
        fill_block(dense, lead, &b);
        fill_columns(dense, &b, columns);
        gonio_multiply(1, gonio_matrix_transposed(gonio_matrix_of(columns, n, b.count)), gonio_matrix_of(weights, n, c),
                       0, gonio_matrix_of(part, b.count, c));
        for (size_t k = 0; k < b.count; k++) {
            const size_t at = (lead * m + b.last[0][k]) * m + b.last[1][k];
            for (size_t j = 0; j < c; j++) {
                spectrum[at * c + j] = part[j * b.count + k] * b.root_prior[k];
            }
        }
    }
    modes_release(&b);
    free(columns);
    free(part);
    return status;
}

gonio_status gonio_smooth_dense_solve(const gonio_smooth_dense *dense, const double *targets, int channels,
                                      const double *lambdas, gonio_lattice *lattice, gonio_error *error) {
    const size_t m = dense->m, c = (size_t)channels;
    gonio_status status = gonio_lattice_init(lattice, dense->dims, dense->form.level, channels, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *weights = NULL, *spectrum = calloc(lattice->count * c, sizeof *spectrum);
    double *other = malloc(lattice->count * c * sizeof *other);
    if (spectrum == NULL || other == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu modes", lattice->count);
    }
    status = status == GONIO_OK ? representers(dense, targets, channels, lambdas, &weights, error) : status;
    status = status == GONIO_OK ? mode_amplitudes(dense, weights, c, spectrum, error) : status;
    size_t outer = 1, inner = lattice->count / m * c;
    for (int d = 0; d < dense->dims && status == GONIO_OK; d++, outer *= m, inner /= m) {
        gonio_smooth_axis_transform(&dense->axis, outer, inner, spectrum, other);
        double *swap = spectrum;
        spectrum = other;
        other = swap;
    }
    for (size_t i = 0; i < lattice->count * c && status == GONIO_OK; i++) {
        lattice->points[i] = (float)spectrum[i];
    }
    free(weights);
    free(spectrum);
    free(other);
    if (status != GONIO_OK) {
        gonio_lattice_release(lattice);
    }
    return status;
}

gonio_status gonio_smooth_dense_profile_solve(const gonio_smooth_dense *dense, const double *targets, int channels,
                                              const double *lambdas, gonio_lattice *lattice, gonio_error *error) {
    *lattice = (gonio_lattice){0};
    if (!(dense->form.profile > 0)) {
        return GONIO_OK;
    }
    double *weights = NULL;
    gonio_status status = representers(dense, targets, channels, lambdas, &weights, error);
    if (status == GONIO_OK) {
        status = gonio_smooth_profile_solve(dense->profile, dense->form.profile, weights, channels, lattice, error);
    }
    free(weights);
    return status;
}

gonio_status gonio_smooth_dense_shares_solve(const gonio_smooth_dense *dense, const double *targets, int channels,
                                             const double *lambdas, double **out, gonio_error *error) {
    const size_t n = dense->n, c = (size_t)channels;
    *out = NULL;
    if (dense->shares == NULL) {
        return GONIO_OK;
    }
    double *weights = NULL;
    gonio_status status = representers(dense, targets, channels, lambdas, &weights, error);
    if (status == GONIO_OK && (*out = malloc(c * SHARES * sizeof **out)) == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the shares of %zu channels", c);
    }
    if (status == GONIO_OK) {
        gonio_multiply(1, gonio_matrix_transposed(gonio_matrix_of(dense->shares, n, SHARES)),
                       gonio_matrix_of(weights, n, c), 0, gonio_matrix_of(*out, SHARES, c));
    }
    free(weights);
    return status;
}
