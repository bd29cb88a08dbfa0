// SPDX-License-Identifier: BSD-3-Clause
// The sample's spec and the truth in the camera's channels.
#ifndef GONIO_SIM_SAMPLE_H
#define GONIO_SIM_SAMPLE_H

#include "gonio/model.h"
#include "sim/settings.h"

// Takes shape=, radius_mm= and plate_mm= off the end of the spec into the settings and makes the model of the rest,
// which may be patch:PATCH, microgeometry (gonio_patch_open). The caller frees it.
gonio_status gonio_sim_sample_parse(const char *spec, sim_settings *settings, gonio_model **out, gonio_error *error);

// The model in `channels` (1 mono, 3 Bayer) channels: itself where it has as many; the mean over its channels on a mono
// camera; one channel thrice on a Bayer camera. Else GONIO_E_UNSUPPORTED. Where *out != model the caller frees *out
// (which borrows model).
gonio_status gonio_sim_sample_seen(gonio_model *model, int channels, gonio_model **out, gonio_error *error);

#endif
