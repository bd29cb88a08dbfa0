// SPDX-License-Identifier: BSD-3-Clause
#include "fit/design/places.h"

#include <math.h>
#include <stdlib.h>

#include "base/sobol.h"
#include "base/thread_pool.h"
#include "fit/prepare/scatter.h"
#include "fit/prior/places.h"

// Candidates spread over all pairs as the nusselt plan spreads its poses, and about the mirror direction; directions
// that they stand for.
#define SPREAD 1024
#define MIRROR 512
#define DIRECTIONS 16384
#define ASKED 512 // candidates among what is asked for, where not all directions are
// Correlation lengths as the deviations from physics have them (fit/prior/kernel.c).
static const double length_3d[] = {0.08, 0.08, 0.3}, length_4d[] = {0.08, 0.08, 0.2, 0.2};
#define BARRED 0.25    // squared distance, in those lengths, within which nothing is asked for
#define SPREAD_MAX 2.0 // of a relative sigma: more is not known than nothing
#define TINY 1e-3      // of the figures (docs/fitting.md)

double gonio_design_spread(const gonio_model *model, const gonio_pair *pair, double *value) {
    double f[GONIO_CHANNELS_MAX], sigma[GONIO_CHANNELS_MAX], sum = 0, squares = 0;
    const gonio_vec3 wi = gonio_direction(pair->theta_i, pair->phi_i), wo = gonio_direction(pair->theta_o, pair->phi_o);
    gonio_model_eval(model, wi, wo, f);
    const bool told = gonio_model_sigma(model, wi, wo, sigma);
    for (int c = 0; c < model->channels; c++) {
        const double relative = told ? sigma[c] / (fmax(f[c], 0) + TINY) : 1;
        sum += fmax(f[c], 0) / model->channels;
        squares += relative * relative / model->channels;
    }
    *value = sum;
    return fmin(sqrt(squares), SPREAD_MAX);
}

// Degrees with four decimals, as plans have them, and canonical.
static double tidy(double rad, double limit) {
    const double deg = round(gonio_degrees(rad) * 1e4) / 1e4;
    return gonio_angle_canonical(gonio_radians(fmin(deg, gonio_degrees(limit))));
}

static gonio_pair tidied(gonio_pair p, bool isotropic, double theta_max) {
    const double phi_o = isotropic ? fabs(remainder(p.phi_o - p.phi_i, 2 * GONIO_PI)) : p.phi_o;
    return (gonio_pair){tidy(p.theta_i, theta_max), isotropic ? 0 : tidy(p.phi_i, 2 * GONIO_PI),
                        tidy(p.theta_o, theta_max), tidy(phi_o, 2 * GONIO_PI)};
}

gonio_pair gonio_design_mirror_place(uint64_t i, bool isotropic, double theta_max) {
    return tidied(gonio_prior_place(2 * i + 1, isotropic, theta_max), isotropic, theta_max);
}

// Uniform over the projections of both directions.
static gonio_pair spread_place(uint32_t i, const gonio_design *design) {
    const double radius = sin(design->theta_max);
    const double u = gonio_sobol(i, 0, design->seed), v = gonio_sobol(i, 1, design->seed);
    const double w = gonio_sobol(i, 2, design->seed), t = gonio_sobol(i, 3, design->seed);
    const gonio_pair p = {asin(radius * (design->isotropic ? u : sqrt(u))), design->isotropic ? 0 : 2 * GONIO_PI * t,
                          asin(radius * sqrt(v)), (design->isotropic ? 1 : 2) * GONIO_PI * w};
    return tidied(p, design->isotropic, design->theta_max);
}

static void locate(int dims, const gonio_pair *pair, double *x) {
    gonio_scatter_locate(GONIO_HALF_VECTOR, dims, pair, x);
    for (int d = 0; d < dims; d++) {
        x[d] = dims == 3 && d == 1 ? fabs(x[d] - 0.5) : x[d]; // mirror images are one place
        x[d] /= dims == 3 ? length_3d[d] : length_4d[d];
    }
}

static double distance2(int dims, const double *x, const double *y) {
    double sum = 0;
    for (int d = 0; d < dims; d++) {
        sum += (x[d] - y[d]) * (x[d] - y[d]);
    }
    return sum;
}

