// The inner loop of a multilevel fit.
//
// A sample with weights w_a = x_i y_j z_k (a = i, j, k), weight q and residual r adds to each of its 4^d control points
//   denominator  q w_a^2,    numerator  q w_a^3 r / sum_b w_b^2          (Lee, Wolberg and Shin 1997, eqs. 3 to 5)
// All three are products over the axes: sum_b w_b^2 = (sum x^2)(sum y^2)(sum z^2), w^2 = x^2 y^2 z^2, w^3 = x^3 y^3
// z^3. So with (denominator, numerators...) interleaved a control point, the row of four neighbours along the last axis
// takes one vector G, the same for all rows but for the factors (row weight)^2 and ^3: a row costs a load, a
// multiply-add and a store. Recomputing w^2, w^3 and the quotient a control point, as the formulas read, costs six
// times that.
#include "fit/mba_kernel.h"

#include <string.h>

#include "fit/rows.h"

size_t gonio_mba_stride(int channels) {
    const size_t used = (size_t)channels + 1;
    return used <= 2 ? 2 : used <= 4 ? 4 : (used + 7) / 8 * 8;
}

// Squares and cubes of the basis functions: pairs[d][k] = (b^2, b^3) of axis d's k-th function; squares: the product
// over the axes of sum b^2, which is the sum of w^2.
typedef struct powers {
    gonio_d2 pairs[GONIO_DIMS_MAX][4];
    double squares;
} powers;

GONIO_INLINE void raise(const gonio_place *place, const int dims, powers *p) {
    gonio_d4 sum = {0};
    GONIO_UNROLL
    for (int k = 0; k < 4; k++) {
        const gonio_d4 b2 = place->basis[k] * place->basis[k], b3 = b2 * place->basis[k];
        sum += b2;
        p->pairs[0][k] = __builtin_shufflevector(b2, b3, 0, 4);
        p->pairs[1][k] = __builtin_shufflevector(b2, b3, 1, 5);
        p->pairs[2][k] = __builtin_shufflevector(b2, b3, 2, 6);
        if (dims == 4) {
            p->pairs[3][k] = __builtin_shufflevector(b2, b3, 3, 7);
        }
    }
    p->squares = sum[0] * sum[1] * sum[2] * (dims == 4 ? sum[3] : 1);
}

// Written out: GCC 12 takes a shuffle from 2 to 8 lanes through memory, with a stalled load.
GONIO_INLINE void repeat(const gonio_d2 *pair, gonio_d8 *out) {
    const double a = (*pair)[0], b = (*pair)[1];
    *out = (gonio_d8){a, b, a, b, a, b, a, b};
}

// 4-D: inner[4 j + k] = pair j of the second axis times inner[k].
GONIO_INLINE void spread(const gonio_d2 *pairs, gonio_d8 *inner) {
    for (int m = 15; m >= 0; m--) {
        gonio_d8 factor;
        repeat(&pairs[m / 4], &factor);
        inner[m] = factor * inner[m % 4];
    }
}

// One channel: add the sample to the cell whose first control point has its sums at `sums`; rows lie row_step doubles
// apart.
GONIO_INLINE void add_one(double *sums, size_t row_step, size_t plane_step, size_t volume_step, const int dims,
                          const powers *p, double q, double f) {
    const gonio_d2 *z = p->pairs[dims - 1];
    const gonio_d2 scale = {q, f};
    const gonio_d2 z0 = z[0] * scale, z1 = z[1] * scale, z2 = z[2] * scale, z3 = z[3] * scale;
    const gonio_d8 g = {z0[0], z0[1], z1[0], z1[1], z2[0], z2[1], z3[0], z3[1]};
    gonio_d8 inner[16], factor;
    GONIO_UNROLL
    for (int j = 0; j < 4; j++) {
        repeat(&p->pairs[dims - 2][j], &factor);
        inner[j] = factor * g;
    }
    if (dims == 4) {
        spread(p->pairs[1], inner);
    }
    GONIO_UNROLL
    for (size_t i = 0; i < 4; i++) {
        repeat(&p->pairs[0][i], &factor);
        if (dims == 3) {
            double *row = sums + i * plane_step;
            *(gonio_d8 *)row += factor * inner[0];
            *(gonio_d8 *)(row + row_step) += factor * inner[1];
            *(gonio_d8 *)(row + 2 * row_step) += factor * inner[2];
            *(gonio_d8 *)(row + 3 * row_step) += factor * inner[3];
        } else {
            for (size_t j = 0; j < 16; j++) {
                *(gonio_d8 *)(sums + i * volume_step + j / 4 * plane_step + j % 4 * row_step) += factor * inner[j];
            }
        }
    }
}

