// SPDX-License-Identifier: BSD-3-Clause
// A flat field in a file (docs/formats.md): relative responsivity of every pixel of a read-out window and its variance,
// so that a session's reference has to tell the scale only.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "calib/internal.h"
#include "gonio/output.h"

#define MAGIC "GONIOFLT"
#define VERSION 1

// Little-endian, 4-byte members, no padding.
typedef struct header {
    char magic[8];
    uint32_t version;
    int32_t sensor_width, sensor_height, pattern;
    int32_t x, y, width, height;
    char serial[64];
} header;

_Static_assert(sizeof(header) == 104, "the file's header has no padding");
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "files are little-endian, as every host so far");

gonio_status gonio_calib_flat_save(const gonio_calib *calib, const char *path, gonio_error *error) {
    if (!calib->prepared) {
        return gonio_fail(error, GONIO_E_USAGE, "the calibration is not prepared");
    }
    const gonio_window *w = &calib->window;
    header h = {MAGIC,
                VERSION,
                calib->camera.width,
                calib->camera.height,
                (int32_t)calib->camera.pattern,
                w->x,
                w->y,
                w->width,
                w->height,
                {0}};
    memcpy(h.serial, calib->camera.serial, sizeof h.serial);
    float *maps = malloc(2 * calib->pixels * sizeof *maps);
    gonio_output *output;
    gonio_status status = maps == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for a flat field")
                                       : gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        free(maps);
        return status;
    }
    double mean[3];
    gonio_flat_means(calib, mean);
    for (size_t p = 0; p < calib->pixels; p++) {
        maps[p] = calib->defect[p] ? NAN : (float)(calib->flat[p] / mean[calib->channel[p]]);
        maps[calib->pixels + p] = calib->defect[p] ? NAN : calib->flat_variance[p];
    }
    const size_t bytes = 2 * calib->pixels * sizeof *maps;
    uLong crc = crc32(0, (const Bytef *)&h, sizeof h);
    crc = crc32_z(crc, (const Bytef *)maps, bytes);
    const uint32_t sum = (uint32_t)crc;
    FILE *stream = gonio_output_stream(output);
    fwrite(&h, sizeof h, 1, stream);
    fwrite(maps, 1, bytes, stream);
    fwrite(&sum, sizeof sum, 1, stream);
    free(maps);
    return gonio_output_commit(output, error);
}

static gonio_status check_header(const gonio_calib *calib, const header *h, const char *path, gonio_error *error) {
    if (memcmp(h->magic, MAGIC, sizeof h->magic) != 0 || h->version != VERSION) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a flat field of version %d", VERSION);
    }
    const gonio_window *w = &calib->window;
    if (h->sensor_width != calib->camera.width || h->sensor_height != calib->camera.height ||
        h->pattern != (int32_t)calib->camera.pattern) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "of a sensor of %d x %d; this one has %d x %d",
                               h->sensor_width, h->sensor_height, calib->camera.width, calib->camera.height);
    }
    const bool sound = h->x >= 0 && h->y >= 0 && h->width > 0 && h->height > 0 && h->width <= h->sensor_width - h->x &&
                       h->height <= h->sensor_height - h->y;
    if (!sound || w->x < h->x || w->y < h->y || w->x + w->width > h->x + h->width ||
        w->y + w->height > h->y + h->height) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "of the window %dx%d+%d+%d; %dx%d+%d+%d is needed",
                               h->width, h->height, h->x, h->y, w->width, w->height, w->x, w->y);
    }
    if (strncmp(h->serial, calib->camera.serial, sizeof h->serial) != 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "of the camera '%.63s'; this one is '%s'", h->serial,
                               calib->camera.serial);
    }
    return GONIO_OK;
}

// The part of the file's maps that the window reads.
static gonio_status take_maps(gonio_calib *calib, const header *h, const float *maps, const char *path,
                              gonio_error *error) {
    const gonio_window *w = &calib->window;
    const size_t whole = (size_t)h->width * (size_t)h->height;
    calib->known_flat = malloc(2 * calib->pixels * sizeof *calib->known_flat);
    if (calib->known_flat == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a flat field");
    }
    for (size_t p = 0; p < calib->pixels; p++) {
        const size_t column = p % (size_t)w->width + (size_t)(w->x - h->x);
        const size_t row = p / (size_t)w->width + (size_t)(w->y - h->y), at = row * (size_t)h->width + column;
        const float flat = maps[at], variance = maps[whole + at];
        if (!isnan(flat) && !(flat > 0 && flat < 100 && variance >= 0 && variance < 1)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "pixel (%zu, %zu): responsivity %g, variance %g",
                                   column, row, (double)flat, (double)variance);
        }
        calib->known_flat[p] = flat;
        calib->known_flat[calib->pixels + p] = variance;
    }
    return GONIO_OK;
}

gonio_status gonio_flat_open(gonio_calib *calib, gonio_error *error) {
    const char *path = calib->facts.flat_path;
    FILE *file = fopen(path, "rb");
    header h;
    if (file == NULL || fread(&h, sizeof h, 1, file) != 1) {
        if (file != NULL) {
            fclose(file);
        }
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read a flat field's header");
    }
    gonio_status status = check_header(calib, &h, path, error);
    const size_t count = status == GONIO_OK ? 2 * (size_t)h.width * (size_t)h.height : 0;
    float *maps = status == GONIO_OK ? malloc(count * sizeof *maps) : NULL;
    uint32_t sum = 0;
    if (status == GONIO_OK && maps == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for a flat field");
    }
    if (status == GONIO_OK &&
        (fread(maps, sizeof *maps, count, file) != count || fread(&sum, sizeof sum, 1, file) != 1)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "shorter than its header says");
    }
    if (status == GONIO_OK &&
        sum != (uint32_t)crc32_z(crc32(0, (const Bytef *)&h, sizeof h), (const Bytef *)maps, count * sizeof *maps)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "its checksum is wrong");
    }
    status = status == GONIO_OK ? take_maps(calib, &h, maps, path, error) : status;
    free(maps);
    fclose(file);
    return status;
}
