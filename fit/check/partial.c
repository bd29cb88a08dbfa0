// SPDX-License-Identifier: BSD-3-Clause
#include "fit/check/partial.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "fit/check/neighbours.h"
#include "fit/check/significance.h"
#include "fit/smooth/matrix.h"

enum {
    TERMS = 6,   // columns of X at most
    NEAR = 20,   // neighbours of a local regression: twice the unknowns of the plane and more
    FEWEST = 60, // samples below which nothing is said
    IMAGES = 4,
};
// Relative size of a column's remainder below which neighbours explain it, and so nothing is known of its effect.
static const double explained = 1e-3;

typedef struct problem {
    const gonio_samples *s;
    gonio_symmetry_test symmetry;
    int dims, images, terms;
    double *u;  // [n][images][dims]
    double *x;  // [n][TERMS]
    double *rx; // what is left of x
    double *l;  // [n][NEAR] weights of the regression
    size_t *of; // [n][NEAR] samples that they belong to
    int *found; // [n]
    gonio_neighbours tree;
    // of one channel
    double *y, *sy, *ry, *w, *residual; // [n]: value, its sigma, what is left, weight, residual
} problem;

// ---- coordinates and the terms ----

static void reflect(double *x, int dims, unsigned axes) {
    for (int d = 0; d < dims; d++) {
        x[d] = (axes >> d & 1) != 0 ? 1 - x[d] : x[d];
    }
}

// The sample's images under what changes nothing: exchange (for reciprocity) and the mirror (isotropic coordinates).
static void place(const problem *p, size_t i, gonio_vec3 wi, gonio_vec3 wo) {
    const gonio_coordinates system = GONIO_HALF_VECTOR;
    double *u = p->u + i * (size_t)(p->images * p->dims);
    for (int k = 0; k < p->images; k++, u += p->dims) {
        if (p->dims == 3) {
            gonio_coordinates_isotropic(system, wi, wo, u);
        } else {
            gonio_coordinates_anisotropic(system, wi, wo, u);
        }
        const bool mirrored = p->dims == 3 && k % 2 == 1;
        const bool swapped = p->symmetry == GONIO_TEST_RECIPROCITY && (p->dims == 3 ? k >= 2 : k == 1);
        reflect(u, p->dims, mirrored ? gonio_coordinates_mirror_axes(system, p->dims) : 0);
        reflect(u, p->dims, swapped ? gonio_coordinates_swap_axes(system, p->dims) : 0);
    }
}

// What exchanging the directions turns to its negative: a surplus toward the normal on one side, its change with tilt
// and with azimuth.
static int odd_terms(gonio_vec3 wi, gonio_vec3 wo, double *x) {
    const double d = wi.z - wo.z, in_plane = wi.x * wo.x + wi.y * wo.y;
    x[0] = d;
    x[1] = d * (wi.z + wo.z - 1);
    x[2] = d * in_plane;
    return 3;
}

