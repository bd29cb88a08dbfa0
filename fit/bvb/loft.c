// SPDX-License-Identifier: BSD-3-Clause
// Approximate lofting: a B-spline volume of a table as one pass of curve fitting an axis.
//
// A basis function of the volume is a product, so its control points come axis by axis: along phi_d every polyline of
// the table is fitted by a curve on knots that they share (eq. 7, 11), then along theta_o the control points of these
// curves (eq. 9), then along theta_i (eq. 10), and of anisotropic tables along phi_i. The curves of a pass have one
// normal matrix, of bandwidth `order`; it is factored once and solved for all polylines.
//
// By a tolerance: each pass may err by a share of it, over its polylines' points. Since basis functions are not
// negative and sum to 1, what a pass does to its control points moves no point of the table by more, and the whole errs
// by at most the sum: with a third for each of three passes, the paper's way, the tolerance is kept. The least number
// of control points that keeps the share is searched by halving; with as many as there are points the curves
// interpolate, so there is one.
#include "fit/bvb/loft.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TILE 96 // numbers beside one another that are solved for at a time

typedef struct pass {
    const float *in; // [outer][size][inner]
    float *out;      // [outer][count][inner]; NULL: only the error is asked for
    size_t outer, size, inner, channels, count;
    int order;
    const double *knots;
    // Of every point of a polyline: the first basis function that is not 0 there, and those from it on.
    size_t *first;
    double (*basis)[GONIO_BVB_ORDER_MAX];
    double (*factor)[GONIO_BVB_ORDER_MAX]; // the normal matrix' Cholesky factor: [row][how far left of the diagonal]
    double *worst;                         // [items]: largest squared length that is left; negative: no memory
} pass;

static size_t tile_of(const pass *p) { return p->channels > TILE ? p->channels : TILE / p->channels * p->channels; }
static size_t tiles_of(const pass *p) { return (p->inner + tile_of(p) - 1) / tile_of(p); }

// The banded normal matrix and its factor; false where it is singular.
static bool factor_matrix(pass *p) {
    const size_t band = (size_t)p->order;
    memset(p->factor, 0, p->count * sizeof *p->factor);
    for (size_t j = 0; j < p->size; j++) {
        p->first[j] = gonio_bvb_basis(p->knots, p->count, p->order, (double)j / (double)(p->size - 1), p->basis[j]);
        for (size_t a = 0; a < band; a++) {
            for (size_t b = 0; b <= a; b++) {
                p->factor[p->first[j] + a][a - b] += p->basis[j][a] * p->basis[j][b];
            }
        }
    }
    for (size_t i = 0; i < p->count; i++) {
        const size_t low = i + 1 > band ? i + 1 - band : 0;
        const double whole = p->factor[i][0];
        for (size_t k = low; k <= i; k++) {
            double sum = p->factor[i][i - k];
            for (size_t m = low; m < k; m++) {
                sum -= k - m < band ? p->factor[i][i - m] * p->factor[k][k - m] : 0;
            }
            if (k < i) {
                p->factor[i][i - k] = sum / p->factor[k][0];
            } else if (!(sum > 1e-13 * whole)) {
                return false;
            } else {
                p->factor[i][0] = sqrt(sum);
            }
        }
    }
    return true;
}

// x -= factor * y, n numbers.
static void subtract(double *x, double factor, const double *y, size_t n) {
    for (size_t k = 0; k < n; k++) {
        x[k] -= factor * y[k];
    }
}

// x[count][n]: right sides, then solutions.
static void solve(const pass *p, double *x, size_t n) {
    const size_t band = (size_t)p->order;
    for (size_t i = 0; i < p->count; i++) {
        for (size_t d = 1; d < band && d <= i; d++) {
            subtract(x + i * n, p->factor[i][d], x + (i - d) * n, n);
        }
        for (size_t k = 0; k < n; k++) {
            x[i * n + k] /= p->factor[i][0];
        }
    }
    for (size_t i = p->count; i-- > 0;) {
        for (size_t d = 1; d < band && i + d < p->count; d++) {
            subtract(x + i * n, p->factor[i + d][d], x + (i + d) * n, n);
        }
        for (size_t k = 0; k < n; k++) {
            x[i * n + k] /= p->factor[i][0];
        }
    }
}

