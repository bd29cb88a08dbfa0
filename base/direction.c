// SPDX-License-Identifier: BSD-3-Clause
#include "gonio/direction.h"

#include <math.h>

gonio_vec3 gonio_direction(double theta, double phi) {
    const double s = sin(theta);
    return (gonio_vec3){s * cos(phi), s * sin(phi), cos(theta)};
}

// atan2 of the two legs keeps full precision at both ends, where acos(z) loses half the digits.
double gonio_direction_theta(gonio_vec3 v) { return atan2(hypot(v.x, v.y), v.z); }

double gonio_direction_phi(gonio_vec3 v) { return v.x == 0 && v.y == 0 ? 0 : atan2(v.y, v.x); }

gonio_pair gonio_pair_from_vectors(gonio_vec3 wi, gonio_vec3 wo) {
    return (gonio_pair){gonio_direction_theta(wi), gonio_direction_phi(wi), gonio_direction_theta(wo),
                        gonio_direction_phi(wo)};
}

gonio_pair gonio_pair_mirrored(gonio_pair p) { return (gonio_pair){p.theta_i, -p.phi_i, p.theta_o, -p.phi_o}; }

gonio_pair gonio_pair_swapped(gonio_pair p) { return (gonio_pair){p.theta_o, p.phi_o, p.theta_i, p.phi_i}; }

// ---- halves ----

const char *gonio_half_name(gonio_half half) {
#define NAME(id, number, name, summary) name,
    static const char *const names[] = {GONIO_HALF_TABLE(NAME)};
#undef NAME
    return names[half];
}

#define HORIZON_ROUNDING 1e-9

gonio_half gonio_half_of(gonio_vec3 wi, gonio_vec3 wo) {
    const bool light = wi.z < -HORIZON_ROUNDING, camera = wo.z < -HORIZON_ROUNDING;
    return (gonio_half)((light != camera ? GONIO_TRANSMISSION : 0) | (light ? GONIO_REFLECTION_BACK : 0));
}

gonio_half gonio_pair_half(gonio_pair p) {
    const double horizon = GONIO_PI / 2 + HORIZON_ROUNDING;
    const bool light = p.theta_i > horizon, camera = p.theta_o > horizon;
    return (gonio_half)((light != camera ? GONIO_TRANSMISSION : 0) | (light ? GONIO_REFLECTION_BACK : 0));
}

// In degrees, so that 150 deg becomes 30 deg exactly, and 179.9 deg 0.1 deg, which 180 - 179.9 is not.
static double mirrored(double theta) {
    const double deg = 180 - gonio_degrees(theta), written = round(deg * 1e9) / 1e9;
    return gonio_radians(fabs(written - deg) < 1e-12 ? written : deg);
}

static double raised(double theta) { return theta > GONIO_PI / 2 + HORIZON_ROUNDING ? mirrored(theta) : theta; }

gonio_pair gonio_pair_raised(gonio_pair p) {
    return (gonio_pair){raised(p.theta_i), p.phi_i, raised(p.theta_o), p.phi_o};
}

gonio_pair gonio_pair_lowered(gonio_pair p, gonio_half half) {
    const bool light = (half & GONIO_REFLECTION_BACK) != 0, camera = ((half & GONIO_TRANSMISSION) != 0) != light;
    return (gonio_pair){light ? mirrored(p.theta_i) : p.theta_i, p.phi_i, camera ? mirrored(p.theta_o) : p.theta_o,
                        p.phi_o};
}

double gonio_radians(double deg) { return deg * (GONIO_PI / 180); }

// deg -> rad scales by 0.01745..., so between octave boundaries either several degrees share a radian or some radians
// have no degree at all. Trying the neighbours of the rounded quotient finds the degree wherever one exists.
// Of several, the one that people wrote: 30, not 29.999999999999996.
double gonio_degrees(double rad) {
    const double first = rad * (180 / GONIO_PI), written = round(first * 1e9) / 1e9;
    if (gonio_radians(written) == rad) {
        return written;
    }
    double below = first, above = first;
    for (int step = 0; step < 4; step++) {
        if (gonio_radians(below) == rad) {
            return below;
        }
        if (gonio_radians(above) == rad) {
            return above;
        }
        below = nextafter(below, -INFINITY);
        above = nextafter(above, INFINITY);
    }
    return first;
}

double gonio_angle_canonical(double rad) { return gonio_radians(gonio_degrees(rad)); }
