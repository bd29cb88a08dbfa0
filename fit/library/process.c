// SPDX-License-Identifier: BSD-3-Clause
// The Gaussian process of a library (fit/library/library.h), and its posterior.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "fit/library/library.h"
#include "fit/prepare/scatter.h"
#include "fit/smooth/matrix.h"

#define NUGGET 1e-5 // variance of z that no sample is without: 0.3 %
#define TINY 1e-3   // of the figures
// Lengths over which materials deviate from what components hold, in half-vector coordinates (fit/prior/kernel.c).
static const double lengths[3] = {0.08, 0.08, 0.3};

gonio_status gonio_library_new(int rank, int models, gonio_library **out, gonio_error *error) {
    gonio_library *l = calloc(1, sizeof *l);
    *out = NULL;
    if (l != NULL) {
        l->grid = gonio_grid_of(GONIO_GRID_HALF_ANGLES, 3, LIBRARY_LEVEL);
        l->rank = rank;
        l->facts.rank = rank;
        l->facts.models = models;
        l->mean = calloc(l->grid.count * (size_t)(3 + rank), sizeof *l->mean);
        l->names = calloc((size_t)models + 1, sizeof *l->names);
    }
    if (l == NULL || l->mean == NULL || l->names == NULL) {
        gonio_library_free(l);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a prior of %d components", rank);
    }
    l->reference = l->mean + l->grid.count;
    l->rest = l->reference + l->grid.count;
    l->components = l->rest + l->grid.count;
    l->facts.bytes = l->grid.count * (size_t)(3 + rank) * sizeof *l->mean;
    *out = l;
    return GONIO_OK;
}

void gonio_library_free(gonio_library *library) {
    if (library != NULL) {
        free(library->mean);
        free(library->names);
        free(library);
    }
}

void gonio_library_tell(const gonio_library *library, gonio_library_facts *facts) { *facts = library->facts; }

void gonio_library_place(const gonio_library *l, const gonio_pair *pair, double *components, library_place *place) {
    const gonio_vec3 wi = gonio_direction(pair->theta_i, pair->phi_i), wo = gonio_direction(pair->theta_o, pair->phi_o);
    const size_t rank = (size_t)l->rank;
    size_t nodes[GONIO_GRID_POINTS_MAX];
    double weights[GONIO_GRID_POINTS_MAX], x[4], at[GONIO_DIMS_MAX];
    *place = (library_place){.pair = *pair, .weight = fmax(wi.z * wo.z, LIBRARY_EPS), .components = components};
    memset(components, 0, rank * sizeof *components);
    gonio_grid_locate(&l->grid, wi, wo, x);
    int n = gonio_grid_points(&l->grid, GONIO_GRID_CUBIC, x, nodes, weights);
    for (int k = 0; k < n; k++) {
        place->mean += weights[k] * l->mean[nodes[k]];
        place->reference += weights[k] * l->reference[nodes[k]];
        gonio_add_scaled(rank, weights[k], l->components + nodes[k] * rank, components);
    }
    n = gonio_grid_points(&l->grid, GONIO_GRID_LINEAR, x, nodes, weights);
    for (int k = 0; k < n; k++) {
        place->rest += weights[k] * l->rest[nodes[k]];
    }
    gonio_scatter_locate(GONIO_HALF_VECTOR, 3, pair, at);
    for (int d = 0; d < 3; d++) {
        place->at[d] = (d == 1 ? fabs(at[d] - 0.5) : at[d]) / lengths[d]; // mirror images are one place
    }
}

double gonio_library_covariance(const gonio_library *l, const library_place *p, const library_place *q) {
    double distance2 = 0;
    for (int d = 0; d < 3; d++) {
        distance2 += (p->at[d] - q->at[d]) * (p->at[d] - q->at[d]);
    }
    return gonio_dot((size_t)l->rank, p->components, q->components) + p->rest * q->rest * exp(-0.5 * distance2);
}

double gonio_library_map(const library_place *place, double f) {
    return log(fmin(fmax(f, 0), 1e9) * place->weight + LIBRARY_EPS) - place->reference;
}

double gonio_library_unmap(const library_place *place, double z) {
    return fmax((exp(fmin(z + place->reference, 60)) - LIBRARY_EPS) / place->weight, 0);
}

double gonio_library_slope(const library_place *place, double f) {
    return place->weight / (fmax(f, 0) * place->weight + LIBRARY_EPS);
}

// ---- the posterior ----

void gonio_library_posterior_release(library_posterior *p) {
    free(p->places);
    free(p->components);
    free(p->factor);
    free(p->weights);
    *p = (library_posterior){0};
}

