// SPDX-License-Identifier: BSD-3-Clause
// Pictures that are drawn: PNG, or SVG where the path ends in .svg.
#ifndef GONIO_CLI_DRAWING_H
#define GONIO_CLI_DRAWING_H

#include <cairo.h>

#include "gonio/status.h"

// Calls draw with white paper, lines of width 1 and text of 12 points. Written whole or not at all.
gonio_status cli_drawing(const char *path, int width, int height, void (*draw)(cairo_t *cairo, void *context),
                         void *context, gonio_error *error);
// From dark blue (0) over green to yellow (1): the lightness rises evenly, so that it can be read in grey too.
void cli_drawing_colour(cairo_t *cairo, double t);

#endif
