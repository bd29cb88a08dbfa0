// SPDX-License-Identifier: BSD-3-Clause
// How far two pictures lie apart.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "io/colour.h"
#include "scene/image.h"

#define DIFFERENCE_GAIN 8

static size_t pixels_of(const gonio_picture *image) { return (size_t)image->width * (size_t)image->height; }

static gonio_status check_sizes(const gonio_picture *a, const gonio_picture *b, gonio_error *error) {
    return a->width == b->width && a->height == b->height
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_RANGE, "pictures of %d x %d and %d x %d pixels cannot be compared", a->width,
                            a->height, b->width, b->height);
}

gonio_status gonio_picture_compare(const gonio_picture *image, const gonio_picture *reference, double scale,
                                   gonio_picture_error *result, gonio_error *error) {
    const gonio_status status = check_sizes(image, reference, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t pixels = pixels_of(image);
    double lengths = 0, squares = 0, light = 0, apart = 0;
    result->largest = 0;
    for (size_t i = 0; i < pixels; i++) {
        double length2 = 0;
        for (size_t c = 3 * i; c < 3 * i + 3; c++) {
            const double a = (double)image->rgb[c], b = (double)reference->rgb[c];
            const double d = gonio_srgb_code(scale * a) - gonio_srgb_code(scale * b);
            length2 += d * d;
            result->largest = fmax(result->largest, fabs(d));
            light += b * b;
            apart += (a - b) * (a - b);
        }
        lengths += sqrt(length2);
        squares += length2;
    }
    result->mae = lengths / (double)pixels;
    result->psnr_db = squares > 0 ? 10 * log10(255.0 * 255.0 * 3 * (double)pixels / squares) : INFINITY;
    result->snr_db = apart > 0 ? 10 * log10(light / apart) : INFINITY;
    return GONIO_OK;
}

static gonio_status write_codes(const gonio_picture *image, const gonio_picture *reference, double scale,
                                const char *path, gonio_error *error) {
    const size_t values = 3 * pixels_of(image);
    unsigned char *codes = malloc(values);
    if (codes == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to write %s", path);
    }
    for (size_t i = 0; i < values; i++) {
        const int d =
            gonio_srgb_code(scale * (double)image->rgb[i]) - gonio_srgb_code(scale * (double)reference->rgb[i]);
        codes[i] = (unsigned char)(abs(d) * DIFFERENCE_GAIN < 255 ? abs(d) * DIFFERENCE_GAIN : 255);
    }
    const gonio_status status = gonio_scene_codes_write(codes, image->width, image->height, path, error);
    free(codes);
    return status;
}

gonio_status gonio_picture_write_difference(const gonio_picture *image, const gonio_picture *reference, double scale,
                                            const char *path, gonio_error *error) {
    gonio_status status = check_sizes(image, reference, error);
    status = status == GONIO_OK ? gonio_picture_check_name(path, error) : status;
    const char *dot = strrchr(path, '.');
    if (status != GONIO_OK || (dot != NULL && strcasecmp(dot, ".png") == 0)) {
        return status == GONIO_OK ? write_codes(image, reference, scale, path, error) : status;
    }
    gonio_picture *apart;
    status = gonio_scene_picture_new(image->width, image->height, &apart, error);
    if (status == GONIO_OK) {
        for (size_t i = 0; i < 3 * pixels_of(image); i++) {
            apart->rgb[i] = image->rgb[i] - reference->rgb[i];
        }
        status = gonio_picture_write(apart, path, 1, error);
        gonio_picture_free(apart);
    }
    return status;
}
