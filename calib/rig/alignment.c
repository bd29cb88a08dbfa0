// SPDX-License-Identifier: BSD-3-Clause
// Where an imperfect rig's arms stand, and how well their directions are known.
#include "gonio/alignment.h"

#include <string.h>

#include "base/vector.h"

#define P GONIO_ALIGNMENT_PARAMETERS

typedef struct line {
    gonio_vec3 direction, point;
} line;

static line azimuth_axis(const double v[4]) { return (line){normalised((gonio_vec3){v[0], v[1], 1}), {v[2], v[3], 0}}; }

static line tilt_axis(const double v[4]) { return (line){normalised((gonio_vec3){v[0], 1, v[1]}), {v[2], 0, v[3]}}; }

static gonio_vec3 about(line axis, double angle, gonio_vec3 point) {
    return sum(axis.point, turned(difference(point, axis.point), axis.direction, angle));
}

// exp([w]) v
static gonio_vec3 by_rotation_vector(const double w[3], gonio_vec3 v) {
    const gonio_vec3 axis = {w[0], w[1], w[2]};
    const double angle = sqrt(dot(axis, axis));
    return angle > 0 ? turned(v, scaled(axis, 1 / angle), angle) : v;
}

void gonio_alignment_nominal(double light_distance_mm, double camera_distance_mm, gonio_alignment *out) {
    *out = (gonio_alignment){.known = false};
    out->value[GONIO_CAMERA_ZERO + 2] = camera_distance_mm;
    out->value[GONIO_LIGHT_ZERO + 2] = light_distance_mm;
}

gonio_vec3 gonio_alignment_light(const double value[P], double theta, double phi) {
    const double *zero = value + GONIO_LIGHT_ZERO;
    const gonio_vec3 tilted =
        about(tilt_axis(value + GONIO_LIGHT_TILT_AXIS), theta, (gonio_vec3){zero[0], zero[1], zero[2]});
    return about(azimuth_axis(value + GONIO_LIGHT_AZIMUTH_AXIS), phi, tilted);
}

void gonio_alignment_camera(const double value[P], double theta, double phi, gonio_vec3 *position, gonio_vec3 *right,
                            gonio_vec3 *up, gonio_vec3 *forward) {
    const line azimuth = azimuth_axis(value + GONIO_CAMERA_AZIMUTH_AXIS),
               tilt = tilt_axis(value + GONIO_CAMERA_TILT_AXIS);
    const double *zero = value + GONIO_CAMERA_ZERO;
    *position = about(azimuth, phi, about(tilt, theta, (gonio_vec3){zero[0], zero[1], zero[2]}));
    static const gonio_vec3 nominal[3] = {{0, 1, 0}, {-1, 0, 0}, {0, 0, -1}};
    gonio_vec3 *const out[3] = {right, up, forward};
    for (int k = 0; k < 3; k++) {
        const gonio_vec3 at_zero = by_rotation_vector(zero + 3, nominal[k]);
        *out[k] = turned(turned(at_zero, tilt.direction, theta), azimuth.direction, phi);
    }
}

static gonio_vec3 camera_direction(const double value[P], const gonio_pair *axes) {
    gonio_vec3 position, unused[3];
    gonio_alignment_camera(value, axes->theta_o, axes->phi_o, &position, &unused[0], &unused[1], &unused[2]);
    return normalised(position);
}

static gonio_vec3 light_direction(const double value[P], const gonio_pair *axes) {
    return normalised(gonio_alignment_light(value, axes->theta_i, axes->phi_i));
}

gonio_pair gonio_alignment_directions(const gonio_alignment *alignment, const gonio_pair *axes) {
    return gonio_pair_from_vectors(light_direction(alignment->value, axes), camera_direction(alignment->value, axes));
}

static double along_theta(gonio_vec3 d, gonio_vec3 at) {
    const double s = hypot(at.x, at.y);
    const gonio_vec3 e = s > 0 ? (gonio_vec3){at.z * at.x / s, at.z * at.y / s, -s} : (gonio_vec3){1, 0, 0};
    return dot(d, e);
}

static double along_phi(gonio_vec3 d, gonio_vec3 at) {
    const double s = hypot(at.x, at.y);
    return s > 0 ? (at.x * d.y - at.y * d.x) / s : d.y;
}

// The five displacements that a change of parameter k by +-step makes, per unit of it.
static void displacements(const double value[P], int k, const gonio_pair *axes, const gonio_pair *reference,
                          double out[5]) {
    const double step = 1e-5;
    double low[P], high[P];
    memcpy(low, value, sizeof low);
    memcpy(high, value, sizeof high);
    low[k] -= step;
    high[k] += step;
    const gonio_vec3 light = light_direction(value, axes), camera = camera_direction(value, axes);
    const gonio_vec3 reference_light = light_direction(value, reference);
    const gonio_vec3 dl = scaled(difference(light_direction(high, axes), light_direction(low, axes)), 0.5 / step);
    const gonio_vec3 dc = scaled(difference(camera_direction(high, axes), camera_direction(low, axes)), 0.5 / step);
    const gonio_vec3 dr =
        scaled(difference(light_direction(high, reference), light_direction(low, reference)), 0.5 / step);
    out[0] = along_theta(dl, light);
    out[1] = along_phi(dl, light);
    out[2] = along_theta(dc, camera);
    out[3] = along_phi(dc, camera);
    out[4] = along_theta(dr, reference_light);
}

void gonio_alignment_covariance(const gonio_alignment *alignment, const gonio_pair *axes, const gonio_pair *reference,
                                double covariance[5][5]) {
    double d[P][5];
    for (int k = 0; k < P; k++) {
        displacements(alignment->value, k, axes, reference, d[k]);
    }
    memset(covariance, 0, sizeof(double[5][5]));
    for (int k = 0; k < P; k++) {
        for (int l = 0; l < P; l++) {
            const double c = alignment->covariance[k * P + l];
            for (int i = 0; i < 5; i++) {
                for (int j = 0; j < 5; j++) {
                    covariance[i][j] += d[k][i] * c * d[l][j];
                }
            }
        }
    }
}

double gonio_alignment_sigma(const gonio_alignment *alignment) {
    double total = 0;
    int n = 0;
    for (int theta = 15; theta <= 75; theta += 30) {
        for (int phi = -135; phi <= 135; phi += 90, n += 4) {
            const double t = gonio_radians(theta), p = gonio_radians(phi);
            const gonio_pair axes = {t, p, t, p};
            double c[5][5];
            gonio_alignment_covariance(alignment, &axes, &axes, c);
            total += c[0][0] + c[1][1] + c[2][2] + c[3][3];
        }
    }
    return sqrt(total / n);
}
