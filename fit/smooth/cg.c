// SPDX-License-Identifier: BSD-3-Clause
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
// Without a preconditioner hundreds of iterations carry a smooth correction across a region without samples; the
// multilevel one (fit/smooth/precondition.h) costs about as much as a product and needs tens.
//
// All in double but for that: float normal equations lose the small eigenvalues that interpolation between samples
// lives on.
#include "fit/smooth/cg.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "brdf/spline/refine.h"
#include "fit/smooth/apply.h"
#include "fit/smooth/penalty.h"
#include "fit/smooth/precondition.h"

#define LEVELS 10 // 0 to 9

struct gonio_smooth_cg {
    const gonio_dataset *data;
    gonio_smooth_form form;
    gonio_smooth_places places;
    gonio_pool *pool;
    gonio_deadline *watch; // NULL: none
    // Of each level that was solved on, by need: B^T W 1 and the diagonal of B^T W B, before folding.
    double *lumped[LEVELS], *diagonal[LEVELS];
};

void gonio_smooth_cg_watch(gonio_smooth_cg *cg, gonio_deadline *watch) { cg->watch = watch; }

void gonio_smooth_cg_reform(gonio_smooth_cg *cg, const gonio_smooth_form *form) { cg->form = *form; }

size_t gonio_smooth_cg_count(const gonio_smooth_cg *cg, int level) {
    return gonio_lattice_count(cg->places.dims, level);
}

void gonio_smooth_cg_free(gonio_smooth_cg *cg) {
    if (cg == NULL) {
        return;
    }
    for (int h = 0; h < LEVELS; h++) {
        free(cg->lumped[h]);
        free(cg->diagonal[h]);
    }
    gonio_pool_free(cg->pool);
    gonio_smooth_places_release(&cg->places);
    free(cg);
}

gonio_status gonio_smooth_cg_new(const gonio_dataset *data, const gonio_smooth_form *form, int threads,
                                 gonio_smooth_cg **out, gonio_error *error) {
    gonio_smooth_cg *cg = *out = calloc(1, sizeof *cg);
    if (cg == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a solver");
    }
    cg->data = data;
    cg->form = *form;
    const gonio_status status = gonio_smooth_places_init(&cg->places, data, form, error);
    if (status != GONIO_OK) {
        free(cg);
        *out = NULL;
        return status;
    }
    cg->pool = gonio_pool_new(threads);
    return GONIO_OK;
}

// ---- what depends on the samples' places alone ----

static gonio_status sum_places(gonio_smooth_cg *cg, int level, gonio_error *error) {
    const size_t n = gonio_smooth_cg_count(cg, level);
    if (cg->diagonal[level] != NULL) {
        return GONIO_OK;
    }
    double *lumped = calloc(n, sizeof *lumped), *diagonal = calloc(n, sizeof *diagonal);
    if (lumped == NULL || diagonal == NULL) {
        free(lumped);
        free(diagonal);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu control points (%.3g GB)", n, 16e-9 * (double)n);
    }
    // The diagonal's place holds the ones until then.
    for (size_t i = 0; i < n; i++) {
        diagonal[i] = 1;
    }
    gonio_smooth_apply(&cg->places, cg->pool, level, GONIO_SMOOTH_NORMAL, NULL, 0, diagonal, lumped);
    memset(diagonal, 0, n * sizeof *diagonal);
    gonio_smooth_apply(&cg->places, cg->pool, level, GONIO_SMOOTH_DIAGONAL, NULL, 0, NULL, diagonal);
    cg->lumped[level] = lumped;
    cg->diagonal[level] = diagonal;
    return GONIO_OK;
}

// ---- conjugate gradients ----

// One solve's vectors. Loops over them run plane by plane; sums are those of the planes, added in order.
typedef struct solve {
    const gonio_smooth_cg *cg;
    gonio_smooth_planes planes;
    size_t n;
    double lambda;
    gonio_smooth_precondition *precondition;
    double *points, *r, *z, *p, *q;
    double *sums; // [planes]
    double step, beta;
} solve;

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

static double run_planes(solve *s, void (*work)(void *, size_t)) {
    memset(s->sums, 0, s->planes.size * sizeof *s->sums);
    gonio_pool_run(s->cg->pool, s->planes.size, work, s);
    double sum = 0;
    for (size_t i = 0; i < s->planes.size; i++) {
        sum += s->sums[i];
    }
    return sum;
}

// q = A p from B^T W B p in q; sum p . q.
static void finish_product(void *context, size_t plane) {
    solve *s = context;
    const size_t at = plane * s->planes.points;
    gonio_smooth_fold(&s->planes, s->cg->places.mirror_axes, s->q, plane);
    gonio_smooth_penalise(&s->planes, &s->cg->form, s->lambda, s->p, s->q, plane);
    s->sums[plane] = dot(s->p + at, s->q + at, s->planes.points);
}

// The negative gradient, B^T W (t - B phi) - lambda R phi, from its first part in r.
static void finish_residual(void *context, size_t plane) {
    solve *s = context;
    gonio_smooth_fold(&s->planes, s->cg->places.mirror_axes, s->r, plane);
    gonio_smooth_penalise(&s->planes, &s->cg->form, -s->lambda, s->points, s->r, plane);
}

