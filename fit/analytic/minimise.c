// SPDX-License-Identifier: BSD-3-Clause
// Levenberg-Marquardt (Levenberg 1944, Marquardt 1963) within a box.
//
// An unknown at a bound whose gradient points outwards is held there for the step; a step that crosses a bound ends on
// it. Marquardt's damping, a share of the diagonal, makes the path independent of the unknowns' units. A fit without
// noise ends where steps are rounding.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/analytic/problem.h"

#define DAMPING_FIRST 1e-3
#define DAMPING_MOST 1e13 // steps of 1e-13 of the way change nothing more
#define STEP_LEAST 1e-11  // of the range, or of a strength
#define GAIN_LEAST 1e-13  // of the cost
#define NOTHING 1e-12     // of the brightest sample: strengths below are none
#define STEEP 1e-4        // cosine of the angle between the residuals and a column of the Jacobian

static void hold(gonio_arrow *a, const gonio_analytic_problem *problem, const gonio_analytic_point *point) {
    const gonio_analytic_layout *layout = problem->layout;
    for (int m = 0; m < a->shapes; m++) {
        a->held[m] = (point->shapes[m] <= layout->low[m] && a->right[m] <= 0) ||
                     (point->shapes[m] >= layout->high[m] && a->right[m] >= 0);
    }
    for (int m = 0; m < a->channels * a->strengths; m++) {
        const double right = a->right[a->shapes + m];
        a->held[a->shapes + m] =
            (point->strengths[m] <= 0 && right <= 0) || (point->strengths[m] >= layout->limit && right >= 0);
    }
}

// The point a step away, and how long the step is at most, in shares of the ranges and strengths.
static double move(const gonio_analytic_problem *problem, const gonio_analytic_point *from, const gonio_arrow *a,
                   gonio_analytic_point *to) {
    const gonio_analytic_layout *layout = problem->layout;
    double longest = 0;
    for (int m = 0; m < a->shapes; m++) {
        to->shapes[m] = fmin(fmax(from->shapes[m] + a->step[m], layout->low[m]), layout->high[m]);
        longest = fmax(longest, fabs(to->shapes[m] - from->shapes[m]) / (layout->high[m] - layout->low[m]));
    }
    for (int m = 0; m < a->channels * a->strengths; m++) {
        const double x = from->strengths[m];
        // A lobe without strength has no derivative by its shape: it goes towards 0 a tenth at a time, and may turn
        // back.
        to->strengths[m] = fmin(fmax(x + a->step[a->shapes + m], x > NOTHING ? 0.1 * x : 0), layout->limit);
        longest =
            fmax(longest, to->strengths[m] != x ? fabs(to->strengths[m] - x) / fmax(fabs(x), to->strengths[m]) : 0);
    }
    gonio_analytic_units(problem, to);
    if (problem->data->loss.loss != GONIO_LOSS_LOG) {
        gonio_analytic_solve_strengths(problem, to);
    }
    gonio_analytic_cost(problem, to);
    return longest;
}

static void swap(gonio_analytic_point *a, gonio_analytic_point *b) {
    const gonio_analytic_point kept = *a;
    *a = *b;
    *b = kept;
}

// Is the gradient flat, where no step leads down any more?
static bool flat(const gonio_arrow *a, double cost) {
    bool is = true;
    for (int m = 0; m < a->shapes + a->channels * a->strengths; m++) {
        const int k = a->strengths, at = m - a->shapes;
        const double diagonal =
            m < a->shapes ? a->core[m * a->shapes + m] : a->block[at / k * k * k + at % k * k + at % k];
        is = is && (a->held[m] || !(diagonal > 0) || fabs(a->right[m]) <= STEEP * sqrt(2 * cost * diagonal));
    }
    return is;
}

typedef enum state { GOING, ARRIVED, STUCK } state;

// One step downhill, with as much damping as it takes.
static state descend(const gonio_analytic_problem *problem, gonio_arrow *a, gonio_analytic_point *at,
                     gonio_analytic_point *trial, double *damping) {
    for (; *damping < DAMPING_MOST; *damping *= 4) {
        if (!gonio_arrow_solve(a, *damping)) {
            continue;
        }
        const double longest = move(problem, at, a, trial);
        if (longest == 0) {
            return ARRIVED;
        }
        if (trial->cost < at->cost) {
            const bool little = longest < STEP_LEAST || at->cost - trial->cost < GAIN_LEAST * at->cost;
            swap(at, trial);
            *damping = fmax(*damping / 8, 1e-15);
            return little ? ARRIVED : GOING;
        }
        if (longest < STEP_LEAST) {
            return ARRIVED;
        }
    }
    return flat(a, at->cost) ? ARRIVED : STUCK;
}

gonio_status gonio_analytic_minimise(const gonio_analytic_problem *problem, gonio_analytic_point *point, int iterations,
                                     gonio_analytic_end *end, gonio_error *error) {
    gonio_arrow arrow;
    gonio_analytic_point trial;
    gonio_status status = gonio_arrow_init(&arrow, problem, error);
    if (status == GONIO_OK && (status = gonio_analytic_point_init(&trial, problem, error)) != GONIO_OK) {
        gonio_arrow_release(&arrow);
    }
    if (status != GONIO_OK) {
        return status;
    }
    gonio_analytic_units(problem, point);
    gonio_analytic_cost(problem, point);
    double damping = DAMPING_FIRST;
    state now = isfinite(point->cost) ? GOING : STUCK;
    int done = 0;
    for (; done < iterations && now == GOING && point->cost > 0; done++) {
        gonio_arrow_fill(&arrow, problem, point);
        hold(&arrow, problem, point);
        now = descend(problem, &arrow, point, &trial, &damping);
    }
    if (end != NULL) {
        end->converged = now == ARRIVED || point->cost == 0;
        end->iterations = done;
    }
    gonio_analytic_point_release(&trial);
    gonio_arrow_release(&arrow);
    return GONIO_OK;
}
