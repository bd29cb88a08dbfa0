// Preconditioned conjugate gradients for the normal equations (B^T W B + lambda R) phi = B^T W t.
//
// One pass over the samples applies B^T W B: the spline at a sample is gathered from its 4^d control points and, times
// the weight, scattered back to them while the basis functions are still in registers. Samples are sorted along the
// first axis and cut into slabs of cells; even slabs touch no control point in common, nor do odd ones, so each half
// runs on any number of threads and every sum has one order.
//
// Mirror symmetry: geometries are folded to one side, the vectors stay symmetric, and the scattered sums are averaged
// with their mirror image, which is the projection of the equations on symmetric lattices.
//
// All in double: float normal equations lose the small eigenvalues that interpolation between samples lives on.
#include "fit/lsq_cg.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/lsq_apply.h"
#include "fit/team.h"

struct gonio_lsq_cg {
    const gonio_lsq_data *data;
    gonio_lsq_form form;
    gonio_lsq_places places;
    gonio_team *team;
    gonio_lsq_watch *watch; // NULL: none
};

void gonio_lsq_cg_watch(gonio_lsq_cg *cg, gonio_lsq_watch *watch) { cg->watch = watch; }

size_t gonio_lsq_cg_count(const gonio_lsq_cg *cg, int level) { return gonio_lattice_count(cg->places.dims, level); }

void gonio_lsq_cg_free(gonio_lsq_cg *cg) {
    if (cg == NULL) {
        return;
    }
    gonio_team_free(cg->team);
    gonio_lsq_places_release(&cg->places);
    free(cg);
}

gonio_status gonio_lsq_cg_new(const gonio_lsq_data *data, const gonio_lsq_form *form, int threads, gonio_lsq_cg **out,
                              gonio_error *error) {
    gonio_lsq_cg *cg = *out = calloc(1, sizeof *cg);
    if (cg == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a solver");
    }
    cg->data = data;
    cg->form = *form;
    const gonio_status status = gonio_lsq_places_init(&cg->places, data, form, error);
    if (status != GONIO_OK) {
        free(cg);
        *out = NULL;
        return status;
    }
    cg->team = gonio_team_new(threads);
    return GONIO_OK;
}

// ---- the penalty ----

// One line of D^T D, the second differences' Gram matrix: coefficients of row i of an axis of m points.
static void gram_row(size_t m, size_t i, double coefficient[5]) {
    memset(coefficient, 0, 5 * sizeof *coefficient);
    static const double stencil[3] = {1, -2, 1};
    for (size_t shift = 0; shift < 3; shift++) {
        // The difference that begins at i - shift uses point i with stencil[shift].
        if (i < shift || i - shift + 2 >= m) {
            continue;
        }
        for (size_t k = 0; k < 3; k++) {
            coefficient[2 + k - shift] += stencil[shift] * stencil[k];
        }
    }
}

// out += factor D^T D in along one axis; inner: points between neighbours on it.
static void add_axis(const double *in, double *out, size_t m, size_t outer, size_t inner, double factor) {
    for (size_t o = 0; o < outer; o++) {
        const double *from = in + o * m * inner;
        double *to = out + o * m * inner;
        for (size_t i = 0; i < m; i++) {
            double row[5];
            gram_row(m, i, row);
            for (int k = 0; k < 5; k++) {
                const double f = factor * row[k];
                if (f == 0) {
                    continue;
                }
                const double *source = from + (i + (size_t)k - 2) * inner;
                for (size_t j = 0; j < inner; j++) {
                    to[i * inner + j] += f * source[j];
                }
            }
        }
    }
}

// The last axis, where neighbours are adjacent: out += factor D^T D in.
static void add_last_axis(const double *in, double *out, size_t m, size_t lines, double factor) {
    for (size_t l = 0; l < lines; l++) {
        const double *p = in + l * m;
        double *q = out + l * m;
        for (size_t i = 0; i + 2 < m; i++) {
            const double d = factor * (p[i] - 2 * p[i + 1] + p[i + 2]);
            q[i] += d;
            q[i + 1] -= 2 * d;
            q[i + 2] += d;
        }
    }
}

// out += lambda R in.
static void add_penalty(const gonio_lsq_cg *cg, int level, double lambda, const double *in, double *out) {
    const size_t m = gonio_bspline_size(level), count = gonio_lsq_cg_count(cg, level);
    size_t outer = 1, inner = count / m;
    for (int d = 0; d < cg->places.dims; d++, outer *= m, inner /= m) {
        const double factor = lambda * cg->form.stretch[d] * ldexp(1, level);
        if (inner > 1) {
            add_axis(in, out, m, outer, inner, factor);
        } else {
            add_last_axis(in, out, m, outer, factor);
        }
    }
    for (size_t i = 0; i < count; i++) {
        out[i] += lambda * GONIO_LSQ_RIDGE * in[i];
    }
}

static double penalty_diagonal(const gonio_lsq_cg *cg, int level, double lambda) {
    double sum = GONIO_LSQ_RIDGE;
    for (int d = 0; d < cg->places.dims; d++) {
        sum += 6 * cg->form.stretch[d] * ldexp(1, level); // 1 + 4 + 1 on the diagonal
    }
    return lambda * sum;
}

