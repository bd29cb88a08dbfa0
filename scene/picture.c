// SPDX-License-Identifier: BSD-3-Clause
#include <stdlib.h>

#include "scene/image.h"

gonio_status gonio_scene_picture_new(int width, int height, gonio_picture **out, gonio_error *error) {
    *out = NULL;
    const size_t pixels = width > 0 && height > 0 ? (size_t)width * (size_t)height : 0;
    if (pixels == 0 || width > SCENE_IMAGE_SIDE_MAX || height > SCENE_IMAGE_SIDE_MAX ||
        pixels > SCENE_IMAGE_PIXELS_MAX) {
        return gonio_fail(error, GONIO_E_RANGE,
                          "a picture of %d x %d pixels; sides of 1 to %d and %zu pixels are possible", width, height,
                          SCENE_IMAGE_SIDE_MAX, SCENE_IMAGE_PIXELS_MAX);
    }
    gonio_picture *image = malloc(sizeof *image);
    float *rgb = calloc(pixels, 3 * sizeof *rgb);
    if (image == NULL || rgb == NULL) {
        free(image);
        free(rgb);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a picture of %d x %d pixels", width, height);
    }
    *image = (gonio_picture){width, height, rgb};
    *out = image;
    return GONIO_OK;
}

void gonio_picture_free(gonio_picture *image) {
    if (image != NULL) {
        free(image->rgb);
        free(image);
    }
}
