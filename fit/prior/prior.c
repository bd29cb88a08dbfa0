// SPDX-License-Identifier: BSD-3-Clause
// The posterior of fit/prior/prior.h.
//
// A step moves every material: a new place near the old one, taken with the probability that tempered likelihoods give
// it (Metropolis). The random numbers do not depend on the samples, so that rounding never grows from step to step.
#include "fit/prior/prior.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "fit/prepare/holdout.h"
#include "fit/smooth/matrix.h"

#define SAMPLES_MAX 300   // of the kernel
#define SAMPLES_LIKELY 64 // of the likelihood: several times the numbers of a material
#define STAGES 16
#define MOVES 6
#define FREEDOM 4.0    // of the deviations' scale a priori,
#define DEVIATION 0.05 // about 5 %: as analytic models fit each other at best
// What a material deviates is alike over wider distances than the kernel's: no set counts for more independent
// deviations (tests/bench/fit_support: without a bound the truth was beyond 2 sigma at one of seven unseen incidences,
// with 15 at one of a hundred).
#define FREEDOM_MAX 15.0

typedef struct walk {
    const gonio_prior *prior;
    size_t step; // between the samples that take part
    double freedom;
    bool isotropic;
} walk;

// Mean square of what the material deviates, and its offset: the mean of what it is too low.
static double squares_of(const walk *w, const gonio_material *m, double *offset) {
    const gonio_prior *p = w->prior;
    double sum = 0, squares = 0, n = 0;
    for (size_t i = 0; i < p->data.n; i += w->step, n++) {
        const double e = p->target[i] - gonio_material_ln(m, &p->geometry[i]);
        sum += e;
        squares += e * e;
    }
    *offset = sum / n;
    return fmax(squares / n - *offset * *offset, 0);
}

static double ln_likelihood(const walk *w, const gonio_material *m) {
    double offset;
    const double squares = w->freedom * squares_of(w, m, &offset) + FREEDOM * DEVIATION * DEVIATION;
    return -0.5 * (w->freedom + FREEDOM) * log(squares);
}

static double reflected(double u) {
    u = fmod(fabs(u), 2);
    return u > 1 ? 2 - u : u;
}

// A place near another: some of its coordinates move, few of them anywhere, from one family or Fresnel term to another.
static void proposed(const double *from, double width, uint64_t *state, double *to) {
    for (int d = 0; d < GONIO_MATERIAL_DIMS; d++) {
        const double which = gonio_random_next(state), u = gonio_random_next(state), v = gonio_random_next(state);
        to[d] = which < 0.06 ? u : which < 0.35 ? reflected(from[d] + 2 * width * (u + v - 1)) : from[d];
    }
}

static void move(const walk *w, double temper, double width, uint64_t *state, gonio_material *m, double *ln) {
    double place[GONIO_MATERIAL_DIMS];
    gonio_material trial;
    proposed(m->place, width, state, place);
    const double u = gonio_random_next(state);
    gonio_material_of(place, w->isotropic, &trial);
    const double now = ln_likelihood(w, &trial);
    if (log(u + 1e-300) < temper * (now - *ln)) {
        *m = trial;
        *ln = now;
    }
}

// Materials in proportion to their weights e^(by ln): systematic resampling. old: room for all.
static void resample(double by, uint64_t *state, gonio_material *m, double *ln, gonio_material *old) {
    enum { N = GONIO_PRIOR_MATERIALS };
    const double at = gonio_random_next(state);
    double most = -INFINITY, total = 0, sum = 0, weights[N], kept[N];
    for (int k = 0; k < N; k++) {
        most = fmax(most, ln[k]);
    }
    for (int k = 0; k < N; k++) {
        total += weights[k] = exp(by * (ln[k] - most));
    }
    memcpy(old, m, N * sizeof *old);
    memcpy(kept, ln, sizeof kept);
    for (int k = 0, out = 0; k < N; k++) {
        sum += weights[k] * N / total;
        for (; out < N && (at + out < sum || k == N - 1); out++) {
            m[out] = old[k];
            ln[out] = kept[k];
        }
    }
}

static gonio_status find_materials(gonio_prior *p, double freedom, gonio_error *error) {
    const walk w = {p, 1 + (p->data.n - 1) / SAMPLES_LIKELY, freedom, p->data.dims == 3};
    uint64_t state = 1;
    double ln[GONIO_PRIOR_MATERIALS], before = 0;
    gonio_material *old = malloc(GONIO_PRIOR_MATERIALS * sizeof *old);
    if (old == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what %zu samples leave open", p->data.n);
    }
    for (int k = 0; k < GONIO_PRIOR_MATERIALS; k++) {
        double place[GONIO_MATERIAL_DIMS];
        for (int d = 0; d < GONIO_MATERIAL_DIMS; d++) {
            place[d] = gonio_random_next(&state);
        }
        gonio_material_of(place, w.isotropic, &p->materials[k]);
        ln[k] = ln_likelihood(&w, &p->materials[k]);
    }
    for (int stage = 1; stage <= STAGES; stage++) {
        const double part = (double)stage / STAGES, temper = part * part * part;
        const double widths[2] = {0.4 * (1 - part) + 0.03, 0.1 * (1 - part) + 0.01};
        resample(temper - before, &state, p->materials, ln, old);
        before = temper;
        for (int k = 0; k < GONIO_PRIOR_MATERIALS * MOVES; k++) {
            move(&w, temper, widths[k % MOVES % 2], &state, &p->materials[k / MOVES], &ln[k / MOVES]);
        }
    }
    free(old);
    return GONIO_OK;
}

