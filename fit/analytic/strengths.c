// SPDX-License-Identifier: BSD-3-Clause
// Strengths for given shapes: linear least squares between 0 and a limit, a handful of unknowns a channel.
//
// The active-set method of Lawson and Hanson (Solving least squares problems, 1974, chapter 23) on the normal matrix
// with columns of unit length: all unknowns are free at first, those that leave their bounds are held there, and one
// whose gradient points back is freed again. The solution is refined once with the residuals themselves, since a normal
// matrix squares the condition. A column that the others make up within rounding gets no strength.
//
// Residuals of logarithms are not linear in the strengths: there it is Gauss and Newton's method, begun with weights of
// 1/y, which neither the peak nor the dark directions rule.
#include <math.h>
#include <string.h>

#include "fit/analytic/problem.h"

#define MAX GONIO_ANALYTIC_STRENGTHS_MAX
#define STRIDE (1 + GONIO_ANALYTIC_OWN_MAX)
#define DEPENDENT 1e-13 // of a column's square: what the others leave of it is rounding

typedef struct normal {
    int n;
    double a[MAX][MAX], b[MAX];
} normal;

// x of the free unknowns of a x = b; held and dependent ones stay as they are.
static void solve_free(const normal *m, const bool *is_free, double *x) {
    double l[MAX][MAX], z[MAX];
    int of[MAX], count = 0;
    for (int i = 0; i < m->n; i++) {
        if (!is_free[i]) {
            continue;
        }
        of[count] = i;
        double rest = m->b[i];
        for (int k = 0; k < m->n; k++) {
            rest -= is_free[k] ? 0 : m->a[i][k] * x[k];
        }
        double pivot = m->a[i][i];
        for (int k = 0; k < count; k++) {
            double sum = m->a[i][of[k]];
            for (int j = 0; j < k; j++) {
                sum -= l[count][j] * l[k][j];
            }
            l[count][k] = sum / l[k][k];
            pivot -= l[count][k] * l[count][k];
            rest -= l[count][k] * z[k];
        }
        if (pivot > DEPENDENT * m->a[i][i]) {
            l[count][count] = sqrt(pivot);
            z[count] = rest / l[count][count];
            count++;
        } else {
            x[i] = 0;
        }
    }
    for (int k = count - 1; k >= 0; k--) {
        double sum = z[k];
        for (int j = k + 1; j < count; j++) {
            sum -= l[j][k] * x[of[j]];
        }
        x[of[k]] = sum / l[k][k];
    }
}

// The unknown outside its bounds that is farthest out, or -1.
static int worst_outside(const normal *m, const double *x, double limit) {
    int worst = -1;
    double most = 0;
    for (int i = 0; i < m->n; i++) {
        const double out = fmax(-x[i], x[i] - limit) * sqrt(m->a[i][i]);
        if (out > most) {
            most = out;
            worst = i;
        }
    }
    return worst;
}

// The held unknown whose gradient points farthest back between the bounds, or -1.
static int worst_held(const normal *m, const bool *is_free, const double *x) {
    int worst = -1;
    double most = 1e-12;
    for (int i = 0; i < m->n; i++) {
        double down = m->b[i], size = fabs(m->b[i]);
        for (int k = 0; k < m->n; k++) {
            down -= m->a[i][k] * x[k];
            size += fabs(m->a[i][k] * x[k]);
        }
        const double back = size > 0 ? (x[i] > 0 ? -down : down) / size : 0;
        if (!is_free[i] && m->a[i][i] > 0 && back > most) {
            most = back;
            worst = i;
        }
    }
    return worst;
}

static void solve_bounded(const normal *m, double limit, double *x) {
    bool is_free[MAX];
    for (int i = 0; i < m->n; i++) {
        is_free[i] = m->a[i][i] > 0;
        x[i] = 0;
    }
    for (int round = 0; round < 6 * m->n; round++) {
        int at;
        solve_free(m, is_free, x);
        while ((at = worst_outside(m, x, limit)) >= 0) {
            is_free[at] = false;
            x[at] = x[at] > 0 ? limit : 0;
            solve_free(m, is_free, x);
        }
        at = worst_held(m, is_free, x);
        if (at < 0) {
            return;
        }
        is_free[at] = true;
    }
    for (int i = 0; i < m->n; i++) {
        x[i] = fmin(fmax(x[i], 0), limit);
    }
}

// Weight of a squared residual that is linear in f: the loss's own, or 1/y for the logarithm.
static double weight_of(const gonio_analytic_data *data, int channel, size_t i) {
    const double y = fabs(data->y[(size_t)channel * data->n + i]) + data->eps[channel];
    const double scale = data->loss.loss == GONIO_LOSS_LINEAR ? 1 : data->loss.loss == GONIO_LOSS_LOG ? y : y * y;
    return data->weight[i] / scale;
}

