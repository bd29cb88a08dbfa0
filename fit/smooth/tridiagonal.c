// SPDX-License-Identifier: BSD-3-Clause
// Symmetric tridiagonal eigenproblems (fit/smooth/tridiagonal.h).
//
// Small ones: implicit QR steps with Wilkinson's shift (Golub & Van Loan 2013, "Matrix computations", algorithm 8.3.2).
// Large ones: Cuppen's division. T = diag(T1, T2) + rho u u^T, so with T1 = Q1 D1 Q1^T and T2 = Q2 D2 Q2^T it remains
// to decompose D + rho z z^T, whose values are the roots of the secular equation 1 + rho sum z_i^2 / (d_i - x) = 0.
// Where z_i vanishes, or two d_i meet, a vector is final ("deflation"), which in covariance matrices most are. The roots'
// distances to the d_i are kept, and z is then replaced by the one of which they are exact roots (Gu & Eisenstat 1994,
// "A stable and efficient algorithm for the rank-one modification of the symmetric eigenproblem", eq. 3.3): so the
// vectors are orthogonal although each is computed alone.
#include "fit/smooth/tridiagonal.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/smooth/kernels.h"
#include "fit/smooth/matrix.h"

#define STEPS 60        // a value; two to three are usual
#define LEAF 24         // smaller problems are not divided
#define EVALUATIONS 200 // of the secular equation for one root; five to seven are usual

// One step on the rows p..q.
static void step_once(size_t p, size_t q, double *d, double *e, size_t rows, size_t step, double *vectors) {
    const double half = 0.5 * (d[q - 1] - d[q]), last = e[q - 1];
    const double shift = d[q] - last * last / (half + copysign(sqrt(half * half + last * last), half));
    double x = d[p] - shift, y = e[p];
    for (size_t k = p; k < q; k++) {
        const double r = sqrt(x * x + y * y), c = r > 0 ? x / r : 1, s = r > 0 ? y / r : 0;
        if (k > p) {
            e[k - 1] = r;
        }
        const double h = 2 * c * e[k] + s * (d[k + 1] - d[k]);
        d[k] += s * h;
        d[k + 1] -= s * h;
        x = e[k] = c * h - e[k];
        if (k + 1 < q) {
            y = s * e[k + 1];
            e[k + 1] *= c;
        }
        if (vectors != NULL) {
            gonio_kernels_best()->turn(rows, c, s, vectors + k * step, vectors + (k + 1) * step);
        }
    }
}

bool gonio_tridiagonal_steps(size_t n, double *d, double *e, size_t rows, size_t step, double *vectors) {
    double norm = 0;
    for (size_t k = 0; k < n; k++) {
        norm = fmax(norm, fmax(fabs(d[k]), k + 1 < n ? fabs(e[k]) : 0));
    }
    size_t q = n > 0 ? n - 1 : 0;
    for (int left = STEPS; q > 0 && left > 0; left--) {
        size_t p = q; // p..q: all of their e are other than zero
        while (p > 0 && !(fabs(e[p - 1]) <= DBL_EPSILON * (fabs(d[p - 1]) + fabs(d[p]) + DBL_EPSILON * norm))) {
            p--;
        }
        if (p == q) {
            q--;
            left = STEPS + 1;
        } else {
            step_once(p, q, d, e, rows, step, vectors);
        }
    }
    return q == 0;
}

// ---- the secular equation ----

typedef struct secular {
    size_t n;
    const double *pole, *weight; // ascending; rho z^2, positive
} secular;

static void measure_from(const secular *s, size_t origin, double *delta) {
    for (size_t i = 0; i < s->n; i++) {
        delta[i] = s->pole[i] - s->pole[origin];
    }
}

// The step from x to the root of c + a / (delta_p - x) + b / (delta_q - x) that has the value and the slopes of the
// sums below and above there (the "middle way" of Li 1993, "Solving secular equations stably and efficiently").
static double middle_way(double p, double q, double value, double below, double above, bool last) {
    const double c = value - p * below - q * above, a = (p + q) * value - p * q * (below + above), b = p * q * value;
    const double root = sqrt(fmax(a * a - 4 * b * c, 0));
    if (last) {
        return a >= 0 ? (a + root) / (2 * c) : 2 * b / (a - root);
    }
    return a <= 0 ? (a - root) / (2 * c) : 2 * b / (a + root);
}

