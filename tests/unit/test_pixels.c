// SPDX-License-Identifier: BSD-3-Clause
// Unpacking against the layouts written out by hand, round trips through independent packers, and the choice of format.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <linux/videodev2.h>

#include "host/drivers/pixels.h"

static uint32_t random_state = 12345;

static uint32_t next_random(void) { return random_state = random_state * 1664525u + 1013904223u; }

// Pack as CSI-2 and the V4L2 documentation lay the bytes out, bit by bit.
static void put_bits(uint8_t *bytes, size_t bit, unsigned value) {
    bytes[bit / 8] = (uint8_t)((bytes[bit / 8] & ~(1u << bit % 8)) | (value & 1u) << bit % 8);
}

static void pack_row(const gonio_pixel_format *f, const uint16_t *words, int width, uint8_t *row) {
    for (int x = 0; x < width; x++) {
        const unsigned v = words[x];
        const size_t i = (size_t)x;
        switch (f->packing) {
        case GONIO_PACK_8:
            row[i] = (uint8_t)v;
            break;
        case GONIO_PACK_16:
            memcpy(row + 2 * i, (uint8_t[]){(uint8_t)v, (uint8_t)(v >> 8)}, 2);
            break;
        case GONIO_PACK_16BE:
            memcpy(row + 2 * i, (uint8_t[]){(uint8_t)(v >> 8), (uint8_t)v}, 2);
            break;
        case GONIO_PACK_YUYV:
            row[2 * i] = (uint8_t)v;
            row[2 * i + 1] = 0x80;
            break;
        case GONIO_PACK_UYVY:
            row[2 * i] = 0x80;
            row[2 * i + 1] = (uint8_t)v;
            break;
        case GONIO_PACK_MIPI10:
        case GONIO_PACK_MIPI12:
        case GONIO_PACK_MIPI14: {
            const size_t low = (size_t)f->bits - 8, group = f->packing == GONIO_PACK_MIPI12 ? 2 : 4;
            const size_t bytes = group + group * low / 8, at = i / group * bytes;
            row[at + i % group] = (uint8_t)(v >> low);
            for (size_t b = 0; b < low; b++) {
                put_bits(row + at + group, i % group * low + b, v >> b);
            }
            break;
        }
        case GONIO_PACK_BITS10:
            for (size_t b = 0; b < 10; b++) { // high bit first, from the high bit of each byte on
                const size_t bit = 10 * i + b;
                put_bits(row, bit / 8 * 8 + 7 - bit % 8, v >> (9 - b));
            }
            break;
        }
    }
}

static void test_known_bytes(void **state) {
    (void)state;
    const gonio_window two = {0, 0, 2, 1}, four = {0, 0, 4, 1};
    uint16_t out[4];
    const uint8_t y12p[] = {0xab, 0xde, 0xfc}; // 0xabc and 0xdef
    assert_int_equal(gonio_pixels_unpack(gonio_pixel_format_named("Y12P"), y12p, 3, 3, 2, 1, &two, 0, out, NULL),
                     GONIO_OK);
    assert_int_equal(out[0], 0xabc);
    assert_int_equal(out[1], 0xdef);
    const uint8_t y10p[] = {0xff, 0x00, 0x80, 0x01, 0xe4}; // low bits 0, 1, 2, 3
    assert_int_equal(gonio_pixels_unpack(gonio_pixel_format_named("Y10P"), y10p, 5, 5, 4, 1, &four, 0, out, NULL),
                     GONIO_OK);
    assert_int_equal(out[0], 0x3fc);
    assert_int_equal(out[1], 1);
    assert_int_equal(out[2], 0x202);
    assert_int_equal(out[3], 7);
}

