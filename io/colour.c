// SPDX-License-Identifier: BSD-3-Clause
// Spectral models to RGB: CIE 1931 colour matching by the multi-lobe fit of Wyman, Sloan and Shirley, "Simple analytic
// approximations to the CIE XYZ color matching functions" (JCGT 2(2), 2013, table 1), integrated by trapezoids over the
// model's wavelengths, under equal-energy light, X, Y and Z scaled to D65's white. A preview needs no more: the fit is
// within 1 % of the tables, and a reflectance has no light of its own.
#include "io/colour.h"

#include <math.h>
#include <stdlib.h>

#include "gonio/sample.h"

typedef struct lobe {
    int axis; // X, Y or Z
    double height, centre_nm, below_nm, above_nm;
} lobe;

static const lobe lobes[] = {{0, 1.056, 599.8, 37.9, 31.0},  {0, 0.362, 442.0, 16.0, 26.7},
                             {0, -0.065, 501.1, 20.4, 26.2}, {1, 0.821, 568.8, 46.9, 40.5},
                             {1, 0.286, 530.9, 16.3, 31.1},  {2, 1.217, 437.0, 11.8, 36.0},
                             {2, 0.681, 459.0, 26.0, 13.8}};

#define VISIBLE_MIN_NM 380
#define VISIBLE_MAX_NM 730

static void matching(double nm, double xyz[3]) {
    xyz[0] = xyz[1] = xyz[2] = 0;
    for (size_t k = 0; k < sizeof lobes / sizeof *lobes; k++) {
        const double d = (nm - lobes[k].centre_nm) / (nm < lobes[k].centre_nm ? lobes[k].below_nm : lobes[k].above_nm);
        xyz[lobes[k].axis] += lobes[k].height * exp(-0.5 * d * d);
    }
}

// Linear sRGB from XYZ (IEC 61966-2-1), and D65's white, which it maps to (1, 1, 1).
static const double from_xyz[3][3] = {{3.2406, -1.5372, -0.4986}, {-0.9689, 1.8758, 0.0415}, {0.0557, -0.2040, 1.0570}};
static const double white[3] = {0.9505, 1, 1.0890};

// Half the distance between a wavelength's visible neighbours: the trapezoid rule, whatever the channels' order.
static double quadrature(int channels, const double *nm, int c) {
    double below = -INFINITY, above = INFINITY;
    for (int k = 0; k < channels; k++) {
        if (nm[k] >= VISIBLE_MIN_NM && nm[k] <= VISIBLE_MAX_NM) {
            below = nm[k] < nm[c] ? fmax(below, nm[k]) : below;
            above = nm[k] > nm[c] ? fmin(above, nm[k]) : above;
        }
    }
    return (isinf(above) ? 0 : (above - nm[c]) / 2) + (isinf(below) ? 0 : (nm[c] - below) / 2);
}

static void spectral_weights(gonio_colour_weights *colour, const double *nm) {
    const int n = colour->channels;
    double sum[3] = {0};
    for (int pass = 0; pass < 2; pass++) { // the first pass finds what a flat spectrum gives
        for (int c = 0; c < n; c++) {
            if (!(nm[c] >= VISIBLE_MIN_NM && nm[c] <= VISIBLE_MAX_NM)) {
                continue;
            }
            double xyz[3];
            matching(nm[c], xyz);
            const double step = quadrature(n, nm, c);
            for (int k = 0; k < 3; k++) {
                if (pass == 0) {
                    sum[k] += xyz[k] * step;
                } else {
                    for (int rgb = 0; rgb < 3; rgb++) {
                        colour->weight[rgb * n + c] += from_xyz[rgb][k] * white[k] * xyz[k] * step / sum[k];
                    }
                }
            }
        }
    }
}

gonio_status gonio_colour_new(int channels, const char (*names)[32], gonio_colour_weights *colour, gonio_error *error) {
    double *nm = malloc((size_t)channels * sizeof *nm);
    *colour = (gonio_colour_weights){channels, calloc(3 * (size_t)channels, sizeof *colour->weight)};
    if (nm == NULL || colour->weight == NULL) {
        free(nm);
        gonio_colour_free(colour);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d channels' colours", channels);
    }
    int visible = 0;
    for (int c = 0; c < channels; c++) {
        nm[c] = gonio_channel_wavelength_nm(names[c]);
        visible += nm[c] >= VISIBLE_MIN_NM && nm[c] <= VISIBLE_MAX_NM;
    }
    if (visible >= 3) {
        spectral_weights(colour, nm);
    }
    for (int rgb = 0; rgb < 3 && visible < 3; rgb++) {
        for (int c = 0; c < channels; c++) {
            colour->weight[rgb * channels + c] = channels == 3 ? rgb == c : 1.0 / channels;
        }
    }
    free(nm);
    return GONIO_OK;
}

void gonio_colour_free(gonio_colour_weights *colour) {
    free(colour->weight);
    colour->weight = NULL;
}

void gonio_colour_rgb(const gonio_colour_weights *colour, const double *values, double rgb[3]) {
    for (int k = 0; k < 3; k++) {
        rgb[k] = 0;
        for (int c = 0; c < colour->channels; c++) {
            rgb[k] += colour->weight[k * colour->channels + c] * values[c];
        }
    }
}

unsigned char gonio_srgb_code(double linear) {
    const double v = fmin(fmax(linear, 0), 1); // fmax takes NaN to 0
    return (unsigned char)(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055) + 0.5);
}