static void fill_misfits(gonio_prior *p, double freedom) {
    const size_t n = p->data.n;
    const walk w = {p, 1, freedom, p->data.dims == 3};
    for (int k = 0; k < GONIO_PRIOR_MATERIALS; k++) {
        const double square = squares_of(&w, &p->materials[k], &p->offset[k]);
        p->scale[k] = sqrt((freedom * square + FREEDOM * DEVIATION * DEVIATION) / (freedom + FREEDOM));
        p->draw[k] = gonio_holdout_noise((uint64_t)k);
        for (size_t i = 0; i < n; i++) {
            p->misfit[(size_t)k * n + i] =
                p->target[i] - p->offset[k] - gonio_material_ln(&p->materials[k], &p->geometry[i]);
        }
    }
}

void gonio_prior_release(gonio_prior *p) {
    gonio_dataset_release(&p->data);
    gonio_prior_kernel_release(&p->kernel);
    free(p->geometry);
    free(p->target);
    free(p->colour);
    free(p->misfit);
    free(p->weights);
    *p = (gonio_prior){0};
}

static gonio_lobe_geometry geometry_of(const gonio_pair *p) {
    return gonio_lobe_geometry_of(gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o));
}

static gonio_status prepare(gonio_prior *p, gonio_error *error) {
    const size_t n = p->data.n, c = (size_t)p->data.channels;
    p->geometry = malloc(n * sizeof *p->geometry);
    p->target = calloc(n, sizeof *p->target);
    p->colour = malloc(n * c * sizeof *p->colour);
    p->misfit = malloc(n * GONIO_PRIOR_MATERIALS * sizeof *p->misfit);
    p->weights = malloc(n * sizeof *p->weights);
    if (p->geometry == NULL || p->target == NULL || p->colour == NULL || p->misfit == NULL || p->weights == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for what %zu samples leave open", n);
    }
    for (size_t i = 0; i < n; i++) {
        p->geometry[i] = geometry_of(&p->data.pairs[i]);
        for (size_t k = 0; k < c; k++) {
            const gonio_transform *t = &p->data.transforms[k];
            p->colour[i * c + k] = log(fmax(p->data.values[i * c + k] / t->scale, t->eps));
            p->target[i] += p->colour[i * c + k] / (double)c;
        }
        for (size_t k = 0; k < c; k++) {
            p->colour[i * c + k] -= p->target[i];
        }
    }
    return gonio_prior_kernel_init(&p->kernel, &p->data, error);
}

// The measured ones, or as many as the kernel takes, spread over them.
static gonio_status choose_samples(gonio_prior *p, const gonio_dataset *data, gonio_error *error) {
    gonio_dataset measured = *data;
    measured.n = data->measured;
    return gonio_dataset_thin(&measured, measured.n < SAMPLES_MAX ? measured.n : SAMPLES_MAX, 1, &p->data, error);
}

gonio_status gonio_prior_init(gonio_prior *p, const gonio_dataset *data, gonio_error *error) {
    *p = (gonio_prior){.materials_n = data->kind == GONIO_TRANSFORM_ASINH ? 0 : GONIO_PRIOR_MATERIALS};
    gonio_status status = choose_samples(p, data, error);
    status = status == GONIO_OK ? prepare(p, error) : status;
    if (status != GONIO_OK) {
        gonio_prior_release(p);
        return status;
    }
    double freedom = 0;
    status = p->materials_n > 0 ? gonio_prior_kernel_freedom(&p->kernel, &freedom, error) : GONIO_OK;
    if (status == GONIO_OK && p->materials_n > 0) {
        freedom = fmin(freedom, FREEDOM_MAX);
        status = find_materials(p, freedom, error);
        fill_misfits(p, freedom);
    }
    if (status != GONIO_OK) {
        gonio_prior_release(p);
    }
    return status;
}

// Far from the samples the mean over them; between them what the kernel makes of theirs.
static void colour_at(const gonio_prior *p, double *out) {
    const size_t n = p->data.n, c = (size_t)p->data.channels;
    for (size_t k = 0; k < c; k++) {
        double mean = 0;
        for (size_t i = 0; i < n; i++) {
            mean += p->colour[i * c + k] / (double)n;
        }
        out[k] = mean;
        for (size_t i = 0; i < n; i++) {
            out[k] += p->weights[i] * (p->colour[i * c + k] - mean);
        }
    }
}

double gonio_prior_support(gonio_prior *p, const gonio_pair *pair) {
    return gonio_prior_kernel_support(&p->kernel, pair, p->weights);
}

double gonio_prior_at(gonio_prior *p, const gonio_pair *pair, double out[GONIO_PRIOR_MATERIALS], double *colour) {
    const double support = gonio_prior_support(p, pair), open = sqrt(1 - support);
    const gonio_lobe_geometry g = geometry_of(pair);
    gonio_prior_kernel_weights(&p->kernel, p->weights);
    for (int k = 0; k < p->materials_n; k++) {
        const double carried = gonio_dot(p->data.n, p->weights, p->misfit + (size_t)k * p->data.n);
        out[k] = p->offset[k] + gonio_material_ln(&p->materials[k], &g) + carried + p->scale[k] * open * p->draw[k];
    }
    if (colour != NULL) {
        colour_at(p, colour);
    }
    return support;
}
