// SPDX-License-Identifier: BSD-3-Clause
// Where to start. A sum of lobes has many local minima, so shapes are tried all over their ranges, and lobes are added
// one by one:
//   1. On a few hundred samples (half of them spread over the directions, half over the brightness, so that no peak is
//      missed) of the mean over channels, shapes from a low-discrepancy sequence are ranked by what their best
//      strengths leave. Two lobes and more: a new lobe beside the best sums of one lobe less, and whole sums anew.
//   2. The best go downhill on the same samples; the best of those on thousands; the winner on all samples and
//   channels.
// Nothing is random, and the order of samples does not matter: they come sorted.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "fit/analytic/problem.h"

#define SPREAD 6.0 // of starts that are divided by another value: 6 times their range, over it

enum {
    TRIED = 150, // shapes of the sequence a lobe
    CHOSEN = 6,  // go downhill
    KEPT = 3,    // and on
    FEW = 300,   // samples of the first ranking, for one lobe; FEW_MORE for every further shape
    FEW_MORE = 30,
    MANY = 3000,      // of the second descent
    DESCENT_FEW = 40, // iterations
    DESCENT_MANY = 60,
    DESCENT_ALL = 300,
};

typedef struct start {
    double shapes[GONIO_ANALYTIC_SHAPES_MAX];
    double cost;
} start;

// ---- parts of the data ----

typedef struct ranked {
    double y;
    size_t index;
} ranked;

static int by_brightness(const void *a, const void *b) {
    const ranked *x = a, *y = b;
    return x->y != y->y ? (x->y < y->y ? -1 : 1) : x->index < y->index ? -1 : x->index > y->index;
}

static double *mean_of(const gonio_analytic_data *all) {
    double *mean = calloc(all->n, sizeof *mean);
    for (int c = 0; mean != NULL && c < all->channels; c++) {
        for (size_t i = 0; i < all->n; i++) {
            mean[i] += all->y[(size_t)c * all->n + i] / all->channels;
        }
    }
    return mean;
}

// Marks about `count` samples; returns how many.
static size_t choose(size_t n, const double *y, size_t count, bool *chosen, ranked *work) {
    size_t found = 0;
    for (size_t i = 0; i < n; i++) {
        work[i] = (ranked){y[i], i};
        chosen[i] = count >= n;
    }
    qsort(work, n, sizeof *work, by_brightness);
    for (size_t k = 0; k < count / 2 && count < n; k++) {
        chosen[(2 * k + 1) * n / (2 * (count / 2))] = true;
        // Ranks are spread by their square: more of the brightest.
        const double down = (double)k / (double)(count / 2);
        chosen[work[n - 1 - (size_t)(down * down * (double)(n - 1))].index] = true;
    }
    for (size_t i = 0; i < n; i++) {
        found += chosen[i];
    }
    return found;
}

typedef struct part {
    gonio_analytic_data data;
    gonio_lobe_geometry *geometry;
    double *y, *weight, eps, highest;
} part;

static void part_release(part *p) {
    free(p->geometry);
    free(p->y);
    free(p->weight);
}

// About `count` samples of the mean over channels. On failure nothing is left to release.
static gonio_status part_init(part *p, const gonio_analytic_data *all, size_t count, gonio_error *error) {
    *p = (part){.data = *all};
    bool *chosen = malloc(all->n * sizeof *chosen);
    ranked *work = malloc(all->n * sizeof *work);
    double *mean = mean_of(all);
    p->geometry = malloc(all->n * sizeof *p->geometry);
    p->y = malloc(all->n * sizeof *p->y);
    p->weight = malloc(all->n * sizeof *p->weight);
    const bool enough =
        chosen != NULL && work != NULL && mean != NULL && p->geometry != NULL && p->y != NULL && p->weight != NULL;
    if (enough) {
        p->data.n = choose(all->n, mean, count, chosen, work);
        size_t at = 0;
        for (size_t i = 0; i < all->n; i++) {
            if (chosen[i]) {
                p->geometry[at] = all->geometry[i];
                p->weight[at] = all->weight[i];
                p->y[at++] = mean[i];
            }
        }
        for (int c = 0; c < all->channels; c++) {
            p->eps += all->eps[c] / all->channels;
            p->highest += all->highest[c] / all->channels;
        }
        p->data.channels = 1;
    } else {
        part_release(p);
    }
    free(chosen);
    free(work);
    free(mean);
    return enough ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory to fit lobes to %zu samples", all->n);
}

