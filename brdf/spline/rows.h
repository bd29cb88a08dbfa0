// SPDX-License-Identifier: BSD-3-Clause
// Evaluation of a lattice by rows: what the fast evaluation and the fast fit share.
//
// The 4^d control points of a cell are 4^(d-1) rows of 4 neighbours along the last axis, each row 4 x channels
// contiguous floats. Rows are summed with the weights of the leading axes, nested (x_i times the sum over j of y_j
// row_ij), and the last axis' four weights are applied once at the end: a multiplication and an addition a control
// point, on contiguous vectors.
//
// The basis functions of all axes are computed side by side, one axis a vector lane.
#ifndef GONIO_BRDF_SPLINE_ROWS_H
#define GONIO_BRDF_SPLINE_ROWS_H

#include <string.h>

#include "brdf/spline/clones.h"
#include "brdf/spline/lattice.h"

typedef uint32_t gonio_u4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t gonio_i4 __attribute__((vector_size(16), aligned(4), may_alias));

// Where a position lies: the first control point of its cell, and basis[k][d], the k-th basis function on axis d.
typedef struct gonio_place {
    size_t first;
    gonio_d4 basis[4];
} gonio_place;

// position: 4 numbers are read; those beyond dims only fill unused lanes.
GONIO_INLINE void gonio_rows_locate(const uint32_t *position, int level, size_t size, const int dims,
                                    gonio_place *place) {
    const gonio_u4 fixed = *(const gonio_u4 *)position;
    const gonio_u4 cell = fixed >> 1 >> (uint32_t)(31 - level);
    const gonio_i4 part = (gonio_i4)(fixed << (uint32_t)level >> 1);
    const gonio_d4 t = __builtin_convertvector(part, gonio_d4) * 0x1p-31;
    const gonio_d4 s = 1 - t, t2 = t * t, s2 = s * s;
    place->basis[0] = s2 * s * (1.0 / 6);
    place->basis[1] = (4 + 3 * t2 * (t - 2)) * (1.0 / 6);
    place->basis[2] = (4 + 3 * s2 * (s - 2)) * (1.0 / 6);
    place->basis[3] = t2 * t * (1.0 / 6);
    size_t first = cell[0];
    GONIO_UNROLL
    for (int d = 1; d < dims; d++) {
        first = first * size + cell[d];
    }
    place->first = first;
}

// Floats. Smaller lattices stay in a second-level cache by themselves, where asking ahead costs more than it saves.
#define GONIO_ROWS_PREFETCH_MIN (1u << 19)

// Ask for the rows of a position.
GONIO_INLINE void gonio_rows_prefetch(const gonio_lattice *l, const uint32_t *position, const int dims) {
    size_t first = 0;
    for (int d = 0; d < dims; d++) {
        first = first * l->size + gonio_bspline_cell(position[d], l->level);
    }
    const size_t channels = (size_t)l->channels, plane = l->size * l->size * (dims == 4 ? l->size : 1);
    const float *base = l->points + first * channels;
    const size_t inner = dims == 4 ? 16 : 4, row_bytes = 16 * channels;
    for (size_t i = 0; i < 4; i++) {
        for (size_t j = 0; j < inner; j++) {
            const size_t row = i * plane + (dims == 4 ? (j / 4 * l->size + j % 4) * l->size : j * l->size);
            const char *at = (const char *)(base + row * channels);
            for (size_t byte = 0; byte < row_bytes; byte += 64) {
                __builtin_prefetch(at + byte);
            }
            __builtin_prefetch(at + row_bytes - 1);
        }
    }
}

// The last axis' four weights.
GONIO_INLINE void gonio_rows_last(const gonio_place *place, const int dims, gonio_d4 *last) {
    const gonio_d4 *b = place->basis;
    *last = (gonio_d4){b[0][dims - 1], b[1][dims - 1], b[2][dims - 1], b[3][dims - 1]};
}

// Sum over j of y_j row_j: 4 rows, `stride` floats apart, of one channel; y_j is lane `axis` of basis[j].
GONIO_INLINE void sum_four_rows(const float *base, size_t stride, const gonio_f4 *basis, const int axis,
                                gonio_f4 *out) {
    const gonio_f4 r0 = *(const gonio_f4 *)base, r1 = *(const gonio_f4 *)(base + stride);
    const gonio_f4 r2 = *(const gonio_f4 *)(base + 2 * stride), r3 = *(const gonio_f4 *)(base + 3 * stride);
    *out = (basis[0][axis] * r0 + basis[1][axis] * r1) + (basis[2][axis] * r2 + basis[3][axis] * r3);
}

GONIO_INLINE void sum_four(const gonio_f4 *in, const gonio_f4 *basis, const int axis, gonio_f4 *out) {
    *out = (basis[0][axis] * in[0] + basis[1][axis] * in[1]) + (basis[2][axis] * in[2] + basis[3][axis] * in[3]);
}

