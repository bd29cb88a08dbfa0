// SPDX-License-Identifier: BSD-3-Clause
// min sum_i w_i (y_i - mean - sum_k a_k x_ik)^2 + lambda |a|^2, lambda by leave-one-out.
//
// With X'WX = V diag(s) V' and z_i = V'x_i, the leverage of sample i is h_i = w_i sum_j z_ij^2 / (s_j + lambda), and
// what a fit without it misses it by is r_i / (1 - h_i) (Allen 1974): every lambda of a grid costs one pass over the
// z_i and no fit. The ridge draws towards the weighted mean of the samples, not towards 0: the basis' first function is
// a constant. Columns are orthogonal over the hemisphere, not over scattered samples, so a projection would not do.
//
// The uncertainty is the posterior's: s^2 x'(X'WX + lambda)^-1 x, s^2 the mean square of what leaving one out misses,
// so that it holds what the basis cannot say; of the channels' lambdas the least.
//
// w_i is 1, or 1 over the square of a sample's mean over channels and its noise, so that dark directions count. Rows
// are made block by block, twice: nothing grows with the samples but the samples.
#include "fit/linear/ridge.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/prepare/dataset.h"
#include "fit/smooth/matrix.h"

enum { BLOCK = 256, GRID = 29, GEOMETRIES_LEAST = 5 };

typedef struct ridge {
    const gonio_linear_basis *basis;
    const gonio_dataset *data;
    int order;
    bool isotropic;
    size_t terms, channels;
    double unit;     // f_r = unit * y
    double *weight;  // [n], its root
    double *mean;    // [channels]
    double *vectors; // [terms][terms]
    double *values;  // [terms]
    double *right;   // [terms x channels]: V'X'W(y - mean)
    double *rows;    // [terms x BLOCK], weighted
    double *turned;  // [terms x BLOCK]: V' rows
    double *y;       // [BLOCK x channels], weighted, without the mean
    double *fitted;  // [BLOCK x channels]
    double *shrunk;  // [terms x channels]
    double *miss;    // [GRID][channels]: sums of squares of what leaving one out misses
    double *factors; // [channels]: of the uncertainty
    double grid[GRID];
    int tried; // of the grid; 1: the lambda was given
} ridge;

static void release(ridge *r) {
    double *const all[] = {r->weight, r->mean, r->vectors, r->values, r->right, r->rows,
                           r->turned, r->y,    r->fitted,  r->shrunk, r->miss,  r->factors};
    for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
        free(all[k]);
    }
}

static bool allocate(ridge *r) {
    const size_t p = r->terms, c = r->channels;
    const struct {
        double **to;
        size_t count;
    } all[] = {{&r->weight, r->data->n}, {&r->mean, c},         {&r->vectors, p * p},    {&r->values, p},
               {&r->right, p * c},       {&r->rows, p * BLOCK}, {&r->turned, p * BLOCK}, {&r->y, BLOCK * c},
               {&r->fitted, BLOCK * c},  {&r->shrunk, p * c},   {&r->miss, GRID * c},    {&r->factors, c}};
    bool enough = true;
    for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
        *all[k].to = calloc(all[k].count, sizeof(double));
        enough = enough && *all[k].to != NULL;
    }
    return enough;
}

// The root of each sample's weight, and the weighted mean of each channel.
static void weigh(ridge *r, gonio_loss loss, bool thesis) {
    const gonio_dataset *data = r->data;
    const size_t c = r->channels;
    double eps = 0, total = 0;
    for (size_t k = 0; k < c; k++) {
        eps += data->transforms[k].eps * (data->transforms[k].scale / r->unit) / (double)c;
    }
    for (size_t i = 0; i < data->n; i++) {
        double mean = 0;
        for (size_t k = 0; k < c; k++) {
            mean += data->values[i * c + k] / r->unit / (double)c;
        }
        r->weight[i] = (thesis ? 1 : sqrt(data->weights[i])) / (loss == GONIO_LOSS_RELATIVE ? fabs(mean) + eps : 1);
        const double w = r->weight[i] * r->weight[i];
        total += w;
        for (size_t k = 0; k < c; k++) {
            r->mean[k] += w * (data->values[i * c + k] / r->unit);
        }
    }
    for (size_t k = 0; k < c; k++) {
        r->mean[k] /= total;
    }
}

