// SPDX-License-Identifier: BSD-3-Clause
// Multilevel B-spline approximation of prepared samples, level after level.
#ifndef GONIO_FIT_MBA_MBA_H
#define GONIO_FIT_MBA_MBA_H

#include "brdf/spline/lattice.h"
#include "fit/prepare/scatter.h"

typedef struct gonio_mba gonio_mba;

// Start a fit of the scatter (borrowed until the mba is freed) from the constant start[channels] (NULL: 0). threads 0:
// all. The caller frees it.
gonio_status gonio_mba_new(const gonio_scatter *scatter, const double *start, int threads, gonio_mba **out,
                           gonio_error *error);
// Fit the next level: 0 at the first call. GONIO_E_MEMORY leaves the mba at the level it had.
gonio_status gonio_mba_next(gonio_mba *mba, gonio_error *error);
// The sum over the levels so far, as one lattice at the last level; borrowed until the next call.
const gonio_lattice *gonio_mba_lattice(const gonio_mba *mba);
// Hand the lattice over to the caller.
void gonio_mba_take(gonio_mba *mba, gonio_lattice *lattice);
void gonio_mba_free(gonio_mba *mba); // NULL is allowed

// Bytes that fitting up to `level` needs beside the samples.
double gonio_mba_memory(int dims, int level, int channels, size_t samples, int threads);
// All levels from 0 to `level` at once.
gonio_status gonio_mba_fit(const gonio_scatter *scatter, const double *start, int level, int threads,
                           gonio_lattice *lattice, gonio_error *error);
// Levels from `first` to `level`, without the coarser ones: what is far from any sample stays 0.
gonio_status gonio_mba_fit_from(const gonio_scatter *scatter, int first, int level, int threads,
                                gonio_lattice *lattice, gonio_error *error);

#endif