// Variance of a sample's z, mean over the channels.
static double noise_of(const gonio_samples *samples, const library_place *place, size_t i) {
    const size_t c = (size_t)samples->channels;
    double sum = 0;
    for (size_t k = 0; k < c && samples->sigma_random != NULL; k++) {
        const double sigma = samples->sigma_random[i * c + k] * gonio_library_slope(place, samples->values[i * c + k]);
        sum += sigma * sigma / (double)c;
    }
    return sum + NUGGET;
}

static void fill(const gonio_samples *samples, library_posterior *p) {
    const size_t n = p->n, c = (size_t)p->channels;
    for (size_t i = 0; i < n; i++) {
        gonio_library_place(p->learnt, &samples->pairs[i], p->components + i * (size_t)p->learnt->rank, &p->places[i]);
    }
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j; i < n; i++) {
            p->factor[j * n + i] = gonio_library_covariance(p->learnt, &p->places[i], &p->places[j]);
        }
        p->factor[j * n + j] += noise_of(samples, &p->places[j], j);
        for (size_t k = 0; k < c; k++) {
            p->weights[k * n + j] = gonio_library_map(&p->places[j], samples->values[j * c + k]) - p->places[j].mean;
        }
    }
}

// What leaves each sample out, from the inverse's diagonal: e_i = weight_i / inverse_ii, of variance 1 / inverse_ii.
static gonio_status leave_out(const gonio_samples *samples, library_posterior *p, gonio_error *error) {
    const size_t n = p->n, c = (size_t)p->channels;
    double *inverse = malloc(2 * n * n * sizeof *inverse), *relative = malloc((n * c + 1) * sizeof *relative);
    if (inverse == NULL || relative == NULL) {
        free(inverse);
        free(relative);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the prior's fit of %zu samples", n);
    }
    memcpy(inverse, p->factor, n * n * sizeof *inverse);
    gonio_cholesky_invert(n, inverse, inverse + n * n);
    p->residual = 0;
    for (size_t k = 0; k < c; k++) {
        for (size_t i = 0; i < n; i++) {
            const double diagonal = inverse[i * n + i], weight = p->weights[k * n + i];
            const double f = fmax(samples->values[i * c + k], 0);
            p->residual += weight * weight / diagonal / (double)(n * c);
            const double z = gonio_library_map(&p->places[i], f) - weight / diagonal;
            relative[k * n + i] = fabs(gonio_library_unmap(&p->places[i], z) - f) / (f + TINY);
        }
    }
    p->loo_rel = gonio_median(relative, n * c);
    free(inverse);
    free(relative);
    return GONIO_OK;
}

gonio_status gonio_library_condition(const gonio_library *library, const gonio_samples *samples, library_posterior *p,
                                     gonio_error *error) {
    const size_t n = samples->n, c = (size_t)samples->channels;
    *p = (library_posterior){.learnt = library,
                             .n = n,
                             .channels = samples->channels,
                             .places = malloc((n + 1) * sizeof(library_place)),
                             .components = malloc((n * (size_t)library->rank + 1) * sizeof(double)),
                             .factor = calloc(n * n + 1, sizeof(double)),
                             .weights = malloc((n * c + 1) * sizeof(double))};
    if (p->places == NULL || p->components == NULL || p->factor == NULL || p->weights == NULL) {
        gonio_library_posterior_release(p);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the prior's fit of %zu samples", n);
    }
    fill(samples, p);
    gonio_status status = gonio_cholesky(n, p->factor) ? GONIO_OK
                                                       : gonio_fail(error, GONIO_E_CONVERGENCE,
                                                                    "the prior's fit of %zu samples was not found", n);
    if (status == GONIO_OK) {
        gonio_cholesky_solve(n, p->factor, gonio_matrix_of(p->weights, n, c));
        status = leave_out(samples, p, error);
    }
    if (status != GONIO_OK) {
        gonio_library_posterior_release(p);
    }
    return status;
}

void gonio_library_predict(const library_posterior *p, const library_place *at, double *z, double *variance,
                           double *work) {
    for (size_t i = 0; i < p->n; i++) {
        work[i] = gonio_library_covariance(p->learnt, &p->places[i], at);
    }
    for (int k = 0; k < p->channels; k++) {
        z[k] = at->mean + gonio_dot(p->n, work, p->weights + (size_t)k * p->n);
    }
    for (size_t j = 0; j < p->n; j++) { // |L^-1 k|^2
        const double *column = p->factor + j * p->n;
        work[j] /= column[j];
        gonio_add_scaled(p->n - j - 1, -work[j], column + j + 1, work + j + 1);
    }
    *variance = fmax(gonio_library_covariance(p->learnt, at, at) - gonio_dot(p->n, work, work), 0);
}
