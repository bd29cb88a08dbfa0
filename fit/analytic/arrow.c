// SPDX-License-Identifier: BSD-3-Clause
// The normal equations of shapes and strengths, an arrow:
//   | core   side_1' .. side_C' |   shapes
//   | side_1 block_1            |   strengths of channel 1
//   |   ..             ..       |
// solved by eliminating the channels: (core - sum side' block^-1 side) x = right - sum side' block^-1 right_c.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/analytic/problem.h"
#include "fit/smooth/matrix.h"

#define S GONIO_ANALYTIC_SHAPES_MAX
#define K GONIO_ANALYTIC_STRENGTHS_MAX

gonio_status gonio_arrow_init(gonio_arrow *a, const gonio_analytic_problem *problem, gonio_error *error) {
    const size_t s = (size_t)problem->layout->shapes, k = (size_t)problem->layout->strengths;
    const size_t c = (size_t)problem->data->channels, unknowns = s + c * k;
    *a = (gonio_arrow){.shapes = (int)s, .strengths = (int)k, .channels = (int)c};
    a->core = malloc((s * s + c * k * s + c * k * k + 2 * unknowns + c * k * (s + 1 + k) + 1) * sizeof *a->core);
    a->held = calloc(unknowns + 1, sizeof *a->held);
    if (a->core == NULL || a->held == NULL) {
        gonio_arrow_release(a);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the strengths of %zu channels", c);
    }
    a->side = a->core + s * s;
    a->block = a->side + c * k * s;
    a->right = a->block + c * k * k;
    a->step = a->right + unknowns;
    a->scratch = a->step + unknowns;
    return GONIO_OK;
}

void gonio_arrow_release(gonio_arrow *a) {
    free(a->core);
    free(a->held);
    *a = (gonio_arrow){0};
}

// One residual r with its derivatives: by_shape[s] and by_strength[k] (the channel's).
static void add(gonio_arrow *a, int channel, double r, const double *by_shape, const double *by_strength) {
    const int s = a->shapes, k = a->strengths;
    double *side = a->side + channel * k * s, *block = a->block + channel * k * k, *right = a->right + s + channel * k;
    for (int m = 0; m < s; m++) {
        a->right[m] -= by_shape[m] * r;
        for (int l = 0; l <= m; l++) {
            a->core[m * s + l] += by_shape[m] * by_shape[l];
        }
    }
    for (int m = 0; m < k; m++) {
        right[m] -= by_strength[m] * r;
        for (int l = 0; l < s; l++) {
            side[m * s + l] += by_strength[m] * by_shape[l];
        }
        for (int l = 0; l <= m; l++) {
            block[m * k + l] += by_strength[m] * by_strength[l];
        }
    }
}

static void add_prices(gonio_arrow *a, const gonio_analytic_problem *problem, const gonio_analytic_point *point,
                       int channel) {
    const gonio_analytic_layout *layout = problem->layout;
    for (int k = 0; k < a->strengths; k++) {
        const double *unit;
        const double price = gonio_analytic_price(problem, point, channel, k, &unit);
        double by_shape[S] = {0}, by_strength[K] = {0};
        for (int j = 0; j < layout->own && price > 0; j++) {
            by_shape[layout->strength[k].lobe * layout->own + j] = GONIO_ANALYTIC_PRICE * unit[1 + j] / unit[0];
        }
        if (price > 0) {
            by_strength[k] = GONIO_ANALYTIC_PRICE / point->strengths[channel * a->strengths + k];
            add(a, channel, price, by_shape, by_strength);
        }
    }
}

static void mirror(int n, double *m) {
    for (int i = 0; i < n; i++) {
        for (int j = i + 1; j < n; j++) {
            m[i * n + j] = m[j * n + i];
        }
    }
}

void gonio_arrow_fill(gonio_arrow *a, const gonio_analytic_problem *problem, const gonio_analytic_point *point) {
    const int s = a->shapes, k = a->strengths, stride = 1 + GONIO_ANALYTIC_OWN_MAX;
    memset(a->core, 0, (size_t)(a->scratch - a->core) * sizeof *a->core);
    for (int c = 0; c < a->channels; c++) {
        for (size_t i = 0; i < problem->data->n; i++) {
            double by_shape[S], by_strength[K], slope;
            const double *unit = point->units + i * (size_t)(k * stride);
            const double f = gonio_analytic_value_at(problem, point, c, i, by_shape);
            const double r = gonio_analytic_residual(problem->data, c, i, f, &slope);
            for (int m = 0; m < s; m++) {
                by_shape[m] *= slope;
            }
            for (int m = 0; m < k; m++) {
                by_strength[m] = unit[m * stride] * slope;
            }
            add(a, c, r, by_shape, by_strength);
        }
        add_prices(a, problem, point, c);
        mirror(k, a->block + c * k * k);
    }
    mirror(s, a->core);
}

