// SPDX-License-Identifier: BSD-3-Clause
#include <stdlib.h>
#include <string.h>

#include "calib/opencv.h"
#include "gonio/characterise.h"

gonio_status gonio_image_read(const char *path, bool grey, gonio_image *image, gonio_error *error) {
    *image = (gonio_image){0};
    return gonio_opencv_read_image(path, grey, &image->width, &image->height, &image->channels, &image->bits,
                                   &image->pixels, error);
}

void gonio_image_free(gonio_image *image) {
    free(image->pixels);
    *image = (gonio_image){0};
}

gonio_status gonio_map_write(const char *path, int width, int height, const float *values, gonio_error *error) {
    return gonio_opencv_write_map(path, width, height, values, error);
}

gonio_status gonio_image_write(const gonio_image *image, const char *path, gonio_error *error) {
    return gonio_opencv_write_image(image, path, error);
}

static gonio_status move(gonio_image *image, const int shift[2], gonio_error *error) {
    const size_t pixel = (size_t)image->channels * sizeof *image->pixels;
    uint16_t *moved = calloc((size_t)image->width * (size_t)image->height, pixel);
    if (moved == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for an image of %d x %d", image->width, image->height);
    }
    for (int y = 0; y < image->height; y++) {
        const int from = y - shift[1];
        const int first = shift[0] > 0 ? shift[0] : 0;
        const int last = shift[0] < 0 ? image->width + shift[0] : image->width;
        if (from >= 0 && from < image->height && last > first) {
            const size_t to = (size_t)y * (size_t)image->width + (size_t)first;
            const size_t at = (size_t)from * (size_t)image->width + (size_t)(first - shift[0]);
            memcpy((char *)moved + to * pixel, (char *)image->pixels + at * pixel, (size_t)(last - first) * pixel);
        }
    }
    free(image->pixels);
    image->pixels = moved;
    return GONIO_OK;
}

gonio_status gonio_images_align(int n, gonio_image *images, const double *exposure_s, int (*shifts)[2],
                                gonio_error *error) {
    int middle = 0;
    for (int j = 0; j < n; j++) { // the median exposure
        int below = 0;
        for (int k = 0; k < n; k++) {
            below += exposure_s[k] < exposure_s[j];
        }
        middle = below == n / 2 ? j : middle;
    }
    gonio_status status = GONIO_OK;
    for (int j = 0; status == GONIO_OK && j < n; j++) {
        int shift[2] = {0, 0};
        if (j != middle) {
            status = gonio_opencv_shift(&images[middle], &images[j], shift, error);
        }
        if (status == GONIO_OK && (shift[0] != 0 || shift[1] != 0)) {
            status = move(&images[j], shift, error);
        }
        if (shifts != NULL) {
            memcpy(shifts[j], shift, sizeof shift);
        }
    }
    return status;
}
