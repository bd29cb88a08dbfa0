// SPDX-License-Identifier: BSD-3-Clause
// Multilevel B-spline approximation (MBA).
//
// One level, Lee, Wolberg and Shin 1997, eqs. 3 to 5 (Kameya 2002, 2.3.2): a sample with residual r among the 4^d
// control points of its cell asks each for phi_c = w_c r / sum_a w_a^2; where samples disagree, the least squares
// answer is
//   phi = sum_c q_c w_c^2 phi_c / sum_c q_c w_c^2,
// with q_c the sample's weight (1 in the thesis). A point that no sample reaches keeps 0: the coarser level's value.
// Then the lattice is refined and the next level fits what is left.
//
// The residual of level h is taken from the sum of the levels below it, already refined to level h. So weights and
// addresses of a sample are computed once a level for both the residual and the sums, and no residuals are stored.
#include "fit/mba/mba.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/mba/level.h"

struct gonio_mba {
    gonio_mba_level level;
    gonio_lattice lattice;
    double start[GONIO_CHANNELS_MAX];
    int first_level;
    bool begun;
};

gonio_status gonio_mba_new(const gonio_scatter *scatter, const double *start, int threads, gonio_mba **out,
                           gonio_error *error) {
    gonio_mba *mba = *out = calloc(1, sizeof *mba);
    if (mba == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a fit");
    }
    mba->level.scatter = scatter;
    mba->level.lattice = &mba->lattice;
    mba->level.pool = scatter->n >= GONIO_POOL_SAMPLES ? gonio_pool_new(threads) : NULL;
    if (start != NULL) {
        memcpy(mba->start, start, (size_t)scatter->channels * sizeof *start);
    }
    return GONIO_OK;
}

void gonio_mba_free(gonio_mba *mba) {
    if (mba != NULL) {
        gonio_lattice_release(&mba->lattice);
        gonio_pool_free(mba->level.pool);
        free(mba->level.scratch);
        free(mba);
    }
}

const gonio_lattice *gonio_mba_lattice(const gonio_mba *mba) { return &mba->lattice; }

void gonio_mba_take(gonio_mba *mba, gonio_lattice *lattice) {
    *lattice = mba->lattice;
    mba->lattice.points = NULL;
}

gonio_status gonio_mba_next(gonio_mba *mba, gonio_error *error) {
    const gonio_scatter *s = mba->level.scatter;
    gonio_status status;
    if (mba->begun) {
        status = gonio_lattice_refine(&mba->lattice, error);
    } else {
        status = gonio_lattice_init(&mba->lattice, s->dims, mba->first_level, s->channels, error);
        if (status == GONIO_OK) {
            gonio_lattice_fill(&mba->lattice, mba->start);
            mba->begun = true;
        }
    }
    if (status != GONIO_OK) {
        return status;
    }
    const bool coarse = mba->lattice.level <= gonio_mba_coarse_level(s->dims);
    return (coarse ? gonio_mba_fit_coarse : gonio_mba_fit_fine)(&mba->level, error);
}

double gonio_mba_memory(int dims, int level, int channels, size_t samples, int threads) {
    const double points = (double)gonio_lattice_count(dims, level) * 4.0 * channels;
    const double coarser = level > 0 ? (double)gonio_lattice_count(dims, level - 1) * 4.0 * channels : 0;
    const int coarse = gonio_mba_coarse_level(dims);
    const double sums = level <= coarse ? gonio_mba_coarse_memory(dims, level, channels, samples)
                                        : fmax(gonio_mba_coarse_memory(dims, coarse, channels, samples),
                                               gonio_mba_fine_memory(dims, level, channels, samples, threads));
    const double refining = points / (double)gonio_bspline_size(level) * 2;
    return points + coarser + fmax(sums, refining);
}

static gonio_status fit_levels(const gonio_scatter *scatter, const double *start, int first, int level, int threads,
                               gonio_lattice *lattice, gonio_error *error) {
    gonio_mba *mba;
    gonio_status status = gonio_mba_new(scatter, start, threads, &mba, error);
    if (status == GONIO_OK) {
        mba->first_level = first;
    }
    for (int h = first; h <= level && status == GONIO_OK; h++) {
        status = gonio_mba_next(mba, error);
    }
    if (status == GONIO_OK) {
        gonio_mba_take(mba, lattice);
    }
    gonio_mba_free(mba);
    return status;
}

gonio_status gonio_mba_fit(const gonio_scatter *scatter, const double *start, int level, int threads,
                           gonio_lattice *lattice, gonio_error *error) {
    return fit_levels(scatter, start, 0, level, threads, lattice, error);
}

gonio_status gonio_mba_fit_from(const gonio_scatter *scatter, int first, int level, int threads,
                                gonio_lattice *lattice, gonio_error *error) {
    return fit_levels(scatter, NULL, first, level, threads, lattice, error);
}
