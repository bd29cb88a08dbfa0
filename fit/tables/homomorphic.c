// SPDX-License-Identifier: BSD-3-Clause
// Homomorphic factorisation of scattered samples, McCool, Ang and Ahmad (2001); brdf/kind/homomorphic.c.
//
// In logarithms the factors' nodes are unknowns of a linear least squares problem, sum_i w_i (t_i - sum_k b_ik x_k)^2 +
// lambda (R + 1e-4 |x|^2), R the squared second differences along tilts and azimuths as in their section 3: nodes that
// no sample meets follow their neighbours. The normal matrix is the same for all channels. lambda is what predicts a
// fifth of the geometries from the others best.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/kind/homomorphic.h"
#include "fit/memory.h"
#include "fit/method.h"
#include "fit/prepare/dataset.h"
#include "fit/smooth/matrix.h"

static const int level_usual[2] = {5, 3};
#define LEVEL_MAX_4D 4 // 2 x 544 unknowns; the next level's 4,200 take a minute
#define RIDGE 1e-4
#define TRIALS 8 // lambdas, from 100 down by tens, times the mean weight of an unknown

typedef struct system {
    const gonio_dataset *data;
    int level;
    size_t unknowns, channels;
    double *normal, *right; // [unknowns^2], [unknowns x channels]
    double *matrix, *x;     // their copies, solved in place
    double *mean;           // [channels]
    double unit;            // mean weight of an unknown
} system_of;

static bool judges(size_t sample, bool hold) { return hold && sample % 5 == 2; }

static int row_of(const system_of *s, size_t sample, size_t at[12], double weights[12]) {
    const gonio_pair *p = &s->data->pairs[sample];
    return gonio_homomorphic_row(s->data->dims, s->level, gonio_direction(p->theta_i, p->phi_i),
                                 gonio_direction(p->theta_o, p->phi_o), at, weights);
}

static void accumulate(system_of *s, bool hold) {
    const gonio_dataset *data = s->data;
    const size_t n = s->unknowns;
    memset(s->normal, 0, n * n * sizeof *s->normal);
    memset(s->right, 0, n * s->channels * sizeof *s->right);
    s->unit = 0;
    for (size_t i = 0; i < data->n; i++) {
        size_t at[12];
        double b[12];
        const int count = judges(i, hold) ? 0 : row_of(s, i, at, b);
        for (int j = 0; j < count; j++) {
            const double w = data->weights[i] * b[j];
            s->unit += w * b[j] / (double)n;
            for (int k = 0; k < count; k++) {
                s->normal[at[j] * n + at[k]] += w * b[k];
            }
            for (size_t c = 0; c < s->channels; c++) {
                s->right[c * n + at[j]] += w * (data->targets[i * s->channels + c] - s->mean[c]);
            }
        }
    }
}

static void add_difference(system_of *s, double lambda, size_t a, size_t b, size_t c) {
    const size_t at[3] = {a, b, c};
    static const double d[3] = {1, -2, 1};
    for (int j = 0; j < 3; j++) {
        for (int k = 0; k < 3; k++) {
            s->matrix[at[j] * s->unknowns + at[k]] += lambda * d[j] * d[k];
        }
    }
}

// The matrix with its penalty.
static void penalise(system_of *s, double lambda) {
    const gonio_grid grid = gonio_grid_of(GONIO_GRID_ANGLES, s->data->dims, s->level);
    const size_t tilts = grid.size[0], azimuths = grid.dims == 4 ? grid.size[1] : 1, rows = tilts * azimuths;
    memcpy(s->matrix, s->normal, s->unknowns * s->unknowns * sizeof *s->matrix);
    for (size_t factor = 0; factor < 2; factor++) {
        const size_t base = factor * rows;
        for (size_t i = 0; i < rows; i++) {
            const size_t tilt = i / azimuths, azimuth = i % azimuths;
            s->matrix[(base + i) * (s->unknowns + 1)] += RIDGE * lambda;
            if (tilt > 0 && tilt + 1 < tilts) {
                add_difference(s, lambda, base + i - azimuths, base + i, base + i + azimuths);
            }
            if (azimuths > 1) {
                const size_t left = (azimuth + azimuths - 1) % azimuths, right = (azimuth + 1) % azimuths;
                add_difference(s, lambda, base + tilt * azimuths + left, base + i, base + tilt * azimuths + right);
            }
        }
    }
}

static gonio_status solve(system_of *s, double lambda, gonio_error *error) {
    penalise(s, lambda);
    memcpy(s->x, s->right, s->unknowns * s->channels * sizeof *s->x);
    if (!gonio_cholesky(s->unknowns, s->matrix)) {
        return gonio_fail(error, GONIO_E_CONVERGENCE, "the normal matrix of %zu unknowns is not positive definite",
                          s->unknowns);
    }
    gonio_cholesky_solve(s->unknowns, s->matrix, gonio_matrix_of(s->x, s->unknowns, s->channels));
    return GONIO_OK;
}

static double held_error(const system_of *s) {
    double sum = 0;
    for (size_t i = 0; i < s->data->n; i++) {
        size_t at[12];
        double b[12];
        const int count = judges(i, true) ? row_of(s, i, at, b) : 0;
        for (size_t c = 0; c < s->channels && count > 0; c++) {
            double miss = s->mean[c] - s->data->targets[i * s->channels + c];
            for (int k = 0; k < count; k++) {
                miss += b[k] * s->x[c * s->unknowns + at[k]];
            }
            sum += miss * miss;
        }
    }
    return sum;
}