// Cholesky of n x n in place (rows one after another, lower triangle); false: a pivot is lost to rounding.
static bool factor(int n, double *m, double least) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = m[i * n + j];
            for (int k = 0; k < j; k++) {
                sum -= m[i * n + k] * m[j * n + k];
            }
            if (i == j && !(sum > least * m[i * n + i])) {
                return false;
            }
            m[i * n + j] = i == j ? sqrt(sum) : sum / m[j * n + j];
        }
    }
    return true;
}

static void forward(int n, const double *l, double *x, int step) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++) {
            x[i * step] -= l[i * n + j] * x[j * step];
        }
        x[i * step] /= l[i * n + i];
    }
}

static void backward(int n, const double *l, double *x, int step) {
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) {
            x[i * step] -= l[j * n + i] * x[j * step];
        }
        x[i * step] /= l[i * n + i];
    }
}

// What is held keeps a row of its own, and so does what no residual depends on.
static bool out(const gonio_arrow *a, int unknown, double diagonal) { return a->held[unknown] || !(diagonal > 0); }

// The channel's block damped and factored into l, and l^-1 (side, right) into w [k][s + 1].
static bool eliminate(const gonio_arrow *a, int channel, double lambda, double *l, double *w) {
    const int s = a->shapes, k = a->strengths;
    const double *block = a->block + channel * k * k, *side = a->side + channel * k * s;
    for (int m = 0; m < k; m++) {
        const int me = s + channel * k + m;
        const bool away = out(a, me, block[m * k + m]);
        for (int j = 0; j < k; j++) {
            const bool other = out(a, s + channel * k + j, block[j * k + j]);
            l[m * k + j] = m == j ? (away ? 1 : block[m * k + m] * (1 + lambda)) : away || other ? 0 : block[m * k + j];
        }
        for (int j = 0; j < s; j++) {
            w[m * (s + 1) + j] = away || out(a, j, a->core[j * s + j]) ? 0 : side[m * s + j];
        }
        w[m * (s + 1) + s] = away ? 0 : a->right[me];
    }
    if (!factor(k, l, 1e-15)) {
        return false;
    }
    for (int j = 0; j <= s; j++) {
        forward(k, l, w + j, s + 1);
    }
    return true;
}

// The Schur complement of the shapes, and its right side, not factored; l and w of every channel go to a->scratch.
static bool reduce(const gonio_arrow *a, double lambda, double *core, double *x) {
    const int s = a->shapes, k = a->strengths;
    for (int m = 0; m < s; m++) {
        const bool away = out(a, m, a->core[m * s + m]);
        for (int j = 0; j < s; j++) {
            const bool other = out(a, j, a->core[j * s + j]);
            core[m * s + j] = m == j          ? (away ? 1 : a->core[m * s + m] * (1 + lambda))
                              : away || other ? 0
                                              : a->core[m * s + j];
        }
        x[m] = away ? 0 : a->right[m];
    }
    for (int c = 0; c < a->channels; c++) {
        double *l = a->scratch + (ptrdiff_t)c * k * (k + s + 1), *w = l + k * k;
        if (!eliminate(a, c, lambda, l, w)) {
            return false;
        }
        for (int m = 0; m < s; m++) {
            for (int i = 0; i < k; i++) {
                const double left = w[i * (s + 1) + m];
                for (int j = 0; j < s; j++) {
                    core[m * s + j] -= left * w[i * (s + 1) + j];
                }
                x[m] -= left * w[i * (s + 1) + s];
            }
        }
    }
    return true;
}

