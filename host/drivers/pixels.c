// SPDX-License-Identifier: BSD-3-Clause
// Layouts after the V4L2 documentation, "Image Formats" (Luma-Only, Raw Bayer): the MIPI packings follow CSI-2.
#include "host/drivers/pixels.h"

#include <string.h>
#include <strings.h>

#define FOURCC(a, b, c, d) ((uint32_t)(a) | (uint32_t)(b) << 8 | (uint32_t)(c) << 16 | (uint32_t)(d) << 24)
#define NOT_LINEAR "luma of a processed picture: gamma, white balance and noise reduction make it not linear"
#define COMPRESSED "compressed: pixel values are not what the sensor counted"
#define BAYER(name, bits, packing, r, g1, g2, b)                                                                       \
    {r, "SRGGB" name, packing, bits, GONIO_RGGB, GONIO_FIT, ""},                                                       \
        {g1, "SGRBG" name, packing, bits, GONIO_GRBG, GONIO_FIT, ""},                                                  \
        {g2, "SGBRG" name, packing, bits, GONIO_GBRG, GONIO_FIT, ""}, {                                                \
        b, "SBGGR" name, packing, bits, GONIO_BGGR, GONIO_FIT, ""                                                      \
    }

// Ordered from best to worst within a number of bits.
static const gonio_pixel_format formats[] = {
    {FOURCC('Y', '1', '6', ' '), "Y16", GONIO_PACK_16, 16, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('Y', '1', '6', ' ') | 1u << 31, "Y16_BE", GONIO_PACK_16BE, 16, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('Y', '1', '4', ' '), "Y14", GONIO_PACK_16, 14, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('Y', '1', '2', ' '), "Y12", GONIO_PACK_16, 12, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('Y', '1', '0', ' '), "Y10", GONIO_PACK_16, 10, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('Y', '1', '4', 'P'), "Y14P", GONIO_PACK_MIPI14, 14, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('Y', '1', '2', 'P'), "Y12P", GONIO_PACK_MIPI12, 12, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('Y', '1', '0', 'P'), "Y10P", GONIO_PACK_MIPI10, 10, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('Y', '1', '0', 'B'), "Y10BPACK", GONIO_PACK_BITS10, 10, GONIO_MONO, GONIO_FIT, ""},
    {FOURCC('G', 'R', 'E', 'Y'), "GREY", GONIO_PACK_8, 8, GONIO_MONO, GONIO_FIT, ""},
    BAYER("16", 16, GONIO_PACK_16, FOURCC('R', 'G', '1', '6'), FOURCC('G', 'R', '1', '6'), FOURCC('G', 'B', '1', '6'),
          FOURCC('B', 'Y', 'R', '2')),
    BAYER("14", 14, GONIO_PACK_16, FOURCC('R', 'G', '1', '4'), FOURCC('G', 'R', '1', '4'), FOURCC('G', 'B', '1', '4'),
          FOURCC('B', 'G', '1', '4')),
    BAYER("12", 12, GONIO_PACK_16, FOURCC('R', 'G', '1', '2'), FOURCC('B', 'A', '1', '2'), FOURCC('G', 'B', '1', '2'),
          FOURCC('B', 'G', '1', '2')),
    BAYER("10", 10, GONIO_PACK_16, FOURCC('R', 'G', '1', '0'), FOURCC('B', 'A', '1', '0'), FOURCC('G', 'B', '1', '0'),
          FOURCC('B', 'G', '1', '0')),
    BAYER("14P", 14, GONIO_PACK_MIPI14, FOURCC('p', 'R', 'E', 'E'), FOURCC('p', 'g', 'E', 'E'),
          FOURCC('p', 'G', 'E', 'E'), FOURCC('p', 'B', 'E', 'E')),
    BAYER("12P", 12, GONIO_PACK_MIPI12, FOURCC('p', 'R', 'C', 'C'), FOURCC('p', 'g', 'C', 'C'),
          FOURCC('p', 'G', 'C', 'C'), FOURCC('p', 'B', 'C', 'C')),
    BAYER("10P", 10, GONIO_PACK_MIPI10, FOURCC('p', 'R', 'A', 'A'), FOURCC('p', 'g', 'A', 'A'),
          FOURCC('p', 'G', 'A', 'A'), FOURCC('p', 'B', 'A', 'A')),
    BAYER("8", 8, GONIO_PACK_8, FOURCC('R', 'G', 'G', 'B'), FOURCC('G', 'R', 'B', 'G'), FOURCC('G', 'B', 'R', 'G'),
          FOURCC('B', 'A', '8', '1')),
    {FOURCC('Y', 'U', 'Y', 'V'), "YUYV", GONIO_PACK_YUYV, 8, GONIO_MONO, GONIO_FIT_WITH_WARNING, NOT_LINEAR},
    {FOURCC('U', 'Y', 'V', 'Y'), "UYVY", GONIO_PACK_UYVY, 8, GONIO_MONO, GONIO_FIT_WITH_WARNING, NOT_LINEAR},
    {FOURCC('M', 'J', 'P', 'G'), "MJPG", GONIO_PACK_8, 8, GONIO_MONO, GONIO_UNFIT, COMPRESSED},
    {FOURCC('J', 'P', 'E', 'G'), "JPEG", GONIO_PACK_8, 8, GONIO_MONO, GONIO_UNFIT, COMPRESSED},
    {FOURCC('H', '2', '6', '4'), "H264", GONIO_PACK_8, 8, GONIO_MONO, GONIO_UNFIT, COMPRESSED},
    {FOURCC('H', 'E', 'V', 'C'), "HEVC", GONIO_PACK_8, 8, GONIO_MONO, GONIO_UNFIT, COMPRESSED},
};
enum { FORMATS = sizeof formats / sizeof *formats };

