// SPDX-License-Identifier: BSD-3-Clause
// The insides of the direct solver that its files share: the lattice's modes, taken in blocks.
#ifndef GONIO_FIT_SMOOTH_MODES_H
#define GONIO_FIT_SMOOTH_MODES_H

#include "fit/smooth/axis.h"
#include "fit/smooth/profile.h"

struct gonio_smooth_dense {
    const gonio_dataset *data;
    gonio_smooth_form form;
    size_t n, m; // geometries, modes an axis
    int dims;
    unsigned mirror_axes, swap_axes;
    gonio_smooth_axis axis; // of every dimension
    double *feature[4];     // mode-major: feature[d][mode n + i], at the samples
    double *root;           // [n] sqrt(weight)
    double *kernel[2];      // n x n, lower triangle: modes even and odd under swapping; [1] NULL where there are none
    double *vectors;        // n x n, eigenvector j in column j
    double *values;         // [n]
    gonio_smooth_profile *profile; // NULL until one is asked for
    double *shares;                // n x (1 + GONIO_LOBES_MAX), sample fastest, times root weight; NULL: none
};

// All products of the last two axes' modes for one choice of the leading axes' modes.
typedef struct gonio_smooth_modes {
    size_t lead[2];     // modes of the leading axes
    size_t count;       // columns
    uint16_t *last[2];  // [count]: modes of the last two axes
    double *root_prior; // [count]: 1/sqrt of the mode's penalty
} gonio_smooth_modes;

gonio_status gonio_smooth_modes_init(const gonio_smooth_dense *dense, gonio_smooth_modes *b, gonio_error *error);
void gonio_smooth_modes_release(gonio_smooth_modes *b);
size_t gonio_smooth_modes_leads(const gonio_smooth_dense *dense); // how many choices of leading modes there are
// Fill the columns of a choice of leading modes that are even (swap 0) or odd (1) under swapping the directions.
void gonio_smooth_modes_block(const gonio_smooth_dense *dense, size_t lead, int swap, gonio_smooth_modes *b);
// columns[count x points], point fastest: the block's modes at points with the given features, times scale[point]
// (NULL: 1).
void gonio_smooth_modes_columns(const gonio_smooth_dense *dense, const gonio_smooth_modes *b, size_t points,
                                double *const feature[4], const double *scale, double *columns);

#endif
