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
    gonio_smooth_axis axis;        // of every dimension
    double *feature[4];            // mode-major: feature[d][mode n + i], at the samples
    double *root;                  // [n] sqrt(weight)
    double *vectors;               // n x n, eigenvector j in column j
    double *values;                // [n]
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

// A mode's prior variance; 0 where the symmetries leave none. mode: an index an axis.
double gonio_smooth_modes_variance(const gonio_smooth_dense *dense, const size_t *mode);

// out[n x points], sample fastest: the lattice's prior covariance between samples (times root weight) and points (times
// scale[point]; NULL: 1). own[points] (NULL: not wanted; then at is not looked at): of the points themselves. at[points
// x dims], feature: of the points.
gonio_status gonio_smooth_covariance(const gonio_smooth_dense *dense, size_t points, const double *at,
                                     double *const feature[4], const double *scale, double *out, double *own,
                                     gonio_error *error);

#endif