// The j-th root: delta becomes pole - root for every pole, free of cancellation. n >= 2.
static double secular_root(const secular *s, size_t j, double *delta) {
    const bool last = j + 1 == s->n;
    double below[2], above[2], low = 0, high = 0, x;
    size_t origin = j; // the nearer pole
    measure_from(s, origin, delta);
    if (last) {
        for (size_t i = 0; i < s->n; i++) {
            high += s->weight[i];
        }
        high *= 1 + 4 * DBL_EPSILON;
        x = 0.5 * high;
    } else {
        x = 0.5 * delta[j + 1];
        gonio_kernels_best()->secular(s->n, delta, s->weight, x, below);
        if (1 + below[0] < 0) {
            origin = j + 1;
            measure_from(s, origin, delta);
            low = x = 0.5 * delta[j];
        } else {
            high = x;
        }
    }
    const gonio_kernels *const kernels = gonio_kernels_best();
    const size_t split = last ? j : j + 1; // the terms below are negative, those above positive; the last root: but one
    for (int i = 0; i < EVALUATIONS; i++) {
        kernels->secular(split, delta, s->weight, x, below);
        kernels->secular(s->n - split, delta + split, s->weight + split, x, above);
        const double value = 1 + below[0] + above[0], slope = below[1] + above[1];
        if (fabs(value) <= DBL_EPSILON * (8 * (1 + fabs(below[0]) + fabs(above[0])) + fabs(x) * slope)) {
            break;
        }
        *(value < 0 ? &low : &high) = x;
        double by = middle_way(delta[split - 1] - x, delta[split] - x, value, below[1], above[1], last);
        by = value * by < 0 ? by : -value / slope;
        double next = x + by;
        next = next > low && next < high ? next : 0.5 * (low + high);
        if (next == x || next == low || next == high) {
            break;
        }
        x = next;
    }
    for (size_t i = 0; i < s->n; i++) {
        delta[i] -= x;
    }
    return s->pole[origin] + x;
}

// squared[i] *= delta[i] / (pole[i] - pole[j]) for i other than j, and delta[j] for that.
static void refine(size_t n, size_t j, const double *pole, const double *delta, double *squared) {
    for (size_t i = 0; i < j; i++) {
        squared[i] *= delta[i] / (pole[i] - pole[j]);
    }
    squared[j] *= -delta[j];
    for (size_t i = j + 1; i < n; i++) {
        squared[i] *= delta[i] / (pole[i] - pole[j]);
    }
}

// ---- dividing ----

enum { UPPER, BOTH, LOWER, DEFLATED }; // the half in which a column is other than zero

typedef struct divide {
    size_t n;
    double *d, *e, *vectors;
    double *packed, *inner;                       // n x n each
    double *z, *pole, *weight, *value, *sum;      // n each
    size_t *order;                                // columns by ascending d, of each part solved so far
    size_t *kept, *place, *final;                 // n each
    unsigned char *half;                          // of each column
} divide;

static void sort(const double *d, size_t n, size_t *index) {
    for (size_t i = 1; i < n; i++) { // nearly sorted already, or short
        const size_t at = index[i];
        size_t k = i;
        for (; k > 0 && d[index[k - 1]] > d[at]; k--) {
            index[k] = index[k - 1];
        }
        index[k] = at;
    }
}

// Merge two sorted stretches of indices into out.
static void merge_order(const double *d, const size_t *a, size_t n, const size_t *b, size_t m, size_t *out) {
    size_t i = 0, j = 0;
    while (i < n || j < m) {
        const bool first = j == m || (i < n && d[a[i]] <= d[b[j]]);
        *out++ = first ? a[i++] : b[j++];
    }
}

