// SPDX-License-Identifier: BSD-3-Clause
// Fast evaluation of a lattice at fixed-point positions (brdf/spline/bspline.h), for the machine's vectors.
#ifndef GONIO_BRDF_SPLINE_LATTICE_EVAL_H
#define GONIO_BRDF_SPLINE_LATTICE_EVAL_H

#include "brdf/spline/clones.h"
#include "brdf/spline/lattice.h"

// Four numbers a position, so that one vector load reads it; those beyond the lattice's dims are ignored.
typedef struct gonio_position {
    uint32_t x[GONIO_DIMS_MAX];
} gonio_position;

static inline gonio_position gonio_position_of(const double *x, int dims) {
    gonio_position p = {{0}};
    for (int d = 0; d < dims; d++) {
        p.x[d] = gonio_bspline_fix(x[d]);
    }
    return p;
}

// The same from four numbers in registers, stored at once: a vector load right behind four small stores would stall.
GONIO_INLINE void gonio_position_set(gonio_position *p, double x0, double x1, double x2, double x3) {
    typedef uint32_t word8 __attribute__((vector_size(32)));
    typedef uint32_t word4 __attribute__((vector_size(16), aligned(4), may_alias));
    const gonio_d4 inside = {gonio_bspline_inside(x0), gonio_bspline_inside(x1), gonio_bspline_inside(x2),
                             gonio_bspline_inside(x3)};
    const gonio_d4 moved = inside + 0x1p20;
    word8 bits;
    memcpy(&bits, &moved, sizeof bits);
    *(word4 *)p->x = __builtin_shufflevector(bits, bits, 0, 2, 4, 6);
}

// n positions, values n x channels. Lines are fetched ahead, so random positions cost less than one call each.
void gonio_lattice_eval_positions(const gonio_lattice *lattice, size_t n, const gonio_position *positions,
                                  float *values);

#endif