// The data of a part where it lies now.
static const gonio_analytic_data *part_data(part *p) {
    p->data.geometry = p->geometry;
    p->data.y = p->y;
    p->data.weight = p->weight;
    p->data.eps = &p->eps;
    p->data.highest = &p->highest;
    return &p->data;
}

// ---- ranking ----

// The index-th point of the additive sequence of Roberts (2018): steps of 1/g, 1/g^2 .., g the root of g^(own + 1) = g
// + 1, fill a cube of `own` dimensions evenly. `lobe` shifts it.
static void sequence(const gonio_analytic_layout *layout, size_t index, int lobe, double *shapes) {
    double g = 2, step = 1;
    for (int k = 0; k < 60; k++) {
        g = pow(1 + g, 1.0 / (layout->own + 1));
    }
    for (int j = 0; j < layout->own; j++) {
        step /= g;
        double whole;
        const double u = modf(0.5 + 0.37 * lobe + step * (double)(index + 1), &whole);
        const int at = lobe * layout->own + j;
        shapes[at] = layout->low[at] + u * (layout->high[at] - layout->low[at]);
    }
    for (int j = 0; j < layout->own; j++) {
        const int over = layout->variables[j].over;
        double slope;
        if (over > 0) {
            const double *by = shapes + lobe * layout->own + over - 1;
            const int at = lobe * layout->own + j;
            const double value =
                SPREAD * shapes[at] / gonio_analytic_value_of(&layout->variables[over - 1], *by, &slope);
            shapes[at] = fmin(fmax(value, layout->low[at]), layout->high[at]);
        }
    }
}

static double rank(const gonio_analytic_problem *problem, gonio_analytic_point *point, const double *shapes) {
    memcpy(point->shapes, shapes, sizeof point->shapes);
    gonio_analytic_units(problem, point);
    gonio_analytic_solve_strengths(problem, point);
    gonio_analytic_cost(problem, point);
    return point->cost;
}

static bool near(const gonio_analytic_layout *layout, const start *a, const start *b) {
    double most = 0;
    for (int m = 0; m < layout->shapes; m++) {
        most = fmax(most, fabs(a->shapes[m] - b->shapes[m]) / (layout->high[m] - layout->low[m]));
    }
    return most < 0.02;
}

// Keep the best of different starts, in order.
static void offer(const gonio_analytic_layout *layout, const start *new, start *best, size_t *n, size_t most) {
    size_t at = *n;
    for (size_t k = 0; k < *n; k++) {
        if (near(layout, new, &best[k])) {
            if (new->cost >= best[k].cost) {
                return;
            }
            // It takes that one's place, which the one before it may have deserved.
            memmove(best + k, best + k + 1, (*n - k - 1) * sizeof *best);
            at = --*n;
            break;
        }
    }
    while (at > 0 && new->cost < best[at - 1].cost) {
        at--;
    }
    if (at >= most) {
        return;
    }
    *n = *n < most ? *n + 1 : most;
    memmove(best + at + 1, best + at, (*n - at - 1) * sizeof *best);
    best[at] = *new;
}

// ---- descents ----

typedef struct descents {
    const gonio_analytic_problem *problem;
    start *starts;
    int iterations;
} descents;

static gonio_status go_down(void *context, size_t item, gonio_error *error) {
    const descents *d = context;
    start *s = &d->starts[item];
    gonio_analytic_point point;
    gonio_status status = gonio_analytic_point_init(&point, d->problem, error);
    if (status == GONIO_OK) {
        rank(d->problem, &point, s->shapes);
        status = gonio_analytic_minimise(d->problem, &point, d->iterations, NULL, error);
        memcpy(s->shapes, point.shapes, sizeof s->shapes);
        s->cost = point.cost;
        gonio_analytic_point_release(&point);
    }
    return status;
}

