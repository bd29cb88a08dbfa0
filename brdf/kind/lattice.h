// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "lattice": a B-spline over the coordinates of a direction pair.
#ifndef GONIO_BRDF_KIND_LATTICE_H
#define GONIO_BRDF_KIND_LATTICE_H

#include "brdf/spline/lattice.h"
#include "brdf/transform.h"
#include "gonio/model.h"

// Make a model of *lattice, whose points it takes over (the caller's are then NULL); names and transforms (one a
// channel) are copied. dims 3 is isotropic, 4 anisotropic.
gonio_status gonio_lattice_model_new(gonio_lattice *lattice, gonio_coordinates coordinates, gonio_transform_kind kind,
                                     const gonio_transform *transforms, const char (*channel_names)[32],
                                     gonio_model **out, gonio_error *error);
// The lattice of a model of kind "lattice", borrowed from it; NULL for other kinds.
const gonio_lattice *gonio_lattice_model_lattice(const gonio_model *model);
// Its coordinates, transform kind and transforms (borrowed); each may be NULL.
void gonio_lattice_model_about(const gonio_model *model, gonio_coordinates *coordinates, gonio_transform_kind *kind,
                               const gonio_transform **transforms);

#endif