// The largest squared length of what curves leave of their points.
static double largest_left(const pass *p, const float *in, const double *x, size_t n, double *left) {
    double worst = 0;
    for (size_t j = 0; j < p->size; j++) {
        const float *point = in + j * p->inner;
        for (size_t k = 0; k < n; k++) {
            left[k] = (double)point[k];
        }
        for (size_t f = 0; f < (size_t)p->order; f++) {
            subtract(left, p->basis[j][f], x + (p->first[j] + f) * n, n);
        }
        for (size_t k = 0; k < n; k += p->channels) {
            double square = 0;
            for (size_t c = 0; c < p->channels; c++) {
                square += left[k + c] * left[k + c];
            }
            worst = square > worst ? square : worst;
        }
    }
    return worst;
}

// A tile of the polylines of one `outer`.
static void fit_tile(void *context, size_t item) {
    const pass *p = context;
    const size_t a = item / tiles_of(p), begin = item % tiles_of(p) * tile_of(p);
    const size_t n = p->inner - begin < tile_of(p) ? p->inner - begin : tile_of(p);
    const float *in = p->in + a * p->size * p->inner + begin;
    double *x = calloc((p->count + 1) * n, sizeof *x);
    p->worst[item] = -1;
    if (x == NULL) {
        return;
    }
    for (size_t j = 0; j < p->size; j++) {
        for (size_t f = 0; f < (size_t)p->order; f++) {
            double *right = x + (p->first[j] + f) * n;
            for (size_t k = 0; k < n; k++) {
                right[k] += p->basis[j][f] * (double)in[j * p->inner + k];
            }
        }
    }
    solve(p, x, n);
    p->worst[item] = largest_left(p, in, x, n, x + p->count * n);
    for (size_t i = 0; p->out != NULL && i < p->count; i++) {
        float *out = p->out + (a * p->count + i) * p->inner + begin;
        for (size_t k = 0; k < n; k++) {
            out[k] = (float)x[i * n + k];
        }
    }
    free(x);
}

// Fit every polyline by p->count control points on p->knots; *error_now: the largest error.
static gonio_status run_pass(pass *p, gonio_pool *pool, double *error_now, gonio_error *error) {
    const size_t items = p->outer * tiles_of(p);
    if (!factor_matrix(p)) {
        return gonio_fail(error, GONIO_E_CONVERGENCE,
                          "%zu control points of order %d: their knots leave the least squares singular; ask for fewer "
                          "points or dominant knots",
                          p->count, p->order);
    }
    gonio_pool_run(pool, items, fit_tile, p);
    double worst = 0, least = 0;
    for (size_t k = 0; k < items; k++) {
        worst = fmax(worst, p->worst[k]);
        least = fmin(least, p->worst[k]);
    }
    *error_now = sqrt(worst);
    return least < 0 ? gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu control points of a curve", p->count)
                     : GONIO_OK;
}

// ---- one axis ----

// A pass along one axis of a view on some values, which are borrowed.
typedef struct lofting {
    const gonio_loft *loft;
    gonio_pool *pool;
    int axis;
    pass pass;
    gonio_columns columns;
    double *knots;
    double *known; // [size + 1]: the error of each count that was tried; NaN where it was not
} lofting;

// The first pass is kept: with another share of the tolerance it begins from what it knows.
typedef struct volume {
    const gonio_bvb_table *table;
    const gonio_loft *loft;
    double unit, stretch; // of heights, of lengths
    gonio_pool *pool;
    lofting first;
} volume;

static bool dominant(const gonio_loft *loft) { return loft->knots < GONIO_KNOTS_KTP; }

static void lofting_release(lofting *l) {
    gonio_columns_release(&l->columns);
    free(l->pass.first);
    free(l->pass.basis);
    free(l->pass.factor);
    free(l->pass.worst);
    free(l->knots);
    free(l->known);
}

static bool allocate(lofting *l) {
    pass *p = &l->pass;
    p->first = malloc(p->size * sizeof *p->first);
    p->basis = calloc(p->size, sizeof *p->basis);
    p->factor = malloc(p->size * sizeof *p->factor);
    p->worst = malloc(p->outer * tiles_of(p) * sizeof *p->worst);
    l->knots = malloc((p->size + GONIO_BVB_ORDER_MAX) * sizeof *l->knots);
    l->known = malloc((p->size + 1) * sizeof *l->known);
    for (size_t n = 0; l->known != NULL && n <= p->size; n++) {
        l->known[n] = NAN;
    }
    return p->first != NULL && p->basis != NULL && p->factor != NULL && p->worst != NULL && l->knots != NULL &&
           l->known != NULL;
}

