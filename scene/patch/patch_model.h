// SPDX-License-Identifier: BSD-3-Clause
// A patch as a model, for the simulated rig.
#ifndef GONIO_SCENE_PATCH_PATCH_MODEL_H
#define GONIO_SCENE_PATCH_PATCH_MODEL_H

#include "gonio/model.h"

// text: see gonio_patch_open. Unlike other models this one computes what it is asked for when it is first asked, under
// a lock: rays at the corners of a one-degree grid of both directions, between which it interpolates. Deterministic,
// whatever the order of the questions. The caller frees it.
gonio_status gonio_patch_model_new(const char *text, gonio_model **out, gonio_error *error);

#endif