static void test_every_format_round_trips(void **state) {
    (void)state;
    static const char *const names[] = {"GREY",     "Y10",      "Y12",      "Y14",    "Y16",     "Y16_BE",  "Y10P",
                                        "Y12P",     "Y14P",     "Y10BPACK", "SRGGB8", "SGRBG10", "SGBRG12", "SBGGR16",
                                        "SRGGB10P", "SBGGR12P", "SGRBG14P", "YUYV",   "UYVY"};
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        const gonio_pixel_format *f = gonio_pixel_format_named(names[k]);
        assert_non_null(f);
        for (int width = 1; width <= 19; width++) {
            enum { HEIGHT = 3 };
            const size_t row = gonio_pixel_row_bytes(f, width), stride = row + (size_t)(width % 3),
                         n = stride * (HEIGHT - 1) + row;
            uint8_t *bytes = calloc(1, n); // exactly as long as needed, so that the sanitizer sees one byte too many
            uint16_t words[HEIGHT][19], out[HEIGHT * 19];
            for (int j = 0; j < HEIGHT; j++) {
                for (int i = 0; i < width; i++) {
                    words[j][i] = (uint16_t)(next_random() >> 8 & ((1u << f->bits) - 1));
                }
                pack_row(f, words[j], width, bytes + stride * (size_t)j);
            }
            const gonio_window w = {width / 3, 1, width - width / 3, 2};
            assert_int_equal(gonio_pixels_unpack(f, bytes, n, stride, width, HEIGHT, &w, 0, out, NULL), GONIO_OK);
            for (int j = 0; j < w.height; j++) {
                for (int i = 0; i < w.width; i++) {
                    assert_int_equal(out[j * w.width + i], words[w.y + j][w.x + i]);
                }
            }
            assert_int_equal(gonio_pixels_unpack(f, bytes, n - 1, stride, width, HEIGHT, &w, 0, out, NULL),
                             GONIO_E_DEVICE);
            free(bytes);
        }
    }
}

static void test_faults_are_named(void **state) {
    (void)state;
    const uint8_t bytes[] = {0, 0x10}; // 0x1000: a 13th bit
    const gonio_window one = {0, 0, 1, 1}, outside = {1, 0, 1, 1}, huge = {0, 0, 2147483647, 1};
    uint16_t out[1];
    gonio_error error = {0};
    const gonio_pixel_format *y12 = gonio_pixel_format_named("y12"), *y16 = gonio_pixel_format_named("Y16");
    assert_int_equal(gonio_pixels_unpack(y12, bytes, 2, 2, 1, 1, &one, 0, out, &error), GONIO_E_DEVICE);
    assert_non_null(strstr(error.message, "0x1000"));
    assert_int_equal(gonio_pixels_unpack(y16, bytes, 2, 2, 1, 1, &one, 4, out, NULL), GONIO_OK);
    assert_int_equal(out[0], 0x100);
    assert_int_equal(gonio_pixels_unpack(y16, bytes, 2, 2, 1, 1, &outside, 0, out, NULL), GONIO_E_RANGE);
    assert_int_equal(gonio_pixels_unpack(y16, bytes, 2, 2, 1, 1, &huge, 0, out, NULL), GONIO_E_RANGE);
    assert_int_equal(gonio_pixels_unpack(y16, bytes, 2, 2, 1, 1, &one, 16, out, NULL), GONIO_E_RANGE);
}