const gonio_pixel_format *gonio_pixel_format_of(uint32_t fourcc) {
    for (int i = 0; i < FORMATS; i++) {
        if (formats[i].fourcc == fourcc) {
            return &formats[i];
        }
    }
    return NULL;
}

const gonio_pixel_format *gonio_pixel_format_named(const char *name) {
    for (int i = 0; i < FORMATS; i++) {
        if (strcasecmp(formats[i].name, name) == 0) {
            return &formats[i];
        }
    }
    return NULL;
}

static bool better(const gonio_pixel_format *a, const gonio_pixel_format *b) {
    if (b == NULL || a->fitness != b->fitness) {
        return b == NULL || a->fitness < b->fitness;
    }
    return a->bits != b->bits ? a->bits > b->bits : a < b; // the table is ordered
}

const gonio_pixel_format *gonio_pixel_format_choose(const uint32_t *offered, size_t n) {
    const gonio_pixel_format *best = NULL;
    for (size_t i = 0; i < n; i++) {
        const gonio_pixel_format *format = gonio_pixel_format_of(offered[i]);
        if (format != NULL && format->fitness != GONIO_UNFIT && better(format, best)) {
            best = format;
        }
    }
    return best;
}

size_t gonio_pixel_row_bytes(const gonio_pixel_format *format, int width) {
    const size_t w = (size_t)width;
    switch (format->packing) {
    case GONIO_PACK_8:
        return w;
    case GONIO_PACK_16:
    case GONIO_PACK_16BE:
        return 2 * w;
    case GONIO_PACK_YUYV:
    case GONIO_PACK_UYVY:
        return (w + 1) / 2 * 4;
    case GONIO_PACK_MIPI10:
        return (w + 3) / 4 * 5;
    case GONIO_PACK_MIPI12:
        return (w + 1) / 2 * 3;
    case GONIO_PACK_MIPI14:
        return (w + 3) / 4 * 7;
    case GONIO_PACK_BITS10:
        return (w * 10 + 7) / 8;
    }
    return 0;
}