// The normal equations of y - f at the strengths x (NULL: 0).
static void fill(const gonio_analytic_problem *problem, const gonio_analytic_point *point, int channel, const double *x,
                 normal *m) {
    const gonio_analytic_data *data = problem->data;
    const int n = problem->layout->strengths;
    *m = (normal){.n = n};
    for (size_t i = 0; i < data->n; i++) {
        const double *unit = point->units + i * (size_t)n * STRIDE;
        const double w = weight_of(data, channel, i);
        double rest =
            data->y[(size_t)channel * data->n + i] - (point->offsets != NULL ? point->offsets[i * STRIDE] : 0);
        for (int k = 0; k < n && x != NULL; k++) {
            rest -= x[k] * unit[k * STRIDE];
        }
        for (int k = 0; k < n; k++) {
            const double wu = w * unit[k * STRIDE];
            m->b[k] += wu * rest;
            for (int j = 0; j <= k; j++) {
                m->a[k][j] += wu * unit[j * STRIDE];
            }
        }
    }
    for (int k = 0; k < n; k++) {
        for (int j = 0; j < k; j++) {
            m->a[j][k] = m->a[k][j];
        }
    }
}

static void solve_linear(const gonio_analytic_problem *problem, const gonio_analytic_point *point, int channel,
                         double *x) {
    const int n = problem->layout->strengths;
    const double limit = problem->layout->limit;
    double correction[MAX] = {0};
    bool is_free[MAX] = {false};
    normal m;
    fill(problem, point, channel, NULL, &m);
    solve_bounded(&m, limit, x);
    fill(problem, point, channel, x, &m);
    for (int k = 0; k < n; k++) {
        is_free[k] = x[k] > 0 && x[k] < limit;
    }
    solve_free(&m, is_free, correction);
    for (int k = 0; k < n; k++) {
        const double refined = x[k] + (is_free[k] ? correction[k] : 0);
        x[k] = isfinite(refined) ? fmin(fmax(refined, 0), limit) : 0;
    }
}

// ---- logarithms ----

// The cost of a channel at the strengths in point, and the normal equations of the strengths that would make the
// linearised residuals 0 (m NULL: not wanted).
static double linearise(const gonio_analytic_problem *problem, const gonio_analytic_point *point, int channel,
                        normal *m) {
    const gonio_analytic_data *data = problem->data;
    const int n = problem->layout->strengths;
    double sum = 0;
    if (m != NULL) {
        *m = (normal){.n = n};
    }
    for (size_t i = 0; i < data->n; i++) {
        const double *unit = point->units + i * (size_t)n * STRIDE;
        double slope;
        const double f = gonio_analytic_value_at(problem, point, channel, i, NULL);
        const double r = gonio_analytic_residual(data, channel, i, f, &slope);
        sum += r * r / 2;
        const double offset = point->offsets != NULL ? point->offsets[i * STRIDE] : 0;
        for (int k = 0; k < n && m != NULL; k++) {
            const double u = slope * unit[k * STRIDE];
            m->b[k] += u * (slope * (f - offset) - r);
            for (int j = 0; j <= k; j++) {
                m->a[k][j] += u * slope * unit[j * STRIDE];
                m->a[j][k] = m->a[k][j];
            }
        }
    }
    return isfinite(sum) ? sum : INFINITY;
}

// Enough for a start: steps that gain less than GAIN of the cost are left to the descent.
enum { NEWTON = 5, HALVINGS = 2 };
#define GAIN 1e-3

static void solve_log(const gonio_analytic_problem *problem, const gonio_analytic_point *point, int channel,
                      double *x) {
    const int n = problem->layout->strengths;
    bool better = true;
    for (int step = 0; step < NEWTON && better; step++) {
        normal m;
        double from[MAX], to[MAX];
        const double cost = linearise(problem, point, channel, &m);
        memcpy(from, x, (size_t)n * sizeof *x);
        solve_bounded(&m, problem->layout->limit, to);
        better = false;
        for (int half = 0; half <= HALVINGS && !better; half++) {
            for (int k = 0; k < n; k++) {
                x[k] = from[k] + ldexp(to[k] - from[k], -half);
            }
            better = linearise(problem, point, channel, NULL) < cost * (1 - GAIN);
        }
        if (!better) {
            memcpy(x, from, (size_t)n * sizeof *x);
        }
    }
}

void gonio_analytic_solve_strengths(const gonio_analytic_problem *problem, gonio_analytic_point *point) {
    for (int c = 0; c < problem->data->channels; c++) {
        double *x = point->strengths + c * problem->layout->strengths;
        solve_linear(problem, point, c, x);
        if (problem->data->loss.loss == GONIO_LOSS_LOG) {
            solve_log(problem, point, c, x);
        }
    }
}
