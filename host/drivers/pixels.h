// SPDX-License-Identifier: BSD-3-Clause
// The pixel formats a V4L2 camera may offer: which are fit for radiometry, and how their bytes become words.
#ifndef GONIO_DRIVERS_PIXELS_H
#define GONIO_DRIVERS_PIXELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/rig.h"

typedef enum gonio_packing {
    GONIO_PACK_8,      // one byte a pixel
    GONIO_PACK_16,     // two bytes a pixel, little-endian
    GONIO_PACK_16BE,   // the same, big-endian
    GONIO_PACK_MIPI10, // 4 pixels in 5 bytes: the high 8 bits of each, then the low 2 bits of all, first pixel lowest
    GONIO_PACK_MIPI12, // 2 pixels in 3 bytes: the high 8 bits of each, then the low 4 bits, first pixel lowest
    GONIO_PACK_MIPI14, // 4 pixels in 7 bytes: the high 8 bits of each, then the low 6 bits, first pixel lowest
    GONIO_PACK_BITS10, // 10 bits a pixel back to back, high bit first (Y10B)
    GONIO_PACK_YUYV,   // luma in every even byte
    GONIO_PACK_UYVY    // luma in every odd byte
} gonio_packing;

typedef enum gonio_fitness { GONIO_FIT, GONIO_FIT_WITH_WARNING, GONIO_UNFIT } gonio_fitness;

typedef struct gonio_pixel_format {
    uint32_t fourcc;
    const char *name; // as V4L2 names it: "Y12", "SRGGB10P"
    gonio_packing packing;
    int bits;
    gonio_pattern pattern;
    gonio_fitness fitness;
    const char *why; // of a warning or a refusal; "" where it is fit
} gonio_pixel_format;

// The format of a FourCC or a name (case is ignored); NULL where unknown. Static storage.
const gonio_pixel_format *gonio_pixel_format_of(uint32_t fourcc);
const gonio_pixel_format *gonio_pixel_format_named(const char *name);
// The best of the offered formats: linear before not, more bits before fewer, unpacked before packed; NULL: none is
// fit.
const gonio_pixel_format *gonio_pixel_format_choose(const uint32_t *offered, size_t n);

// Bytes that one row of width pixels takes; rows of packed formats end on whole groups.
size_t gonio_pixel_row_bytes(const gonio_pixel_format *format, int width);
// Unpack the window of a width x height frame into words of `bits` significant low bits. stride: bytes from row to row.
// GONIO_E_DEVICE where n bytes are too few (a short frame); words above the format's bits are GONIO_E_DEVICE too.
// shift: how far the sensor's bits stand above bit 0 (left-justified Y16: 4 for 12 bits).
gonio_status gonio_pixels_unpack(const gonio_pixel_format *format, const uint8_t *bytes, size_t n, size_t stride,
                                 int width, int height, const gonio_window *window, int shift, uint16_t *out,
                                 gonio_error *error);

#endif
