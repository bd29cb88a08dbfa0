// SPDX-License-Identifier: BSD-3-Clause
// Channels to linear sRGB, and the transfer function.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "io/colour.h"
#include "tests/unit/near.h"

#define NM_FIRST 380
#define NM_COUNT 351

static void name_all(char names[][32], int n, int first, int step) {
    for (int c = 0; c < n; c++) {
        snprintf(names[c], 32, "%dnm", first + c * step);
    }
}

static void three_channels_pass(void **state) {
    (void)state;
    const char names[3][32] = {"r", "g", "b"};
    gonio_colour_weights colour;
    assert_int_equal(gonio_colour_new(3, names, &colour, NULL), GONIO_OK);
    const double values[3] = {0.1, 0.2, 0.7};
    double rgb[3];
    gonio_colour_rgb(&colour, values, rgb);
    assert_memory_equal(rgb, values, sizeof rgb);
    gonio_colour_free(&colour);
}

static void few_channels_are_grey(void **state) {
    (void)state;
    const char names[4][32] = {"550nm", "900nm", "1000nm", "x"};
    for (int n = 1; n <= 4; n++) {
        if (n == 3) {
            continue;
        }
        gonio_colour_weights colour;
        assert_int_equal(gonio_colour_new(n, names, &colour, NULL), GONIO_OK);
        const double values[4] = {1, 2, 3, 4};
        double rgb[3];
        gonio_colour_rgb(&colour, values, rgb);
        for (int k = 0; k < 3; k++) {
            assert_near(rgb[k], (n + 1) / 2.0, 1e-12);
        }
        gonio_colour_free(&colour);
    }
}

// A flat spectrum is white whatever the sampling; the sampling's density drops out.
static void flat_spectrum_is_white(void **state) {
    (void)state;
    const int cases[][3] = {{31, 400, 10}, {16, 400, 20}, {3, 450, 75}, {80, 300, 10}};
    for (int k = 0; k < 4; k++) {
        char names[80][32];
        name_all(names, cases[k][0], cases[k][1], cases[k][2]);
        gonio_colour_weights colour;
        assert_int_equal(gonio_colour_new(cases[k][0], (const char(*)[32])names, &colour, NULL), GONIO_OK);
        double values[80], rgb[3];
        for (int c = 0; c < 80; c++) {
            values[c] = 0.25;
        }
        gonio_colour_rgb(&colour, values, rgb);
        for (int j = 0; j < 3; j++) {
            assert_near(rgb[j], 0.25, 5e-5); // the rounding of the standard's matrix
        }
        gonio_colour_free(&colour);
    }
}

// The luminance of each wavelength against the tables of CIE 15 (1931 observer); the fit's own error is 1 % of the
// peak.
static void luminance_follows_the_cie_tables(void **state) {
    (void)state;
    static char names[NM_COUNT][32];
    name_all(names, NM_COUNT, NM_FIRST, 1);
    gonio_colour_weights colour;
    assert_int_equal(gonio_colour_new(NM_COUNT, (const char(*)[32])names, &colour, NULL), GONIO_OK);
    const struct {
        int nm;
        double y;
    } table[] = {{450, 0.038}, {500, 0.323}, {530, 0.862}, {550, 0.99495}, {555, 1.0}, {600, 0.631}, {650, 0.107}};
    for (int k = 0; k < 7; k++) {
        double values[NM_COUNT] = {0}, rgb[3];
        values[table[k].nm - NM_FIRST] = 106.857; // the sum of the tabulated y over 1 nm steps
        gonio_colour_rgb(&colour, values, rgb);
        assert_near(0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2], table[k].y, 0.015);
    }
    gonio_colour_free(&colour);
}

static void hues_are_where_they_belong(void **state) {
    (void)state;
    char names[31][32];
    name_all(names, 31, 400, 10);
    gonio_colour_weights colour;
    assert_int_equal(gonio_colour_new(31, (const char(*)[32])names, &colour, NULL), GONIO_OK);
    const int bands[3][2] = {{61, 70}, {52, 56}, {43, 47}}; // red, green, blue, in 10 nm
    for (int k = 0; k < 3; k++) {
        double values[31] = {0}, rgb[3];
        for (int band = bands[k][0]; band <= bands[k][1]; band++) {
            values[band - 40] = 1;
        }
        gonio_colour_rgb(&colour, values, rgb);
        for (int j = 0; j < 3; j++) {
            assert_true(j == k || rgb[j] < 0.5 * rgb[k]);
        }
    }
    gonio_colour_free(&colour);
}

// IEC 61966-2-1 by hand: 0.5 linear is code 188, 0.214041 is 127.5's neighbour, the toe is straight.
static void transfer(void **state) {
    (void)state;
    assert_int_equal(gonio_srgb_code(0), 0);
    assert_int_equal(gonio_srgb_code(1), 255);
    assert_int_equal(gonio_srgb_code(0.5), 188);
    assert_int_equal(gonio_srgb_code(0.2158605), 128);
    assert_int_equal(gonio_srgb_code(0.001), 3);
    assert_int_equal(gonio_srgb_code(-1), 0);
    assert_int_equal(gonio_srgb_code(7), 255);
    assert_int_equal(gonio_srgb_code(NAN), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_channels_pass),        cmocka_unit_test(few_channels_are_grey),
        cmocka_unit_test(flat_spectrum_is_white),     cmocka_unit_test(luminance_follows_the_cie_tables),
        cmocka_unit_test(hues_are_where_they_belong), cmocka_unit_test(transfer),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