// The sums of one cell, collected aside, into the lattice's. cell SIZE_MAX: there are none yet.
GONIO_INLINE void flush_cell(double *sums, size_t cell, size_t row_step, size_t plane_step, const double *local) {
    if (cell == SIZE_MAX) {
        return;
    }
    GONIO_UNROLL
    for (size_t r = 0; r < 16; r++) {
        *(gonio_d8 *)(sums + cell * 2 + r / 4 * plane_step + r % 4 * row_step) += *(const gonio_d8 *)(local + 8 * r);
    }
}

// The sums' address as if they began at the lattice's first plane.
GONIO_INLINE double *origin(const gonio_mba_job *job, const int dims, size_t stride) {
    return job->sums - job->plane * job->size * job->size * (dims == 4 ? job->size : 1) * stride;
}

GONIO_INLINE void accumulate_one(const gonio_mba_job *job, const int dims, const bool runs) {
    const gonio_scatter *s = job->scatter;
    const size_t row_step = job->size * 2, plane_step = row_step * job->size, volume_step = plane_step * job->size;
    double *sums = origin(job, dims, 2), local[16 * 8] = {0};
    size_t cell = SIZE_MAX;
    for (size_t i = job->begin; i < job->end; i++) {
        gonio_place place;
        powers p;
        gonio_rows_locate(s->positions + i * (size_t)dims, job->level, job->size, dims, &place);
        const double value = gonio_rows_eval_one(job->points, job->size, dims, &place);
        raise(&place, dims, &p);
        const double q = s->weights != NULL ? (double)s->weights[i] : 1;
        const double f = q * ((double)s->values[i] - value) / p.squares;
        if (!runs) {
            add_one(sums + place.first * 2, row_step, plane_step, volume_step, dims, &p, q, f);
            continue;
        }
        if (place.first != cell) {
            flush_cell(sums, cell, row_step, plane_step, local);
            memset(local, 0, sizeof local);
            cell = place.first;
        }
        add_one(local, 8, 32, 0, dims, &p, q, f);
    }
    if (runs) {
        flush_cell(sums, cell, row_step, plane_step, local);
    }
}

// Many channels: G, per k: (q z_k^2, z_k^3 f_0, z_k^3 f_1 ...); f holds one unused place and then f_c = q r_c / sum
// w^2, padded with zeros to the stride.
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

// A row's factors, (w^2, w^3 ...) for the 8 doubles that begin with a denominator.
GONIO_INLINE void row_factors(const gonio_d2 *w, const size_t stride, gonio_d8 *out) {
    const double a = (*w)[0], b = (*w)[1];
    if (stride == 4) {
        *out = (gonio_d8){a, b, b, b, a, b, b, b};
    } else {
        *out = (gonio_d8){a, b, b, b, b, b, b, b};
    }
}

GONIO_INLINE void add_row(double *sums, const gonio_d2 *w, const double *row, const size_t stride) {
    gonio_d8 first;
    row_factors(w, stride, &first);
    for (size_t v = 0; v < stride / 2; v++) {
        gonio_d8 *at = (gonio_d8 *)(sums + 8 * v);
        const gonio_d8 g = *(const gonio_d8 *)(row + 8 * v);
        if (stride <= 8 || v % (stride / 8) == 0) {
            *at += first * g;
        } else {
            *at += (*w)[1] * g;
        }
    }
}

// The same for two samples of one cell: the sums are loaded and stored once.
GONIO_INLINE void add_row_twice(double *sums, const gonio_d2 *w, const double *row, const gonio_d2 *w2,
                                const double *row2, const size_t stride) {
    gonio_d8 first, first2;
    row_factors(w, stride, &first);
    row_factors(w2, stride, &first2);
    for (size_t v = 0; v < stride / 2; v++) {
        gonio_d8 *at = (gonio_d8 *)(sums + 8 * v);
        const gonio_d8 g = *(const gonio_d8 *)(row + 8 * v), g2 = *(const gonio_d8 *)(row2 + 8 * v);
        if (stride <= 8 || v % (stride / 8) == 0) {
            *at += first * g + first2 * g2;
        } else {
            *at += (*w)[1] * g + (*w2)[1] * g2;
        }
    }
}

// The pair of row r: (w^2, w^3).
GONIO_INLINE void row_pair(const powers *p, int r, const int dims, gonio_d2 *w) {
    *w = dims == 3 ? p->pairs[0][r / 4] * p->pairs[1][r % 4]
                   : p->pairs[0][r / 16] * p->pairs[1][r / 4 % 4] * p->pairs[2][r % 4];
}

// A sample that is ready to be added: its cell, its powers, its G.
typedef struct ready {
    size_t first;
    powers powers;
    double *row;
} ready;

