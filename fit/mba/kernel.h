// SPDX-License-Identifier: BSD-3-Clause
// The inner loop of a multilevel fit: one chunk of sorted samples into its sums.
#ifndef GONIO_FIT_MBA_KERNEL_H
#define GONIO_FIT_MBA_KERNEL_H

#include "fit/prepare/scatter.h"

// Doubles a control point in the sums: the denominator, the channels' numerators, padding to whole vectors.
static inline size_t gonio_mba_stride(int channels) {
    const size_t used = (size_t)channels + 1;
    return used <= 2 ? 2 : used <= 4 ? 4 : (used + 7) / 8 * 8;
}

typedef struct gonio_mba_job {
    const gonio_scatter *scatter;
    size_t begin, end; // samples
    int level;
    size_t size;           // control points a dimension
    const float *points;   // the level's lattice so far: residuals are taken from it
    double *const *planes; // [size]: where the sums of each plane of control points along the first axis are
    bool runs;             // many samples share a cell: sum them aside and add the cell's sums once
} gonio_mba_job;

void gonio_mba_accumulate(const gonio_mba_job *job);
void gonio_mba_accumulate_channels(const gonio_mba_job *job); // two channels or more

#endif
