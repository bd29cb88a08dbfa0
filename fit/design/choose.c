// SPDX-License-Identifier: BSD-3-Clause
// The greedy choice (fit/design/design.h).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "fit/design/places.h"
#include "fit/smooth/matrix.h"

// Relative standard deviation that a new sample is left with, whatever the rig: no pose is worth asking for twice for
// the noise's sake.
#define NOISE 0.01
#define TINY 1e-6 // variance, of 1, that is as good as none

typedef struct choice {
    const gonio_design *design;
    const gonio_design_places *places;
    double *covariance; // n x n
    double *column;     // of the pose just chosen, before it was
    double *worth;      // weight over sigma: of the variance, what the mean sigma falls by
    double *gain;
    double *travel; // seconds from the nearest pose of the batch
    double way;     // the usual one between two poses of the batch
    double scale;   // of the column, when the covariance is conditioned
    size_t at;
} choice;

// The process' correlations, with a spread that is half the model's word and half the samples' places': the geometric
// mean of the model's sigma and of what the places alone leave unknown, so that neither a sigma that is wrong somewhere
// nor places without values have all the say.
static void spread(choice *c) {
    const size_t n = c->places->n;
    double model = 0, unknown = 0;
    for (size_t i = 0; i < n; i++) {
        model += c->places->items[i].weight * c->places->items[i].spread;
        unknown += c->places->items[i].weight * sqrt(fmax(c->covariance[i * n + i], 0));
    }
    const double unit = unknown > 0 ? model / unknown : 1;
    for (size_t i = 0; i < n; i++) {
        const double own = sqrt(fmax(c->covariance[i * n + i], TINY));
        c->column[i] = sqrt(c->places->items[i].spread * own * unit) / own;
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            c->covariance[i * n + j] *= c->column[i] * c->column[j];
        }
    }
}

static void condition_row(void *context, size_t i) {
    const choice *c = context;
    const size_t n = c->places->n;
    gonio_add_scaled(n, -c->column[i] * c->scale, c->column, c->covariance + i * n);
    c->covariance[i * n + i] = fmax(c->covariance[i * n + i], 0);
}

// Condition the covariance on a sample at the place.
static void condition(choice *c, gonio_pool *pool, size_t at) {
    const size_t n = c->places->n;
    memcpy(c->column, c->covariance + at * n, n * sizeof *c->column);
    c->scale = 1 / (c->column[at] + NOISE * NOISE);
    gonio_pool_run(pool, n, condition_row, c);
}

static void gain_row(void *context, size_t i) {
    const choice *c = context;
    const size_t n = c->places->n;
    const double *row = c->covariance + i * n;
    double sum[4] = {0};
    size_t j = 0;
    if (!c->places->items[i].open) {
        c->gain[i] = 0;
        return;
    }
    for (; j + 4 <= n; j += 4) {
        for (size_t k = 0; k < 4; k++) {
            sum[k] += c->worth[j + k] * row[j + k] * row[j + k];
        }
    }
    for (; j < n; j++) {
        sum[0] += c->worth[j] * row[j] * row[j];
    }
    c->gain[i] = (sum[0] + sum[1] + sum[2] + sum[3]) / (row[i] + NOISE * NOISE);
}

// What a fall of the variance is worth: between that of the mean square, 1, and that of the mean sigma, 1 / (2 sigma),
// so that neither the few worst directions nor the many good ones are all that counts. Returns what there is to fall.
static double weigh(choice *c) {
    const size_t n = c->places->n;
    double sum = 0;
    for (size_t j = 0; j < n; j++) {
        const double variance = c->covariance[j * n + j];
        c->worth[j] = c->places->items[j].weight / sqrt(sqrt(variance) + NOISE);
        sum += c->worth[j] * variance;
    }
    return sum;
}

static void approach(choice *c, const gonio_pair *from) {
    for (size_t i = 0; i < c->places->n; i++) {
        if (c->places->items[i].open) {
            c->travel[i] = fmin(c->travel[i], c->design->travel_s(c->design->context, from, &c->places->items[i].pair));
        }
    }
}

// The open place of the largest gain a second; false: none is left.
static bool best_place(choice *c, size_t *best, double *seconds) {
    double rate = 0;
    for (size_t i = 0; i < c->places->n; i++) {
        const gonio_design_place *p = &c->places->items[i];
        if (p->open && c->gain[i] > 0) {
            const double s = fmax(c->travel[i], c->way) + c->design->dwell_s(c->design->context, &p->pair, p->value);
            if (c->gain[i] / s > rate) {
                rate = c->gain[i] / s;
                *best = i;
                *seconds = s;
            }
        }
    }
    return rate > 0;
}

// The way from one pose of the batch to the next is about as long as from any place to the nearest of them: who lies
// nearer saves nothing of a tour that passes by in any case.
static double usual_way(const choice *c) {
    double sum = 0;
    size_t open = 0;
    for (size_t i = 0; i < c->places->n; i++) {
        sum += c->places->items[i].open ? c->travel[i] : 0;
        open += c->places->items[i].open;
    }
    return open > 0 ? sum / (double)open : 0;
}

static size_t choose(choice *c, gonio_pool *pool, size_t n, gonio_design_pose *chosen) {
    spread(c);
    for (size_t k = 0; k < c->places->taken; k++) {
        condition(c, pool, k);
        approach(c, &c->places->items[k].pair);
    }
    c->way = c->places->taken > 0 ? usual_way(c) : 0;
    size_t count = 0;
    while (count < n) {
        size_t best = 0;
        double seconds = 0;
        const double all = weigh(c);
        gonio_pool_run(pool, c->places->n, gain_row, c);
        if (!best_place(c, &best, &seconds)) {
            break;
        }
        gonio_design_place *p = &c->places->items[best];
        chosen[count++] = (gonio_design_pose){p->pair, p->spread, all > 0 ? c->gain[best] / all : 0, seconds};
        p->open = false;
        condition(c, pool, best);
        approach(c, &p->pair);
    }
    return count;
}

gonio_status gonio_design_choose(const gonio_design *design, const gonio_model *model, const gonio_samples *samples,
                                 const gonio_pair *taken, size_t taken_n, const gonio_pair *here, size_t n,
                                 gonio_design_pose *chosen, size_t *count, gonio_error *error) {
    gonio_design_places places;
    *count = 0;
    gonio_status status = gonio_design_places_init(&places, design, model, taken, taken_n, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t m = places.n;
    choice c = {.design = design, .places = &places, .covariance = malloc((m + 4) * m * sizeof(double))};
    if (c.covariance == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to choose among %zu poses", m);
    } else {
        status = gonio_design_posterior(&places, samples, design->threads, c.covariance, error);
    }
    if (status == GONIO_OK) {
        c.column = c.covariance + m * m;
        c.worth = c.column + m;
        c.gain = c.worth + m;
        c.travel = c.gain + m;
        for (size_t i = 0; i < m; i++) {
            c.travel[i] = INFINITY;
        }
        approach(&c, here);
        gonio_pool *pool = gonio_pool_new(design->threads);
        *count = choose(&c, pool, n, chosen);
        gonio_pool_free(pool);
    }
    free(c.covariance);
    gonio_design_places_release(&places);
    return status;
}