GONIO_INLINE void add_all(double *sums, const gonio_row_list *list, const int dims, const ready *a, const ready *b,
                          const size_t stride) {
    for (int r = 0; r < (dims == 3 ? 16 : 64); r++) {
        double *at = sums + (a->first + list->offset[r]) * stride;
        gonio_d2 w, w2;
        row_pair(&a->powers, r, dims, &w);
        if (b == NULL) {
            add_row(at, &w, a->row, stride);
        } else {
            row_pair(&b->powers, r, dims, &w2);
            add_row_twice(at, &w, a->row, &w2, b->row, stride);
        }
    }
}

GONIO_INLINE void prepare(const gonio_mba_job *job, size_t i, const int dims, const size_t stride, gonio_row_list *list,
                          float *scratch, float *values, double *f, ready *out) {
    const gonio_scatter *s = job->scatter;
    gonio_place place;
    gonio_rows_locate(s->positions + i * (size_t)dims, job->level, job->size, dims, &place);
    gonio_rows_weights(&place, dims, list);
    gonio_rows_eval_all(job->points, list, dims, s->channels, &place, scratch, values);
    raise(&place, dims, &out->powers);
    const double q = s->weights != NULL ? (double)s->weights[i] : 1;
    const size_t channels = (size_t)s->channels;
    fill_residuals(s->values + i * channels, values, channels, q / out->powers.squares, f);
    fill_row(out->powers.pairs[dims - 1], q, f, stride, out->row);
    out->first = place.first;
}

// The sums of 31 channels are 16 KB a cell, more than a sample's arithmetic takes to load and store: neighbours in the
// sorted order that share their cell are added two at a time.
GONIO_INLINE void accumulate_all(const gonio_mba_job *job, const int dims, const size_t stride) {
    double *sums = origin(job, dims, stride);
    gonio_row_list list;
    gonio_rows_offsets(job->size, dims, &list);
    float scratch[4 * job->scatter->channels], values[job->scatter->channels];
    double rows[2][4 * stride], f[stride];
    memset(f, 0, sizeof f);
    ready sample[2] = {{.row = rows[0]}, {.row = rows[1]}};
    int waiting = 0;
    for (size_t i = job->begin; i < job->end; i++) {
        prepare(job, i, dims, stride, &list, scratch, values, f, &sample[waiting]);
        if (waiting == 0) {
            waiting = 1;
        } else if (sample[0].first == sample[1].first) {
            add_all(sums, &list, dims, &sample[0], &sample[1], stride);
            waiting = 0;
        } else {
            add_all(sums, &list, dims, &sample[0], NULL, stride);
            const ready next = sample[1];
            sample[1].row = sample[0].row;
            sample[0] = next;
        }
    }
    if (waiting == 1) {
        add_all(sums, &list, dims, &sample[0], NULL, stride);
    }
}

// (Clang makes the resolver of a cloned function global, so their names differ from those of other files.)
// One function a shape, each cloned for the machine's vectors: constants let the compiler unroll the rows.
GONIO_CLONES static void fit_one_3d(const gonio_mba_job *job) { accumulate_one(job, 3, false); }
GONIO_CLONES static void fit_one_3d_runs(const gonio_mba_job *job) { accumulate_one(job, 3, true); }
GONIO_CLONES static void fit_one_4d(const gonio_mba_job *job) { accumulate_one(job, 4, false); }
GONIO_CLONES static void fit_rgb_3d(const gonio_mba_job *job) { accumulate_all(job, 3, 4); }
GONIO_CLONES static void fit_rgb_4d(const gonio_mba_job *job) { accumulate_all(job, 4, 4); }
GONIO_CLONES static void fit_spectral_3d(const gonio_mba_job *job) { accumulate_all(job, 3, 32); }
GONIO_CLONES static void fit_any_3d(const gonio_mba_job *job) {
    accumulate_all(job, 3, gonio_mba_stride(job->scatter->channels));
}
GONIO_CLONES static void fit_any_4d(const gonio_mba_job *job) {
    accumulate_all(job, 4, gonio_mba_stride(job->scatter->channels));
}

void gonio_mba_accumulate(const gonio_mba_job *job) {
    const bool spatial = job->scatter->dims == 3;
    switch (gonio_mba_stride(job->scatter->channels)) {
    case 2:
        (!spatial ? fit_one_4d : job->runs ? fit_one_3d_runs : fit_one_3d)(job);
        break;
    case 4:
        (spatial ? fit_rgb_3d : fit_rgb_4d)(job);
        break;
    case 32:
        (spatial ? fit_spectral_3d : fit_any_4d)(job);
        break;
    default:
        (spatial ? fit_any_3d : fit_any_4d)(job);
        break;
    }
}
