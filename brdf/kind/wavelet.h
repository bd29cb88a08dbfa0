// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "wavelet": the largest wavelet coefficients of a table.
#ifndef GONIO_BRDF_KIND_WAVELET_H
#define GONIO_BRDF_KIND_WAVELET_H

#include "brdf/grid/lifting.h"
#include "brdf/transform.h"
#include "gonio/model.h"

// A coefficient stands for at most so many nodes: a short file is no large table.
#define GONIO_WAVELET_NODES_PER_KEY 4096

typedef struct gonio_wavelet_parts {
    gonio_grid grid;
    gonio_wavelet wavelet;
    int channels;
    gonio_transform_kind kind;
    const gonio_transform *transforms; // [channels]
    const char (*names)[32];
    size_t keys;
    const uint32_t *key; // nodes, ascending
    const float *values; // [keys][channels]
} gonio_wavelet_parts;

// Everything is copied. The caller frees the model.
gonio_status gonio_wavelet_new(const gonio_wavelet_parts *parts, gonio_model **out, gonio_error *error);

#endif
