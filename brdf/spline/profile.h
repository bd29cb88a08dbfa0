// SPDX-License-Identifier: BSD-3-Clause
// The profile: a second lattice, of the half vector's tilt and the difference angle alone, beside a spline in
// half-vector coordinates. Most of what a reflectance does at a peak depends on those two (Rusinkiewicz 1998, "A new
// change of variables for efficient BRDF representation", section 3), and two dimensions are filled by far fewer
// samples than three. The tilt's scale is that of half-vector-narrow, whatever the spline's coordinates are: the
// profile is for peaks.
#ifndef GONIO_BRDF_SPLINE_PROFILE_H
#define GONIO_BRDF_SPLINE_PROFILE_H

#include "gonio/direction.h"

// y: (r, theta_d) in [0, 1] of isotropic half-vector coordinates x of a system.
static inline void gonio_profile_locate(gonio_coordinates system, const double x[3], double y[2]) {
    y[0] = gonio_coordinates_narrow_radius(system, x);
    y[1] = x[2];
}

#endif