static void take_step(void *context, size_t plane) {
    solve *s = context;
    const size_t end = (plane + 1) * s->planes.points;
    for (size_t i = plane * s->planes.points; i < end; i++) {
        s->points[i] += s->step * s->p[i];
        s->r[i] -= s->step * s->q[i];
    }
}

// The preconditioner keeps mirror symmetry but for its rounding.
static void sum_rz(void *context, size_t plane) {
    solve *s = context;
    const size_t at = plane * s->planes.points;
    gonio_smooth_fold(&s->planes, s->cg->places.mirror_axes, s->z, plane);
    s->sums[plane] = dot(s->r + at, s->z + at, s->planes.points);
}

// p = z + beta p, and q = 0 for the next product.
static void turn(void *context, size_t plane) {
    solve *s = context;
    const size_t end = (plane + 1) * s->planes.points;
    for (size_t i = plane * s->planes.points; i < end; i++) {
        s->p[i] = s->z[i] + s->beta * s->p[i];
        s->q[i] = 0;
    }
}

// z = P^-1 r; r . z.
static double precondition(solve *s) {
    gonio_smooth_precondition_apply(s->precondition, s->cg->pool, s->r, s->z);
    return run_planes(s, sum_rz);
}

static double product(solve *s) {
    const gonio_smooth_cg *cg = s->cg;
    gonio_smooth_apply(&cg->places, cg->pool, s->planes.level, GONIO_SMOOTH_NORMAL, NULL, 0, s->p, s->q);
    return run_planes(s, finish_product);
}

static gonio_status make_precondition(solve *s, gonio_error *error) {
    const gonio_smooth_cg *cg = s->cg;
    const int level = s->planes.level;
    memcpy(s->q, cg->lumped[level], s->n * sizeof *s->q);
    memcpy(s->z, cg->diagonal[level], s->n * sizeof *s->z);
    for (size_t plane = 0; plane < s->planes.size; plane++) {
        gonio_smooth_fold(&s->planes, cg->places.mirror_axes, s->q, plane);
        gonio_smooth_fold(&s->planes, cg->places.mirror_axes, s->z, plane);
    }
    const gonio_status status = gonio_smooth_precondition_new(s->planes.dims, &cg->form, level, s->lambda, s->q, s->z,
                                                              cg->pool, &s->precondition, error);
    memset(s->q, 0, s->n * sizeof *s->q);
    return status;
}

static gonio_status solve_begin(solve *s, const gonio_smooth_cg *cg, int level, double lambda, double *points,
                                gonio_error *error) {
    const size_t n = gonio_smooth_cg_count(cg, level);
    *s = (solve){.cg = cg, .planes = gonio_smooth_planes_of(cg->places.dims, level), .n = n, .lambda = lambda};
    double *work = calloc(4 * n + s->planes.size, sizeof *work);
    if (work == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to solve for %zu control points (%.3g GB)", n,
                          32e-9 * (double)n);
    }
    s->points = points;
    s->r = work;
    s->z = s->r + n;
    s->p = s->z + n;
    s->q = s->p + n;
    s->sums = s->q + n;
    return make_precondition(s, error);
}

static void solve_end(solve *s) {
    gonio_smooth_precondition_free(s->precondition);
    free(s->r);
}

static gonio_status iterate(solve *s, int iterations, double tolerance, gonio_smooth_cg_report *report,
                            gonio_error *error) {
    gonio_deadline *watch = s->cg->watch;
    double rz = precondition(s), fallen = 0;
    const double first = rz;
    run_planes(s, turn);
    while (report->iterations < iterations && !gonio_deadline_over(watch) && rz > tolerance * tolerance * first &&
           rz > 0) {
        const gonio_status status = gonio_deadline_poll(watch, error);
        if (status != GONIO_OK) {
            return status;
        }
        const double curvature = product(s);
        if (!(curvature > 0)) {
            break; // rounding is all that is left
        }
        s->step = rz / curvature;
        run_planes(s, take_step);
        fallen += 0.5 * s->step * rz;
        const double next = precondition(s);
        s->beta = next / rz;
        run_planes(s, turn);
        rz = next;
        report->iterations++;
    }
    report->gradient = first > 0 ? sqrt(fmax(rz, 0) / first) : 0;
    report->objective = fallen;
    return GONIO_OK;
}

gonio_status gonio_smooth_cg_solve(gonio_smooth_cg *cg, const double *targets, size_t stride, int level, double lambda,
                                   int iterations, double tolerance, double *points, gonio_smooth_cg_report *report,
                                   gonio_error *error) {
    *report = (gonio_smooth_cg_report){.gradient = 1};
    solve s = {0};
    gonio_status status = sum_places(cg, level, error);
    status = status == GONIO_OK ? solve_begin(&s, cg, level, lambda, points, error) : status;
    if (status == GONIO_OK) {
        gonio_smooth_apply(&cg->places, cg->pool, level, GONIO_SMOOTH_RESIDUAL, targets, stride, points, s.r);
        run_planes(&s, finish_residual);
        status = iterate(&s, iterations, tolerance, report, error);
    }
    solve_end(&s);
    return status;
}

