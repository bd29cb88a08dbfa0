// SPDX-License-Identifier: BSD-3-Clause
// Which few columns of a matrix, with weights of 0 or more, add up to the sum of all.
#ifndef GONIO_SCENE_CPM_SELECT_H
#define GONIO_SCENE_CPM_SELECT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct cpm_matrix {
    size_t rows, columns;
    const float *a;  // a column after the other
    const double *b; // [rows]: what is wanted; usually the sum of the columns
} cpm_matrix;

typedef struct cpm_choice {
    size_t n;        // columns chosen
    size_t *columns; // room for `most` of them
    double *weights;
    double snr_db; // 10 log10 |b|^2 / |b - A w|^2
} cpm_choice;

// Greedy: each step takes the column that lies along the rest best, then fits all weights anew by non-negative least
// squares (Lawson and Hanson 1974), until the signal-to-noise ratio is reached or there are `most`. false: no memory.
bool gonio_cpm_select_greedy(const cpm_matrix *matrix, double snr_db, size_t most, cpm_choice *choice);

// The paper's (Wu, Dorsey and Rushmeier 2009, table 2, after Drineas, Mahoney and Muthukrishnan 2006): columns drawn by
// their share in the best approximation of rank k, which keeps `energy` of the squares; weights by least squares with a
// small ridge, negative ones set to 0; the best of `repeats` draws; the least number by bisection. false: no memory, or
// no convergence.
bool gonio_cpm_select_sampled(const cpm_matrix *matrix, double snr_db, size_t most, double energy, int repeats,
                              uint64_t seed, cpm_choice *choice);

#endif
