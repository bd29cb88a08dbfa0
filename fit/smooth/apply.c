// SPDX-License-Identifier: BSD-3-Clause
// Gathering and scattering between samples and a lattice of doubles, by rows of four control points
// (brdf/spline/rows.h).
#include "fit/smooth/apply.h"

#include <stdlib.h>

#include "brdf/spline/rows.h"
#include "fit/prepare/scatter.h"

void gonio_smooth_places_release(gonio_smooth_places *places) {
    free(places->positions);
    free(places->weights);
    free(places->sample);
    *places = (gonio_smooth_places){0};
}

typedef struct entry {
    uint64_t key;
    size_t sample;
} entry;

static int by_key(const void *left, const void *right) {
    const entry *a = left, *b = right;
    if (a->key != b->key) {
        return a->key > b->key ? 1 : -1;
    }
    return (a->sample > b->sample) - (a->sample < b->sample);
}

// Cells in the order of the lattice's memory at the finest level; within a cell, the data's order.
static uint64_t cell_key(const uint32_t *position, int dims, int level) {
    uint64_t key = 0;
    for (int d = 0; d < dims; d++) {
        key = key << 9 | gonio_bspline_cell(position[d], level);
    }
    return key;
}

gonio_status gonio_smooth_places_init(gonio_smooth_places *places, const gonio_dataset *data,
                                      const gonio_smooth_form *form, gonio_error *error) {
    const size_t n = data->n, d = (size_t)data->dims;
    *places = (gonio_smooth_places){.n = n, .dims = data->dims};
    places->mirror_axes = form->mirror ? gonio_coordinates_mirror_axes(form->coordinates, data->dims) : 0;
    places->positions = malloc(n * 4 * sizeof *places->positions);
    places->weights = malloc(n * sizeof *places->weights);
    places->sample = malloc(n * sizeof *places->sample);
    entry *order = malloc(n * sizeof *order);
    double *x = malloc(n * d * sizeof *x);
    gonio_status status = GONIO_OK;
    if (places->positions == NULL || places->weights == NULL || places->sample == NULL || order == NULL || x == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to place %zu samples (%.3g GB)", n, 80e-9 * (double)n);
        gonio_smooth_places_release(places);
    } else {
        gonio_dataset_locate(data, form->coordinates, x);
        for (size_t i = 0; i < n; i++) {
            uint32_t p[4] = {0};
            for (size_t k = 0; k < d; k++) {
                p[k] = gonio_bspline_fix(x[i * d + k]);
            }
            order[i] = (entry){cell_key(p, data->dims, form->level), i};
        }
        qsort(order, n, sizeof *order, by_key);
        for (size_t i = 0; i < n; i++) {
            const size_t sample = places->sample[i] = order[i].sample;
            places->weights[i] = data->weights[sample];
            for (size_t k = 0; k < 4; k++) {
                places->positions[4 * i + k] = k < d ? gonio_bspline_fix(x[sample * d + k]) : 0;
            }
        }
    }
    free(order);
    free(x);
    return status;
}

// ---- one sample ----

GONIO_INLINE size_t row_offset(size_t size, const int dims, size_t r) {
    return dims == 3 ? (r / 4 * size + r % 4) * size : ((r / 16 * size + r / 4 % 4) * size + r % 4) * size;
}

// Products of the leading axes' basis functions: 16 or 64 rows.
GONIO_INLINE void row_weights(const gonio_place *place, const int dims, double *weight) {
    const gonio_d4 *b = place->basis;
    GONIO_UNROLL
    for (int i = 0; i < 4; i++) {
        GONIO_UNROLL
        for (int j = 0; j < 4; j++) {
            const double w = b[i][0] * b[j][1];
            if (dims == 3) {
                weight[4 * i + j] = w;
                continue;
            }
            for (int k = 0; k < 4; k++) {
                weight[16 * i + 4 * j + k] = w * b[k][2];
            }
        }
    }
}

