// SPDX-License-Identifier: BSD-3-Clause
// A multilevel preconditioner: z = sum over all coarser lattices of  P_k D_k^-1 P_k^T r,  P_k the refinement of lattice
// k to the finest one, D_k the diagonal of the normal equations there (Bramble, Pasciak and Xu 1990, "Parallel
// multilevel preconditioners", eq. 1.6; with diagonals: Zhang 1992, "Multilevel Schwarz methods", section 3).
//
// Where no sample lies the penalty alone binds the control points together, and a diagonal alone carries a correction
// one stencil further an iteration: on 14,000 samples at level 6, 2,000 iterations were not enough. With these 100 are.
//
// The axes are two groups, and the coarser lattices are all pairs of levels, (h, g) for h, g = 0 to the finest: so one
// group may be a thousand times stiffer than the other (Griebel and Oswald 1995, "Tensor product type subspace
// splittings and multilevel iterative methods for anisotropic problems"). Lattices of equal levels alone need ever more
// iterations.
//
// A coarse lattice is weighed by (penalty / (penalty + samples))^2, of a lattice one level finer than itself: where
// samples alone hold the control points of that one, the coarser one has nothing to add and would only be counted
// twice.
//
// In float, since a preconditioner need not be exact. First the first group's axes, on blocks of 16 columns; then, rows
// transposed by 16, the second group's; so every step is on vectors of 16, whatever the axes.
#include "fit/smooth/precondition.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/spline/bspline.h"
#include "brdf/spline/clones.h"
#include "brdf/spline/lattice.h"

#define LEVELS 10 // 0 to 9
#define LANES 16

struct gonio_smooth_precondition {
    int dims, split, level;    // the first `split` axes are one group
    size_t rows[LEVELS + 1];   // where the rows of each level of the first group begin
    size_t cells[LEVELS + 1];  // where the columns of each level of the second group begin, finest first
    size_t columns, blocks;    // of the second group's finest level; its blocks of 16
    size_t row_blocks, stride; // blocks of 16 rows, and cells a row with room to work
    float *first;              // all rows x blocks of 16 columns
    float *between;            // as the finest rows: what lies between two axes
    float *second;             // row blocks x stride x 16
    float *inverse;            // row blocks x cells x 16
    const double *from;        // of the apply under way
    double *to;
};

static size_t power(size_t base, int exponent) {
    size_t p = 1;
    while (exponent-- > 0) {
        p *= base;
    }
    return p;
}

static int second_axes(const gonio_smooth_precondition *p) { return p->dims - p->split; }

// ---- one axis, 16 lanes ----

typedef struct axis {
    size_t m, outer, inner; // coarse points; lines before and points behind each
    size_t step;            // floats from one point to the next
} axis;

// out = refined in, or out += it; (p - + 6 p + p +)/8 at even points, the mean of two at odd ones.
GONIO_INLINE void refine(const axis *x, const float *in, float *out, const bool add) {
    const size_t fine = 2 * (x->m - 3) + 3;
    for (size_t o = 0; o < x->outer; o++) {
        for (size_t i = 0; i < fine; i++) {
            const size_t k = (i + 1) / 2;
            for (size_t j = 0; j < x->inner; j++) {
                const float *b = in + ((o * x->m + k) * x->inner + j) * x->step;
                float *t = out + ((o * fine + i) * x->inner + j) * x->step;
                const gonio_f16 here = *(const gonio_f16 *)b, next = *(const gonio_f16 *)(b + x->inner * x->step);
                gonio_f16 sum = {0};
                if (add) {
                    sum = *(gonio_f16 *)t;
                }
                if (i % 2 == 1) {
                    sum += 0.125F * (*(const gonio_f16 *)(b - x->inner * x->step) + next) + 0.75F * here;
                } else {
                    sum += 0.5F * (here + next);
                }
                *(gonio_f16 *)t = sum;
            }
        }
    }
}

