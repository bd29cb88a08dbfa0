// SPDX-License-Identifier: BSD-3-Clause
// What was sampled, as a picture: directions in the projected disc, values by colour.
#ifndef GONIO_CLI_SAMPLES_PICTURE_H
#define GONIO_CLI_SAMPLES_PICTURE_H

#include "gonio/sample.h"
#include "gonio/status.h"

// PNG, or SVG where the path ends in .svg; of the first channel; a disc an incidence, 12 of them at most. Written whole
// or not at all.
gonio_status cli_samples_picture(const gonio_samples *samples, const char *path, gonio_error *error);

#endif