// Rows and values of the samples from `first` on; returns how many there are.
static size_t take(ridge *r, size_t first) {
    const gonio_dataset *data = r->data;
    const size_t count = data->n - first < BLOCK ? data->n - first : BLOCK;
    for (size_t i = 0; i < count; i++) {
        const gonio_pair *p = &data->pairs[first + i];
        const double w = r->weight[first + i];
        double *row = r->rows + i * r->terms;
        r->basis->row(r->order, r->isotropic, gonio_direction(p->theta_i, p->phi_i),
                      gonio_direction(p->theta_o, p->phi_o), row);
        for (size_t k = 0; k < r->terms; k++) {
            row[k] *= w;
        }
        for (size_t k = 0; k < r->channels; k++) {
            r->y[k * BLOCK + i] = w * (data->values[(first + i) * r->channels + k] / r->unit - r->mean[k]);
        }
    }
    return count;
}

// From rounding to the largest eigenvalue, four to a factor of 100; or the one that was given.
static void set_grid(ridge *r, double fixed) {
    const double largest = fmax(r->values[r->terms - 1], 1e-300);
    r->tried = fixed >= 0 ? 1 : GRID;
    for (int g = 0; g < GRID; g++) {
        r->grid[g] = fmax(largest * (fixed >= 0 ? fixed : pow(10, -14 + 0.5 * g)), 1e-300);
    }
}

static gonio_status decompose(ridge *r, gonio_error *error) {
    const size_t p = r->terms, c = r->channels;
    const gonio_matrix a = gonio_matrix_of(r->vectors, p, p);
    for (size_t first = 0; first < r->data->n; first += BLOCK) {
        const size_t count = take(r, first);
        const gonio_matrix x = gonio_matrix_of(r->rows, p, count);
        gonio_multiply_lower(1, x, gonio_matrix_transposed(x), 1, a);
        gonio_multiply(1, x, gonio_matrix_part(gonio_matrix_of(r->y, BLOCK, c), 0, 0, count, c), 1,
                       gonio_matrix_of(r->shrunk, p, c));
    }
    if (!gonio_eigen(p, r->vectors, r->values)) {
        return gonio_fail(error, GONIO_E_CONVERGENCE, "the normal matrix of %zu terms has no eigenvalues", p);
    }
    gonio_multiply(1, gonio_matrix_transposed(a), gonio_matrix_of(r->shrunk, p, c), 0, gonio_matrix_of(r->right, p, c));
    return GONIO_OK;
}

// shrunk = right / (s + lambda).
static void shrink(ridge *r, double lambda, size_t channel) {
    for (size_t j = 0; j < r->terms; j++) {
        r->shrunk[channel * r->terms + j] = r->right[channel * r->terms + j] / (fmax(r->values[j], 0) + lambda);
    }
}

static void leave_one_out(ridge *r) {
    const size_t p = r->terms, c = r->channels;
    const gonio_matrix v = gonio_matrix_of(r->vectors, p, p);
    for (size_t first = 0; first < r->data->n; first += BLOCK) {
        const size_t count = take(r, first);
        const gonio_matrix z = gonio_matrix_of(r->turned, p, count);
        gonio_multiply(1, gonio_matrix_transposed(v), gonio_matrix_of(r->rows, p, count), 0, z);
        for (int g = 0; g < r->tried; g++) {
            for (size_t k = 0; k < c; k++) {
                shrink(r, r->grid[g], k);
            }
            gonio_multiply(1, gonio_matrix_transposed(z), gonio_matrix_of(r->shrunk, p, c), 0,
                           gonio_matrix_part(gonio_matrix_of(r->fitted, BLOCK, c), 0, 0, count, c));
            for (size_t i = 0; i < count; i++) {
                double leverage = 0;
                for (size_t j = 0; j < p; j++) {
                    leverage += r->turned[i * p + j] * r->turned[i * p + j] / (fmax(r->values[j], 0) + r->grid[g]);
                }
                for (size_t k = 0; k < c; k++) {
                    const double miss = (r->y[k * BLOCK + i] - r->fitted[k * BLOCK + i]) / fmax(1 - leverage, 1e-9);
                    r->miss[(size_t)g * c + k] += miss * miss;
                }
            }
        }
    }
}