// Its transpose, out[coarse] from in[fine].
GONIO_INLINE void restrict_to(const axis *x, const float *in, float *out) {
    static const float stencil[5] = {0.125F, 0.5F, 0.75F, 0.5F, 0.125F};
    const size_t fine = 2 * (x->m - 3) + 3;
    for (size_t o = 0; o < x->outer; o++) {
        for (size_t i = 0; i < x->m; i++) {
            for (size_t j = 0; j < x->inner; j++) {
                gonio_f16 sum = {0};
                for (size_t k = 0; k < 5; k++) {
                    if (2 * i + k >= 3 && 2 * i + k - 3 < fine) {
                        const size_t at = (o * fine + 2 * i + k - 3) * x->inner + j;
                        sum += stencil[k] * *(const gonio_f16 *)(in + at * x->step);
                    }
                }
                *(gonio_f16 *)(out + ((o * x->m + i) * x->inner + j) * x->step) = sum;
            }
        }
    }
}

// One or two axes at once, from level `coarse` + 1 down to it or back. room: for what lies between two axes.
GONIO_INLINE void restrict_axes(int axes, int coarse, size_t step, const float *in, float *out, float *room) {
    const size_t m = gonio_bspline_size(coarse), fine = gonio_bspline_size(coarse + 1);
    if (axes == 1) {
        restrict_to(&(axis){m, 1, 1, step}, in, out);
    } else {
        restrict_to(&(axis){m, 1, fine, step}, in, room);
        restrict_to(&(axis){m, m, 1, step}, room, out);
    }
}

GONIO_INLINE void refine_axes(int axes, int coarse, size_t step, const float *in, float *out, float *room) {
    const size_t m = gonio_bspline_size(coarse), fine = gonio_bspline_size(coarse + 1);
    if (axes == 1) {
        refine(&(axis){m, 1, 1, step}, in, out, true);
    } else {
        refine(&(axis){m, 1, m, step}, in, room, false);
        refine(&(axis){m, fine, 1, step}, room, out, true);
    }
}

// ---- the first group: a block of columns each ----

static float *row_of(const gonio_smooth_precondition *p, int level, size_t block) {
    return p->first + (p->rows[level] * p->blocks + block) * LANES;
}

GONIO_CLONES static void first_down(gonio_smooth_precondition *p, size_t block) {
    const size_t begin = block * LANES, step = p->blocks * LANES, rows = power(gonio_bspline_size(p->level), p->split);
    const size_t width = p->columns - begin < LANES ? p->columns - begin : LANES;
    float *finest = row_of(p, p->level, block);
    for (size_t r = 0; r < rows; r++) {
        for (size_t k = 0; k < LANES; k++) {
            finest[r * step + k] = k < width ? (float)p->from[r * p->columns + begin + k] : 0;
        }
    }
    for (int h = p->level - 1; h >= 0; h--) {
        restrict_axes(p->split, h, step, row_of(p, h + 1, block), row_of(p, h, block), p->between + begin);
    }
}

GONIO_CLONES static void first_up(gonio_smooth_precondition *p, size_t block) {
    const size_t begin = block * LANES, step = p->blocks * LANES, rows = power(gonio_bspline_size(p->level), p->split);
    const size_t width = p->columns - begin < LANES ? p->columns - begin : LANES;
    for (int h = 0; h < p->level; h++) {
        refine_axes(p->split, h, step, row_of(p, h, block), row_of(p, h + 1, block), p->between + begin);
    }
    const float *finest = row_of(p, p->level, block);
    for (size_t r = 0; r < rows; r++) {
        for (size_t k = 0; k < width; k++) {
            p->to[r * p->columns + begin + k] = (double)finest[r * step + k];
        }
    }
}

// ---- the second group: 16 rows each ----

static size_t rows_in(const gonio_smooth_precondition *p, size_t block) {
    const size_t left = p->rows[LEVELS] - block * LANES;
    return left < LANES ? left : LANES;
}

GONIO_CLONES static void second_down(gonio_smooth_precondition *p, size_t block) {
    float *lanes = p->second + block * p->stride * LANES;
    const size_t count = rows_in(p, block), step = p->blocks * LANES;
    const float *rows = p->first + block * LANES * step;
    for (size_t c = 0; c < p->columns; c++) {
        for (size_t k = 0; k < LANES; k++) {
            lanes[c * LANES + k] = k < count ? rows[k * step + c] : 0;
        }
    }
    float *room = lanes + p->cells[LEVELS] * LANES;
    for (int h = p->level - 1; h >= 0; h--) {
        restrict_axes(second_axes(p), h, LANES, lanes + p->cells[h + 1] * LANES, lanes + p->cells[h] * LANES, room);
    }
}

