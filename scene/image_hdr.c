// SPDX-License-Identifier: BSD-3-Clause
// Radiance pictures: rows of mantissas with one exponent a pixel, run-length coded in either of two ways or in none
// (Ward, "Real pixels", Graphics Gems II, 1991; the format's text in Radiance's filefmts).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scene/image_formats.h"

typedef struct reading {
    FILE *file;
    const char *path;
    gonio_error *error;
} reading;

static gonio_status fail(const reading *r, const char *what) {
    return gonio_fail_byte(r->error, GONIO_E_INPUT, r->path, (long long)ftell(r->file), "a Radiance picture %s", what);
}

static gonio_status read_header(const reading *r, gonio_picture **out) {
    char line[512];
    long long number = 1;
    if (fgets(line, sizeof line, r->file) == NULL || strncmp(line, "#?", 2) != 0) {
        return gonio_fail_line(r->error, GONIO_E_INPUT, r->path, 1,
                               "not a Radiance picture: it does not begin with #?");
    }
    do {
        number++;
        if (fgets(line, sizeof line, r->file) == NULL) {
            return gonio_fail_line(r->error, GONIO_E_INPUT, r->path, number, "its header has no end");
        }
        if (strncmp(line, "FORMAT=", 7) == 0 && strncmp(line + 7, "32-bit_rle_rgbe", 15) != 0) {
            return gonio_fail_line(r->error, GONIO_E_INPUT, r->path, number,
                                   "%.40s: only FORMAT=32-bit_rle_rgbe is read", line);
        }
    } while (line[0] != '\n' && line[0] != '\r');
    int width, height;
    if (fgets(line, sizeof line, r->file) == NULL || sscanf(line, "-Y %6d +X %6d", &height, &width) != 2) {
        return gonio_fail_line(r->error, GONIO_E_INPUT, r->path, number + 1, "expected '-Y HEIGHT +X WIDTH'");
    }
    return gonio_scene_picture_new(width, height, out, r->error);
}

// One row as Radiance has coded it since 1991: a plane after the other.
static gonio_status read_planes(const reading *r, unsigned char *row, int width) {
    for (int plane = 0; plane < 4; plane++) {
        for (int x = 0; x < width;) {
            const int count = getc(r->file), run = count > 128 ? count - 128 : count;
            if (count == EOF || run == 0 || x + run > width) {
                return fail(r, count == EOF ? "ends too early" : "has a run that leaves its row");
            }
            int value = count > 128 ? getc(r->file) : 0;
            for (int k = 0; k < run; k++, x++) {
                value = count > 128 ? value : getc(r->file);
                row[4 * x + plane] = (unsigned char)value;
            }
            if (value == EOF) {
                return fail(r, "ends too early");
            }
        }
    }
    return GONIO_OK;
}

// A row whose first pixel is known, as it was coded before: pixels, of which 1 1 1 n repeats the last one.
static gonio_status read_pixels(const reading *r, unsigned char *row, int width, const unsigned char first[4]) {
    unsigned char p[4];
    memcpy(p, first, 4);
    int shift = 0;
    for (int x = 0; x < width;) {
        if (p[0] == 1 && p[1] == 1 && p[2] == 1 && x > 0) {
            const long run = shift < 24 ? (long)p[3] << shift : width + 1L;
            if (x + run > width) {
                return fail(r, "has a run that leaves its row");
            }
            for (long k = 0; k < run; k++, x++) {
                memcpy(row + 4 * x, row + 4 * (x - 1), 4);
            }
            shift += 8;
        } else {
            memcpy(row + 4 * x++, p, 4);
            shift = 0;
        }
        if (x < width && fread(p, 1, 4, r->file) != 4) {
            return fail(r, "ends too early");
        }
    }
    return GONIO_OK;
}

static gonio_status read_row(const reading *r, unsigned char *row, int width) {
    unsigned char first[4];
    if (fread(first, 1, 4, r->file) != 4) {
        return fail(r, "ends too early");
    }
    const bool planes = width >= 8 && width < 32768 && first[0] == 2 && first[1] == 2 && first[2] < 128;
    if (!planes) {
        return read_pixels(r, row, width, first);
    }
    return first[2] * 256 + first[3] == width ? read_planes(r, row, width) : fail(r, "has a row of another length");
}

gonio_status gonio_scene_hdr_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error) {
    const reading r = {file, path, error};
    gonio_status status = read_header(&r, out);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_picture *image = *out;
    unsigned char *row = malloc((size_t)image->width * 4);
    if (row == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", path);
    }
    for (int y = 0; y < image->height && status == GONIO_OK; y++) {
        status = read_row(&r, row, image->width);
        float *to = image->rgb + 3 * (size_t)y * (size_t)image->width;
        for (int x = 0; x < image->width && status == GONIO_OK; x++) {
            const double unit = row[4 * x + 3] > 0 ? ldexp(1, row[4 * x + 3] - 136) : 0;
            for (int c = 0; c < 3; c++) {
                to[3 * x + c] = (float)(unit > 0 ? (row[4 * x + c] + 0.5) * unit : 0);
            }
        }
    }
    free(row);
    return status;
}