// ---- the start ----

// points += the multilevel B-spline step for what they leave (Lee, Wolberg and Shin 1997, eq. 5).
static void add_mba_step(const gonio_smooth_cg *cg, const double *targets, size_t stride, int level, double *points,
                         double *numerator, double *denominator) {
    const size_t n = gonio_smooth_cg_count(cg, level);
    memset(numerator, 0, n * sizeof *numerator);
    gonio_smooth_apply(&cg->places, cg->pool, level, GONIO_SMOOTH_MBA, targets, stride, points, numerator);
    if (cg->diagonal[level] != NULL) {
        memcpy(denominator, cg->diagonal[level], n * sizeof *denominator);
    } else {
        memset(denominator, 0, n * sizeof *denominator);
        gonio_smooth_apply(&cg->places, cg->pool, level, GONIO_SMOOTH_DIAGONAL, NULL, 0, NULL, denominator);
    }
    gonio_smooth_symmetrise(&cg->places, level, numerator);
    gonio_smooth_symmetrise(&cg->places, level, denominator);
    for (size_t i = 0; i < n; i++) {
        points[i] += denominator[i] > 0 ? numerator[i] / denominator[i] : 0;
    }
}

#define OF_THREE(a, b, c) (0.125 * ((a) + 6 * (b) + (c)))
GONIO_REFINE(refine, double, OF_THREE)

// The same function, of level `level`, on the lattice of the next. fine must not overlap coarse.
static void refine(int dims, int level, const double *coarse, double *fine, double *work) {
    const size_t m = gonio_bspline_size(level);
    size_t outer = 1, inner = gonio_lattice_count(dims, level);
    for (int d = 0; d < dims; d++, outer *= gonio_bspline_size(level + 1)) {
        double *out = (dims - 1 - d) % 2 == 0 ? fine : work; // the last pass must end in `fine`
        inner /= m;
        refine_axis(coarse, out, outer, m, inner);
        coarse = out;
    }
}

// Level by level up to `level`; from level `solve` on with conjugate gradients. work: 3 times the finest level.
static gonio_status climb(gonio_smooth_cg *cg, const double *targets, size_t stride, int level, int solve,
                          double lambda, int iterations, double tolerance, double *points,
                          gonio_smooth_cg_report *report, gonio_error *error) {
    const size_t finest = gonio_smooth_cg_count(cg, level);
    double *work = malloc(3 * finest * sizeof *work);
    if (work == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to fit %zu control points (%.3g GB)", finest,
                          24e-9 * (double)finest);
    }
    gonio_status status = GONIO_OK;
    for (int h = 0; h <= level && status == GONIO_OK; h++) {
        if (h == 0) {
            memset(points, 0, gonio_smooth_cg_count(cg, 0) * sizeof *points);
        } else {
            memcpy(work, points, gonio_smooth_cg_count(cg, h - 1) * sizeof *work);
            refine(cg->places.dims, h - 1, work, points, work + finest);
        }
        status = h >= solve ? sum_places(cg, h, error) : GONIO_OK;
        if (status != GONIO_OK) {
            break;
        }
        add_mba_step(cg, targets, stride, h, points, work + finest, work + 2 * finest);
        status = gonio_deadline_poll(cg->watch, error);
        if (h >= solve && status == GONIO_OK) {
            const int share = h == level ? iterations - (level - solve) * (iterations / 4) : iterations / 4;
            status = gonio_smooth_cg_solve(cg, targets, stride, h, lambda, share, tolerance, points, report, error);
        }
    }
    free(work);
    return status;
}

void gonio_smooth_cg_start(gonio_smooth_cg *cg, const double *targets, size_t stride, int level, double *points) {
    gonio_smooth_cg_report unused;
    memset(points, 0, gonio_smooth_cg_count(cg, level) * sizeof *points);
    climb(cg, targets, stride, level, level + 1, 0, 0, 0, points, &unused, NULL);
}

gonio_status gonio_smooth_cg_cascade(gonio_smooth_cg *cg, const double *targets, size_t stride, double lambda,
                                     int iterations, double tolerance, double *points, gonio_smooth_cg_report *report,
                                     gonio_error *error) {
    const int level = cg->form.level;
    *report = (gonio_smooth_cg_report){.gradient = 1};
    return climb(cg, targets, stride, level, level > 2 ? level - 2 : 0, lambda, iterations, tolerance, points, report,
                 error);
}

// ---- evaluation ----

gonio_status gonio_smooth_cg_eval(const gonio_smooth_cg *cg, const gonio_dataset *at, int level, const double *points,
                                  double *out, size_t stride, gonio_error *error) {
    gonio_smooth_places places;
    const gonio_status status = gonio_smooth_places_init(&places, at, &cg->form, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_smooth_places_eval(&places, level, points, out, stride);
    gonio_smooth_places_release(&places);
    return GONIO_OK;
}
