// SPDX-License-Identifier: BSD-3-Clause
// The inner loop of a multilevel fit.
//
// A sample with weights w_a = x_i y_j z_k (a = i, j, k), weight q and residual r adds to each of its 4^d control points
//   denominator  q w_a^2,    numerator  q w_a^3 r / sum_b w_b^2          (Lee, Wolberg and Shin 1997, eqs. 3 to 5)
// All three are products over the axes: sum_b w_b^2 = (sum x^2)(sum y^2)(sum z^2), w^2 = x^2 y^2 z^2, w^3 = x^3 y^3
// z^3. So with (denominator, numerators...) interleaved a control point, the row of four neighbours along the last axis
// takes one vector G, the same for all rows but for the factors (row weight)^2 and ^3: a row costs a load, a
// multiply-add and a store. Recomputing w^2, w^3 and the quotient a control point, as the formulas read, costs six
// times that.
#include "fit/mba/kernel.h"

#include <string.h>

#include "fit/mba/powers.h"

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

// One channel: add the sample to the cell whose first control point has its sums at place `at` of planes[0]; rows lie
// row_step doubles apart.
GONIO_INLINE void add_one(double *const *planes, size_t at, size_t row_step, size_t plane_step, const int dims,
                          const gonio_powers *p, double q, double f) {
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
        double *row = planes[i] + at;
        repeat(&p->pairs[0][i], &factor);
        if (dims == 3) {
            *(gonio_d8 *)row += factor * inner[0];
            *(gonio_d8 *)(row + row_step) += factor * inner[1];
            *(gonio_d8 *)(row + 2 * row_step) += factor * inner[2];
            *(gonio_d8 *)(row + 3 * row_step) += factor * inner[3];
        } else {
            for (size_t j = 0; j < 16; j++) {
                *(gonio_d8 *)(row + j / 4 * plane_step + j % 4 * row_step) += factor * inner[j];
            }
        }
    }
}

// The sums of one cell, collected aside, into the lattice's. planes NULL: there are none yet.
GONIO_INLINE void flush_cell(double *const *planes, size_t at, size_t row_step, const double *local) {
    if (planes == NULL) {
        return;
    }
    GONIO_UNROLL
    for (size_t r = 0; r < 16; r++) {
        *(gonio_d8 *)(planes[r / 4] + at + r % 4 * row_step) += *(const gonio_d8 *)(local + 8 * r);
    }
}

GONIO_INLINE void accumulate_one(const gonio_mba_job *job, const int dims, const bool runs) {
    const gonio_scatter *s = job->scatter;
    const size_t size = job->size, slice = size * size * (dims == 4 ? size : 1);
    double local[16 * 8] = {0}, *const locals[4] = {local, local + 32, local + 64, local + 96};
    double *const *planes = NULL;
    size_t cell = SIZE_MAX, at = 0;
    for (size_t i = job->begin; i < job->end; i++) {
        const uint32_t *position = s->positions + i * (size_t)dims;
        gonio_place place;
        gonio_powers p;
        gonio_rows_locate(position, job->level, size, dims, &place);
        const double value = gonio_rows_eval_one(job->points, size, dims, &place);
        gonio_powers_raise(&place, dims, &p);
        const double q = s->weights != NULL ? (double)s->weights[i] : 1;
        const double f = q * ((double)s->values[i] - value) / p.squares;
        const size_t x = gonio_bspline_cell(position[0], job->level);
        if (!runs) {
            add_one(job->planes + x, (place.first - x * slice) * 2, size * 2, size * size * 2, dims, &p, q, f);
            continue;
        }
        if (place.first != cell) {
            flush_cell(planes, at, size * 2, local);
            memset(local, 0, sizeof local);
            cell = place.first;
            planes = job->planes + x;
            at = (place.first - x * slice) * 2;
        }
        add_one(locals, 0, 8, 0, dims, &p, q, f);
    }
    if (runs) {
        flush_cell(planes, at, size * 2, local);
    }
}

// (Clang makes the resolver of a cloned function global, so their names differ from those of other files.)
// One function a shape, each cloned for the machine's vectors: constants let the compiler unroll the rows.
GONIO_CLONES static void fit_one_3d(const gonio_mba_job *job) { accumulate_one(job, 3, false); }
GONIO_CLONES static void fit_one_3d_runs(const gonio_mba_job *job) { accumulate_one(job, 3, true); }
GONIO_CLONES static void fit_one_4d(const gonio_mba_job *job) { accumulate_one(job, 4, false); }

void gonio_mba_accumulate(const gonio_mba_job *job) {
    if (job->scatter->channels > 1) {
        gonio_mba_accumulate_channels(job);
    } else if (job->scatter->dims == 4) {
        fit_one_4d(job);
    } else {
        (job->runs ? fit_one_3d_runs : fit_one_3d)(job);
    }
}