static int by_cost(const void *a, const void *b) {
    const start *x = a, *y = b;
    return x->cost < y->cost ? -1 : x->cost > y->cost;
}

static gonio_status descend(const gonio_analytic_problem *problem, start *starts, size_t n, int iterations, int threads,
                            gonio_error *error) {
    descents d = {problem, starts, iterations};
    const gonio_status status = gonio_pool_try(threads, n, go_down, &d, error);
    qsort(starts, n, sizeof *starts, by_cost);
    return status;
}

// Starts of `lobes` lobes from the best ones of one less (none for the first).
static gonio_status add_lobe(const gonio_analytic_problem *problem, int lobes, const start *before, size_t n_before,
                             start *best, size_t *n, gonio_error *error) {
    const gonio_analytic_layout *layout = problem->layout;
    gonio_analytic_point point;
    const gonio_status status = gonio_analytic_point_init(&point, problem, error);
    *n = 0;
    for (size_t from = 0; from <= n_before && status == GONIO_OK; from++) {
        for (size_t k = 0; k < (layout->own > 0 ? TRIED : 1); k++) {
            start new = {.cost = 0};
            for (int lobe = 0; lobe < lobes; lobe++) {
                sequence(layout, k, lobe, new.shapes);
            }
            if (from < n_before) {
                memcpy(new.shapes, before[from].shapes, (size_t)((lobes - 1) * layout->own) * sizeof(double));
            }
            new.cost = rank(problem, &point, new.shapes);
            offer(layout, &new, best, n, CHOSEN);
        }
    }
    if (status == GONIO_OK) {
        gonio_analytic_point_release(&point);
    }
    return status;
}

// The KEPT best starts of all lobes, on few samples.
static gonio_status build(const gonio_analytic_layout *layout, bool isotropic, const gonio_analytic_data *data,
                          int threads, start *best, size_t *n, gonio_analytic_end *end, gonio_error *error) {
    gonio_status status = GONIO_OK;
    start before[KEPT];
    *n = 0;
    for (int lobes = 1; lobes <= layout->lobes && status == GONIO_OK; lobes++) {
        gonio_analytic_layout some;
        gonio_analytic_layout_init(&some, layout->plan, isotropic, lobes);
        const gonio_analytic_problem problem = {&some, data};
        const size_t n_before = *n;
        memcpy(before, best, sizeof before);
        status = add_lobe(&problem, lobes, before, n_before, best, n, error);
        if (status == GONIO_OK) {
            status = descend(&problem, best, *n, DESCENT_FEW, threads, error);
        }
        end->starts = (int)*n;
        end->best = sqrt(2 * best[0].cost / (double)data->n);
        end->worst = sqrt(2 * best[*n - 1].cost / (double)data->n);
        *n = *n < KEPT ? *n : KEPT;
    }
    return status;
}

gonio_status gonio_analytic_search(const gonio_analytic_problem *problem, gonio_analytic_point *point,
                                   gonio_analytic_end *end, int threads, gonio_error *error) {
    const gonio_analytic_layout *layout = problem->layout;
    part few, many;
    start best[CHOSEN + 1];
    size_t n = 0;
    memset(best, 0, sizeof best);
    gonio_status status = part_init(&few, problem->data, FEW + (size_t)(FEW_MORE * layout->shapes), error);
    if (status == GONIO_OK) {
        const bool isotropic = layout->variables == layout->plan->isotropic;
        status = build(layout, isotropic, part_data(&few), threads, best, &n, end, error);
        part_release(&few);
    }
    if (status == GONIO_OK) {
        status = part_init(&many, problem->data, MANY, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_analytic_problem second = {layout, part_data(&many)};
    status = descend(&second, best, n, DESCENT_MANY, threads, error);
    part_release(&many);
    if (status != GONIO_OK) {
        return status;
    }
    rank(problem, point, best[0].shapes);
    return gonio_analytic_minimise(problem, point, DESCENT_ALL, end, error);
}
