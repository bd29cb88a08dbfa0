// SPDX-License-Identifier: BSD-3-Clause
// One level of a multilevel fit: sums over the samples, then the lattice's update. What its two ways share.
#ifndef GONIO_FIT_MBA_LEVEL_H
#define GONIO_FIT_MBA_LEVEL_H

#include "base/thread_pool.h"
#include "brdf/spline/lattice.h"
#include "fit/prepare/scatter.h"

typedef struct gonio_mba_level {
    const gonio_scatter *scatter;
    gonio_lattice *lattice; // of this level, the sum of the coarser ones; updated
    gonio_pool *pool;       // NULL: one thread
    double *scratch;        // kept from level to level; free() it in the end
    size_t scratch_size;    // doubles
} gonio_mba_level;

// Every chunk of samples has sums of its own, merged in order: for lattices of a few hundred KB.
gonio_status gonio_mba_fit_coarse(gonio_mba_level *level, gonio_error *error);
// Planes of the lattice one after the other, in the samples' order: for the finer ones.
gonio_status gonio_mba_fit_fine(gonio_mba_level *level, gonio_error *error);
// The finest level for the first way.
static inline int gonio_mba_coarse_level(int dims) { return dims == 3 ? 4 : 3; }

// Bytes of scratch. threads 0: all.
double gonio_mba_coarse_memory(int dims, int level, int channels, size_t samples);
double gonio_mba_fine_memory(int dims, int level, int channels, size_t samples, int threads);

// At least `doubles` of scratch, 64-aligned, of any content.
gonio_status gonio_mba_level_scratch(gonio_mba_level *level, size_t doubles, gonio_error *error);
// Add the quotients of the sums of one plane (along the first axis) to the lattice; the sums are used up.
void gonio_mba_level_update(const gonio_mba_level *level, size_t plane, double *sums);

#endif
