// Fast evaluation of a lattice at fixed-point positions (fit/bspline.h), for the machine's vectors.
#ifndef GONIO_FIT_LATTICE_EVAL_H
#define GONIO_FIT_LATTICE_EVAL_H

#include "fit/lattice.h"

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

// n positions, values n x channels. Lines are fetched ahead, so random positions cost less than one call each.
void gonio_lattice_eval_positions(const gonio_lattice *lattice, size_t n, const gonio_position *positions,
                                  float *values);

#endif