// The lambda of a channel, by its place in the grid: the largest whose misses are within rounding of the least.
static int choose(const ridge *r, size_t channel) {
    int best = r->tried - 1;
    for (int g = r->tried - 1; g >= 0; g--) {
        if (r->miss[(size_t)g * r->channels + channel] < r->miss[(size_t)best * r->channels + channel] * (1 - 1e-9)) {
            best = g;
        }
    }
    return best;
}

// (V / sqrt(s + lambda))', in float.
static float *spread_of(const ridge *r, double lambda) {
    const size_t p = r->terms;
    float *matrix = malloc(p * p * sizeof *matrix);
    for (size_t j = 0; j < p && matrix != NULL; j++) {
        const double scale = 1 / sqrt(fmax(r->values[j], 0) + lambda);
        for (size_t k = 0; k < p; k++) {
            matrix[j * p + k] = (float)fmin(fmax(r->vectors[j * p + k] * scale, -1e30), 1e30);
        }
    }
    return matrix;
}

static void describe(const ridge *r, double least, double most, gonio_fit_report *report) {
    const double largest = fmax(r->values[r->terms - 1], 1e-300);
    const size_t used = (size_t)snprintf(report->options, sizeof report->options, "order=%d terms=%zu lambda=%.2g",
                                         r->order, r->terms, least / largest);
    if (most > least) {
        snprintf(report->options + used, sizeof report->options - used, "..%.2g", most / largest);
    }
}

static gonio_status solve(ridge *r, const gonio_samples *samples, gonio_model **out, gonio_fit_report *report,
                          gonio_error *error) {
    const size_t p = r->terms, c = r->channels;
    const gonio_vec3 up = {0, 0, 1};
    double least = INFINITY, most = 0;
    for (size_t k = 0; k < c; k++) {
        const int g = choose(r, k);
        least = fmin(least, r->grid[g]);
        most = fmax(most, r->grid[g]);
        shrink(r, r->grid[g], k);
        r->factors[k] = sqrt(r->miss[(size_t)g * c + k] / (double)r->data->n) * r->unit;
    }
    gonio_multiply(1, gonio_matrix_of(r->vectors, p, p), gonio_matrix_of(r->shrunk, p, c), 0,
                   gonio_matrix_of(r->right, p, c));
    r->basis->row(r->order, r->isotropic, up, up, r->rows);
    for (size_t k = 0; k < c; k++) {
        r->right[k * p] += r->mean[k] / r->rows[0];
        for (size_t j = 0; j < p; j++) {
            r->right[k * p + j] *= r->unit;
        }
    }
    describe(r, least, most, report);
    float *matrix = spread_of(r, least);
    const gonio_linear_spread spread = {matrix, r->factors};
    const gonio_status status =
        matrix != NULL ? gonio_linear_new(r->basis, r->order, r->isotropic, samples->channels, r->right, &spread,
                                          (const char(*)[32])samples->channel_names, out, error)
                       : gonio_fail(error, GONIO_E_MEMORY, "no memory for the uncertainty of %zu terms", p);
    free(matrix);
    return status;
}

