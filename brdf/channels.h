// SPDX-License-Identifier: BSD-3-Clause
// What a lattice model keeps of each channel beside its control points.
#ifndef GONIO_BRDF_CHANNELS_H
#define GONIO_BRDF_CHANNELS_H

#include <stddef.h>

#include "brdf/transform.h"
#include "gonio/status.h"

typedef struct gonio_channels {
    gonio_transform *transforms; // [count]
    char (*names)[32];           // [count]; NULL where they lie in the model's file
} gonio_channels;

// Copies; names may be NULL. Release with gonio_channels_release.
gonio_status gonio_channels_init(gonio_channels *channels, size_t count, const gonio_transform *transforms,
                                 const char (*names)[32], gonio_error *error);
void gonio_channels_release(gonio_channels *channels);

#endif