// Sort out the vectors that are final: *kept columns are left to solve, *final are done.
static void deflate(divide *v, size_t low, size_t high, double rho, size_t *kept, size_t *final) {
    double largest = 0;
    for (size_t k = low; k < high; k++) {
        largest = fmax(largest, fmax(fabs(v->d[k]), fabs(v->z[k])));
    }
    const double tolerance = 8 * DBL_EPSILON * largest;
    *kept = *final = 0;
    for (size_t k = low; k < high; k++) {
        const size_t at = v->order[k];
        if (rho * fabs(v->z[at]) <= tolerance) {
            v->final[(*final)++] = at;
            continue;
        }
        if (*kept > 0) {
            const size_t before = v->kept[*kept - 1];
            const double r = sqrt(v->z[at] * v->z[at] + v->z[before] * v->z[before]);
            const double c = v->z[at] / r, s = -v->z[before] / r, gap = v->d[at] - v->d[before];
            if (fabs(gap * c * s) <= tolerance) { // as good as equal: turned so that the one before is final
                v->z[at] = r;
                v->z[before] = 0;
                gonio_kernels_best()->turn(high - low, c, s, v->vectors + before * v->n + low,
                                       v->vectors + at * v->n + low);
                v->half[at] = v->half[at] == v->half[before] ? v->half[at] : BOTH;
                const double moved = v->d[before] * c * c + v->d[at] * s * s;
                v->d[at] = v->d[before] * s * s + v->d[at] * c * c;
                v->d[before] = moved;
                v->final[(*final)++] = before;
                v->kept[*kept - 1] = at;
                continue;
            }
        }
        v->kept[(*kept)++] = at;
    }
    sort(v->d, *final, v->final);
}

// inner (kept x kept): the vectors of D + rho z z^T, rows in `place`s; value: their values.
static void solve_inner(divide *v, size_t kept, double rho) {
    for (size_t i = 0; i < kept; i++) {
        v->pole[i] = v->d[v->kept[i]];
        v->weight[i] = rho * v->z[v->kept[i]] * v->z[v->kept[i]];
        v->sum[i] = 1;
    }
    const secular s = {kept, v->pole, v->weight};
    if (kept == 1) {
        v->value[0] = v->pole[0] + v->weight[0];
        v->inner[0] = 1;
        return;
    }
    for (size_t j = 0; j < kept; j++) {
        v->value[j] = secular_root(&s, j, v->inner + j * kept);
        refine(kept, j, v->pole, v->inner + j * kept, v->sum);
    }
    for (size_t i = 0; i < kept; i++) {
        v->sum[i] = copysign(sqrt(fabs(v->sum[i])), v->z[v->kept[i]]);
    }
    for (size_t j = 0; j < kept; j++) {
        double *column = v->inner + j * kept;
        for (size_t i = 0; i < kept; i++) {
            v->weight[v->place[i]] = v->sum[i] / column[i];
        }
        const double length = sqrt(gonio_dot(kept, v->weight, v->weight));
        for (size_t i = 0; i < kept; i++) {
            column[i] = v->weight[i] / length;
        }
    }
}

// Turn the kept columns by `inner` and put the final ones behind them.
static void turn_columns(divide *v, size_t low, size_t middle, size_t high, size_t kept, size_t final,
                         const size_t count[3]) {
    const size_t n = v->n, rows = high - low, top = middle - low, bottom = high - middle;
    const size_t uppers = count[UPPER] + count[BOTH], lowers = count[BOTH] + count[LOWER];
    double *upper = v->packed, *lower = upper + top * uppers, *rest = lower + bottom * lowers;
    for (size_t i = 0; i < kept; i++) {
        const double *column = v->vectors + v->kept[i] * n;
        if (v->place[i] < uppers) {
            memcpy(upper + v->place[i] * top, column + low, top * sizeof *upper);
        }
        if (v->place[i] >= count[UPPER]) {
            memcpy(lower + (v->place[i] - count[UPPER]) * bottom, column + middle, bottom * sizeof *lower);
        }
    }
    for (size_t i = 0; i < final; i++) {
        memcpy(rest + i * rows, v->vectors + v->final[i] * n + low, rows * sizeof *rest);
        v->sum[i] = v->d[v->final[i]];
    }
    const gonio_matrix inner = gonio_matrix_of(v->inner, kept, kept), all = gonio_matrix_of(v->vectors, n, n);
    gonio_multiply(1, gonio_matrix_of(upper, top, uppers), gonio_matrix_part(inner, 0, 0, uppers, kept), 0,
                   gonio_matrix_part(all, low, low, top, kept));
    gonio_multiply(1, gonio_matrix_of(lower, bottom, lowers),
                   gonio_matrix_part(inner, count[UPPER], 0, lowers, kept), 0,
                   gonio_matrix_part(all, middle, low, bottom, kept));
    for (size_t i = 0; i < final; i++) {
        memcpy(v->vectors + (low + kept + i) * n + low, rest + i * rows, rows * sizeof *rest);
        v->d[low + kept + i] = v->sum[i];
    }
    memcpy(v->d + low, v->value, kept * sizeof *v->d);
}