// What turning the sample changes: one and two periods of the light's azimuth, two of the half vector's.
static int turning_terms(gonio_vec3 wi, gonio_vec3 wo, double *x) {
    const gonio_vec3 h = {wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
    const double length = hypot(h.x, h.y), tilt = h.z > 0 ? tanh(3 * length / h.z) : 1;
    const double c = length > 0 ? h.x / length : 1, s = length > 0 ? h.y / length : 0;
    x[0] = wi.x;
    x[1] = wi.y;
    x[2] = wi.x * wi.x - wi.y * wi.y;
    x[3] = 2 * wi.x * wi.y;
    x[4] = tilt * (c * c - s * s);
    x[5] = tilt * 2 * c * s;
    return 6;
}

// ---- the smooth part taken out ----

// Weights l of the NEAR neighbours: the value at the centre of the plane through them by weighted least squares, a
// little damped so that neighbours in a line do no harm.
static void fit_plane(int dims, int n, const double (*offset)[4], const double *distance2, double *l) {
    double a[25] = {0}, e[5] = {1}, scale = 0;
    const size_t m = (size_t)dims + 1;
    for (int k = 0; k < n; k++) {
        scale = fmax(scale, distance2[k]);
    }
    double row[NEAR][5], weight[NEAR];
    for (int k = 0; k < n; k++) {
        weight[k] = exp(-2 * distance2[k] / (scale > 0 ? scale : 1));
        row[k][0] = 1;
        for (int d = 0; d < dims; d++) {
            row[k][1 + d] = offset[k][d] / (scale > 0 ? sqrt(scale) : 1);
        }
        for (size_t i = 0; i < m; i++) {
            for (size_t j = 0; j <= i; j++) {
                a[j * m + i] += weight[k] * row[k][i] * row[k][j];
            }
        }
    }
    for (size_t i = 1; i < m; i++) {
        a[i * m + i] += 1e-3 * a[0];
    }
    const bool solved = gonio_cholesky(m, a);
    if (solved) {
        gonio_cholesky_solve(m, a, gonio_matrix_of(e, m, 1));
    }
    for (int k = 0; k < n; k++) {
        l[k] = 0;
        for (size_t i = 0; i < m && solved; i++) {
            l[k] += weight[k] * row[k][i] * e[i];
        }
    }
}

static void connect(void *context, size_t i) {
    const problem *p = context;
    const size_t dims = (size_t)p->dims, images = (size_t)p->images;
    const double *u = p->u + i * images * dims;
    gonio_nearest near = {.wanted = NEAR};
    double offset[NEAR][4], l[NEAR];
    gonio_neighbours_find(&p->tree, u, (const size_t[2]){i * images, (i + 1) * images}, &near);
    for (size_t k = 0; k < near.found; k++) {
        for (size_t d = 0; d < dims; d++) {
            offset[k][d] = p->u[near.index[k] * dims + d] - u[d];
        }
    }
    fit_plane(p->dims, (int)near.found, (const double(*)[4])offset, near.distance, l);
    p->found[i] = (int)near.found;
    for (int t = 0; t < p->terms; t++) {
        double left = p->x[i * TERMS + (size_t)t];
        for (size_t k = 0; k < near.found; k++) {
            left -= l[k] * p->x[near.index[k] / images * TERMS + (size_t)t];
        }
        p->rx[i * TERMS + (size_t)t] = left;
    }
    for (size_t k = 0; k < near.found; k++) {
        p->l[i * NEAR + k] = l[k];
        p->of[i * NEAR + k] = near.index[k] / images;
    }
}

// Terms of which neighbours leave nothing are dropped.
static void drop_explained(problem *p) {
    int kept = 0;
    for (int t = 0; t < p->terms; t++) {
        double all = 0, left = 0;
        for (size_t i = 0; i < p->s->n; i++) {
            all += p->x[i * TERMS + (size_t)t] * p->x[i * TERMS + (size_t)t];
            left += p->rx[i * TERMS + (size_t)t] * p->rx[i * TERMS + (size_t)t];
        }
        if (left <= explained * all) {
            continue;
        }
        for (size_t i = 0; i < p->s->n; i++) {
            p->x[i * TERMS + (size_t)kept] = p->x[i * TERMS + (size_t)t];
            p->rx[i * TERMS + (size_t)kept] = p->rx[i * TERMS + (size_t)t];
        }
        kept++;
    }
    p->terms = kept;
}

// ---- one channel ----

static void take_channel(problem *p, size_t c, double eps) {
    const gonio_samples *s = p->s;
    const size_t channels = (size_t)s->channels;
    for (size_t i = 0; i < s->n; i++) {
        const double z = s->values[i * channels + c];
        p->y[i] = asinh(z / (2 * eps));
        p->sy[i] = s->sigma_random != NULL ? s->sigma_random[i * channels + c] / hypot(z, 2 * eps) : 0;
    }
    for (size_t i = 0; i < s->n; i++) {
        p->ry[i] = p->y[i];
        for (int k = 0; k < p->found[i]; k++) {
            p->ry[i] -= p->l[i * NEAR + (size_t)k] * p->y[p->of[i * NEAR + (size_t)k]];
        }
    }
}

// b of the weighted regression of ry on rx; *inverse: its normal matrix' Cholesky factor. False: it is singular.
static bool regress(const problem *p, double *b, double *factor) {
    const size_t m = (size_t)p->terms;
    memset(factor, 0, m * m * sizeof *factor);
    memset(b, 0, m * sizeof *b);
    for (size_t i = 0; i < p->s->n; i++) {
        const double *x = p->rx + i * TERMS;
        for (size_t r = 0; r < m; r++) {
            b[r] += p->w[i] * x[r] * p->ry[i];
            for (size_t q = 0; q <= r; q++) {
                factor[q * m + r] += p->w[i] * x[r] * x[q];
            }
        }
    }
    if (!gonio_cholesky(m, factor)) {
        return false;
    }
    gonio_cholesky_solve(m, factor, gonio_matrix_of(b, m, 1));
    for (size_t i = 0; i < p->s->n; i++) {
        p->residual[i] = p->ry[i];
        for (size_t r = 0; r < m; r++) {
            p->residual[i] -= b[r] * p->rx[i * TERMS + r];
        }
    }
    return true;
}

// Weights from the residuals about each sample: their mean square, or sigma's share where that is more.
static void weigh(problem *p) {
    for (size_t i = 0; i < p->s->n; i++) {
        double own = p->sy[i] * p->sy[i], mean = p->residual[i] * p->residual[i];
        for (int k = 0; k < p->found[i]; k++) {
            const size_t j = p->of[i * NEAR + (size_t)k];
            const double l = p->l[i * NEAR + (size_t)k];
            own += l * l * p->sy[j] * p->sy[j];
            mean += p->residual[j] * p->residual[j];
        }
        p->w[i] = 1 / fmax(fmax(mean / (1 + p->found[i]), own), 1e-24);
    }
}

// b's influence goes through every sample's own error: a_j = w_j x_j - sum_i l_ij w_i x_i. meat = sum a a^T r^2 / (1 +
// l^2): the residual holds the neighbours' errors too. Returns what sigma makes of the trace, over what residuals make.
static double covariance(const problem *p, double *a, double *meat) {
    const size_t m = (size_t)p->terms, n = p->s->n;
    double told = 0, seen = 0;
    memset(a, 0, n * m * sizeof *a);
    memset(meat, 0, m * m * sizeof *meat);
    for (size_t i = 0; i < n; i++) {
        for (size_t r = 0; r < m; r++) {
            const double x = p->w[i] * p->rx[i * TERMS + r];
            a[i * m + r] += x;
            for (int k = 0; k < p->found[i]; k++) {
                a[p->of[i * NEAR + (size_t)k] * m + r] -= p->l[i * NEAR + (size_t)k] * x;
            }
        }
    }
    for (size_t i = 0; i < n; i++) {
        double spread = 1;
        for (int k = 0; k < p->found[i]; k++) {
            spread += p->l[i * NEAR + (size_t)k] * p->l[i * NEAR + (size_t)k];
        }
        const double r2 = p->residual[i] * p->residual[i] / spread;
        for (size_t r = 0; r < m; r++) {
            told += a[i * m + r] * a[i * m + r] * p->sy[i] * p->sy[i];
            seen += a[i * m + r] * a[i * m + r] * r2;
            for (size_t q = 0; q <= r; q++) {
                meat[q * m + r] += a[i * m + r] * a[i * m + q] * r2;
            }
        }
    }
    return seen > 0 ? told / seen : 0;
}

// The rms of X b.
static double effect(const problem *p, const double *b) {
    double squares = 0;
    for (size_t i = 0; i < p->s->n; i++) {
        double x = 0;
        for (int r = 0; r < p->terms; r++) {
            x += b[r] * p->x[i * TERMS + (size_t)r];
        }
        squares += x * x;
    }
    return sqrt(squares / (double)p->s->n);
}

static gonio_status test_channel(problem *p, size_t c, double eps, gonio_check_test *test, double *part,
                                 gonio_error *error) {
    const size_t m = (size_t)p->terms, n = p->s->n;
    double b[TERMS], factor[TERMS * TERMS], meat[TERMS * TERMS], score[TERMS] = {0};
    double *a = malloc(n * m * sizeof *a);
    if (a == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to test %zu samples", n);
    }
    *test = gonio_check_no_test;
    take_channel(p, c, eps);
    for (size_t i = 0; i < n; i++) {
        p->w[i] = 1;
    }
    bool done = regress(p, b, factor);
    for (int round = 0; round < 2 && done; round++) {
        weigh(p);
        done = regress(p, b, factor);
    }
    const double told = done ? covariance(p, a, meat) : 0;
    free(a);
    // b^T (N^-1 meat N^-1)^-1 b = (N b)^T meat^-1 (N b), and N b is the weighted sum of x y.
    for (size_t i = 0; i < n && done; i++) {
        for (size_t r = 0; r < m; r++) {
            score[r] += p->w[i] * p->rx[i * TERMS + r] * p->ry[i];
        }
    }
    if (done && gonio_cholesky(m, meat)) {
        double solved[TERMS];
        memcpy(solved, score, sizeof solved);
        gonio_cholesky_solve(m, meat, gonio_matrix_of(solved, m, 1));
        const double chi2 = gonio_dot(m, score, solved) / fmax(told, 1),
                     p_value = gonio_chi_square_beyond((double)m, chi2);
        *test = (gonio_check_test){chi2, (double)m, p_value, (int)c, p_value};
        *part += effect(p, b) / p->s->channels;
    }
    return GONIO_OK;
}

// ---- all ----

static bool allocate(problem *p) {
    const size_t n = p->s->n;
    p->u = malloc(n * (size_t)(p->images * p->dims) * sizeof *p->u);
    p->x = calloc(n * TERMS, sizeof *p->x);
    p->rx = calloc(n * TERMS, sizeof *p->rx);
    p->l = malloc(n * NEAR * sizeof *p->l);
    p->of = malloc(n * NEAR * sizeof *p->of);
    p->found = malloc(n * sizeof *p->found);
    p->y = malloc(5 * n * sizeof *p->y);
    if (p->y != NULL) {
        p->sy = p->y + n;
        p->ry = p->sy + n;
        p->w = p->ry + n;
        p->residual = p->w + n;
    }
    return p->u != NULL && p->x != NULL && p->rx != NULL && p->l != NULL && p->of != NULL && p->found != NULL &&
           p->y != NULL;
}

static void release(problem *p) {
    gonio_neighbours_free(&p->tree);
    free(p->u);
    free(p->x);
    free(p->rx);
    free(p->l);
    free(p->of);
    free(p->found);
    free(p->y);
}

// Where the logarithm ends: at 3 % of the values' geometric mean, or at the noise's where that is more.
static double floor_of(const gonio_samples *s, size_t c) {
    double sum = 0, noise = 0;
    for (size_t i = 0; i < s->n; i++) {
        const size_t at = i * (size_t)s->channels + c;
        sum += log(fabs(s->values[at]) + 1e-12);
        noise += s->sigma_random != NULL ? log(s->sigma_random[at] + 1e-12) : log(1e-12);
    }
    return fmax(0.03 * exp(sum / (double)s->n), exp(noise / (double)s->n));
}

static gonio_status prepare(problem *p, int threads, gonio_error *error) {
    const gonio_samples *s = p->s;
    if (!allocate(p)) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to test %zu samples", s->n);
    }
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *q = &s->pairs[i];
        const gonio_vec3 wi = gonio_direction(q->theta_i, q->phi_i), wo = gonio_direction(q->theta_o, q->phi_o);
        place(p, i, wi, wo);
        p->terms = p->symmetry == GONIO_TEST_RECIPROCITY ? odd_terms(wi, wo, p->x + i * TERMS)
                                                         : turning_terms(wi, wo, p->x + i * TERMS);
    }
    const gonio_status status = gonio_neighbours_new(p->u, s->n * (size_t)p->images, p->dims, &p->tree, error);
    if (status == GONIO_OK) {
        gonio_pool_for(threads, s->n, connect, p);
        drop_explained(p);
    }
    return status;
}

gonio_status gonio_partial_test(const gonio_samples *samples, gonio_symmetry_test symmetry, int threads,
                                gonio_check_test *test, double *part, gonio_error *error) {
    *test = gonio_check_no_test;
    *part = 0;
    if (samples->n < FEWEST) {
        return GONIO_OK;
    }
    problem p = {.s = samples, .symmetry = symmetry};
    p.dims = samples->isotropic || symmetry == GONIO_TEST_ISOTROPY ? 3 : 4;
    p.images = symmetry == GONIO_TEST_RECIPROCITY ? (p.dims == 3 ? IMAGES : 2) : 2;
    gonio_status status = prepare(&p, threads, error);
    int joined = 0;
    for (size_t c = 0; c < (size_t)samples->channels && status == GONIO_OK && p.terms > 0; c++) {
        gonio_check_test one;
        status = test_channel(&p, c, floor_of(samples, c), &one, part, error);
        gonio_check_join(test, &joined, &one);
    }
    release(&p);
    return status;
}
