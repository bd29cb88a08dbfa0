// SPDX-License-Identifier: BSD-3-Clause
// What is unknown of a deviation from physics at the places of a choice, given where samples lie: a Gaussian process
// of the kernel's lengths (fit/prior/kernel.h), half of its variance, and of a third and a ninth of them, as what few
// samples tell of a lobe's foot is told more finely by more. Values do not enter; how large the deviation is where is
// the model's sigma to say.
#include <math.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "fit/design/places.h"
#include "fit/prior/kernel.h"
#include "fit/smooth/matrix.h"

#define SCALES 3
#define NOISE 1e-3       // variance of a sample's noise over that of the deviation: 1 % over 30 %
#define SAMPLES_MAX 2000 // more lie so densely that every k-th of them tells where they are
static const double scale[SCALES] = {1, 1.0 / 3, 1.0 / 9}, share[SCALES] = {0.5, 0.3, 0.2};

typedef struct point {
    double x[4], norm[SCALES];
} point;

typedef struct posterior {
    gonio_prior_kernel kernel;
    size_t n, m;             // samples, places
    point *samples, *places; // one array
    double *factor;          // n x n
    double *known;           // [m][n]: L^-1 of the covariances of a place and the samples
    double *covariance;      // [m][m]
} posterior;

static void locate(const posterior *p, const gonio_pair *pair, point *to) {
    gonio_prior_kernel_place(&p->kernel, pair, to->x);
    for (int s = 0; s < SCALES; s++) {
        to->norm[s] = 1 / sqrt(gonio_prior_kernel_covariance(&p->kernel, to->x, to->x, scale[s]));
    }
}

static double covariance(const posterior *p, const point *a, const point *b) {
    double sum = 0;
    for (int s = 0; s < SCALES; s++) {
        sum += share[s] * a->norm[s] * b->norm[s] * gonio_prior_kernel_covariance(&p->kernel, a->x, b->x, scale[s]);
    }
    return sum;
}

static void fill_sample(void *context, size_t j) {
    const posterior *p = context;
    for (size_t i = j; i < p->n; i++) {
        p->factor[j * p->n + i] = covariance(p, &p->samples[i], &p->samples[j]) + (i == j ? NOISE : 0);
    }
}

static void know_place(void *context, size_t i) {
    const posterior *p = context;
    double *known = p->known + i * p->n;
    for (size_t k = 0; k < p->n; k++) {
        known[k] = covariance(p, &p->samples[k], &p->places[i]);
    }
    for (size_t k = 0; k < p->n; k++) {
        const double *column = p->factor + k * p->n;
        known[k] /= column[k];
        gonio_add_scaled(p->n - k - 1, -known[k], column + k + 1, known + k + 1);
    }
}

static void fill_place(void *context, size_t i) {
    const posterior *p = context;
    for (size_t j = 0; j <= i; j++) {
        p->covariance[i * p->m + j] =
            covariance(p, &p->places[i], &p->places[j]) - gonio_dot(p->n, p->known + i * p->n, p->known + j * p->n);
    }
}

gonio_status gonio_design_posterior(const gonio_design_places *places, const gonio_samples *samples, int threads,
                                    double *out, gonio_error *error) {
    const size_t step = (samples->n + SAMPLES_MAX - 1) / SAMPLES_MAX, every = step > 0 ? step : 1;
    posterior p = {.n = (samples->n + every - 1) / every, .m = places->n, .covariance = out};
    gonio_prior_kernel_start(&p.kernel, places->dims, places->dims == 3);
    p.samples = malloc((p.n + p.m) * sizeof *p.samples);
    p.factor = malloc((p.n * p.n + 1) * sizeof *p.factor);
    p.known = malloc((p.n * p.m + 1) * sizeof *p.known);
    gonio_status status = GONIO_OK;
    if (p.samples == NULL || p.factor == NULL || p.known == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to choose among %zu poses", p.m);
    } else {
        p.places = p.samples + p.n;
        for (size_t i = 0; i < p.n; i++) {
            locate(&p, &samples->pairs[i * every], &p.samples[i]);
        }
        for (size_t i = 0; i < p.m; i++) {
            locate(&p, &places->items[i].pair, &p.places[i]);
        }
        gonio_pool_for(threads, p.n, fill_sample, &p);
        status = gonio_cholesky(p.n, p.factor)
                     ? GONIO_OK
                     : gonio_fail(error, GONIO_E_CONVERGENCE, "what %zu samples leave unknown was not found", p.n);
    }
    if (status == GONIO_OK) {
        gonio_pool_for(threads, p.m, know_place, &p);
        gonio_pool_for(threads, p.m, fill_place, &p);
        for (size_t i = 0; i < p.m; i++) {
            for (size_t j = i + 1; j < p.m; j++) {
                out[i * p.m + j] = out[j * p.m + i];
            }
        }
    }
    free(p.samples);
    free(p.factor);
    free(p.known);
    return status;
}
