// SPDX-License-Identifier: BSD-3-Clause
// Wavelet transforms of what stands at the nodes of a grid, in place.
#ifndef GONIO_BRDF_GRID_LIFTING_H
#define GONIO_BRDF_GRID_LIFTING_H

#include "brdf/grid/grid.h"

// X(identifier, number in model files, name, what it is).
#define GONIO_WAVELET_TABLE(X)                                                                                         \
    X(HAAR, 0, "haar", "means and differences of two neighbours")                                                      \
    X(CDF53, 1, "cdf53", "Cohen, Daubechies and Feauveau's 5/3: piecewise linear")

#define GONIO_WAVELET_ENUM(id, number, name, summary) GONIO_WAVELET_##id = number,
typedef enum gonio_wavelet { GONIO_WAVELET_TABLE(GONIO_WAVELET_ENUM) } gonio_wavelet;
#undef GONIO_WAVELET_ENUM
#define GONIO_WAVELET_COUNT(id, number, name, summary) +1
#define GONIO_WAVELETS (0 GONIO_WAVELET_TABLE(GONIO_WAVELET_COUNT)) // how many there are

// values[nodes][channels] -> coefficients, each in its node's place; and back.
void gonio_lifting_forward(gonio_wavelet wavelet, const gonio_grid *grid, size_t channels, double *values);
void gonio_lifting_inverse(gonio_wavelet wavelet, const gonio_grid *grid, size_t channels, double *values);
// The step, from 1 on, at which the coefficient of a node came out as a detail; level + 1: it never did.
int gonio_lifting_step(const gonio_grid *grid, size_t node);

#endif
