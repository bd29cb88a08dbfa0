// SPDX-License-Identifier: BSD-3-Clause
// Isotropic coordinates for evaluation: gonio_coordinates_isotropic, with the Nusselt ones computed in place.
#ifndef GONIO_BRDF_LOCATE_H
#define GONIO_BRDF_LOCATE_H

#include <math.h>

#include "gonio/direction.h"

// Nusselt coordinates are on every renderer's inner loop, so they are computed here without calls; a square root of a
// sum of squares, not hypot: unit vectors neither overflow nor, where it matters, underflow.
static inline void gonio_locate_isotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[3]) {
    if (system != GONIO_NUSSELT) {
        gonio_coordinates_isotropic(system, wi, wo, x);
        return;
    }
    const double s = sqrt(wi.x * wi.x + wi.y * wi.y);
    const double inverse = 1 / s, c = s > 0 ? wi.x * inverse : 1, d = s > 0 ? wi.y * inverse : 0;
    x[0] = 0.5 * s + 0.5;
    x[1] = 0.5 * (wo.x * c + wo.y * d) + 0.5;
    x[2] = 0.5 * (wo.y * c - wo.x * d) + 0.5;
}

#endif