GONIO_CLONES static void second_up(gonio_smooth_precondition *p, size_t block) {
    float *lanes = p->second + block * p->stride * LANES;
    const float *inverse = p->inverse + block * p->cells[LEVELS] * LANES;
    for (size_t i = 0; i < p->cells[LEVELS] * LANES; i += LANES) {
        *(gonio_f16 *)(lanes + i) *= *(const gonio_f16 *)(inverse + i);
    }
    float *room = lanes + p->cells[LEVELS] * LANES;
    for (int h = 0; h < p->level; h++) {
        refine_axes(second_axes(p), h, LANES, lanes + p->cells[h] * LANES, lanes + p->cells[h + 1] * LANES, room);
    }
    const size_t count = rows_in(p, block), step = p->blocks * LANES;
    float *rows = p->first + block * LANES * step;
    for (size_t c = 0; c < p->columns; c++) {
        for (size_t k = 0; k < count; k++) {
            rows[k * step + c] = lanes[c * LANES + k];
        }
    }
}

static void down_columns(void *context, size_t block) { first_down(context, block); }
static void down_rows(void *context, size_t block) { second_down(context, block); }
static void up_columns(void *context, size_t block) { first_up(context, block); }

static void across_rows(void *context, size_t block) {
    second_down(context, block);
    second_up(context, block);
}

void gonio_smooth_precondition_apply(gonio_smooth_precondition *p, gonio_pool *pool, const double *r, double *z) {
    p->from = r;
    p->to = z;
    gonio_pool_run(pool, p->blocks, down_columns, p);
    gonio_pool_run(pool, p->row_blocks, across_rows, p);
    gonio_pool_run(pool, p->blocks, up_columns, p);
}

// ---- the diagonals ----

#define SIZE_MAX_1D 516 // points of level 9

// The basis function in the middle of each level, refined to the finest: sums of the squares of its control points
// there, and of their second differences.
static void norms(int finest, double *squares, double *curvature) {
    for (int h = 0; h <= finest; h++) {
        double x[SIZE_MAX_1D] = {0}, y[SIZE_MAX_1D];
        x[gonio_bspline_size(h) / 2] = 1;
        for (int k = h; k < finest; k++) {
            const size_t fine = gonio_bspline_size(k + 1);
            for (size_t i = 0; i < fine; i++) {
                const double *b = x + (i + 1) / 2;
                y[i] = i % 2 == 1 ? 0.125 * (b[-1] + 6 * b[0] + b[1]) : 0.5 * (b[0] + b[1]);
            }
            memcpy(x, y, fine * sizeof *x);
        }
        squares[h] = curvature[h] = 0;
        for (size_t i = 0; i < gonio_bspline_size(finest); i++) {
            const double bend = i + 2 < gonio_bspline_size(finest) ? x[i] - 2 * x[i + 1] + x[i + 2] : 0;
            squares[h] += x[i] * x[i];
            curvature[h] += bend * bend;
        }
    }
}

// The diagonal of R at levels (a, b) of the two groups.
static double penalty_diagonal(const gonio_smooth_precondition *p, const gonio_smooth_form *form, int a, int b,
                               const double *squares, const double *curvature) {
    double all = 1, sum = 0;
    for (int d = 0; d < p->dims; d++) {
        all *= squares[d < p->split ? a : b];
    }
    for (int d = 0; d < p->dims; d++) {
        const int h = d < p->split ? a : b;
        sum += form->stretch[d] * all * curvature[h] / squares[h];
    }
    return ldexp(sum, p->level) + GONIO_SMOOTH_RIDGE * all;
}

// A basis function's square against itself, summed over samples that lie evenly: 151/315 of its sum, an axis.
static double diagonal_share(int dims) { return pow(151.0 / 315, dims); }

static float inverse_of(double samples, double penalty, bool finest) {
    // One level finer the penalty is 2^4 times as large against the samples.
    const double held = finest ? 1 : 16 * penalty / (16 * penalty + samples);
    const double sum = samples + penalty;
    // Without a penalty, points that no sample touches keep their start.
    return sum > 1e-30 && held > 0 ? (float)(held * held / sum) : 0;
}