// Values whose axes are `now` long. Release it also where this fails.
static gonio_status lofting_init(lofting *l, const volume *v, int axis, const size_t *now, int channels,
                                 const float *values, gonio_error *error) {
    // The axes as they lie in memory.
    static const int order[GONIO_BVB_AXES] = {GONIO_BVB_PHI_I, GONIO_BVB_THETA_I, GONIO_BVB_THETA_O, GONIO_BVB_PHI_D};
    const gonio_loft *loft = v->loft;
    *l = (lofting){.loft = loft, .pool = v->pool, .axis = axis};
    l->pass = (pass){.in = values,
                     .outer = 1,
                     .size = now[axis],
                     .inner = (size_t)channels,
                     .channels = (size_t)channels,
                     .order = loft->order};
    bool behind = false;
    for (int k = 0; k < GONIO_BVB_AXES; k++) {
        l->pass.outer *= !behind && order[k] != axis ? now[order[k]] : 1;
        l->pass.inner *= behind ? now[order[k]] : 1;
        behind = behind || order[k] == axis;
    }
    if (!allocate(l)) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to fit curves");
    }
    const bool mean = loft->knots == GONIO_KNOTS_DOMINANT_MEAN || loft->knots == GONIO_KNOTS_DOMINANT_MEAN_RAW;
    return dominant(loft) ? gonio_columns_init(&l->columns, values, l->pass.outer, l->pass.size, l->pass.inner,
                                               channels, v->unit, v->stretch, mean, v->pool, error)
                          : GONIO_OK;
}

static gonio_status try_count(lofting *l, size_t count, float *out, gonio_error *error) {
    const gonio_loft *loft = l->loft;
    if (dominant(loft)) {
        gonio_columns_knots(&l->columns, count, loft->order, l->knots);
    } else {
        gonio_knots_place(loft->knots, l->pass.size, count, loft->order, l->knots);
    }
    l->pass.count = count;
    l->pass.out = out;
    l->pass.knots = l->knots;
    return run_pass(&l->pass, l->pool, &l->known[count], error);
}

// The least count whose error keeps the limit, taking for granted that errors fall with the count.
static gonio_status search_count(lofting *l, double limit, size_t *count, gonio_error *error) {
    size_t low = (size_t)l->loft->order, high = l->pass.size; // the answer lies in [low, high]
    while (low < high) {
        const size_t half = low + (high - low) / 2;
        const gonio_status status = isnan(l->known[half]) ? try_count(l, half, NULL, error) : GONIO_OK;
        if (status == GONIO_E_CONVERGENCE) {
            l->known[half] = INFINITY;
        } else if (status != GONIO_OK) {
            return status;
        }
        if (l->known[half] <= limit) {
            high = half;
        } else {
            low = half + 1;
        }
    }
    *count = low;
    return GONIO_OK;
}