GONIO_INLINE double gather(const double *points, size_t size, const int dims, const gonio_place *place,
                           const double *weight) {
    const double *base = points + place->first;
    gonio_d4 even = {0}, odd = {0}, last;
    for (size_t r = 0; r < (dims == 3 ? 16 : 64); r += 2) {
        even += weight[r] * *(const gonio_d4 *)(base + row_offset(size, dims, r));
        odd += weight[r + 1] * *(const gonio_d4 *)(base + row_offset(size, dims, r + 1));
    }
    gonio_rows_last(place, dims, &last);
    const gonio_d4 sum = (even + odd) * last;
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

GONIO_INLINE void scatter(double *points, size_t size, const int dims, const gonio_place *place, const double *weight,
                          const gonio_d4 *row) {
    double *base = points + place->first;
    for (size_t r = 0; r < (dims == 3 ? 16 : 64); r++) {
        *(gonio_d4 *)(base + row_offset(size, dims, r)) += weight[r] * *row;
    }
}

static double sum_of_squares(const double *weight, int rows, const gonio_d4 *last) {
    double sum = 0;
    for (int r = 0; r < rows; r++) {
        sum += weight[r] * weight[r];
    }
    const gonio_d4 s = *last * *last;
    return sum * ((s[0] + s[1]) + (s[2] + s[3]));
}

typedef struct job {
    const gonio_smooth_places *places;
    int level;
    gonio_smooth_pass pass;
    const double *targets;
    size_t stride;
    const double *in;
    double *out;
    size_t parity; // of the slabs of this half
    const size_t *begin;
} job;

GONIO_INLINE void run(const job *j, size_t begin, size_t end, const int dims, const gonio_smooth_pass pass) {
    const gonio_smooth_places *p = j->places;
    const size_t size = gonio_bspline_size(j->level);
    const int rows = dims == 3 ? 16 : 64;
    for (size_t i = begin; i < end; i++) {
        gonio_place place;
        gonio_d4 last;
        double weight[64];
        gonio_rows_locate(p->positions + 4 * i, j->level, size, dims, &place);
        row_weights(&place, dims, weight);
        gonio_rows_last(&place, dims, &last);
        double amount = p->weights[i];
        if (pass == GONIO_SMOOTH_NORMAL) {
            amount *= gather(j->in, size, dims, &place, weight);
        } else if (pass != GONIO_SMOOTH_DIAGONAL) {
            amount *= j->targets[p->sample[i] * j->stride] - gather(j->in, size, dims, &place, weight);
        }
        gonio_d4 row = last;
        if (pass == GONIO_SMOOTH_MBA) {
            amount /= sum_of_squares(weight, rows, &last);
            row = last * last * last;
        } else if (pass == GONIO_SMOOTH_DIAGONAL) {
            row = last * last;
        }
        for (int r = 0; r < rows && (pass == GONIO_SMOOTH_MBA || pass == GONIO_SMOOTH_DIAGONAL); r++) {
            weight[r] *= pass == GONIO_SMOOTH_MBA ? weight[r] * weight[r] : weight[r];
        }
        row *= amount;
        scatter(j->out, size, dims, &place, weight, &row);
    }
}

#define PASS(name, pass)                                                                                               \
    GONIO_CLONES static void name(const job *j, size_t begin, size_t end) {                                            \
        if (j->places->dims == 3) {                                                                                    \
            run(j, begin, end, 3, pass);                                                                               \
        } else {                                                                                                       \
            run(j, begin, end, 4, pass);                                                                               \
        }                                                                                                              \
    }
PASS(run_normal, GONIO_SMOOTH_NORMAL)
PASS(run_residual, GONIO_SMOOTH_RESIDUAL)
PASS(run_diagonal, GONIO_SMOOTH_DIAGONAL)
PASS(run_mba, GONIO_SMOOTH_MBA)

// ---- slabs ----

#define SLABS_MAX 128

// Cells a slab along the first axis: at least 4, so that slabs two apart share none of their 3 points' overlap.
static size_t slab_cells(int level) {
    const size_t cells = (size_t)1 << level;
    return cells / SLABS_MAX > 4 ? cells / SLABS_MAX : 4;
}

static size_t find_slabs(const gonio_smooth_places *places, int level, size_t *begin) {
    const size_t cells = (size_t)1 << level, width = slab_cells(level), slabs = (cells + width - 1) / width;
    size_t at = 0;
    for (size_t s = 0; s < slabs; s++) {
        begin[s] = at;
        // Binary search for the first position beyond the slab.
        size_t low = at, high = places->n;
        while (low < high) {
            const size_t middle = low + (high - low) / 2;
            if (gonio_bspline_cell(places->positions[4 * middle], level) / width > s) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        at = low;
    }
    begin[slabs] = places->n;
    return slabs;
}

static void run_slab(void *context, size_t item) {
    const job *j = context;
    const size_t slab = 2 * item + j->parity;
    (j->pass == GONIO_SMOOTH_NORMAL     ? run_normal
     : j->pass == GONIO_SMOOTH_RESIDUAL ? run_residual
     : j->pass == GONIO_SMOOTH_MBA      ? run_mba
                                        : run_diagonal)(j, j->begin[slab], j->begin[slab + 1]);
}

void gonio_smooth_apply(const gonio_smooth_places *places, gonio_pool *pool, int level, gonio_smooth_pass pass,
                        const double *targets, size_t stride, const double *in, double *out) {
    size_t begin[SLABS_MAX + 2];
    const size_t slabs = find_slabs(places, level, begin);
    job j = {places, level, pass, targets, stride, in, out, 0, begin};
    for (j.parity = 0; j.parity < 2 && j.parity < slabs; j.parity++) {
        gonio_pool_run(pool, (slabs - j.parity + 1) / 2, run_slab, &j);
    }
}

void gonio_smooth_symmetrise(const gonio_smooth_places *places, int level, double *out) {
    if (places->mirror_axes == 0) {
        return;
    }
    const size_t m = gonio_bspline_size(level), count = gonio_lattice_count(places->dims, level);
    size_t at[4] = {0};
    for (size_t i = 0; i < count; i++) {
        size_t image = 0;
        for (int d = 0; d < places->dims; d++) {
            image = image * m + ((places->mirror_axes >> d & 1u) != 0 ? m - 1 - at[d] : at[d]);
        }
        if (image >= i) {
            out[i] = out[image] = out[i] + out[image];
        }
        for (int d = places->dims - 1; d >= 0 && ++at[d] == m; d--) {
            at[d] = 0;
        }
    }
}

void gonio_smooth_places_eval(const gonio_smooth_places *places, int level, const double *in, double *values,
                              size_t stride) {
    const size_t size = gonio_bspline_size(level);
    for (size_t i = 0; i < places->n; i++) {
        gonio_place place;
        double weight[64];
        if (places->dims == 3) {
            gonio_rows_locate(places->positions + 4 * i, level, size, 3, &place);
            row_weights(&place, 3, weight);
            values[places->sample[i] * stride] = gather(in, size, 3, &place, weight);
        } else {
            gonio_rows_locate(places->positions + 4 * i, level, size, 4, &place);
            row_weights(&place, 4, weight);
            values[places->sample[i] * stride] = gather(in, size, 4, &place, weight);
        }
    }
}
