// SPDX-License-Identifier: BSD-3-Clause
// The parts of a model of kind "halves", for what changes them one by one.
#ifndef GONIO_BRDF_KIND_HALVES_H
#define GONIO_BRDF_KIND_HALVES_H

#include "gonio/model.h"

// The model of one half, NULL where there is none; it stays the model's own.
gonio_model *gonio_halves_part(gonio_model *model, gonio_half half);
// The model owns `part` from now on, which has the channels of the one before; that one is not freed: `part` or the
// caller has it.
void gonio_halves_put(gonio_model *model, gonio_half half, gonio_model *part);

#endif