// ---- conjugate gradients ----

static double dot(const double *a, const double *b, size_t n) {
    double sum[4] = {0};
    size_t i = 0;
    for (; i + 4 <= n; i += 4) {
        sum[0] += a[i] * b[i];
        sum[1] += a[i + 1] * b[i + 1];
        sum[2] += a[i + 2] * b[i + 2];
        sum[3] += a[i + 3] * b[i + 3];
    }
    for (; i < n; i++) {
        sum[0] += a[i] * b[i];
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static void apply(const gonio_lsq_cg *cg, int level, double lambda, const double *in, double *out) {
    const size_t count = gonio_lsq_cg_count(cg, level);
    memset(out, 0, count * sizeof *out);
    gonio_lsq_apply(&cg->places, cg->team, level, GONIO_LSQ_NORMAL, NULL, 0, in, out);
    gonio_lsq_symmetrise(&cg->places, level, out, 0.5);
    add_penalty(cg, level, lambda, in, out);
}

// The negative gradient, B^T W (t - B phi) - lambda R phi.
static void residual(const gonio_lsq_cg *cg, const double *targets, size_t stride, int level, double lambda,
                     const double *points, double *out) {
    const size_t count = gonio_lsq_cg_count(cg, level);
    memset(out, 0, count * sizeof *out);
    gonio_lsq_apply(&cg->places, cg->team, level, GONIO_LSQ_RESIDUAL, targets, stride, points, out);
    gonio_lsq_symmetrise(&cg->places, level, out, 0.5);
    add_penalty(cg, level, -lambda, points, out);
}

static void preconditioner(const gonio_lsq_cg *cg, int level, double lambda, double *out) {
    const size_t count = gonio_lsq_cg_count(cg, level);
    memset(out, 0, count * sizeof *out);
    gonio_lsq_apply(&cg->places, cg->team, level, GONIO_LSQ_DIAGONAL, NULL, 0, NULL, out);
    gonio_lsq_symmetrise(&cg->places, level, out, 0.5);
    const double penalty = penalty_diagonal(cg, level, lambda);
    for (size_t i = 0; i < count; i++) {
        // Without a penalty, points that no sample touches keep their start.
        out[i] = out[i] + penalty > 0 ? 1 / (out[i] + penalty) : 0;
    }
}

// z = D^-1 r, and r . z.
static double precondition(const double *inverse, const double *r, double *z, size_t n) {
    for (size_t i = 0; i < n; i++) {
        z[i] = inverse[i] * r[i];
    }
    return dot(r, z, n);
}

gonio_status gonio_lsq_cg_solve(const gonio_lsq_cg *cg, const double *targets, size_t stride, int level, double lambda,
                                int iterations, double tolerance, double *points, gonio_lsq_cg_report *report,
                                gonio_error *error) {
    const size_t n = gonio_lsq_cg_count(cg, level);
    double *work = malloc(5 * n * sizeof *work);
    if (work == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to solve for %zu control points (%.3g GB)", n,
                          40e-9 * (double)n);
    }
    double *r = work, *z = r + n, *p = z + n, *q = p + n, *inverse = q + n;
    preconditioner(cg, level, lambda, inverse);
    residual(cg, targets, stride, level, lambda, points, r);
    double rz = precondition(inverse, r, z, n);
    const double first = rz;
    memcpy(p, z, n * sizeof *p);
    *report = (gonio_lsq_cg_report){.gradient = 1};
    double fallen = 0;
    gonio_status status = GONIO_OK;
    while (report->iterations < iterations && !gonio_lsq_watch_over(cg->watch) && rz > tolerance * tolerance * first &&
           rz > 0) {
        status = gonio_lsq_watch_ask(cg->watch, error);
        if (status != GONIO_OK) {
            break;
        }
        apply(cg, level, lambda, p, q);
        const double curvature = dot(p, q, n);
        if (!(curvature > 0)) {
            break; // rounding is all that is left
        }
        const double step = rz / curvature;
        for (size_t i = 0; i < n; i++) {
            points[i] += step * p[i];
            r[i] -= step * q[i];
        }
        fallen += 0.5 * step * rz;
        const double next = precondition(inverse, r, z, n), beta = next / rz;
        for (size_t i = 0; i < n; i++) {
            p[i] = z[i] + beta * p[i];
        }
        rz = next;
        report->iterations++;
    }
    report->gradient = first > 0 ? sqrt(rz / first) : 0;
    report->objective = fallen;
    free(work);
    return status;
}

// ---- the start ----

// points += the multilevel B-spline step for what they leave (Lee, Wolberg and Shin 1997, eq. 5).
static void add_mba_step(const gonio_lsq_cg *cg, const double *targets, size_t stride, int level, double *points,
                         double *numerator, double *denominator) {
    const size_t n = gonio_lsq_cg_count(cg, level);
    memset(numerator, 0, n * sizeof *numerator);
    memset(denominator, 0, n * sizeof *denominator);
    gonio_lsq_apply(&cg->places, cg->team, level, GONIO_LSQ_MBA, targets, stride, points, numerator);
    gonio_lsq_apply(&cg->places, cg->team, level, GONIO_LSQ_DIAGONAL, NULL, 0, NULL, denominator);
    gonio_lsq_symmetrise(&cg->places, level, numerator, 1);
    gonio_lsq_symmetrise(&cg->places, level, denominator, 1);
    for (size_t i = 0; i < n; i++) {
        points[i] += denominator[i] > 0 ? numerator[i] / denominator[i] : 0;
    }
}

// Level by level up to `level`; from level `solve` on with conjugate gradients. work: 3 times the finest level.
static gonio_status climb(const gonio_lsq_cg *cg, const double *targets, size_t stride, int level, int solve,
                          double lambda, int iterations, double tolerance, double *points, gonio_lsq_cg_report *report,
                          gonio_error *error) {
    const size_t finest = gonio_lsq_cg_count(cg, level);
    double *work = malloc(3 * finest * sizeof *work);
    if (work == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to fit %zu control points (%.3g GB)", finest,
                          24e-9 * (double)finest);
    }
    gonio_status status = GONIO_OK;
    const int solved = level - solve + 1;
    for (int h = 0; h <= level && status == GONIO_OK; h++) {
        if (h == 0) {
            memset(points, 0, gonio_lsq_cg_count(cg, 0) * sizeof *points);
        } else {
            memcpy(work, points, gonio_lsq_cg_count(cg, h - 1) * sizeof *work);
            gonio_lsq_refine(cg->places.dims, h - 1, work, points, work + finest);
        }
        add_mba_step(cg, targets, stride, h, points, work + finest, work + 2 * finest);
        status = gonio_lsq_watch_ask(cg->watch, error);
        if (h >= solve && status == GONIO_OK) {
            const int share = h == level ? iterations - (solved - 1) * (iterations / solved) : iterations / solved;
            status = gonio_lsq_cg_solve(cg, targets, stride, h, lambda, share, tolerance, points, report, error);
        }
    }
    free(work);
    return status;
}

