// SPDX-License-Identifier: BSD-3-Clause
// The prior's covariance as splines.
//
// k(x, .) = sum over modes of their prior variance times their value at x times the mode: a spline on the lattice. Its
// control points take d m^(d+1) products and each of its values 4^d, where the sum over modes takes m^d for each. So
// many samples are cheaper this way; a few are cheaper mode by mode (fit/smooth/dense.c).
#include <stdlib.h>
#include <string.h>

#include "brdf/spline/bspline.h"
#include "brdf/spline/lattice.h"
#include "fit/smooth/matrix.h"
#include "fit/smooth/modes.h"

#define BATCH ((size_t)16) // splines at once, fastest: sums over them run side by side

static bool odd_under(const gonio_smooth_dense *dense, unsigned axes, const size_t *mode) {
    bool odd = false;
    for (int d = 0; d < dense->dims; d++) {
        odd ^= (axes >> d & 1u) != 0 && dense->axis.odd[mode[d]];
    }
    return odd;
}

double gonio_smooth_modes_variance(const gonio_smooth_dense *dense, const size_t *mode) {
    if (odd_under(dense, dense->mirror_axes, mode)) {
        return 0;
    }
    double penalty = GONIO_SMOOTH_RIDGE;
    for (int d = 0; d < dense->dims; d++) {
        penalty += dense->form.stretch[d] * dense->axis.stiffness[mode[d]];
    }
    return (odd_under(dense, dense->swap_axes, mode) ? 1 - dense->form.reciprocity : 1) / penalty;
}

// Where a position lies: the first of its cell's control points, and the basis along each axis.
typedef struct place {
    size_t first;
    double weight[4][4];
} place;

static void locate(const gonio_smooth_dense *dense, const double *x, place *out) {
    *out = (place){0};
    for (int d = 0; d < dense->dims; d++) {
        const uint32_t fixed = gonio_bspline_fix(x[d]);
        out->first = out->first * dense->m + gonio_bspline_cell(fixed, dense->form.level);
        gonio_bspline_weights(gonio_bspline_place(fixed, dense->form.level), out->weight[d]);
    }
}

typedef struct splines {
    const gonio_smooth_dense *dense;
    size_t modes[4];        // of each axis; one that is mirrored by itself has its even ones alone
    uint16_t *mode[4];      // which
    double *matrix[4];      // m x modes: their control points
    size_t count;           // control points of the lattice
    double *variance;       // [product of modes]
    double *points, *other; // count x BATCH
} splines;

static void release(splines *s) {
    for (int d = 0; d < 4; d++) {
        free(s->mode[d]);
        free(s->matrix[d]);
    }
    free(s->variance);
    free(s->points);
    free(s->other);
}

static bool choose_modes(splines *s, int d) {
    const gonio_smooth_dense *dense = s->dense;
    const size_t m = dense->m;
    s->mode[d] = malloc(m * sizeof *s->mode[d]);
    s->matrix[d] = malloc(m * m * sizeof *s->matrix[d]);
    if (s->mode[d] == NULL || s->matrix[d] == NULL) {
        return false;
    }
    for (size_t j = 0; j < m; j++) {
        if (dense->mirror_axes != 1u << d || !dense->axis.odd[j]) {
            memcpy(s->matrix[d] + s->modes[d] * m, dense->axis.modes + j * m, m * sizeof(double));
            s->mode[d][s->modes[d]++] = (uint16_t)j;
        }
    }
    return true;
}

static gonio_status splines_init(splines *s, const gonio_smooth_dense *dense, gonio_error *error) {
    *s = (splines){.dense = dense, .count = gonio_lattice_count(dense->dims, dense->form.level)};
    size_t modes = 1;
    bool all = true;
    for (int d = 0; d < dense->dims && all; d++) {
        all = choose_modes(s, d);
        modes *= s->modes[d];
    }
    s->variance = malloc(modes * sizeof *s->variance);
    s->points = malloc(s->count * BATCH * sizeof *s->points);
    s->other = malloc(s->count * BATCH * sizeof *s->other);
    if (!all || s->variance == NULL || s->points == NULL || s->other == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu modes", modes);
    }
    for (size_t k = 0; k < modes; k++) {
        size_t rest = k, mode[4] = {0};
        for (int d = dense->dims - 1; d >= 0; d--) {
            mode[d] = s->mode[d][rest % s->modes[d]];
            rest /= s->modes[d];
        }
        s->variance[k] = gonio_smooth_modes_variance(dense, mode);
    }
    return GONIO_OK;
}

