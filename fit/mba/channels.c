// SPDX-License-Identifier: BSD-3-Clause
// The inner loop of a multilevel fit of several channels.
//
// The sums of 31 channels are 16 KB a cell: adding one sample at a time, loading and storing them takes longer than the
// arithmetic. Neighbours in the sorted order mostly share their cell, so they are taken together, a run at a time, and
// a run's share of a cell is a product of two small matrices:
//   sums[row r][k, c] += sum_s A[r][s] G[s][k, c],   A = w_r^3 of the leading axes, G = z_k^3 q r_c / sum w^2
// (fit/mba/kernel.c; where c is the denominator w_r^2 and q z_k^2). Sixteen rows' sums stay in registers over the
// run, so the cell is loaded and stored once, and so are the lattice's rows from which the residuals are taken.
#include <string.h>

#include "fit/mba/kernel.h"
#include "fit/mba/powers.h"

#define RUN_MAX 8
// Doubles of G that a run may have: with its cell's sums and points they are to stay in a first-level cache.
#define RUN_DOUBLES 1024

typedef struct run {
    size_t n;              // samples
    double *const *planes; // the sums of their cell's four planes
    size_t at;             // the cell's first control point in a plane
    gonio_place places[RUN_MAX];
    gonio_powers powers[RUN_MAX];
    float weights[RUN_MAX][16]; // of the rows; 3-D only
    double *rows;               // G: n x 4 x stride
} run;

// G: per k (q z_k^2, z_k^3 f_0, z_k^3 f_1 ...); f holds one unused place and then f_c = q r_c / sum w^2, padded with
// zeros to the stride.
GONIO_INLINE void fill_row(const gonio_d2 *z, double q, const double *f, const size_t stride, double *row) {
    GONIO_UNROLL
    for (int k = 0; k < 4; k++) {
        double *out = row + (size_t)k * stride;
        for (size_t v = 0; v < stride; v += 4) {
            *(gonio_d4 *)(out + v) = z[k][1] * *(const gonio_d4 *)(f + v);
        }
        out[0] = q * z[k][0];
    }
}

// f from the values z and what the lattice gives for them.
GONIO_INLINE void fill_residuals(const float *z, const float *values, size_t channels, double factor, double *f) {
    size_t c = 0;
    for (; c + 4 <= channels; c += 4) {
        const gonio_f4 r = *(const gonio_f4 *)(z + c) - *(const gonio_f4 *)(values + c);
        *(gonio_d4 *)(f + 1 + c) = factor * __builtin_convertvector(r, gonio_d4);
    }
    for (; c < channels; c++) {
        f[1 + c] = factor * (double)(z[c] - values[c]);
    }
}

// The pair of row r: (w^2, w^3).
GONIO_INLINE void row_pair(const gonio_powers *p, int r, const int dims, gonio_d2 *w) {
    *w = dims == 3 ? p->pairs[0][r / 4] * p->pairs[1][r % 4]
                   : p->pairs[0][r / 16] * p->pairs[1][r / 4 % 4] * p->pairs[2][r % 4];
}

// The factors of rows begin .. begin + 15 of one sample: cubes, and mixed for the 8 doubles that begin with a
// denominator.
typedef struct factors {
    gonio_d8 mixed[16];
    double cubes[16];
} factors;

GONIO_INLINE void fill_factors(const gonio_powers *p, int begin, const int dims, const size_t stride, factors *out) {
    for (int r = 0; r < 16; r++) {
        gonio_d2 w;
        row_pair(p, begin + r, dims, &w);
        const double a = w[0], b = w[1];
        out->mixed[r] = stride == 4 ? (gonio_d8){a, b, b, b, a, b, b, b} : (gonio_d8){a, b, b, b, b, b, b, b};
        out->cubes[r] = b;
    }
}

