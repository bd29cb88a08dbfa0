// SPDX-License-Identifier: BSD-3-Clause
// The true axes of a rig, as `gonio calibrate rig` estimated them, with their covariance.
//
// Every arm is a tilt axis that is carried by an azimuth axis. With R(axis, angle) the right-handed rotation about a
// line in space, an arm at (theta, phi) carries what stood at X0 with both counters at zero to
//   X(theta, phi) = R(azimuth axis, phi) R(tilt axis at phi = 0, theta) X0
// in the sample's frame (rig.h). A perfect rig's azimuth axes are the z axis, its tilt axes the y axis, and X0 lies on
// the z axis. Zero errors of the counters are part of the tilt axis and of X0, so they need no parameters of their own.
// (The form is the product of exponentials of Brockett, "Robotic manipulators and the product of exponentials formula",
// 1984.)
#ifndef GONIO_ALIGNMENT_H
#define GONIO_ALIGNMENT_H

#include <stdbool.h>

#include "gonio/direction.h"
#include "gonio/export.h"
#include "gonio/status.h"

GONIO_BEGIN

// Where each group of parameters begins. An axis has four: two of its direction, two of a point on it. Azimuth axis:
// direction (a, b, 1) / |.|, point (c, d, 0). Tilt axis: direction (a, 1, b) / |.|, point (c, 0, d). Lengths in mm.
enum {
    GONIO_CAMERA_AZIMUTH_AXIS = 0,
    GONIO_CAMERA_TILT_AXIS = 4,
    GONIO_CAMERA_ZERO = 8, // position (3) and rotation vector (3) from the nominal attitude, both counters at zero
    GONIO_LIGHT_AZIMUTH_AXIS = 14,
    GONIO_LIGHT_TILT_AXIS = 18,
    GONIO_LIGHT_ZERO = 22, // position (3)
    GONIO_ALIGNMENT_PARAMETERS = 25
};

typedef struct gonio_alignment {
    bool known; // false: a perfect rig is assumed, and its zero errors are the facts' pointing_systematic_deg
    double value[GONIO_ALIGNMENT_PARAMETERS];
    double covariance[GONIO_ALIGNMENT_PARAMETERS * GONIO_ALIGNMENT_PARAMETERS];
    double sigma_rad; // gonio_alignment_sigma of this covariance
} gonio_alignment;

// A perfect rig: axes through the centre, distances as stated. known stays false.
void gonio_alignment_nominal(double light_distance_mm, double camera_distance_mm, gonio_alignment *out);
// Where the light stands at these counters (rad), in the sample's frame, mm.
gonio_vec3 gonio_alignment_light(const double value[GONIO_ALIGNMENT_PARAMETERS], double theta, double phi);
// Where the camera stands, and its image's right, up and forward directions (rig.h).
void gonio_alignment_camera(const double value[GONIO_ALIGNMENT_PARAMETERS], double theta, double phi,
                            gonio_vec3 *position, gonio_vec3 *right, gonio_vec3 *up, gonio_vec3 *forward);
// The true directions, seen from the centre, of the counters in `axes`.
gonio_pair gonio_alignment_directions(const gonio_alignment *alignment, const gonio_pair *axes);
// Covariance (rad^2) of five displacements on the sphere of directions: of the light's direction at these counters
// along increasing theta and along increasing phi, of the camera's likewise, and of the light's theta at the counters
// of `reference`.
void gonio_alignment_covariance(const gonio_alignment *alignment, const gonio_pair *axes, const gonio_pair *reference,
                                double covariance[5][5]);
// Root mean square over poses of one tangential displacement's standard uncertainty (rad), both arms together: where
// one number must do.
double gonio_alignment_sigma(const gonio_alignment *alignment);

// A text file of numbers with a name for each (docs/formats.md, Alignment). write: all or nothing. read: GONIO_E_INPUT
// with file and line.
gonio_status gonio_alignment_write(const gonio_alignment *alignment, const char *path, gonio_error *error);
gonio_status gonio_alignment_read(const char *path, gonio_alignment *out, gonio_error *error);
// "camera azimuth axis a" ...; static storage.
const char *gonio_alignment_parameter_name(int index);

GONIO_END
#endif