static gonio_status choose(system_of *s, double *lambda, gonio_error *error) {
    double least = INFINITY;
    gonio_status status = GONIO_OK;
    *lambda = 1e-2;
    if (s->data->n < 20) {
        return GONIO_OK;
    }
    accumulate(s, true);
    for (int k = 0; k < TRIALS && status == GONIO_OK; k++) {
        const double trial = pow(10, 2 - k);
        status = solve(s, trial * s->unit, error);
        const double now = status == GONIO_OK ? held_error(s) : INFINITY;
        if (now < least * (1 - 1e-6)) {
            least = now;
            *lambda = trial;
        }
    }
    return status;
}

// Each factor's nodes in float. The mean is q's.
static gonio_status make(const system_of *s, const gonio_samples *samples, gonio_model **out, gonio_error *error) {
    float *factors = malloc(s->unknowns * s->channels * sizeof *factors);
    if (factors == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu nodes", s->unknowns);
    }
    for (size_t k = 0; k < s->unknowns; k++) {
        for (size_t c = 0; c < s->channels; c++) {
            factors[k * s->channels + c] = (float)(s->x[c * s->unknowns + k] + (2 * k >= s->unknowns ? s->mean[c] : 0));
        }
    }
    const gonio_homomorphic_parts parts = {.dims = s->data->dims,
                                           .level = s->level,
                                           .channels = samples->channels,
                                           .kind = s->data->kind,
                                           .transforms = s->data->transforms,
                                           .names = (const char(*)[32])samples->channel_names,
                                           .factors = factors};
    const gonio_status status = gonio_homomorphic_new(&parts, out, error);
    free(factors);
    return status;
}

static void set_means(system_of *s) {
    double total = 0;
    for (size_t i = 0; i < s->data->n; i++) {
        total += s->data->weights[i];
        for (size_t c = 0; c < s->channels; c++) {
            s->mean[c] += s->data->weights[i] * s->data->targets[i * s->channels + c];
        }
    }
    for (size_t c = 0; c < s->channels; c++) {
        s->mean[c] /= total;
    }
}

static gonio_status fit_data(const gonio_dataset *data, const gonio_samples *samples, int level, gonio_model **out,
                             gonio_fit_report *report, gonio_error *error) {
    system_of s = {.data = data,
                   .level = level,
                   .unknowns = 2 * gonio_homomorphic_rows(data->dims, level),
                   .channels = (size_t)data->channels};
    const size_t n = s.unknowns;
    double lambda;
    s.normal = malloc(n * n * sizeof(double));
    s.matrix = malloc(n * n * sizeof(double));
    s.right = malloc(n * s.channels * sizeof(double));
    s.x = malloc(n * s.channels * sizeof(double));
    s.mean = calloc(s.channels, sizeof(double));
    gonio_status status = GONIO_OK;
    if (s.normal == NULL || s.matrix == NULL || s.right == NULL || s.x == NULL || s.mean == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu unknowns", n);
    }
    if (status == GONIO_OK) {
        set_means(&s);
        status = choose(&s, &lambda, error);
    }
    if (status == GONIO_OK) {
        accumulate(&s, false);
        status = solve(&s, lambda * s.unit, error);
    }
    if (status == GONIO_OK) {
        snprintf(report->options, sizeof report->options, "nodes=%zu lambda=%.0e", n, lambda);
        status = make(&s, samples, out, error);
    }
    free(s.normal);
    free(s.matrix);
    free(s.right);
    free(s.x);
    free(s.mean);
    return status;
}

static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                        gonio_fit_report *report, gonio_error *error) {
    const int dims = samples->isotropic ? 3 : 4;
    const int level = options->level != GONIO_LEVEL_AUTO ? options->level : level_usual[dims - 3];
    *out = NULL;
    if (dims == 4 && level > LEVEL_MAX_4D) {
        return gonio_fail(error, GONIO_E_USAGE, "--level %d; anisotropic factors have levels up to %d", level,
                          LEVEL_MAX_4D);
    }
    gonio_dataset data;
    gonio_status status = gonio_dataset_init(
        &data, samples, &(gonio_dataset_options){.mirror = samples->isotropic, .domain = GONIO_LOG}, error);
    if (status != GONIO_OK) {
        return status;
    }
    report->level = level;
    report->coordinates = GONIO_HALF_VECTOR;
    report->domain = GONIO_LOG;
    status = fit_data(&data, samples, level, out, report, error);
    gonio_dataset_release(&data);
    return status;
}

static double memory(const gonio_fit_size *size, double n) {
    const double unknowns = 2 * (double)gonio_homomorphic_rows(size->dims, size->level);
    return 1e6 + n * (160 + 24.0 * size->channels) + unknowns * (16 * unknowns + 24.0 * size->channels);
}

static const gonio_method_option options_of_homomorphic[] = {GONIO_METHOD_OPTION(level, "of the grid (5; 3 in 4-D)"),
                                                             {0}};

static const gonio_method_form forms[] = {GONIO_METHOD_FORM_AUTO};

const gonio_method gonio_method_homomorphic = {
    .name = "homomorphic",
    .summary = "a product of functions of either direction and of the half vector, by least squares of logarithms",
    .kind = "homomorphic",
    .options = options_of_homomorphic,
    .fit = fit,
    .memory = memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