bool gonio_arrow_solve(gonio_arrow *a, double lambda) {
    const int s = a->shapes, k = a->strengths;
    double core[S * S], *x = a->step;
    if (!reduce(a, lambda, core, x) || !factor(s, core, 0)) {
        return false;
    }
    forward(s, core, x, 1);
    backward(s, core, x, 1);
    for (int c = 0; c < a->channels; c++) {
        const double *l = a->scratch + (ptrdiff_t)c * k * (k + s + 1), *w = l + k * k;
        double *y = x + s + c * k;
        for (int i = 0; i < k; i++) {
            y[i] = w[i * (s + 1) + s];
            for (int j = 0; j < s; j++) {
                y[i] -= w[i * (s + 1) + j] * x[j];
            }
        }
        backward(k, l, y, 1);
    }
    for (int m = 0; m < s + a->channels * k; m++) {
        if (!isfinite(x[m])) {
            return false;
        }
    }
    return true;
}

// ---- the covariance ----

// Eigenvalues below this share of the largest are rounding of the normal matrix.
#define LOST 1e-14

// The inverse of a symmetric matrix [n][n], by its eigenvectors with the diagonal scaled to 1; returns the condition
// number of the scaled matrix. A direction without curvature makes every unknown that takes part in it infinite.
static double invert(int n, double *m, const bool *held, bool *infinite) {
    double scale[S + K], vectors[(S + K) * (S + K)], values[S + K];
    for (int i = 0; i < n; i++) {
        scale[i] = m[i * n + i] > 0 && !held[i] ? 1 / sqrt(m[i * n + i]) : 0;
        infinite[i] = scale[i] == 0 && !held[i];
    }
    for (int i = 0; i < n * n; i++) {
        vectors[i] = i / n == i % n && held[i / n] ? 1 : m[i] * scale[i / n] * scale[i % n];
    }
    memset(m, 0, (size_t)(n * n) * sizeof *m);
    if (n == 0 || !gonio_eigen((size_t)n, vectors, values)) {
        return INFINITY;
    }
    for (int v = 0; v < n; v++) {
        const double *at = vectors + v * n;
        for (int i = 0; i < n; i++) {
            infinite[i] = infinite[i] || (values[v] <= LOST * values[n - 1] && fabs(at[i]) > 1e-6);
            for (int j = 0; j < n && values[v] > LOST * values[n - 1]; j++) {
                m[i * n + j] += at[i] * at[j] / values[v] * scale[i] * scale[j];
            }
        }
    }
    return values[0] > LOST * values[n - 1] ? values[n - 1] / values[0] : INFINITY;
}

// Block of the shapes and one channel: its inverse is the channel's covariance but for what the other channels add to
// the shapes' knowledge, so their Schur complements are taken off first.
static void joint_of(const gonio_arrow *a, int channel, const double *core, double *m) {
    const int s = a->shapes, k = a->strengths, n = s + k;
    const double *block = a->block + channel * k * k, *side = a->side + channel * k * s;
    const double *w = a->scratch + (ptrdiff_t)channel * k * (k + s + 1) + k * k;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            const bool shape_i = i < s, shape_j = j < s;
            double sum = 0;
            if (shape_i && shape_j) {
                sum = core[i * s + j];
                for (int q = 0; q < k; q++) { // this channel's own elimination, undone
                    sum += w[q * (s + 1) + i] * w[q * (s + 1) + j];
                }
            } else {
                sum = shape_i ? side[(j - s) * s + i] : shape_j ? side[(i - s) * s + j] : block[(i - s) * k + j - s];
            }
            m[i * n + j] = sum;
        }
    }
}

double gonio_arrow_variances(gonio_arrow *a, double *variances) {
    const int s = a->shapes, k = a->strengths, n = s + k;
    double core[S * S], x[S], m[(S + K) * (S + K)], condition = 1;
    // A damping that rounding hides lets blocks without curvature be eliminated.
    const bool reduced = reduce(a, 1e-13, core, x);
    for (int c = 0; c < a->channels; c++) {
        bool infinite[S + K], held[S + K];
        for (int i = 0; i < n; i++) {
            held[i] = a->held[i < s ? i : s + c * k + i - s];
        }
        double own = INFINITY;
        if (reduced) {
            joint_of(a, c, core, m);
            own = invert(n, m, held, infinite);
        }
        condition = fmax(condition, own);
        for (int i = 0; i < n; i++) {
            const int me = i < s ? i : s + c * k + i - s;
            variances[me] = !reduced || infinite[i] ? INFINITY : m[i * n + i];
        }
    }
    return condition;
}
