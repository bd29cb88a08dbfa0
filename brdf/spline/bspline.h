// SPDX-License-Identifier: BSD-3-Clause
// The uniform cubic B-spline on [0, 1]: the four basis functions of a cell, and where a coordinate lies.
//
// Lee, Wolberg and Shin, "Scattered data interpolation with multilevel B-splines" (IEEE TVCG 1997), eq. 1. Level h has
// 2^h cells and 2^h + 3 control points a dimension; cell i stands on control points i .. i + 3.
#ifndef GONIO_BRDF_SPLINE_BSPLINE_H
#define GONIO_BRDF_SPLINE_BSPLINE_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define GONIO_DIMS_MAX 4

static inline size_t gonio_bspline_size(int level) { return ((size_t)1 << level) + 3; }

// Basis values at t in [0, 1] of a cell; they are >= 0 and sum to 1.
static inline void gonio_bspline_weights(double t, double w[4]) {
    const double s = 1 - t, t2 = t * t, s2 = s * s;
    w[0] = s2 * s * (1.0 / 6);
    w[1] = (4 + 3 * t2 * (t - 2)) * (1.0 / 6);
    w[2] = (4 + 3 * s2 * (s - 2)) * (1.0 / 6);
    w[3] = t2 * t * (1.0 / 6);
}

// Their derivatives with respect to t.
static inline void gonio_bspline_slopes(double t, double w[4]) {
    const double s = 1 - t;
    w[0] = -0.5 * s * s;
    w[1] = 1.5 * t * t - 2 * t;
    w[2] = 2 * s - 1.5 * s * s;
    w[3] = 0.5 * t * t;
}

// A coordinate as a fixed-point number: [0, 1] -> 0 .. 2^32 - 1. The cell of any level is then a shift and the place in
// it a mask, exact and equal for all levels; the resolution, 2.3e-10, is far below any rig's pointing. Positions
// outside [0, 1] are moved to the border, NaN to 0.
//
// Between 2^20 and 2^21 doubles lie 2^-32 apart: adding 2^20 rounds to that and leaves the number in the low word.
static inline double gonio_bspline_inside(double x) { return x > 0 ? x < 1 - 0x1p-32 ? x : 1 - 0x1p-32 : 0; }

static inline uint32_t gonio_bspline_fix(double x) {
    const double moved = gonio_bspline_inside(x) + 0x1p20;
    uint64_t bits;
    memcpy(&bits, &moved, sizeof bits);
    return (uint32_t)bits;
}

// Two shifts, since one by 32 (level 0) is undefined.
static inline uint32_t gonio_bspline_cell(uint32_t fixed, int level) { return fixed >> 1 >> (31 - level); }

// In [0, 1), by 31 bits: signed integers convert to double in one instruction everywhere.
static inline double gonio_bspline_place(uint32_t fixed, int level) {
    return (double)(int32_t)(fixed << level >> 1) * 0x1p-31;
}

#endif