// *out: the control points, from malloc; share: of the tolerance.
static gonio_status fit_axis(lofting *l, double share, gonio_bvb_parts *parts, float **out, gonio_error *error) {
    const gonio_loft *loft = l->loft;
    size_t count = loft->count[l->axis] < l->pass.size ? loft->count[l->axis] : l->pass.size;
    gonio_status status = GONIO_OK;
    *out = NULL;
    if (loft->count[l->axis] == 0) {
        status = search_count(l, share * loft->tolerance, &count, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    *out = malloc((l->pass.outer * count * l->pass.inner + GONIO_BVB_PAD) * sizeof **out);
    double *knots = parts->knots[l->axis] = malloc((count + (size_t)loft->order) * sizeof *knots);
    if (*out == NULL || knots == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu x %zu x %zu control points", l->pass.outer, count,
                          l->pass.inner);
    }
    status = try_count(l, count, *out, error);
    parts->count[l->axis] = count;
    memcpy(knots, l->knots, (count + (size_t)loft->order) * sizeof *knots);
    return status;
}

// ---- all axes ----

static gonio_status loft_with(volume *v, double share, gonio_bvb_parts *out, gonio_error *error) {
    static const int passes[GONIO_BVB_AXES] = {GONIO_BVB_PHI_D, GONIO_BVB_THETA_O, GONIO_BVB_THETA_I, GONIO_BVB_PHI_I};
    const gonio_bvb_table *table = v->table;
    size_t now[GONIO_BVB_AXES];
    float *values = NULL, *next;
    memcpy(now, table->size, sizeof now);
    *out = (gonio_bvb_parts){
        .dims = table->dims, .order = v->loft->order, .channels = table->channels, .count = {1, 1, 1, 1}};
    gonio_status status = fit_axis(&v->first, share, out, &values, error);
    for (int k = 1; k < table->dims && status == GONIO_OK; k++) {
        lofting l;
        now[passes[k - 1]] = out->count[passes[k - 1]];
        status = lofting_init(&l, v, passes[k], now, table->channels, values, error);
        next = NULL;
        status = status == GONIO_OK ? fit_axis(&l, share, out, &next, error) : status;
        lofting_release(&l);
        free(values);
        values = next;
    }
    out->points = values;
    if (status != GONIO_OK) {
        gonio_bvb_parts_release(out);
        return status;
    }
    memset(out->points + gonio_bvb_points(out) * (size_t)out->channels, 0, GONIO_BVB_PAD * sizeof(float));
    return GONIO_OK;
}

#define SHARES 3 // that are tried

// Equal shares leave most of a tolerance unused: errors of passes seldom meet. So the shares grow, as far as the whole
// error, taken at every point of the table, keeps the tolerance; what has the fewest control points is the answer.
static gonio_status use_tolerance(volume *v, gonio_bvb_parts *best, gonio_error *error) {
    double share = 1.0 / v->table->dims, high = INFINITY, low = share;
    for (int k = 0; k < SHARES; k++) {
        gonio_bvb_parts parts;
        gonio_bvb_lengths left;
        gonio_status status = k == 0 ? GONIO_OK : loft_with(v, share, &parts, error);
        status = status == GONIO_OK
                     ? gonio_bvb_errors(v->table, k == 0 ? best : &parts, NULL, v->loft->threads, &left, error)
                     : status;
        const bool keeps = status == GONIO_OK && left.largest <= v->loft->tolerance;
        if (k > 0 && keeps && gonio_bvb_points(&parts) < gonio_bvb_points(best)) {
            const gonio_bvb_parts before = *best;
            *best = parts;
            parts = before;
        }
        if (k > 0) {
            gonio_bvb_parts_release(&parts);
        }
        if (status != GONIO_OK) {
            return status;
        }
        *(keeps ? &low : &high) = share;
        // About proportional; once it was too much, between.
        const double guess = low * fmin(0.9 * v->loft->tolerance / fmax(left.largest, 1e-300), 8);
        share = isinf(high) ? guess : sqrt(low * high);
        if (left.largest == 0 || share < 1.05 * low) {
            break;
        }
    }
    return GONIO_OK;
}

gonio_status gonio_bvb_loft(const gonio_bvb_table *table, const gonio_loft *loft, gonio_bvb_parts *out,
                            gonio_error *error) {
    const bool raw = loft->knots == GONIO_KNOTS_DOMINANT_RAW || loft->knots == GONIO_KNOTS_DOMINANT_MEAN_RAW;
    const gonio_bvb_lengths lengths = gonio_bvb_table_lengths(table);
    volume v = {.table = table,
                .loft = loft,
                .unit = raw ? 1 / loft->unit : lengths.largest,
                .stretch = loft->knots == GONIO_KNOTS_ADAPTIVE && lengths.mean > 0 ? lengths.largest / lengths.mean : 1,
                .pool = gonio_pool_new(loft->threads)};
    *out = (gonio_bvb_parts){0};
    gonio_status status =
        lofting_init(&v.first, &v, GONIO_BVB_PHI_D, table->size, table->channels, table->values, error);
    status = status == GONIO_OK ? loft_with(&v, 1.0 / table->dims, out, error) : status;
    bool open = false;
    for (int d = 0; d < table->dims; d++) {
        open = open || loft->count[d] == 0;
    }
    if (status == GONIO_OK && open && !loft->equal) {
        status = use_tolerance(&v, out, error);
        if (status != GONIO_OK) {
            gonio_bvb_parts_release(out);
        }
    }
    lofting_release(&v.first);
    gonio_pool_free(v.pool);
    return status;
}

// ---- errors ----

gonio_bvb_lengths gonio_bvb_table_lengths(const gonio_bvb_table *t) {
    const size_t nodes = gonio_bvb_nodes(t), c = (size_t)t->channels;
    gonio_bvb_lengths lengths = {0};
    for (size_t i = 0; i < nodes; i++) {
        double square = 0;
        for (size_t k = 0; k < c; k++) {
            square += (double)t->values[i * c + k] * (double)t->values[i * c + k];
        }
        lengths.largest = fmax(lengths.largest, square);
        lengths.mean += sqrt(square) / (double)nodes;
    }
    lengths.largest = sqrt(lengths.largest);
    return lengths;
}

typedef struct comparison {
    const gonio_bvb_table *table;
    const gonio_bvb_parts *parts;
    const double *range;
    gonio_bvb_lengths *lengths; // a plane of one theta_i (and phi_i) each: largest square, sum; negative: no memory
} comparison;

// out[inner] = the control points along one axis at a node of the table; returns nothing but fills out.
static void contract(const gonio_bvb_parts *p, const gonio_bvb_table *t, int axis, size_t node, const double *points,
                     size_t inner, double *out) {
    double basis[GONIO_BVB_ORDER_MAX];
    const double x = (double)node / (double)(t->size[axis] - 1);
    const size_t first = gonio_bvb_basis(p->knots[axis], p->count[axis], p->order, x, basis);
    memset(out, 0, inner * sizeof *out);
    for (int f = 0; f < p->order; f++) {
        subtract(out, -basis[f], points + (first + (size_t)f) * inner, inner);
    }
}

static void compare_row(const comparison *c, const double *row, const float *values, gonio_bvb_lengths *sum) {
    const gonio_bvb_table *t = c->table;
    const size_t channels = (size_t)t->channels;
    double at[channels];
    for (size_t k = 0; k < t->size[GONIO_BVB_PHI_D]; k++) {
        contract(c->parts, t, GONIO_BVB_PHI_D, k, row, channels, at);
        double square = 0;
        for (size_t b = 0; b < channels; b++) {
            const double held = c->range != NULL ? fmin(fmax(at[b], c->range[2 * b]), c->range[2 * b + 1]) : at[b];
            const double left = held - (double)values[k * channels + b];
            square += left * left;
        }
        sum->largest = fmax(sum->largest, square);
        sum->mean += sqrt(square);
    }
}

static void compare_plane(void *context, size_t item) {
    const comparison *c = context;
    const gonio_bvb_parts *p = c->parts;
    const gonio_bvb_table *t = c->table;
    const size_t channels = (size_t)t->channels, row = p->count[2] * channels, plane = p->count[1] * row;
    const size_t volume = p->count[0] * plane, many = t->size[GONIO_BVB_THETA_I];
    double *all = malloc(volume * sizeof *all), *one = malloc((plane + row) * sizeof *one);
    c->lengths[item].largest = -1;
    if (all != NULL && one != NULL) {
        gonio_bvb_lengths sum = {0, 0};
        double basis[GONIO_BVB_ORDER_MAX] = {1};
        size_t first = 0;
        if (p->dims == 4) {
            first = gonio_bvb_basis(p->knots[3], p->count[3], p->order,
                                    (double)(item / many) / (double)(t->size[3] - 1), basis);
        }
        for (size_t k = 0; k < volume; k++) {
            all[k] = 0;
            for (size_t f = 0; f < (p->dims == 4 ? (size_t)p->order : 1); f++) {
                all[k] += basis[f] * (double)p->points[(first + f) * volume + k];
            }
        }
        contract(p, t, GONIO_BVB_THETA_I, item % many, all, plane, one);
        for (size_t j = 0; j < t->size[GONIO_BVB_THETA_O]; j++) {
            contract(p, t, GONIO_BVB_THETA_O, j, one, row, one + plane);
            const size_t at = (item * t->size[GONIO_BVB_THETA_O] + j) * t->size[GONIO_BVB_PHI_D];
            compare_row(c, one + plane, t->values + at * channels, &sum);
        }
        c->lengths[item] = sum;
    }
    free(all);
    free(one);
}

gonio_status gonio_bvb_errors(const gonio_bvb_table *table, const gonio_bvb_parts *parts, const double *range,
                              int threads, gonio_bvb_lengths *out, gonio_error *error) {
    const size_t planes = table->size[GONIO_BVB_PHI_I] * table->size[GONIO_BVB_THETA_I];
    comparison c = {table, parts, range, malloc(planes * sizeof *c.lengths)};
    gonio_status status = c.lengths != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for errors");
    *out = (gonio_bvb_lengths){0};
    if (status == GONIO_OK) {
        gonio_pool_for(threads, planes, compare_plane, &c);
    }
    for (size_t k = 0; k < planes && status == GONIO_OK; k++) {
        if (c.lengths[k].largest < 0) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory for errors");
        }
        out->largest = fmax(out->largest, c.lengths[k].largest);
        out->mean += c.lengths[k].mean;
    }
    out->largest = sqrt(out->largest);
    out->mean /= (double)gonio_bvb_nodes(table);
    free(c.lengths);
    return status;
}
