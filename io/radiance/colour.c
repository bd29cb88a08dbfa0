// SPDX-License-Identifier: BSD-3-Clause
// Radiance's own red, green and blue (its color.h): the primaries (0.640, 0.330), (0.290, 0.600), (0.150, 0.060) and
// equal-energy white, so that what is grey has X = Y = Z in a file. Its renderer turns a file's chromaticity to these
// and takes them, and the numbers of a scene, for the picture's red, green and blue; with sRGB's white, which is D65,
// every grey would come out bluish, and a floor in the scene would not fit the rest in the file.
#include "io/radiance/radiance.h"

#include <math.h>

static const double to_xyz[3][3] = {{0.5141446208, 0.3238844797, 0.1619708995},
                                    {0.2651058201, 0.6701058201, 0.0647883598},
                                    {0.0241005291, 0.1228527337, 0.8530467372}};
static const double to_rgb[3][3] = {{2.5653128430, -1.1668496158, -0.3984632272},
                                    {-1.0221081721, 1.9782866167, 0.0438215555},
                                    {0.0747243773, -0.2519395672, 1.1772151899}};

static void product(const double m[3][3], const double v[3], double out[3]) {
    for (int k = 0; k < 3; k++) {
        out[k] = m[k][0] * v[0] + m[k][1] * v[1] + m[k][2] * v[2];
    }
}

void gonio_radiance_rgb_to_xyz(const double rgb[3], double xyz[3]) { product(to_xyz, rgb, xyz); }

void gonio_radiance_xyz_to_rgb(const double xyz[3], double rgb[3]) {
    product(to_rgb, xyz, rgb);
    for (int k = 0; k < 3; k++) {
        rgb[k] = fmax(rgb[k], 0);
    }
}
