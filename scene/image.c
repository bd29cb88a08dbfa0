// SPDX-License-Identifier: BSD-3-Clause
#include "scene/image.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <png.h>

#include "base/order_statistic.h"
#include "gonio/output.h"
#include "io/colour.h"
#include "scene/image_formats.h"

#define PERCENTILE 0.99
#define PERCENTILE_TO 0.9

// ---- PFM ----

gonio_status gonio_scene_pfm_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error) {
    char kind[3] = "", end;
    int width, height;
    float scale;
    if (fscanf(file, "%2s %6d %6d %f%c", kind, &width, &height, &scale, &end) != 5 ||
        (strcmp(kind, "PF") != 0 && strcmp(kind, "Pf") != 0) || !(fabsf(scale) > 0)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                               "not a PFM picture: expected PF or Pf, width, height and scale");
    }
    const gonio_status status = gonio_scene_picture_new(width, height, out, error);
    const size_t channels = kind[1] == 'F' ? 3 : 1;
    for (int y = height - 1; y >= 0 && status == GONIO_OK; y--) {
        for (int x = 0; x < width; x++) {
            unsigned char bytes[12];
            float *to = (*out)->rgb + 3 * ((size_t)y * (size_t)width + (size_t)x);
            if (fread(bytes, 4, channels, file) != channels) {
                return gonio_fail_byte(error, GONIO_E_INPUT, path, (long long)ftell(file),
                                       "a PFM picture ends too early");
            }
            for (size_t c = 0; c < 3; c++) {
                const unsigned char *b = bytes + 4 * (c < channels ? c : 0);
                const uint32_t bits = scale < 0
                                          ? (uint32_t)b[3] << 24 | (uint32_t)b[2] << 16 | (uint32_t)b[1] << 8 | b[0]
                                          : (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
                memcpy(to + c, &bits, sizeof bits);
            }
        }
    }
    return status;
}

gonio_status gonio_scene_pfm_write(const gonio_picture *image, FILE *file, const char *path, gonio_error *error) {
    fprintf(file, "PF\n%d %d\n-1.0\n", image->width, image->height);
    for (int y = image->height - 1; y >= 0; y--) {
        const float *row = image->rgb + 3 * (size_t)y * (size_t)image->width;
        for (int i = 0; i < 3 * image->width; i++) {
            uint32_t bits;
            memcpy(&bits, row + i, sizeof bits);
            const unsigned char b[4] = {(unsigned char)bits, (unsigned char)(bits >> 8), (unsigned char)(bits >> 16),
                                        (unsigned char)(bits >> 24)};
            fwrite(b, 1, 4, file);
        }
    }
    return ferror(file) ? gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it: %s", strerror(errno))
                        : GONIO_OK;
}

// ---- PNG ----

static double linear_of(unsigned code) {
    const double v = code / 255.0;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

// libpng's simplified interface, which never jumps: what has more than 8 bits is read as 8.
gonio_status gonio_scene_png_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error) {
    png_image png = {.version = PNG_IMAGE_VERSION};
    if (!png_image_begin_read_from_stdio(&png, file)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a PNG picture that can be read: %s", png.message);
    }
    png.format = PNG_FORMAT_RGB;
    const bool sized = png.width <= SCENE_IMAGE_SIDE_MAX && png.height <= SCENE_IMAGE_SIDE_MAX;
    gonio_status status =
        gonio_scene_picture_new(sized ? (int)png.width : -1, sized ? (int)png.height : -1, out, error);
    unsigned char *codes = status == GONIO_OK ? malloc(PNG_IMAGE_SIZE(png)) : NULL;
    if (status == GONIO_OK && codes == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", path);
    }
    if (status == GONIO_OK && !png_image_finish_read(&png, &(png_color){0, 0, 0}, codes, 0, NULL)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a PNG picture that can be read: %s", png.message);
    }
    png_image_free(&png);
    float table[256];
    for (unsigned k = 0; k < 256; k++) {
        table[k] = (float)linear_of(k);
    }
    for (size_t i = 0; status == GONIO_OK && i < 3 * (size_t)(*out)->width * (size_t)(*out)->height; i++) {
        (*out)->rgb[i] = table[codes[i]];
    }
    free(codes);
    return status;
}

gonio_status gonio_scene_codes_write(const unsigned char *codes, int width, int height, const char *path,
                                     gonio_error *error) {
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    // 8-bit RGB, which this interface marks as sRGB.
    png_image png = {.version = PNG_IMAGE_VERSION,
                     .width = (png_uint_32)width,
                     .height = (png_uint_32)height,
                     .format = PNG_FORMAT_RGB};
    if (!png_image_write_to_stdio(&png, gonio_output_stream(output), 0, codes, 0, NULL)) {
        status = gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it: %s", png.message);
        gonio_output_abandon(output);
        return status;
    }
    return gonio_output_commit(output, error);
}