// 8 doubles of 16 rows.
GONIO_INLINE void add_block(const run *run, const factors *factors, double *const *rows, size_t v, const bool mixed,
                            const size_t stride) {
    gonio_d8 acc[16] = {0};
    for (size_t s = 0; s < run->n; s++) {
        const gonio_d8 g = *(const gonio_d8 *)(run->rows + s * 4 * stride + v);
        GONIO_UNROLL
        for (int r = 0; r < 16; r++) {
            acc[r] += mixed ? factors[s].mixed[r] * g : factors[s].cubes[r] * g;
        }
    }
    GONIO_UNROLL
    for (int r = 0; r < 16; r++) {
        *(gonio_d8 *)(rows[r] + v) += acc[r];
    }
}

GONIO_INLINE void add_run(const run *run, size_t size, const int dims, const size_t stride) {
    factors factors[RUN_MAX];
    double *rows[16];
    for (int begin = 0; begin < (dims == 3 ? 16 : 64); begin += 16) {
        for (size_t s = 0; s < run->n; s++) {
            fill_factors(&run->powers[s], begin, dims, stride, &factors[s]);
        }
        for (size_t r = 0; r < 16; r++) {
            const size_t row = dims == 3 ? r % 4 : r / 4 * size + r % 4; // within its plane
            rows[r] = run->planes[dims == 3 ? r / 4 : (size_t)begin / 16] + (run->at + row * size) * stride;
        }
        for (size_t v = 0; v < 4 * stride; v += 8) {
            if (stride <= 8 || v % stride == 0) {
                add_block(run, factors, rows, v, true, stride);
            } else {
                add_block(run, factors, rows, v, false, stride);
            }
        }
    }
}

// 16 floats of the 16 rows, at `at` of a row, weighted and summed for every sample of the run.
GONIO_INLINE void sum_rows(const run *run, const gonio_row_list *list, size_t at, size_t channels, const float *base,
                           float *sums) {
    gonio_f16 points[16];
    GONIO_UNROLL
    for (int r = 0; r < 16; r++) {
        points[r] = *(const gonio_f16 *)(base + list->offset[r] * channels + at);
    }
    for (size_t s = 0; s < run->n; s++) {
        gonio_f16 even = {0}, odd = {0};
        GONIO_UNROLL
        for (int r = 0; r < 16; r += 2) {
            even += run->weights[s][r] * points[r];
            odd += run->weights[s][r + 1] * points[r + 1];
        }
        *(gonio_f16 *)(sums + s * 4 * channels + at) = even + odd;
    }
}

// The lattice's values at the run's samples: gonio_rows_eval_all, with the rows of a 3-D cell loaded once.
GONIO_INLINE void eval_run(const gonio_mba_job *job, run *run, const int dims, gonio_row_list *list, float *scratch,
                           float *values) {
    const size_t channels = (size_t)job->scatter->channels, length = 4 * channels;
    const bool together = dims == 3 && length >= 16;
    for (size_t i = 0; i < run->n; i++) {
        gonio_rows_weights(&run->places[i], dims, list);
        if (together) {
            memcpy(run->weights[i], list->weight, sizeof run->weights[i]);
        } else {
            gonio_rows_eval_all(job->points, list, dims, (int)channels, &run->places[i], scratch,
                                values + i * channels);
        }
    }
    for (size_t v = 0; together && v < length; v += 16) {
        // The last vector may overlap the one before: what both hold is computed twice, with the same result.
        sum_rows(run, list, v + 16 <= length ? v : length - 16, channels, job->points + run->places[0].first * channels,
                 scratch);
    }
    for (size_t i = 0; together && i < run->n; i++) {
        gonio_rows_sum_last(&run->places[i], dims, (int)channels, scratch + i * length, values + i * channels);
    }
}

GONIO_INLINE void fill_run(const gonio_mba_job *job, run *run, size_t begin, const int dims, const size_t stride,
                           const float *values, double *f) {
    const gonio_scatter *s = job->scatter;
    const size_t channels = (size_t)s->channels;
    for (size_t i = 0; i < run->n; i++) {
        gonio_powers *p = &run->powers[i];
        gonio_powers_raise(&run->places[i], dims, p);
        const double q = s->weights != NULL ? (double)s->weights[begin + i] : 1;
        fill_residuals(s->values + (begin + i) * channels, values + i * channels, channels, q / p->squares, f);
        fill_row(p->pairs[dims - 1], q, f, stride, run->rows + i * 4 * stride);
    }
}

