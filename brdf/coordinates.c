// SPDX-License-Identifier: BSD-3-Clause
// The coordinate systems of a fit's domain: pair of unit vectors -> [0, 1]^3 (isotropic) or [0, 1]^4 (anisotropic).
//
// nusselt      Kameya 2002: projections of the two directions on the surface, kappa = (x + 1)/2, lambda = (y + 1)/2.
// half-vector  r = asinh(tan(theta_h) / 0.1) spreads the lobe's peak evenly over the lattice, whatever its width down
//              to about 0.1; on measured paints this choice of coordinates gains more than any level. Reciprocity is
//              a point reflection in the (x, y) plane there, mirror symmetry y -> -y. -narrow and -wide have 0.03 and
//              0.4 in its place: more of the lattice for a sharp peak, or for what lies about a broad one.
// reflected    offset of the outgoing from the mirror direction, in the same stretch.
#include "gonio/direction.h"

#include <math.h>
#include <stddef.h>

#include "base/keys.h"

typedef struct coordinate_system coordinate_system;

// Everything in which systems differ. [0]: of the isotropic coordinates (3-D), [1]: of the anisotropic ones (4-D).
struct coordinate_system {
    void (*map[2])(const coordinate_system *system, gonio_vec3 wi, gonio_vec3 wo, double *x);
    // The plane offset's half-width that asinh leaves linear, and the asinh of the largest offset.
    double stretch, limit;
    bool half_vector;
    gonio_coordinates base;
    unsigned mirror_axes[2], swap_axes[2];
    struct {
        int first, count;
    } slow_axes[2];
};

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
static double half_vector_radius(const coordinate_system *system, double sin_h, double cos_h) {
    return cos_h > 0 ? asinh(sin_h / cos_h / system->stretch) : system->limit;
}

static void half_vector_isotropic(const coordinate_system *system, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    const gonio_vec3 h = half_vector(wi, wo);
    const gonio_vec3 d = difference_vector(wi, h);
    const double sin_h = hypot(h.x, h.y), sin_d = hypot(d.x, d.y);
    // phi_d is measured from the half vector's azimuth; where either is undefined, r or theta_d makes it irrelevant.
    double c = 1, s = 0;
    if (sin_h > 0 && sin_d > 0) {
        c = (d.x * h.x + d.y * h.y) / (sin_h * sin_d);
        s = (d.y * h.x - d.x * h.y) / (sin_h * sin_d);
    }
    stretched(c, s, 1, half_vector_radius(system, sin_h, h.z), system->limit, x);
    x[2] = unit_interval(atan2(sin_d, d.z) * (2 / GONIO_PI));
}

static void half_vector_anisotropic(const coordinate_system *system, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    const gonio_vec3 h = half_vector(wi, wo);
    const gonio_vec3 d = difference_vector(wi, h);
    const double sin_h = hypot(h.x, h.y);
    stretched(h.x, h.y, sin_h, half_vector_radius(system, sin_h, h.z), system->limit, x);
    x[2] = unit_interval((d.x + 1) / 2);
    x[3] = unit_interval((d.y + 1) / 2);
}

static void nusselt_isotropic(const coordinate_system *system, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    (void)system;
    double sin_i;
    gonio_vec3 o;
    turn_to_incidence(wi, wo, &sin_i, &o);
    x[0] = unit_interval((sin_i + 1) / 2);
    x[1] = unit_interval((o.x + 1) / 2);
    x[2] = unit_interval((o.y + 1) / 2);
}

static void nusselt_anisotropic(const coordinate_system *system, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    (void)system;
    x[0] = unit_interval((wi.x + 1) / 2);
    x[1] = unit_interval((wi.y + 1) / 2);
    x[2] = unit_interval((wo.x + 1) / 2);
    x[3] = unit_interval((wo.y + 1) / 2);
}

static void offset(const coordinate_system *system, double u, double v, double *x) {
    const double length = hypot(u, v);
    stretched(u, v, length, asinh(length / system->stretch), system->limit, x);
}

static void reflected_isotropic(const coordinate_system *system, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    double sin_i;
    gonio_vec3 o;
    turn_to_incidence(wi, wo, &sin_i, &o);
    x[0] = unit_interval((sin_i + 1) / 2);
    offset(system, o.x + sin_i, o.y, x + 1);
}

static void reflected_anisotropic(const coordinate_system *system, gonio_vec3 wi, gonio_vec3 wo, double *x) {
    x[0] = unit_interval((wi.x + 1) / 2);
    x[1] = unit_interval((wi.y + 1) / 2);
    offset(system, wo.x + wi.x, wo.y + wi.y, x + 2);
}