// One channel. Rows in float, as the lattice is; its rounding, 1e-7 of the cell's largest control point, is the
// lattice's own.
GONIO_INLINE double gonio_rows_eval_one(const float *points, size_t size, const int dims, const gonio_place *place) {
    const float *base = points + place->first;
    const size_t plane = size * size;
    gonio_f4 sum[4], all, basis[4];
    gonio_d4 last;
    GONIO_UNROLL
    for (int k = 0; k < 4; k++) {
        basis[k] = __builtin_convertvector(place->basis[k], gonio_f4);
    }
    GONIO_UNROLL
    for (size_t i = 0; i < 4; i++) {
        if (dims == 3) {
            sum_four_rows(base + i * plane, size, basis, 1, &sum[i]);
        } else {
            gonio_f4 inner[4];
            for (size_t j = 0; j < 4; j++) {
                sum_four_rows(base + i * plane * size + j * plane, size, basis, 2, &inner[j]);
            }
            sum_four(inner, basis, 1, &sum[i]);
        }
    }
    sum_four(sum, basis, 0, &all);
    gonio_rows_last(place, dims, &last);
    return ((double)all[0] * last[0] + (double)all[1] * last[1]) +
           ((double)all[2] * last[2] + (double)all[3] * last[3]);
}

// The rows' weights and their offsets from the first control point, in control points.
typedef struct gonio_row_list {
    float weight[64];
    size_t offset[64];
} gonio_row_list;

GONIO_INLINE void gonio_rows_offsets(size_t size, const int dims, gonio_row_list *list) {
    const int rows = dims == 3 ? 16 : 64;
    for (int r = 0; r < rows; r++) {
        const size_t k = (size_t)r;
        list->offset[r] =
            dims == 3 ? (k / 4 * size + k % 4) * size : ((k / 16 * size + k / 4 % 4) * size + k % 4) * size;
    }
}

GONIO_INLINE void gonio_rows_weights(const gonio_place *place, const int dims, gonio_row_list *list) {
    const gonio_d4 *b = place->basis;
    const gonio_d4 y = {b[0][1], b[1][1], b[2][1], b[3][1]}, z = {b[0][2], b[1][2], b[2][2], b[3][2]};
    GONIO_UNROLL
    for (int i = 0; i < 4; i++) {
        const gonio_d4 w = b[i][0] * y;
        if (dims == 3) {
            *(gonio_f4 *)(list->weight + 4 * i) = __builtin_convertvector(w, gonio_f4);
            continue;
        }
        GONIO_UNROLL
        for (int j = 0; j < 4; j++) {
            *(gonio_f4 *)(list->weight + 16 * i + 4 * j) = __builtin_convertvector(w[j] * z, gonio_f4);
        }
    }
}

// The last axis' weights over the four points of a row's sum: scratch[4 x channels] -> values[channels].
GONIO_INLINE void gonio_rows_sum_last(const gonio_place *place, const int dims, int channels, const float *scratch,
                                      float *values) {
    const size_t c = (size_t)channels;
    gonio_d4 last;
    gonio_rows_last(place, dims, &last);
    const gonio_f4 w = __builtin_convertvector(last, gonio_f4);
    if (c >= 16) {
        for (size_t v = 0; v < c; v += 16) {
            // The last vector may overlap the one before: what both hold is computed twice, with the same result.
            const float *at = scratch + (v + 16 <= c ? v : c - 16);
            *(gonio_f16 *)(values + (at - scratch)) =
                (w[0] * *(const gonio_f16 *)at + w[1] * *(const gonio_f16 *)(at + c)) +
                (w[2] * *(const gonio_f16 *)(at + 2 * c) + w[3] * *(const gonio_f16 *)(at + 3 * c));
        }
        return;
    }
    for (size_t k = 0; k < c; k++) {
        values[k] =
            (w[0] * scratch[k] + w[1] * scratch[c + k]) + (w[2] * scratch[2 * c + k] + w[3] * scratch[3 * c + k]);
    }
}

// All channels (2 or more), in float: a row has 4 x channels floats. scratch[4 x channels], values[channels].
GONIO_INLINE void gonio_rows_eval_all(const float *points, const gonio_row_list *list, const int dims, int channels,
                                      const gonio_place *place, float *scratch, float *values) {
    const int rows = dims == 3 ? 16 : 64;
    const size_t c = (size_t)channels, length = 4 * c;
    const float *base = points + place->first * c;
    if (length >= 16) {
        for (size_t v = 0; v < length; v += 16) {
            // The last vector may overlap the one before: what both hold is computed twice, with the same result.
            const size_t at = v + 16 <= length ? v : length - 16;
            gonio_f16 even = {0}, odd = {0};
            GONIO_UNROLL
            for (int r = 0; r < rows; r += 2) {
                even += list->weight[r] * *(const gonio_f16 *)(base + list->offset[r] * c + at);
                odd += list->weight[r + 1] * *(const gonio_f16 *)(base + list->offset[r + 1] * c + at);
            }
            *(gonio_f16 *)(scratch + at) = even + odd;
        }
    } else {
        for (size_t v = 0; v < length; v += 4) {
            gonio_f4 even = {0}, odd = {0};
            GONIO_UNROLL
            for (int r = 0; r < rows; r += 2) {
                even += list->weight[r] * *(const gonio_f4 *)(base + list->offset[r] * c + v);
                odd += list->weight[r + 1] * *(const gonio_f4 *)(base + list->offset[r + 1] * c + v);
            }
            *(gonio_f4 *)(scratch + v) = even + odd;
        }
    }
    gonio_rows_sum_last(place, dims, channels, scratch, values);
}

#endif