// Variance times the modes' values at points first .. first + BATCH - 1 (0 where there are none), in s->points.
static void fill_modes(splines *s, size_t points, size_t first, double *const feature[4]) {
    const size_t dims = (size_t)s->dense->dims, many = points - first < BATCH ? points - first : BATCH;
    size_t have = 1;
    for (size_t b = 0; b < BATCH; b++) {
        s->points[b] = b < many ? 1 : 0;
    }
    // An axis at a time, from the back: what is still to be read is not overwritten.
    for (size_t d = 0; d < dims; d++) {
        const size_t modes = s->modes[d];
        for (size_t k = have; k-- > 0;) {
            double line[BATCH];
            memcpy(line, s->points + k * BATCH, sizeof line);
            for (size_t j = modes; j-- > 0;) {
                const double *value = feature[d] + s->mode[d][j] * points + first;
                double *out = s->points + (k * modes + j) * BATCH;
                for (size_t b = 0; b < many; b++) {
                    out[b] = line[b] * value[b];
                }
                memset(out + many, 0, (BATCH - many) * sizeof *out);
            }
        }
        have *= modes;
    }
    for (size_t k = 0; k < have; k++) {
        for (size_t b = 0; b < BATCH; b++) {
            s->points[k * BATCH + b] *= s->variance[k];
        }
    }
}

// Modes -> control points along an axis whose neighbours are `inner` apart; `outer` times.
static void transform(splines *s, int d, size_t outer, size_t inner) {
    const size_t m = s->dense->m, modes = s->modes[d];
    for (size_t o = 0; o < outer; o++) {
        gonio_multiply(1, gonio_matrix_of(s->points + o * modes * inner, inner, modes),
                       gonio_matrix_transposed(gonio_matrix_of(s->matrix[d], m, modes)), 0,
                       gonio_matrix_of(s->other + o * m * inner, inner, m));
    }
    double *swap = s->points;
    s->points = s->other;
    s->other = swap;
}

// The axis with the fewest modes last: until then its half is all there is.
static void fill_points(splines *s, size_t points, size_t first, double *const feature[4]) {
    const int dims = s->dense->dims;
    size_t size[4];
    fill_modes(s, points, first, feature);
    memcpy(size, s->modes, sizeof size);
    for (int pass = 0; pass < 2; pass++) {
        for (int d = 0; d < dims; d++) {
            if ((s->modes[d] < s->dense->m) == (pass == 1)) {
                size_t outer = 1, inner = BATCH;
                for (int k = 0; k < dims; k++) {
                    outer *= k < d ? size[k] : 1;
                    inner *= k > d ? size[k] : 1;
                }
                transform(s, d, outer, inner);
                size[d] = s->dense->m;
            }
        }
    }
}

static void values_at(const splines *s, const place *p, double out[BATCH]) {
    const size_t m = s->dense->m, lines = s->dense->dims == 3 ? 16 : 64;
    const int last = s->dense->dims - 1;
    double sum[BATCH] = {0};
    for (size_t l = 0; l < lines; l++) {
        size_t at = 0;
        double weight = 1;
        for (int d = 0; d < last; d++) {
            const size_t k = l >> (2 * (last - 1 - d)) & 3;
            at = at * m + k;
            weight *= p->weight[d][k];
        }
        const double *line = s->points + (p->first + at * m) * BATCH;
        for (size_t k = 0; k < 4; k++) {
            const double w = weight * p->weight[last][k];
            for (size_t b = 0; b < BATCH; b++) {
                sum[b] += w * line[k * BATCH + b];
            }
        }
    }
    memcpy(out, sum, sizeof sum);
}

gonio_status gonio_smooth_covariance(const gonio_smooth_dense *dense, size_t points, const double *at,
                                     double *const feature[4], const double *scale, double *out, double *own,
                                     gonio_error *error) {
    const size_t n = dense->n, d = (size_t)dense->dims;
    splines s;
    double *x = malloc(n * d * sizeof *x), value[BATCH];
    place *samples = malloc(n * sizeof *samples), here;
    gonio_status status = splines_init(&s, dense, error);
    if (status == GONIO_OK && (x == NULL || samples == NULL)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu positions", n);
    }
    if (status == GONIO_OK) {
        gonio_dataset_locate(dense->data, dense->form.coordinates, x);
        for (size_t i = 0; i < n; i++) {
            locate(dense, x + i * d, &samples[i]);
        }
    }
    for (size_t first = 0; first < points && status == GONIO_OK; first += BATCH) {
        fill_points(&s, points, first, feature);
        for (size_t i = 0; i < n; i++) {
            values_at(&s, &samples[i], value);
            for (size_t b = 0; b < BATCH && first + b < points; b++) {
                out[(first + b) * n + i] = dense->root[i] * value[b] * (scale != NULL ? scale[first + b] : 1);
            }
        }
        for (size_t b = 0; own != NULL && b < BATCH && first + b < points; b++) {
            locate(dense, at + (first + b) * d, &here);
            values_at(&s, &here, value);
            own[first + b] = value[b];
        }
    }
    release(&s);
    free(x);
    free(samples);
    return status;
}