static gonio_status fit_data(ridge *r, const gonio_samples *samples, const gonio_fit_options *options, gonio_loss loss,
                             gonio_model **out, gonio_fit_report *report, gonio_error *error) {
    if (r->data->n < GEOMETRIES_LEAST) {
        return gonio_fail(error, GONIO_E_INPUT,
                          "%zu geometries; a linear basis and its leaving out of one need at least %d", r->data->n,
                          GEOMETRIES_LEAST);
    }
    if (!allocate(r)) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu terms of %zu channels", r->terms, r->channels);
    }
    weigh(r, loss, options->thesis);
    const gonio_status status = decompose(r, error);
    if (status != GONIO_OK) {
        return status;
    }
    set_grid(r, options->lambda);
    leave_one_out(r);
    return solve(r, samples, out, report, error);
}

// The order that was asked for, or the usual one where there are samples for it.
static gonio_status choose_order(const gonio_linear_basis *basis, const gonio_fit_options *options, bool isotropic,
                                 int *order, gonio_error *error) {
    *order = options->order != GONIO_ORDER_AUTO ? options->order : basis->order_usual[isotropic];
    if (basis->order_max[isotropic] == 0) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "'%s' describes isotropic materials only, and these samples are not declared to be of one",
                          options->method);
    }
    if (*order < basis->order_min || *order > basis->order_max[isotropic]) {
        return gonio_fail(error, GONIO_E_USAGE, "--order %d; method '%s' has %d to %d here", *order, options->method,
                          basis->order_min, basis->order_max[isotropic]);
    }
    return GONIO_OK;
}

gonio_status gonio_ridge_fit(const gonio_linear_basis *basis, const gonio_samples *samples,
                             const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                             gonio_error *error) {
    *out = NULL;
    int order;
    const gonio_loss loss = options->loss != GONIO_LOSS_AUTO ? options->loss
                            : options->thesis                ? GONIO_LOSS_LINEAR
                                                             : GONIO_LOSS_RELATIVE;
    gonio_status status = choose_order(basis, options, samples->isotropic, &order, error);
    if (status == GONIO_OK && loss == GONIO_LOSS_LOG) {
        status = gonio_fail(error, GONIO_E_USAGE, "--loss log; a linear basis takes linear or relative residuals");
    }
    if (status != GONIO_OK) {
        return status;
    }
    gonio_dataset data;
    status = gonio_dataset_init(&data, samples,
                                &(gonio_dataset_options){.mirror = samples->isotropic, .domain = GONIO_LINEAR}, error);
    if (status != GONIO_OK) {
        return status;
    }
    ridge r = {.basis = basis,
               .data = &data,
               .order = order,
               .isotropic = samples->isotropic,
               .terms = (size_t)basis->terms(order, samples->isotropic),
               .channels = (size_t)samples->channels};
    for (size_t k = 0; k < r.channels; k++) {
        r.unit = fmax(r.unit, data.transforms[k].scale);
    }
    status = fit_data(&r, samples, options, loss, out, report, error);
    report->coordinates = GONIO_NUSSELT;
    report->domain = GONIO_LINEAR;
    snprintf(report->note, sizeof report->note, "%s residuals; the ridge draws towards the mean",
             gonio_loss_names()[loss]);
    release(&r);
    gonio_dataset_release(&data);
    return status;
}

// The data set and its sorting; matrices of at most GONIO_LINEAR_TERMS_MAX terms, twice for the eigenvectors.
double gonio_ridge_memory(const gonio_fit_size *size, double n) {
    const double terms = GONIO_LINEAR_TERMS_MAX, channels = size->channels;
    return 1e6 + n * (160 + 8 * 3 * channels + 8) + 8 * terms * (3 * terms + 2 * BLOCK + 3 * channels);
}

const gonio_method_option gonio_ridge_options[] = {GONIO_METHOD_OPTION(thesis, "plain residuals of f_r, no weights"),
                                                   GONIO_METHOD_OPTION(loss, "linear or relative"),
                                                   GONIO_METHOD_OPTION(order, NULL),
                                                   GONIO_METHOD_OPTION(lambda, "ridge over the largest eigenvalue"),
                                                   {0}};
