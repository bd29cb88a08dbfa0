// SPDX-License-Identifier: BSD-3-Clause
// Directions, direction pairs and the coordinates that fits work in (docs/fitting.md).
//
// Directions are unit vectors that point away from the surface in the sample's frame: +z is the normal, +x the sample's
// mark; theta is measured from +z, phi from +x toward +y. With phi_i = 0 the mirror direction is at phi_o = 180 deg.
#ifndef GONIO_DIRECTION_H
#define GONIO_DIRECTION_H

#include <stdbool.h>

#include "gonio/export.h"

GONIO_BEGIN

#define GONIO_PI 3.14159265358979323846

// An incident (light) and an outgoing (camera) direction, in radians; theta in [0, pi/2], and on to pi for directions
// behind the surface where transmission is spoken of.
typedef struct gonio_pair {
    double theta_i, phi_i, theta_o, phi_o;
} gonio_pair;

typedef struct gonio_vec3 {
    double x, y, z;
} gonio_vec3;

gonio_vec3 gonio_direction(double theta, double phi); // spherical (rad) to unit vector
double gonio_direction_theta(gonio_vec3 v);           // in [0, pi], exact near the pole and the horizon
double gonio_direction_phi(gonio_vec3 v);             // in (-pi, pi]; 0 at the pole
gonio_pair gonio_pair_from_vectors(gonio_vec3 wi, gonio_vec3 wo);
gonio_pair gonio_pair_mirrored(gonio_pair p); // phi -> -phi on both
gonio_pair gonio_pair_swapped(gonio_pair p);  // Helmholtz: incident <-> outgoing

// The halves of what a thin sheet scatters: which side the light is on, and whether it comes back or goes through.
// X(identifier, number, name, what it is): bit 0 of the number: transmitted, bit 1: light from behind.
#define GONIO_HALF_TABLE(X)                                                                                            \
    X(REFLECTION, 0, "reflection", "light and camera in front (theta up to 90 deg)")                                   \
    X(TRANSMISSION, 1, "transmission", "light in front, camera behind (theta_o beyond 90 deg)")                        \
    X(REFLECTION_BACK, 2, "reflection-back", "light and camera behind")                                                \
    X(TRANSMISSION_BACK, 3, "transmission-back", "light behind, camera in front")

#define GONIO_HALF_ENUM(id, number, name, summary) GONIO_##id = number,
typedef enum gonio_half { GONIO_HALF_TABLE(GONIO_HALF_ENUM) } gonio_half;
#undef GONIO_HALF_ENUM
#define GONIO_HALVES 4

const char *gonio_half_name(gonio_half half);
// A direction within rounding (1e-9 rad) of the horizon counts as in front.
gonio_half gonio_half_of(gonio_vec3 wi, gonio_vec3 wo);
gonio_half gonio_pair_half(gonio_pair p);
// Both directions in front of the surface: those behind it are mirrored in it, so that the direct way through becomes
// the mirror direction.
gonio_pair gonio_pair_raised(gonio_pair p);
// The inverse: the pair of a half whose directions, mirrored, are these.
gonio_pair gonio_pair_lowered(gonio_pair p, gonio_half half);

double gonio_radians(double deg);
// Degrees d that gonio_radians() turns back into exactly rad wherever such a d exists (always, for angles that
// themselves came from degrees); otherwise the nearest.
double gonio_degrees(double rad);
// rad, moved by at most 1 ulp or so to an angle that degrees can express exactly; idempotent. Readers of files in
// radians pass every angle through it, so that writing and reading a samples file gives the same bits.
double gonio_angle_canonical(double rad);

// Coordinate systems of a fit's domain; every coordinate lies in [0, 1]. X(identifier, number in model files, name,
// what it is); brdf/coordinates.c has a row for each with everything in which they differ.
#define GONIO_COORDINATES_TABLE(X)                                                                                     \
    X(NUSSELT, 0, "nusselt", "projections of both directions on the surface (Kameya 2002)")                            \
    X(HALF_VECTOR, 1, "half-vector", "half vector and difference vector, tilts spread from tan(theta_h) = 0.1 on")     \
    X(REFLECTED, 2, "reflected", "outgoing direction about the mirror direction")                                      \
    X(HALF_VECTOR_NARROW, 3, "half-vector-narrow", "as half-vector, from 0.03 on: for sharp peaks")                    \
    X(HALF_VECTOR_WIDE, 4, "half-vector-wide", "as half-vector, from 0.4 on: for broad lobes")

#define GONIO_COORDINATES_ENUM(id, number, name, summary) GONIO_##id = number,
typedef enum gonio_coordinates {
    GONIO_COORDINATES_AUTO = -1, // in options: the method chooses
    GONIO_COORDINATES_TABLE(GONIO_COORDINATES_ENUM)
} gonio_coordinates;
#undef GONIO_COORDINATES_ENUM
#define GONIO_COORDINATES_COUNT(id, number, name, summary) +1
#define GONIO_COORDINATES (0 GONIO_COORDINATES_TABLE(GONIO_COORDINATES_COUNT)) // how many there are

// Is it a half-vector system? They share their axes: two of the half vector's tilt, then the difference vector's.
bool gonio_coordinates_are_half_vector(gonio_coordinates system);
// The system that this one is another width of; itself where it is none.
gonio_coordinates gonio_coordinates_base(gonio_coordinates system);
// Bits of the axes, of dims (3: isotropic, 4: not), that are reflected about 1/2 when the pair is mirrored
// (phi -> -phi), and when its directions are swapped (0: swapping is no such reflection in this system).
unsigned gonio_coordinates_mirror_axes(gonio_coordinates system, int dims);
unsigned gonio_coordinates_swap_axes(gonio_coordinates system, int dims);
// The axes along which BRDFs vary slowly, `*count` of them from the one that is returned on: the difference angle, or
// the incidence.
int gonio_coordinates_slow_axes(gonio_coordinates system, int dims, int *count);

// The isotropic (3-D) coordinates of a pair: x[3] in [0, 1]. Defined for every pair with both thetas in [0, pi/2].
void gonio_coordinates_isotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[3]);
// The anisotropic (4-D) coordinates: x[4] in [0, 1].
void gonio_coordinates_anisotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[4]);

// What a length l becomes in the half-vector and reflected systems: asinh(l / stretch) / limit, at most 1.
void gonio_coordinates_stretch(gonio_coordinates system, double *stretch, double *limit);
// The radius, in [0, 1], that half-vector-narrow gives to the pair whose isotropic coordinates in another half-vector
// system are x.
double gonio_coordinates_narrow_radius(gonio_coordinates system, const double x[3]);

const char *gonio_coordinates_name(gonio_coordinates system); // "nusselt" "half-vector" ...; "auto"
bool gonio_coordinates_parse(const char *name, gonio_coordinates *system);
const char *const *gonio_coordinates_names(void); // in the enum's order, NULL-terminated; static storage

GONIO_END
#endif