typedef struct filling {
    gonio_design_places *places;
    const gonio_design *design;
    const gonio_model *model;
    size_t *nearest; // of the directions
} filling;

static void describe_place(void *context, size_t i) {
    const filling *f = context;
    const gonio_design *design = f->design;
    gonio_design_place *p = &f->places->items[i];
    const int dims = f->places->dims;
    p->spread = gonio_design_spread(f->model, &p->pair, &p->value);
    double variance = p->spread * p->spread;
    for (size_t k = 0; k < design->surprises_n; k++) {
        double y[4];
        locate(dims, &design->surprises[k].pair, y);
        variance += design->surprises[k].variance * exp(-distance2(dims, p->x, y) / 2);
    }
    p->spread = fmin(sqrt(variance), SPREAD_MAX);
    for (size_t k = 0; k < design->barred_n; k++) {
        double y[4];
        locate(dims, &design->barred[k], y);
        p->open &= distance2(dims, p->x, y) > BARRED;
    }
    p->open &= design->allowed == NULL || design->allowed(design->context, &p->pair);
}

static void nearest_place(void *context, size_t i) {
    const filling *f = context;
    const gonio_design *design = f->design;
    const gonio_pair pair = design->asked_n > 0 ? design->asked[i] : spread_place((uint32_t)(SPREAD + i), design);
    double x[4], best = INFINITY;
    locate(f->places->dims, &pair, x);
    for (size_t k = f->places->taken; k < f->places->n; k++) {
        const double d2 = distance2(f->places->dims, x, f->places->items[k].x);
        if (d2 < best) {
            best = d2;
            f->nearest[i] = k;
        }
    }
}

static gonio_status fill(filling *f, gonio_error *error) {
    gonio_design_places *places = f->places;
    const size_t n = f->design->asked_n > 0 ? f->design->asked_n : DIRECTIONS;
    f->nearest = calloc(n, sizeof *f->nearest);
    if (f->nearest == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to choose poses");
    }
    gonio_pool_for(f->design->threads, places->n, describe_place, f);
    gonio_pool_for(f->design->threads, n, nearest_place, f);
    double all = 0;
    for (size_t i = 0; i < n; i++) {
        all += f->design->asked_n > 0 ? f->design->asked_worth[i] : 1;
    }
    for (size_t i = 0; i < n && all > 0; i++) {
        places->items[f->nearest[i]].weight += (f->design->asked_n > 0 ? f->design->asked_worth[i] : 1) / all;
    }
    return GONIO_OK;
}

// The k-th of the candidates that are not taken.
static gonio_pair candidate(const gonio_design *design, size_t k) {
    if (k < SPREAD) {
        return spread_place((uint32_t)k, design);
    }
    if (k < SPREAD + MIRROR) {
        return gonio_design_mirror_place(design->seed % 65536 * MIRROR + k - SPREAD, design->isotropic,
                                         design->theta_max);
    }
    const size_t of = (k - SPREAD - MIRROR) * design->asked_n / ASKED;
    return tidied(design->asked[of], design->isotropic, design->theta_max);
}

gonio_status gonio_design_places_init(gonio_design_places *places, const gonio_design *design, const gonio_model *model,
                                      const gonio_pair *taken, size_t taken_n, gonio_error *error) {
    *places = (gonio_design_places){.n = taken_n + SPREAD + MIRROR + (design->asked_n > 0 ? ASKED : 0),
                                    .taken = taken_n,
                                    .dims = design->isotropic ? 3 : 4};
    places->items = calloc(places->n, sizeof *places->items);
    if (places->items == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to choose poses");
    }
    for (size_t i = 0; i < places->n; i++) {
        gonio_design_place *p = &places->items[i];
        const size_t k = i - taken_n;
        p->open = i >= taken_n;
        p->pair = i < taken_n ? taken[i] : candidate(design, k);
        locate(places->dims, &p->pair, p->x);
    }
    filling f = {.places = places, .design = design, .model = model};
    const gonio_status status = fill(&f, error);
    free(f.nearest);
    if (status != GONIO_OK) {
        gonio_design_places_release(places);
    }
    return status;
}

void gonio_design_places_release(gonio_design_places *places) {
    free(places->items);
    *places = (gonio_design_places){0};
}
