#include <stdlib.h>

#include "calib/opencv.h"
#include "gonio/calibrate.h"

gonio_status gonio_image_read(const char *path, bool grey, gonio_image *image, gonio_error *error) {
    *image = (gonio_image){0};
    return opencv_read_image(path, grey, &image->width, &image->height, &image->channels, &image->bits, &image->pixels,
                             error);
}

void gonio_image_free(gonio_image *image) {
    free(image->pixels);
    *image = (gonio_image){0};
}

gonio_status gonio_map_write(const char *path, int width, int height, const float *values, gonio_error *error) {
    return opencv_write_map(path, width, height, values, error);
}