// ---- all ----

typedef struct format {
    const char *ending;
    gonio_status (*read)(FILE *file, const char *path, gonio_picture **out, gonio_error *error);
    gonio_status (*write)(const gonio_picture *image, FILE *file, const char *path, gonio_error *error); // but for PNG
} format;
static const format formats[] = {
    {".png", gonio_scene_png_read, NULL},
    {".exr", gonio_scene_exr_read, gonio_scene_exr_write},
    {".pfm", gonio_scene_pfm_read, gonio_scene_pfm_write},
    {".hdr", gonio_scene_hdr_read, NULL},
    {".pic", gonio_scene_hdr_read, NULL},
};

static const format *find(const char *path) {
    const char *dot = strrchr(path, '.');
    for (size_t k = 0; dot != NULL && k < sizeof formats / sizeof *formats; k++) {
        if (strcasecmp(formats[k].ending, dot) == 0) {
            return &formats[k];
        }
    }
    return NULL;
}

static gonio_status check_values(const gonio_picture *image, const char *path, gonio_error *error) {
    for (size_t i = 0; i < 3 * (size_t)image->width * (size_t)image->height; i++) {
        if (!isfinite(image->rgb[i])) {
            const size_t pixel = i / 3, width = (size_t)image->width;
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                   "column %zu, row %zu: found %g, expected finite values", pixel % width,
                                   pixel / width, (double)image->rgb[i]);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_picture_read(const char *path, gonio_picture **out, gonio_error *error) {
    *out = NULL;
    const format *f = find(path);
    if (f == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "a picture is a .png, .exr, .hdr, .pic or .pfm file");
    }
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    gonio_status status = f->read(file, path, out, error);
    fclose(file);
    if (status == GONIO_E_RANGE) { // of a size, which here is the file's
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "its size is impossible, or too large");
    }
    status = status == GONIO_OK ? check_values(*out, path, error) : status;
    if (status != GONIO_OK) {
        gonio_picture_free(*out);
        *out = NULL;
    }
    return status;
}

gonio_status gonio_picture_check_name(const char *path, gonio_error *error) {
    const format *f = find(path);
    return f != NULL && (f->write != NULL || f->read == gonio_scene_png_read)
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE, "'%.200s': a picture is written as .png, .exr or .pfm", path);
}

void gonio_scene_picture_codes(const gonio_picture *image, double scale, unsigned char *codes) {
    for (size_t i = 0; i < 3 * (size_t)image->width * (size_t)image->height; i++) {
        codes[i] = gonio_srgb_code(scale * (double)image->rgb[i]);
    }
}

static gonio_status write_png(const gonio_picture *image, const char *path, double scale, gonio_error *error) {
    unsigned char *codes = malloc(3 * (size_t)image->width * (size_t)image->height);
    if (codes == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to write %s", path);
    }
    gonio_scene_picture_codes(image, scale, codes);
    const gonio_status status = gonio_scene_codes_write(codes, image->width, image->height, path, error);
    free(codes);
    return status;
}

gonio_status gonio_picture_write(const gonio_picture *image, const char *path, double scale, gonio_error *error) {
    gonio_status status = gonio_picture_check_name(path, error);
    const format *f = find(path);
    if (status != GONIO_OK || f->write == NULL) {
        return status == GONIO_OK ? write_png(image, path, scale, error) : status;
    }
    gonio_output *output;
    status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = f->write(image, gonio_output_stream(output), path, error);
    if (status != GONIO_OK) {
        gonio_output_abandon(output);
        return status;
    }
    return gonio_output_commit(output, error);
}

gonio_status gonio_picture_exposure(const gonio_picture *image, double *scale, gonio_error *error) {
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    float *levels = malloc(pixels * sizeof *levels);
    if (levels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to find the exposure");
    }
    size_t count = 0;
    for (size_t i = 0; i < pixels; i++) {
        const float *p = image->rgb + 3 * i, level = fmaxf(p[0], fmaxf(p[1], p[2]));
        if (level > 0 && isfinite(level)) {
            levels[count++] = level;
        }
    }
    const size_t rank = count > 0 ? (size_t)(PERCENTILE * (double)(count - 1)) : 0;
    *scale = count > 0 ? PERCENTILE_TO / (double)gonio_order_statistic_f32(levels, count, rank) : 1;
    free(levels);
    return GONIO_OK;
}
