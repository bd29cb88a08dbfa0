// The coordinate systems of a fit's domain: pair of unit vectors -> [0, 1]^3 (isotropic) or [0, 1]^4 (anisotropic).
//
// nusselt      Kameya 2002: projections of the two directions on the surface, kappa = (x + 1)/2, lambda = (y + 1)/2.
// half-vector  r = asinh(tan(theta_h) / 0.1) spreads the lobe's peak evenly over the lattice, whatever its width down
//              to about 0.1 (DESIGN section 8). Reciprocity is a point reflection in the (x, y) plane there, mirror
//              symmetry y -> -y. -narrow and -wide have 0.03 and 0.4 in its place: more of the lattice for a sharp
//              peak, or for what lies about a broad one.
// reflected    offset of the outgoing from the mirror direction, in the same stretch.
#include "gonio/direction.h"

#include <math.h>
#include <string.h>

#define STRETCH 0.1 // half-width of the region that asinh leaves linear: the reflected coordinates'

// theta_h is at most 90 deg, where tan diverges, but only for retro-reflection at the very horizon. tan = 20 (87 deg)
// bounds the lattice; beyond it the radius is held.
static const struct {
    double stretch, limit; // limit: asinh(20 / stretch)
} half_vectors[] = {
    [GONIO_HALF_VECTOR] = {0.1, 5.991470797049389},
    [GONIO_HALF_VECTOR_NARROW] = {0.03, 7.195437913933444},
    [GONIO_HALF_VECTOR_WIDE] = {0.4, 4.605270170991424},
};

#define OFFSET_MAX 3.6895038689889055 // asinh(2 / STRETCH): two projections lie at most 2 apart

static double unit_interval(double x) { return fmin(fmax(x, 0), 1); }

// Turn both directions about the normal so that phi_i = 0; at normal incidence phi_i is taken as 0.
static void turn_to_incidence(gonio_vec3 wi, gonio_vec3 wo, double *sin_i, gonio_vec3 *turned_o) {
    const double s = hypot(wi.x, wi.y);
    *sin_i = s;
    if (s > 0) {
        const double c = wi.x / s, d = wi.y / s;
        *turned_o = (gonio_vec3){wo.x * c + wo.y * d, wo.y * c - wo.x * d, wo.z};
    } else {
        *turned_o = wo;
    }
}

// A plane offset of length up to `limit` after the asinh stretch -> two coordinates about the centre (0.5, 0.5).
static void stretched(double x, double y, double length, double radius, double limit, double out[2]) {
    const double scale = length > 0 ? fmin(radius, limit) / (2 * limit * length) : 0;
    out[0] = unit_interval(0.5 + x * scale);
    out[1] = unit_interval(0.5 + y * scale);
}

static gonio_vec3 half_vector(gonio_vec3 wi, gonio_vec3 wo) {
    const gonio_vec3 sum = {wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
    const double length = sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    // Opposite directions along the horizon: the limit of mirror reflection, so the half vector is the normal.
    return length > 1e-12 ? (gonio_vec3){sum.x / length, sum.y / length, sum.z / length} : (gonio_vec3){0, 0, 1};
}

// The incident direction about the half vector: rotated by the shortest arc that takes h to +z, so that nothing spins
// where the half vector meets the normal.
static gonio_vec3 difference_vector(gonio_vec3 wi, gonio_vec3 h) {
    const double dot = wi.x * h.x + wi.y * h.y;
    const double k = dot / (1 + h.z);
    return (gonio_vec3){wi.x - h.x * (wi.z + k), wi.y - h.y * (wi.z + k), wi.x * h.x + wi.y * h.y + wi.z * h.z};
}

// The radius that tan(theta_h) = sin_h / h.z takes in a system's plane.
static double half_vector_radius(gonio_coordinates system, double sin_h, double cos_h) {
    return cos_h > 0 ? asinh(sin_h / cos_h / half_vectors[system].stretch) : half_vectors[system].limit;
}

static void half_vector_isotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[3]) {
    const gonio_vec3 h = half_vector(wi, wo);
    const gonio_vec3 d = difference_vector(wi, h);
    const double sin_h = hypot(h.x, h.y), sin_d = hypot(d.x, d.y);
    // phi_d is measured from the half vector's azimuth; where either is undefined, r or theta_d makes it irrelevant.
    double c = 1, s = 0;
    if (sin_h > 0 && sin_d > 0) {
        c = (d.x * h.x + d.y * h.y) / (sin_h * sin_d);
        s = (d.y * h.x - d.x * h.y) / (sin_h * sin_d);
    }
    stretched(c, s, 1, half_vector_radius(system, sin_h, h.z), half_vectors[system].limit, x);
    x[2] = unit_interval(atan2(sin_d, d.z) * (2 / GONIO_PI));
}

void gonio_coordinates_isotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[3]) {
    double sin_i;
    gonio_vec3 o;
    if (gonio_coordinates_are_half_vector(system)) {
        half_vector_isotropic(system, wi, wo, x);
        return;
    }
    turn_to_incidence(wi, wo, &sin_i, &o);
    x[0] = unit_interval((sin_i + 1) / 2);
    if (system == GONIO_NUSSELT) {
        x[1] = unit_interval((o.x + 1) / 2);
        x[2] = unit_interval((o.y + 1) / 2);
        return;
    }
    const double u = o.x + sin_i, v = o.y, length = hypot(u, v);
    stretched(u, v, length, asinh(length / STRETCH), OFFSET_MAX, x + 1);
}

void gonio_coordinates_anisotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[4]) {
    if (gonio_coordinates_are_half_vector(system)) {
        const gonio_vec3 h = half_vector(wi, wo);
        const gonio_vec3 d = difference_vector(wi, h);
        const double sin_h = hypot(h.x, h.y);
        stretched(h.x, h.y, sin_h, half_vector_radius(system, sin_h, h.z), half_vectors[system].limit, x);
        x[2] = unit_interval((d.x + 1) / 2);
        x[3] = unit_interval((d.y + 1) / 2);
        return;
    }
    x[0] = unit_interval((wi.x + 1) / 2);
    x[1] = unit_interval((wi.y + 1) / 2);
    if (system == GONIO_NUSSELT) {
        x[2] = unit_interval((wo.x + 1) / 2);
        x[3] = unit_interval((wo.y + 1) / 2);
        return;
    }
    const double u = wo.x + wi.x, v = wo.y + wi.y, length = hypot(u, v);
    stretched(u, v, length, asinh(length / STRETCH), OFFSET_MAX, x + 2);
}

double gonio_coordinates_narrow_radius(gonio_coordinates system, const double x[3]) {
    const double u = 2 * x[0] - 1, v = 2 * x[1] - 1, r = fmin(sqrt(u * u + v * v), 1);
    if (system == GONIO_HALF_VECTOR_NARROW) {
        return r;
    }
    const double tangent = half_vectors[system].stretch * sinh(r * half_vectors[system].limit);
    return fmin(half_vector_radius(GONIO_HALF_VECTOR_NARROW, tangent, 1) / half_vectors[GONIO_HALF_VECTOR_NARROW].limit,
                1);
}

static const char *const names[GONIO_COORDINATES] = {"nusselt", "half-vector", "reflected", "half-vector-narrow",
                                                     "half-vector-wide"};

const char *gonio_coordinates_name(gonio_coordinates system) { return names[system]; }

bool gonio_coordinates_parse(const char *name, gonio_coordinates *system) {
    for (int i = 0; i < GONIO_COORDINATES; i++) {
        if (strcmp(name, names[i]) == 0) {
            *system = (gonio_coordinates)i;
            return true;
        }
    }
    return false;
}