static void fill_inverse(gonio_smooth_precondition *p, const gonio_smooth_form *form, double lambda,
                         const double *diagonal) {
    double squares[LEVELS], curvature[LEVELS];
    norms(p->level, squares, curvature);
    const double share = diagonal_share(p->dims);
    for (int a = 0; a <= p->level; a++) {
        for (int b = 0; b <= p->level; b++) {
            const double penalty = lambda * penalty_diagonal(p, form, a, b, squares, curvature);
            const bool finest = a == p->level && b == p->level;
            const size_t cells = power(gonio_bspline_size(b), second_axes(p));
            for (size_t row = p->rows[a]; row < p->rows[a] + power(gonio_bspline_size(a), p->split); row++) {
                const size_t block = row / LANES, lane = row % LANES;
                const float *lumped = p->second + (block * p->stride + p->cells[b]) * LANES + lane;
                float *out = p->inverse + (block * p->cells[LEVELS] + p->cells[b]) * LANES + lane;
                for (size_t c = 0; c < cells; c++) {
                    const double samples =
                        finest ? diagonal[(row - p->rows[a]) * cells + c] : share * (double)lumped[c * LANES];
                    out[c * LANES] = inverse_of(samples, penalty, finest);
                }
            }
        }
    }
}

// ---- making one ----

typedef struct sizes {
    size_t first, between, second, inverse; // floats
} sizes;

static sizes lay_out(gonio_smooth_precondition *p, int dims, const gonio_smooth_form *form, int level) {
    p->dims = dims;
    p->level = level;
    // The stiff axes by themselves: the incidence, or the difference angle (fit/auto/descent.c).
    int slow;
    const int first = gonio_coordinates_slow_axes(form->coordinates, dims, &slow);
    p->split = first > 0 ? first : slow;
    const size_t finest = gonio_bspline_size(p->level);
    size_t rows = 0, cells = 0;
    for (int h = p->level; h >= 0; h--) {
        p->rows[h] = rows;
        p->cells[h] = cells;
        rows += power(gonio_bspline_size(h), p->split);
        cells += power(gonio_bspline_size(h), second_axes(p));
    }
    p->rows[LEVELS] = rows;
    p->cells[LEVELS] = cells;
    p->columns = power(finest, second_axes(p));
    p->blocks = (p->columns + LANES - 1) / LANES;
    p->row_blocks = (rows + LANES - 1) / LANES;
    p->stride = cells + (second_axes(p) == 2 ? p->columns : 0);
    return (sizes){.first = rows * p->blocks * LANES,
                   .between = power(finest, p->split) * p->blocks * LANES,
                   .second = p->row_blocks * p->stride * LANES,
                   .inverse = p->row_blocks * cells * LANES};
}

static double bytes_of(const sizes *s) {
    return sizeof(float) * (double)(s->first + s->between + s->second + s->inverse);
}

double gonio_smooth_precondition_memory(int dims, const gonio_smooth_form *form, int level) {
    gonio_smooth_precondition unused = {0};
    const sizes s = lay_out(&unused, dims, form, level);
    return bytes_of(&s);
}

void gonio_smooth_precondition_free(gonio_smooth_precondition *p) {
    if (p != NULL) {
        free(p->first);
        free(p->between);
        free(p->second);
        free(p->inverse);
        free(p);
    }
}

gonio_status gonio_smooth_precondition_new(int dims, const gonio_smooth_form *form, int level, double lambda,
                                           const double *lumped, const double *diagonal, gonio_pool *pool,
                                           gonio_smooth_precondition **out, gonio_error *error) {
    gonio_smooth_precondition *p = *out = calloc(1, sizeof *p);
    if (p == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a preconditioner");
    }
    const sizes s = lay_out(p, dims, form, level);
    p->first = malloc(s.first * sizeof(float));
    p->between = malloc(s.between * sizeof(float));
    p->second = malloc(s.second * sizeof(float));
    p->inverse = calloc(s.inverse, sizeof(float));
    if (p->first == NULL || p->between == NULL || p->second == NULL || p->inverse == NULL) {
        gonio_smooth_precondition_free(p);
        *out = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a preconditioner of level %d (%.3g GB)", level,
                          1e-9 * bytes_of(&s));
    }
    p->from = lumped;
    gonio_pool_run(pool, p->blocks, down_columns, p);
    gonio_pool_run(pool, p->row_blocks, down_rows, p);
    fill_inverse(p, form, lambda, diagonal);
    return GONIO_OK;
}
