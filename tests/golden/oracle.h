// SPDX-License-Identifier: BSD-3-Clause
// The thesis' algorithm, transcribed plainly: the oracle that the fast kernels are held against, and the baseline of
// the benches. Scalar code, float32 lattices, double sums, samples in the order given, no weights, no offset.
//
// Kameya, "A smooth, efficient representation of reflectance" (2002), 2.3; Lee, Wolberg and Shin, "Scattered data
// interpolation with multilevel B-splines" (1997): B-spline approximation (section 3.1), refinement (4.2), hierarchy
// (4). Positions are x[3] in [0, 1]; the lattice of level h has n = 2^h + 3 control points a dimension.
#ifndef TESTS_GOLDEN_ORACLE_H
#define TESTS_GOLDEN_ORACLE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct oracle_lattice {
    int level;
    size_t n;
    float *points;
} oracle_lattice;

static inline void oracle_basis(double t, double b[4]) {
    b[0] = (1 - t) * (1 - t) * (1 - t) / 6;
    b[1] = (3 * t * t * t - 6 * t * t + 4) / 6;
    b[2] = (-3 * t * t * t + 3 * t * t + 3 * t + 1) / 6;
    b[3] = t * t * t / 6;
}

static inline size_t oracle_cell(double x, int level, double *t) {
    const double cells = (double)(1 << level), scaled = x * cells;
    double cell = floor(scaled);
    if (cell > cells - 1) {
        cell = cells - 1;
    }
    *t = scaled - cell;
    return (size_t)cell;
}

static inline double oracle_eval(const oracle_lattice *lattice, const double *x) {
    double t[3], b[3][4], sum = 0;
    size_t cell[3];
    for (int d = 0; d < 3; d++) {
        cell[d] = oracle_cell(x[d], lattice->level, &t[d]);
        oracle_basis(t[d], b[d]);
    }
    const size_t n = lattice->n;
    for (size_t i = 0; i < 4; i++) {
        for (size_t j = 0; j < 4; j++) {
            for (size_t k = 0; k < 4; k++) {
                const size_t at = ((cell[0] + i) * n + cell[1] + j) * n + cell[2] + k;
                sum += b[0][i] * b[1][j] * b[2][k] * (double)lattice->points[at];
            }
        }
    }
    return sum;
}

static inline oracle_lattice oracle_new(int level) {
    const size_t n = ((size_t)1 << level) + 3;
    return (oracle_lattice){level, n, calloc(n * n * n, sizeof(float))};
}

// One B-spline approximation of the residuals at one level.
static inline oracle_lattice oracle_approximate(int level, size_t count, const double *x, const double *residual) {
    oracle_lattice lattice = oracle_new(level);
    const size_t n = lattice.n;
    double *delta = calloc(n * n * n, sizeof *delta), *omega = calloc(n * n * n, sizeof *omega);
    for (size_t s = 0; s < count; s++) {
        double t[3], b[3][4], squares = 0;
        size_t cell[3];
        for (int d = 0; d < 3; d++) {
            cell[d] = oracle_cell(x[3 * s + (size_t)d], level, &t[d]);
            oracle_basis(t[d], b[d]);
        }
        for (int p = 0; p < 64; p++) {
            const double w = b[0][p / 16] * b[1][p / 4 % 4] * b[2][p % 4];
            squares += w * w;
        }
        for (size_t i = 0; i < 4; i++) {
            for (size_t j = 0; j < 4; j++) {
                for (size_t k = 0; k < 4; k++) {
                    const double w = b[0][i] * b[1][j] * b[2][k];
                    const size_t at = ((cell[0] + i) * n + cell[1] + j) * n + cell[2] + k;
                    delta[at] += w * w * (w * residual[s] / squares);
                    omega[at] += w * w;
                }
            }
        }
    }
    for (size_t i = 0; i < n * n * n; i++) {
        lattice.points[i] = omega[i] > 0 ? (float)(delta[i] / omega[i]) : 0;
    }
    free(delta);
    free(omega);
    return lattice;
}

// Coarse points around fine point f along one axis, with their weights (Lee et al. 1997, 4.2).
static inline int oracle_parents(size_t f, size_t parent[3], double weight[3]) {
    if (f % 2 == 0) {
        parent[0] = f / 2;
        parent[1] = f / 2 + 1;
        weight[0] = weight[1] = 0.5;
        return 2;
    }
    parent[0] = f / 2;
    parent[1] = f / 2 + 1;
    parent[2] = f / 2 + 2;
    weight[0] = weight[2] = 0.125;
    weight[1] = 0.75;
    return 3;
}

static inline oracle_lattice oracle_refine(const oracle_lattice *coarse) {
    oracle_lattice fine = oracle_new(coarse->level + 1);
    for (size_t f = 0; f < fine.n * fine.n * fine.n; f++) {
        size_t parent[3][3];
        double weight[3][3], sum = 0;
        const int a = oracle_parents(f / fine.n / fine.n, parent[0], weight[0]);
        const int b = oracle_parents(f / fine.n % fine.n, parent[1], weight[1]);
        const int c = oracle_parents(f % fine.n, parent[2], weight[2]);
        for (int i = 0; i < a; i++) {
            for (int j = 0; j < b; j++) {
                for (int k = 0; k < c; k++) {
                    const size_t at = (parent[0][i] * coarse->n + parent[1][j]) * coarse->n + parent[2][k];
                    sum += weight[0][i] * weight[1][j] * weight[2][k] * (double)coarse->points[at];
                }
            }
        }
        fine.points[f] = (float)sum;
    }
    return fine;
}

// All levels from 0; residual (count, in: the values) is left with what remains. The caller frees .points.
static inline oracle_lattice oracle_fit(int level, size_t count, const double *x, double *residual) {
    oracle_lattice total = {0};
    for (int h = 0; h <= level; h++) {
        oracle_lattice phi = oracle_approximate(h, count, x, residual);
        for (size_t s = 0; s < count; s++) {
            residual[s] -= oracle_eval(&phi, x + 3 * s);
        }
        if (h > 0) {
            oracle_lattice refined = oracle_refine(&total);
            for (size_t i = 0; i < phi.n * phi.n * phi.n; i++) {
                phi.points[i] += refined.points[i];
            }
            free(refined.points);
            free(total.points);
        }
        total = phi;
    }
    return total;
}

#endif
