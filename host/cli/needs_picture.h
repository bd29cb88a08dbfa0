// SPDX-License-Identifier: BSD-3-Clause
// What a scene needs, as a picture: a row a material.
#ifndef GONIO_CLI_NEEDS_PICTURE_H
#define GONIO_CLI_NEEDS_PICTURE_H

#include "gonio/needs.h"

// PNG, or SVG where the path ends in .svg. Written whole or not at all.
gonio_status cli_needs_picture(const gonio_needs *needs, const char *path, gonio_error *error);

#endif
