// SPDX-License-Identifier: BSD-3-Clause
// The formats of pictures, each read from and written to a stream. Of scene/image.c alone.
#ifndef GONIO_SCENE_IMAGE_FORMATS_H
#define GONIO_SCENE_IMAGE_FORMATS_H

#include <stdio.h>

#include "scene/image.h"

gonio_status gonio_scene_hdr_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error);
gonio_status gonio_scene_pfm_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error);
gonio_status gonio_scene_png_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error);
gonio_status gonio_scene_exr_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error);
gonio_status gonio_scene_pfm_write(const gonio_picture *image, FILE *file, const char *path, gonio_error *error);
gonio_status gonio_scene_exr_write(const gonio_picture *image, FILE *file, const char *path, gonio_error *error);

#endif
