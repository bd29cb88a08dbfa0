// SPDX-License-Identifier: BSD-3-Clause
// What models of lattices of transformed values begin with: their channels, and the file that they lie in.
#ifndef GONIO_BRDF_CHANNELS_H
#define GONIO_BRDF_CHANNELS_H

#include "brdf/model_file.h"
#include "brdf/transform.h"

typedef struct gonio_channels {
    gonio_model head;
    gonio_transform_kind kind;
    gonio_transform *transforms; // [head.channels]
    char (*names)[32];           // [head.channels]; NULL where they lie in the file
    gonio_mapped mapped;         // base NULL: the arrays are our own
} gonio_channels;

// A model of `size` bytes, zeros but for its channels, which are copied. names NULL: gonio_channels_adopt follows.
gonio_status gonio_channels_new(size_t size, int count, gonio_transform_kind kind, const gonio_transform *transforms,
                                const char (*names)[32], void **out, gonio_error *error);
// The file is the model's from here on, and *mapped is empty.
void gonio_channels_adopt(gonio_channels *model, gonio_mapped *mapped);
void gonio_channels_free(gonio_channels *model);

#endif