// Samples from begin on that share a cell, at most `most`.
GONIO_INLINE void find_run(const gonio_mba_job *job, size_t begin, size_t most, const int dims, run *run) {
    const gonio_scatter *s = job->scatter;
    const uint32_t *position = s->positions + begin * (size_t)dims;
    const size_t limit = job->end - begin < most ? job->end - begin : most;
    for (run->n = 0; run->n < limit; run->n++) {
        gonio_rows_locate(position + run->n * (size_t)dims, job->level, job->size, dims, &run->places[run->n]);
        if (run->places[run->n].first != run->places[0].first) {
            break;
        }
    }
    const size_t slice = job->size * job->size * (dims == 4 ? job->size : 1);
    const size_t x = gonio_bspline_cell(position[0], job->level);
    run->planes = job->planes + x;
    run->at = run->places[0].first - x * slice;
}

typedef struct work {
    const gonio_mba_job *job;
    run run;
    size_t most; // samples a run
    size_t stride;
    gonio_row_list list;
    float *scratch, *values;
    double *f;
} work;

// The run that begins at a sample, up to its products.
GONIO_INLINE void prepare(work *w, size_t begin, const int dims) {
    find_run(w->job, begin, w->most, dims, &w->run);
    eval_run(w->job, &w->run, dims, &w->list, w->scratch, w->values);
    fill_run(w->job, &w->run, begin, dims, w->stride, w->values, w->f);
}

// Cloned for the machine's vectors. Constants let the compiler unroll the rows; the two halves of the work are apart
// because one function of both a shape takes the compiler more than twice as long, for the same speed.
GONIO_CLONES static void prepare_run_3d(work *w, size_t begin) { prepare(w, begin, 3); }
GONIO_CLONES static void prepare_run_4d(work *w, size_t begin) { prepare(w, begin, 4); }
GONIO_CLONES static void add_rgb_3d(const work *w) { add_run(&w->run, w->job->size, 3, 4); }
GONIO_CLONES static void add_rgb_4d(const work *w) { add_run(&w->run, w->job->size, 4, 4); }
GONIO_CLONES static void add_spectral_3d(const work *w) { add_run(&w->run, w->job->size, 3, 32); }
GONIO_CLONES static void add_any_3d(const work *w) { add_run(&w->run, w->job->size, 3, w->stride); }
GONIO_CLONES static void add_any_4d(const work *w) { add_run(&w->run, w->job->size, 4, w->stride); }

void gonio_mba_accumulate_channels(const gonio_mba_job *job) {
    const size_t channels = (size_t)job->scatter->channels, stride = gonio_mba_stride(job->scatter->channels);
    const size_t fitting = RUN_DOUBLES / 4 / stride, most = fitting > RUN_MAX ? RUN_MAX : fitting > 1 ? fitting : 1;
    _Alignas(64) double rows[most * 4 * stride], f[stride];
    float scratch[most * 4 * channels], values[most * channels];
    memset(f, 0, sizeof f);
    work w = {
        .job = job, .run.rows = rows, .most = most, .stride = stride, .scratch = scratch, .values = values, .f = f};
    const bool spatial = job->scatter->dims == 3;
    void (*const prepare_run)(work *, size_t) = spatial ? prepare_run_3d : prepare_run_4d;
    void (*const add)(const work *) = stride == 4               ? (spatial ? add_rgb_3d : add_rgb_4d)
                                      : stride == 32 && spatial ? add_spectral_3d
                                      : spatial                 ? add_any_3d
                                                                : add_any_4d;
    gonio_rows_offsets(job->size, job->scatter->dims, &w.list);
    for (size_t i = job->begin; i < job->end; i += w.run.n) {
        prepare_run(&w, i);
        add(&w);
    }
}
