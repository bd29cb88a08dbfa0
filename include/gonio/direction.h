// Directions, direction pairs and the coordinates that fits work in (docs/fitting.md).
//
// Directions are unit vectors that point away from the surface in the sample's frame: +z is the normal, +x the sample's
// mark; theta is measured from +z, phi from +x toward +y. With phi_i = 0 the mirror direction is at phi_o = 180 deg.
#ifndef GONIO_DIRECTION_H
#define GONIO_DIRECTION_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GONIO_PI 3.14159265358979323846

// An incident (light) and an outgoing (camera) direction, in radians; theta in [0, pi/2].
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

double gonio_radians(double deg);
// Degrees d that gonio_radians() turns back into exactly rad wherever such a d exists (always, for angles that
// themselves came from degrees); otherwise the nearest.
double gonio_degrees(double rad);
// rad, moved by at most 1 ulp or so to an angle that degrees can express exactly; idempotent. Readers of files in
// radians pass every angle through it, so that writing and reading a samples file gives the same bits.
double gonio_angle_canonical(double rad);

// Coordinate systems of a fit's domain; every coordinate lies in [0, 1].
typedef enum gonio_coordinates {
    GONIO_NUSSELT = 0,            // isotropic: (kappa_i, kappa_o, lambda_o) with phi_i = 0; Kameya 2002
    GONIO_HALF_VECTOR = 1,        // (r cos phi_d, r sin phi_d, theta_d), r = asinh(tan theta_h / 0.1): DESIGN section 8
    GONIO_REFLECTED = 2,          // Nusselt coordinates of the outgoing direction about the mirror direction
    GONIO_HALF_VECTOR_NARROW = 3, // as half-vector, 0.03 instead of 0.1
    GONIO_HALF_VECTOR_WIDE = 4,   // 0.4
} gonio_coordinates;
#define GONIO_COORDINATES 5 // how many there are

static inline bool gonio_coordinates_are_half_vector(gonio_coordinates system) {
    return system == GONIO_HALF_VECTOR || system == GONIO_HALF_VECTOR_NARROW || system == GONIO_HALF_VECTOR_WIDE;
}

// The isotropic (3-D) coordinates of a pair: x[3] in [0, 1]. Defined for every pair with both thetas in [0, pi/2].
void gonio_coordinates_isotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[3]);
// The anisotropic (4-D) coordinates: x[4] in [0, 1].
void gonio_coordinates_anisotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[4]);

// The radius, in [0, 1], that half-vector-narrow gives to the pair whose isotropic coordinates in another half-vector
// system are x.
double gonio_coordinates_narrow_radius(gonio_coordinates system, const double x[3]);

const char *gonio_coordinates_name(gonio_coordinates system); // "nusselt" "half-vector" ...
bool gonio_coordinates_parse(const char *name, gonio_coordinates *system);

#ifdef __cplusplus
}
#endif
#endif
