// SPDX-License-Identifier: BSD-3-Clause
// From a model's channels to linear sRGB, and to what a display wants.
#ifndef GONIO_IO_COLOUR_H
#define GONIO_IO_COLOUR_H

#include "gonio/model.h"

// rgb[k] = sum over channels of weight[k * channels + c] value[c].
typedef struct gonio_colour_weights {
    int channels;
    double *weight; // 3 x channels
} gonio_colour_weights;

// Three channels that are no wavelengths: as they are. At least three wavelengths between 380 and 730 nm: by the colour
// matching functions. Otherwise the mean, as grey. Every choice shows a flat spectrum of 1 as (1, 1, 1).
gonio_status gonio_colour_new(int channels, const char (*names)[32], gonio_colour_weights *colour, gonio_error *error);
void gonio_colour_free(gonio_colour_weights *colour);
void gonio_colour_rgb(const gonio_colour_weights *colour, const double *values, double rgb[3]);

// IEC 61966-2-1: linear light to an 8-bit code; clipped to [0, 1] first.
unsigned char gonio_srgb_code(double linear);

#endif
