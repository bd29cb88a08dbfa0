// SPDX-License-Identifier: BSD-3-Clause
// Control lattices: storage, refinement, plain evaluation.
//
// Refinement is exact: a uniform cubic B-spline is also one on half the spacing, with
//   fine[2i] = (coarse[i-1] + 6 coarse[i] + coarse[i+1]) / 8,   fine[2i+1] = (coarse[i] + coarse[i+1]) / 2
// along each axis in turn (Lee, Wolberg and Shin 1997, section 4.2). So the sum over levels stays one lattice, and an
// evaluation costs the same whatever the number of levels.
#include "brdf/spline/lattice.h"

#include <stdlib.h>
#include <string.h>

#include "brdf/spline/refine.h"

size_t gonio_lattice_count(int dims, int level) {
    size_t count = 1;
    for (int d = 0; d < dims; d++) {
        if (__builtin_mul_overflow(count, gonio_bspline_size(level), &count)) {
            return 0;
        }
    }
    return count;
}

gonio_status gonio_lattice_init(gonio_lattice *lattice, int dims, int level, int channels, gonio_error *error) {
    *lattice = (gonio_lattice){.dims = dims, .level = level, .channels = channels};
    if (dims < 2 || dims > GONIO_DIMS_MAX || level < 0 || level > 9 || channels < 1) {
        return gonio_fail(error, GONIO_E_RANGE, "a lattice of %d dimensions, level %d, %d channels; 2 to 4, 0 to 9, 1+",
                          dims, level, channels);
    }
    lattice->size = gonio_bspline_size(level);
    lattice->count = gonio_lattice_count(dims, level);
    lattice->points = calloc(lattice->count, (size_t)channels * sizeof(float));
    if (lattice->points == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a level %d lattice of %d channels (%.3g GB)", level,
                          channels, (double)lattice->count * channels * sizeof(float) / 1e9);
    }
    return GONIO_OK;
}

void gonio_lattice_release(gonio_lattice *lattice) {
    free(lattice->points);
    lattice->points = NULL;
}

void gonio_lattice_fill(gonio_lattice *lattice, const double *values) {
    float *p = lattice->points;
    for (size_t i = 0; i < lattice->count; i++) {
        for (int c = 0; c < lattice->channels; c++) {
            *p++ = (float)values[c];
        }
    }
}

#define OF_THREE(a, b, c) (0.125f * ((a) + (c)) + 0.75f * (b))
GONIO_REFINE(refine, float, OF_THREE)

// One plane of the finer lattice after another: what lies between the passes, work[2][plane], stays in a cache.
static void refine_plane(const gonio_lattice *coarse, const gonio_lattice *fine, size_t s, float *work) {
    const size_t plane = fine->count / fine->size * (size_t)fine->channels;
    size_t inner = coarse->count / coarse->size * (size_t)coarse->channels, outer = 1;
    const float *from = work;
    refine_point(coarse->points, s, inner, work);
    for (int d = 1; d < coarse->dims; d++) {
        float *to = d == coarse->dims - 1 ? fine->points + s * plane : from == work ? work + plane : work;
        inner /= coarse->size;
        refine_axis(from, to, outer, coarse->size, inner);
        outer *= fine->size;
        from = to;
    }
}

gonio_status gonio_lattice_refine(gonio_lattice *lattice, gonio_error *error) {
    gonio_lattice fine;
    const gonio_status status = gonio_lattice_init(&fine, lattice->dims, lattice->level + 1, lattice->channels, error);
    if (status != GONIO_OK) {
        gonio_lattice_release(&fine);
        return status;
    }
    float *work = malloc(2 * (fine.count / fine.size) * (size_t)fine.channels * sizeof *work);
    if (work == NULL) {
        gonio_lattice_release(&fine);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to refine to level %d", fine.level);
    }
    for (size_t s = 0; s < fine.size; s++) {
        refine_plane(lattice, &fine, s, work);
    }
    free(work);
    gonio_lattice_release(lattice);
    *lattice = fine;
    return GONIO_OK;
}

// The 4 x dims weights and the first control point of the cell that holds x.
static size_t locate(const gonio_lattice *lattice, const double *x, double w[GONIO_DIMS_MAX][4],
                     double place[GONIO_DIMS_MAX]) {
    size_t first = 0;
    for (int d = 0; d < lattice->dims; d++) {
        const uint32_t fixed = gonio_bspline_fix(x[d]);
        first = first * lattice->size + gonio_bspline_cell(fixed, lattice->level);
        place[d] = gonio_bspline_place(fixed, lattice->level);
        gonio_bspline_weights(place[d], w[d]);
    }
    return first;
}

// Sum over the rows of 4 control points along the last axis; leading axes in weights w[0 .. dims - 2].
static double sum_rows(const gonio_lattice *lattice, size_t first, double w[GONIO_DIMS_MAX][4], int channel) {
    const int last = lattice->dims - 1, rows = 1 << 2 * last;
    double sum = 0;
    for (int r = 0; r < rows; r++) {
        double weight = 1;
        size_t offset = 0;
        for (int d = 0; d < last; d++) {
            const int k = r >> 2 * (last - 1 - d) & 3;
            weight *= w[d][k];
            offset = (offset + (size_t)k) * lattice->size;
        }
        const float *p = lattice->points + (first + offset) * (size_t)lattice->channels + channel;
        for (int k = 0; k < 4; k++) {
            sum += weight * w[last][k] * (double)p[k * lattice->channels];
        }
    }
    return sum;
}

void gonio_lattice_eval(const gonio_lattice *lattice, const double *x, double *values) {
    double w[GONIO_DIMS_MAX][4], place[GONIO_DIMS_MAX];
    const size_t first = locate(lattice, x, w, place);
    for (int c = 0; c < lattice->channels; c++) {
        values[c] = sum_rows(lattice, first, w, c);
    }
}

double gonio_lattice_eval_channel(const gonio_lattice *lattice, const double *x, int channel) {
    double w[GONIO_DIMS_MAX][4], place[GONIO_DIMS_MAX];
    const size_t first = locate(lattice, x, w, place);
    return sum_rows(lattice, first, w, channel);
}

double gonio_lattice_gradient(const gonio_lattice *lattice, const double *x, int channel, double *gradient) {
    double w[GONIO_DIMS_MAX][4], place[GONIO_DIMS_MAX], kept[4];
    const size_t first = locate(lattice, x, w, place);
    const double cells = (double)(lattice->size - 3);
    for (int d = 0; d < lattice->dims; d++) {
        memcpy(kept, w[d], sizeof kept);
        gonio_bspline_slopes(place[d], w[d]);
        gradient[d] = cells * sum_rows(lattice, first, w, channel);
        memcpy(w[d], kept, sizeof kept);
    }
    return sum_rows(lattice, first, w, channel);
}