#define AXIS(axis) (1u << (axis))
// Mirroring turns y into -y: lambda_o, the reflected offset's y, r sin phi_d; in 4-D the second of each pair. Swapping
// keeps the half vector and turns the difference vector about it by 180 deg.
//
// theta_h is at most 90 deg, where tan diverges, but only for retro-reflection at the very horizon: tan = 20 (87 deg)
// bounds the lattice, and beyond it the radius is held. The limit is asinh(20 / stretch).
#define HALF_VECTOR_SYSTEM(width, bound)                                                                               \
    {                                                                                                                  \
        .map = {half_vector_isotropic, half_vector_anisotropic}, .stretch = (width), .limit = (bound),                 \
        .half_vector = true, .base = GONIO_HALF_VECTOR, .mirror_axes = {AXIS(1), AXIS(1) | AXIS(3)},                   \
        .swap_axes = {AXIS(0) | AXIS(1), AXIS(2) | AXIS(3)}, .slow_axes = {                                            \
            {2, 1},                                                                                                    \
            {2, 2}                                                                                                     \
        }                                                                                                              \
    }

static const coordinate_system systems[GONIO_COORDINATES] = {
    [GONIO_NUSSELT] = {.map = {nusselt_isotropic, nusselt_anisotropic},
                       .base = GONIO_NUSSELT,
                       .mirror_axes = {AXIS(2), AXIS(1) | AXIS(3)},
                       .slow_axes = {{0, 1}, {0, 2}}},
    [GONIO_HALF_VECTOR] = HALF_VECTOR_SYSTEM(0.1, 5.991470797049389),
    [GONIO_REFLECTED] = {.map = {reflected_isotropic, reflected_anisotropic},
                         .stretch = 0.1,
                         .limit = 3.6895038689889055, // asinh(2 / stretch): two projections lie at most 2 apart
                         .base = GONIO_REFLECTED,
                         .mirror_axes = {AXIS(2), AXIS(1) | AXIS(3)},
                         .slow_axes = {{0, 1}, {0, 2}}},
    [GONIO_HALF_VECTOR_NARROW] = HALF_VECTOR_SYSTEM(0.03, 7.195437913933444),
    [GONIO_HALF_VECTOR_WIDE] = HALF_VECTOR_SYSTEM(0.4, 4.605270170991424),
};

void gonio_coordinates_isotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[3]) {
    systems[system].map[0](&systems[system], wi, wo, x);
}

void gonio_coordinates_anisotropic(gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo, double x[4]) {
    systems[system].map[1](&systems[system], wi, wo, x);
}

void gonio_coordinates_stretch(gonio_coordinates system, double *stretch, double *limit) {
    const bool stretches = systems[system].limit > 0;
    *stretch = stretches ? systems[system].stretch : 1;
    *limit = stretches ? systems[system].limit : 1;
}

double gonio_coordinates_narrow_radius(gonio_coordinates system, const double x[3]) {
    const coordinate_system *narrow = &systems[GONIO_HALF_VECTOR_NARROW];
    const double u = 2 * x[0] - 1, v = 2 * x[1] - 1, r = fmin(sqrt(u * u + v * v), 1);
    if (system == GONIO_HALF_VECTOR_NARROW) {
        return r;
    }
    const double tangent = systems[system].stretch * sinh(r * systems[system].limit);
    return fmin(half_vector_radius(narrow, tangent, 1) / narrow->limit, 1);
}

bool gonio_coordinates_are_half_vector(gonio_coordinates system) { return systems[system].half_vector; }

gonio_coordinates gonio_coordinates_base(gonio_coordinates system) { return systems[system].base; }

unsigned gonio_coordinates_mirror_axes(gonio_coordinates system, int dims) {
    return systems[system].mirror_axes[dims - 3];
}

unsigned gonio_coordinates_swap_axes(gonio_coordinates system, int dims) { return systems[system].swap_axes[dims - 3]; }

int gonio_coordinates_slow_axes(gonio_coordinates system, int dims, int *count) {
    *count = systems[system].slow_axes[dims - 3].count;
    return systems[system].slow_axes[dims - 3].first;
}

#define NAME(id, number, name, summary) [number] = name,
static const char *const names[] = {GONIO_COORDINATES_TABLE(NAME)[GONIO_COORDINATES] = NULL};

const char *const *gonio_coordinates_names(void) { return names; }

const char *gonio_coordinates_name(gonio_coordinates system) {
    return system == GONIO_COORDINATES_AUTO ? "auto" : names[system];
}

bool gonio_coordinates_parse(const char *name, gonio_coordinates *system) {
    const int found = gonio_names_find(names, name);
    *system = found >= 0 ? (gonio_coordinates)found : *system;
    return found >= 0;
}
