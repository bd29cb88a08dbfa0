// SPDX-License-Identifier: BSD-3-Clause
// Which few columns of a matrix, with weights of 0 or more, add up to the sum of all.
#ifndef GONIO_SCENE_CPM_SELECT_H
#define GONIO_SCENE_CPM_SELECT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Some rows of the matrix and what is wanted of them, usually the sum of their columns.
typedef struct cpm_rows {
    size_t n, stride;
    const float *a;  // a column after the other, `stride` apart
    const double *b; // [n]
} cpm_rows;

typedef struct cpm_matrix {
    size_t columns;
    cpm_rows fit;  // what columns are chosen and weighted by
    cpm_rows held; // what decides whether there are enough; none: the same
} cpm_matrix;

typedef struct cpm_choice {
    size_t n;        // columns chosen
    size_t *columns; // room for `most` of them
    double *weights;
    double snr_db; // 10 log10 |b|^2 / |b - A w|^2, of the rows held out where there are some
} cpm_choice;

// That figure of some rows.
double gonio_cpm_snr(const cpm_rows *rows, size_t n, const size_t *columns, const double *weights);

// Greedy: each step takes the column that lies along the rest best, then fits all weights anew by non-negative least
// squares (Lawson and Hanson 1974), held to equal weights as far as the rows leave them open, until the signal-to-noise
// ratio is reached, there are `most`, or more columns no longer help the rows held out; the best is kept. false: no
// memory.
bool gonio_cpm_select_greedy(const cpm_matrix *matrix, double snr_db, size_t most, cpm_choice *choice);

// The paper's (Wu, Dorsey and Rushmeier 2009, table 2, after Drineas, Mahoney and Muthukrishnan 2006): columns drawn by
// their share in the best approximation of rank k, which keeps `energy` of the squares; weights by least squares with a
// small ridge, negative ones set to 0; the best of `repeats` draws; the least number by bisection. false: no memory, or
// no convergence.
bool gonio_cpm_select_sampled(const cpm_matrix *matrix, double snr_db, size_t most, double energy, int repeats,
                              uint64_t seed, cpm_choice *choice);

#endif
