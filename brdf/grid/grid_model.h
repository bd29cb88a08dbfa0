// SPDX-License-Identifier: BSD-3-Clause
// What the sections of models over a grid have in common: the description, the channels' transforms, then parts of the
// kind's own (docs/formats.md).
#ifndef GONIO_BRDF_GRID_GRID_MODEL_H
#define GONIO_BRDF_GRID_GRID_MODEL_H

#include <string.h>

#include "brdf/channels.h"
#include "brdf/grid/grid.h"
#include "brdf/kind.h"

// A model over a grid: its kinds' models begin with it.
typedef struct gonio_grid_model {
    gonio_channels channels;
    gonio_grid grid;
} gonio_grid_model;

// The first 64 bytes of the section; own[] is the kind's.
typedef struct gonio_grid_description {
    uint32_t dims, level, system, transform, own[12];
} gonio_grid_description;
_Static_assert(sizeof(gonio_grid_description) == 64, "the description is one block");

gonio_grid_description gonio_grid_describe(const gonio_grid_model *model);
// Read description and transforms, which are checked, and make of them a model of `size` bytes, whose channels are
// still in the file: gonio_channels_adopt follows. *at is behind them, *about the description.
gonio_status gonio_grid_model_read(const gonio_mapped *mapped, size_t size, const gonio_model_ops *ops, size_t *at,
                                   const gonio_grid_description **about, void **out, gonio_error *error);
// The same of a model that is not in a file: names and transforms are copied.
gonio_status gonio_grid_model_new(size_t size, const gonio_model_ops *ops, const gonio_grid *grid, int channels,
                                  gonio_transform_kind kind, const gonio_transform *transforms, const char (*names)[32],
                                  void **out, gonio_error *error);

// sums[channels] = the weighted sum of points[nodes][channels].
static inline void gonio_grid_sum(const float *points, size_t channels, int n, const size_t *nodes,
                                  const double *weights, double *sums) {
    memset(sums, 0, channels * sizeof *sums);
    for (int k = 0; k < n; k++) {
        const float *point = points + nodes[k] * channels;
        for (size_t c = 0; c < channels; c++) {
            sums[c] += weights[k] * (double)point[c];
        }
    }
}

// values[c] = f_r of the transformed sums[c].
static inline void gonio_grid_invert(const gonio_grid_model *m, const double *sums, double *values) {
    for (int c = 0; c < m->channels.head.channels; c++) {
        values[c] = gonio_transform_invert(m->channels.kind, &m->channels.transforms[c], sums[c]);
    }
}

#endif
