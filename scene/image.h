// SPDX-License-Identifier: BSD-3-Clause
// Pictures of light, what the public header does not say of them.
#ifndef GONIO_SCENE_IMAGE_H
#define GONIO_SCENE_IMAGE_H

#include <stdio.h>

#include "gonio/scene.h"

#define SCENE_IMAGE_SIDE_MAX 32768
#define SCENE_IMAGE_PIXELS_MAX ((size_t)1 << 27)

// Room for it, all black; GONIO_E_RANGE for an impossible size. The caller frees it.
gonio_status gonio_scene_picture_new(int width, int height, gonio_picture **out, gonio_error *error);
// 8-bit sRGB codes, width x height x 3, and a PNG file of some.
void gonio_scene_picture_codes(const gonio_picture *image, double scale, unsigned char *codes);
gonio_status gonio_scene_codes_write(const unsigned char *codes, int width, int height, const char *path,
                                     gonio_error *error);

#endif