void gonio_lsq_cg_start(const gonio_lsq_cg *cg, const double *targets, size_t stride, int level, double *points) {
    gonio_lsq_cg_report unused;
    memset(points, 0, gonio_lsq_cg_count(cg, level) * sizeof *points);
    climb(cg, targets, stride, level, level + 1, 0, 0, 0, points, &unused, NULL);
}

gonio_status gonio_lsq_cg_cascade(const gonio_lsq_cg *cg, const double *targets, size_t stride, double lambda,
                                  int iterations, double tolerance, double *points, gonio_lsq_cg_report *report,
                                  gonio_error *error) {
    const int level = cg->form.level;
    *report = (gonio_lsq_cg_report){.gradient = 1};
    return climb(cg, targets, stride, level, level > 2 ? level - 2 : 0, lambda, iterations, tolerance, points, report,
                 error);
}

// ---- refinement and evaluation ----

// One axis from m to fine points (Kameya 2002, 2.3.4): even ones (p - + 6 p + p +)/8, odd ones the mean of two.
static void refine_axis(const double *in, double *out, size_t m, size_t outer, size_t inner) {
    const size_t fine = 2 * (m - 3) + 3;
    for (size_t o = 0; o < outer; o++) {
        const double *from = in + o * m * inner;
        double *to = out + o * fine * inner;
        for (size_t i = 0; i < fine; i++) {
            // Fine point i lies at (i - 1) half cells from the domain's start; coarse point k at 2 (k - 1).
            const size_t k = (i + 1) / 2;
            for (size_t j = 0; j < inner; j++) {
                to[i * inner + j] =
                    i % 2 == 1
                        ? 0.125 * (from[(k - 1) * inner + j] + 6 * from[k * inner + j] + from[(k + 1) * inner + j])
                        : 0.5 * (from[k * inner + j] + from[(k + 1) * inner + j]);
            }
        }
    }
}

void gonio_lsq_refine(int dims, int level, const double *coarse, double *fine, double *work) {
    const size_t m = gonio_bspline_size(level), f = gonio_bspline_size(level + 1);
    const double *in = coarse;
    size_t outer = 1, inner = 1;
    for (int d = 1; d < dims; d++) {
        inner *= m;
    }
    for (int d = 0; d < dims; d++, outer *= f, inner /= m) {
        // The last pass must end in `fine`.
        double *out = (dims - 1 - d) % 2 == 0 ? fine : work;
        refine_axis(in, out, m, outer, inner);
        in = out;
    }
}

gonio_status gonio_lsq_cg_eval(const gonio_lsq_cg *cg, const gonio_lsq_data *at, int level, const double *points,
                               double *out, size_t stride, gonio_error *error) {
    gonio_lsq_places places;
    const gonio_status status = gonio_lsq_places_init(&places, at, &cg->form, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_lsq_places_eval(&places, level, points, out, stride);
    gonio_lsq_places_release(&places);
    return GONIO_OK;
}
