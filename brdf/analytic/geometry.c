// SPDX-License-Identifier: BSD-3-Clause
// The geometry of a pair of directions, as the analytic formulae need it.
#include "brdf/analytic/formula.h"

static gonio_vec3 raised(gonio_vec3 v) { return (gonio_vec3){v.x, v.y, fmax(v.z, GONIO_LOBE_COSINE_MIN)}; }

gonio_lobe_geometry gonio_lobe_geometry_of(gonio_vec3 wi, gonio_vec3 wo) {
    gonio_lobe_geometry g = {.wi = raised(wi), .wo = raised(wo)};
    const gonio_vec3 sum = {g.wi.x + g.wo.x, g.wi.y + g.wo.y, g.wi.z + g.wo.z};
    // sum.z >= 2e-6, so nothing below divides by zero.
    const double length = sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    g.h = (gonio_vec3){sum.x / length, sum.y / length, sum.z / length};
    // |wi + wo| = 2 cos(theta_d) for unit vectors; unlike the dot product it keeps its digits toward 90 deg.
    g.cos_d = fmin(length / 2, 1);
    g.tan_x = sum.x / sum.z;
    g.tan_y = sum.y / sum.z;
    g.tan2 = g.tan_x * g.tan_x + g.tan_y * g.tan_y;
    return g;
}

double gonio_fresnel_grazing(double cos_d) { return pow(1 - cos_d, 5); }

double gonio_fresnel_schlick(double cos_d, double f0) { return f0 + (1 - f0) * gonio_fresnel_grazing(cos_d); }