static uint16_t mipi14(const uint8_t *row, size_t x) {
    const uint8_t *group = row + x / 4 * 7;
    const uint32_t low = (uint32_t)group[4] | (uint32_t)group[5] << 8 | (uint32_t)group[6] << 16;
    return (uint16_t)((uint32_t)group[x % 4] << 6 | (low >> (6 * (x % 4)) & 63));
}

static uint16_t bits10(const uint8_t *row, size_t x) {
    const size_t bit = 10 * x;
    const unsigned two = (unsigned)row[bit / 8] << 8 | row[bit / 8 + 1];
    return (uint16_t)(two >> (6 - bit % 8) & 1023);
}

static uint16_t pixel(gonio_packing packing, const uint8_t *row, size_t x) {
    switch (packing) {
    case GONIO_PACK_8:
        return row[x];
    case GONIO_PACK_16:
        return (uint16_t)(row[2 * x] | row[2 * x + 1] << 8);
    case GONIO_PACK_16BE:
        return (uint16_t)(row[2 * x] << 8 | row[2 * x + 1]);
    case GONIO_PACK_YUYV:
        return row[2 * x];
    case GONIO_PACK_UYVY:
        return row[2 * x + 1];
    case GONIO_PACK_MIPI10:
        return (uint16_t)(row[x / 4 * 5 + x % 4] << 2 | (row[x / 4 * 5 + 4] >> (2 * (x % 4)) & 3));
    case GONIO_PACK_MIPI12:
        return (uint16_t)(row[x / 2 * 3 + x % 2] << 4 | (row[x / 2 * 3 + 2] >> (4 * (x % 2)) & 15));
    case GONIO_PACK_MIPI14:
        return mipi14(row, x);
    case GONIO_PACK_BITS10:
        return bits10(row, x);
    }
    return 0;
}

static gonio_status unpack_row(const gonio_pixel_format *format, const uint8_t *row, const gonio_window *window,
                               int shift, uint16_t *out, gonio_error *error) {
    uint16_t seen = 0; // every bit that any pixel has set
    for (int i = 0; i < window->width; i++) {
        const uint16_t word = pixel(format->packing, row, (size_t)(window->x + i));
        seen |= word;
        out[i] = (uint16_t)(word >> shift);
    }
    if (format->packing == GONIO_PACK_16 && (seen >> format->bits) != 0) {
        return gonio_fail(error, GONIO_E_DEVICE, "%s frame with bits above the %d-th set (0x%04x)", format->name,
                          format->bits, seen);
    }
    return GONIO_OK;
}

gonio_status gonio_pixels_unpack(const gonio_pixel_format *format, const uint8_t *bytes, size_t n, size_t stride,
                                 int width, int height, const gonio_window *window, int shift, uint16_t *out,
                                 gonio_error *error) {
    const size_t row_bytes = gonio_pixel_row_bytes(format, width);
    if (window->x < 0 || window->y < 0 || window->width < 1 || window->height < 1 ||
        window->width > width - window->x || window->height > height - window->y) {
        return gonio_fail(error, GONIO_E_RANGE, "window %d,%d %dx%d outside the frame of %dx%d", window->x, window->y,
                          window->width, window->height, width, height);
    }
    if (shift < 0 || shift >= format->bits) {
        return gonio_fail(error, GONIO_E_RANGE, "shift of %d bits in a format of %d", shift, format->bits);
    }
    const size_t needed = stride * (size_t)(height - 1) + row_bytes;
    if (stride < row_bytes || n < needed) {
        return gonio_fail(error, GONIO_E_DEVICE,
                          "short frame: %zu bytes in rows of %zu; %s %dx%d needs %zu in rows of "
                          "%zu or more",
                          n, stride, format->name, width, height, needed, row_bytes);
    }
    for (int j = 0; j < window->height; j++) {
        const gonio_status status = unpack_row(format, bytes + stride * (size_t)(window->y + j), window, shift,
                                               out + (size_t)j * (size_t)window->width, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    return GONIO_OK;
}