static void join(divide *v, size_t low, size_t middle, size_t high, double rho) {
    const double root = sqrt(0.5); // |z|^2 is 2
    for (size_t k = low; k < high; k++) {
        const size_t row = k < middle ? middle - 1 : middle;
        v->z[k] = v->vectors[k * v->n + row] * (k >= middle && rho < 0 ? -root : root);
        v->half[k] = k < middle ? UPPER : LOWER;
    }
    rho = 2 * fabs(rho);
    merge_order(v->d, v->order + low, middle - low, v->order + middle, high - middle, v->kept);
    memcpy(v->order + low, v->kept, (high - low) * sizeof *v->order);
    size_t kept, final, count[3] = {0}, first[3];
    deflate(v, low, high, rho, &kept, &final);
    for (size_t i = 0; i < kept; i++) {
        count[v->half[v->kept[i]]]++;
    }
    first[UPPER] = 0;
    first[BOTH] = count[UPPER];
    first[LOWER] = count[UPPER] + count[BOTH];
    for (size_t i = 0; i < kept; i++) {
        v->place[i] = first[v->half[v->kept[i]]]++;
    }
    solve_inner(v, kept, rho);
    turn_columns(v, low, middle, high, kept, final, count);
    for (size_t k = 0; k < high - low; k++) {
        v->place[k] = low + k;
    }
    merge_order(v->d, v->place, kept, v->place + kept, final, v->order + low);
}

static bool solve(divide *v, size_t low, size_t high) {
    if (high - low <= LEAF) {
        for (size_t k = low; k < high; k++) {
            v->vectors[k * v->n + k] = 1;
            v->order[k] = k;
        }
        if (!gonio_tridiagonal_steps(high - low, v->d + low, v->e + low, high - low, v->n,
                                     v->vectors + low * v->n + low)) {
            return false;
        }
        sort(v->d, high - low, v->order + low);
        return true;
    }
    const size_t middle = low + (high - low) / 2;
    const double rho = v->e[middle - 1];
    v->d[middle - 1] -= fabs(rho);
    v->d[middle] -= fabs(rho);
    if (!solve(v, low, middle) || !solve(v, middle, high)) {
        return false;
    }
    join(v, low, middle, high, rho);
    return true;
}

bool gonio_tridiagonal_eigen(size_t n, double *diagonal, double *side, double *vectors) {
    double *numbers = malloc((2 * n + 5) * n * sizeof *numbers);
    size_t *indices = malloc(4 * n * sizeof *indices);
    unsigned char *half = malloc(n);
    bool done = numbers != NULL && indices != NULL && half != NULL;
    if (done) {
        double *small = numbers + 2 * n * n;
        divide v = {n, diagonal, side, vectors, numbers, numbers + n * n, small, small + n, small + 2 * n,
                    small + 3 * n, small + 4 * n, indices, indices + n, indices + 2 * n, indices + 3 * n, half};
        memset(vectors, 0, n * n * sizeof *vectors);
        done = solve(&v, 0, n);
        for (size_t k = 0; k < n && done; k++) {
            memcpy(v.packed + k * n, vectors + v.order[k] * n, n * sizeof *vectors);
            v.z[k] = diagonal[v.order[k]];
        }
        if (done) {
            memcpy(vectors, v.packed, n * n * sizeof *vectors);
            memcpy(diagonal, v.z, n * sizeof *diagonal);
        }
    }
    free(numbers);
    free(indices);
    free(half);
    return done;
}