static void test_fourccs_are_the_kernels(void **state) {
    (void)state;
    const struct {
        uint32_t fourcc;
        const char *name;
        gonio_pattern pattern;
    } known[] = {{V4L2_PIX_FMT_GREY, "GREY", GONIO_MONO},         {V4L2_PIX_FMT_Y10, "Y10", GONIO_MONO},
                 {V4L2_PIX_FMT_Y12, "Y12", GONIO_MONO},           {V4L2_PIX_FMT_Y14, "Y14", GONIO_MONO},
                 {V4L2_PIX_FMT_Y16, "Y16", GONIO_MONO},           {V4L2_PIX_FMT_Y16_BE, "Y16_BE", GONIO_MONO},
                 {V4L2_PIX_FMT_Y10P, "Y10P", GONIO_MONO},         {V4L2_PIX_FMT_Y10BPACK, "Y10BPACK", GONIO_MONO},
                 {V4L2_PIX_FMT_SRGGB8, "SRGGB8", GONIO_RGGB},     {V4L2_PIX_FMT_SBGGR8, "SBGGR8", GONIO_BGGR},
                 {V4L2_PIX_FMT_SGRBG8, "SGRBG8", GONIO_GRBG},     {V4L2_PIX_FMT_SGBRG8, "SGBRG8", GONIO_GBRG},
                 {V4L2_PIX_FMT_SRGGB10, "SRGGB10", GONIO_RGGB},   {V4L2_PIX_FMT_SGRBG10, "SGRBG10", GONIO_GRBG},
                 {V4L2_PIX_FMT_SGBRG10, "SGBRG10", GONIO_GBRG},   {V4L2_PIX_FMT_SBGGR10, "SBGGR10", GONIO_BGGR},
                 {V4L2_PIX_FMT_SRGGB12, "SRGGB12", GONIO_RGGB},   {V4L2_PIX_FMT_SGRBG12, "SGRBG12", GONIO_GRBG},
                 {V4L2_PIX_FMT_SGBRG12, "SGBRG12", GONIO_GBRG},   {V4L2_PIX_FMT_SBGGR12, "SBGGR12", GONIO_BGGR},
                 {V4L2_PIX_FMT_SRGGB14, "SRGGB14", GONIO_RGGB},   {V4L2_PIX_FMT_SGRBG14, "SGRBG14", GONIO_GRBG},
                 {V4L2_PIX_FMT_SGBRG14, "SGBRG14", GONIO_GBRG},   {V4L2_PIX_FMT_SBGGR14, "SBGGR14", GONIO_BGGR},
                 {V4L2_PIX_FMT_SRGGB16, "SRGGB16", GONIO_RGGB},   {V4L2_PIX_FMT_SGRBG16, "SGRBG16", GONIO_GRBG},
                 {V4L2_PIX_FMT_SGBRG16, "SGBRG16", GONIO_GBRG},   {V4L2_PIX_FMT_SBGGR16, "SBGGR16", GONIO_BGGR},
                 {V4L2_PIX_FMT_SRGGB10P, "SRGGB10P", GONIO_RGGB}, {V4L2_PIX_FMT_SGRBG10P, "SGRBG10P", GONIO_GRBG},
                 {V4L2_PIX_FMT_SGBRG10P, "SGBRG10P", GONIO_GBRG}, {V4L2_PIX_FMT_SBGGR10P, "SBGGR10P", GONIO_BGGR},
                 {V4L2_PIX_FMT_SRGGB12P, "SRGGB12P", GONIO_RGGB}, {V4L2_PIX_FMT_SGRBG12P, "SGRBG12P", GONIO_GRBG},
                 {V4L2_PIX_FMT_SGBRG12P, "SGBRG12P", GONIO_GBRG}, {V4L2_PIX_FMT_SBGGR12P, "SBGGR12P", GONIO_BGGR},
                 {V4L2_PIX_FMT_SRGGB14P, "SRGGB14P", GONIO_RGGB}, {V4L2_PIX_FMT_SGRBG14P, "SGRBG14P", GONIO_GRBG},
                 {V4L2_PIX_FMT_SGBRG14P, "SGBRG14P", GONIO_GBRG}, {V4L2_PIX_FMT_SBGGR14P, "SBGGR14P", GONIO_BGGR},
                 {V4L2_PIX_FMT_YUYV, "YUYV", GONIO_MONO},         {V4L2_PIX_FMT_MJPEG, "MJPG", GONIO_MONO}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        const gonio_pixel_format *f = gonio_pixel_format_of(known[i].fourcc);
        if (f == NULL || strcmp(f->name, known[i].name) != 0 || f->pattern != known[i].pattern) {
            fail_msg("%s: found %s", known[i].name, f != NULL ? f->name : "nothing");
        }
    }
    assert_null(gonio_pixel_format_of(V4L2_PIX_FMT_NV12));
}

static void test_choice(void **state) {
    (void)state;
    const uint32_t webcam[] = {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_YUYV};
    const uint32_t mixed[] = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_Y10P, V4L2_PIX_FMT_Y10};
    const uint32_t bayer[] = {V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SRGGB12P, V4L2_PIX_FMT_SRGGB10};
    assert_string_equal(gonio_pixel_format_choose(webcam, 2)->name, "YUYV");
    assert_int_equal(gonio_pixel_format_choose(webcam, 2)->fitness, GONIO_FIT_WITH_WARNING);
    assert_null(gonio_pixel_format_choose(webcam, 1));
    assert_null(gonio_pixel_format_choose(webcam, 0));
    assert_string_equal(gonio_pixel_format_choose(mixed, 4)->name, "Y10");
    assert_string_equal(gonio_pixel_format_choose(bayer, 3)->name, "SRGGB12P");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_known_bytes),      cmocka_unit_test(test_every_format_round_trips),
        cmocka_unit_test(test_faults_are_named), cmocka_unit_test(test_fourccs_are_the_kernels),
        cmocka_unit_test(test_choice),
    };
    return cmocka_run_group_tests_name("pixels", tests, NULL, NULL);
}
