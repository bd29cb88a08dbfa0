// SPDX-License-Identifier: BSD-3-Clause
#include "calib/geometry.h"

#include <math.h>
#include <stddef.h>

#include "base/vector.h"

geometry gonio_geometry_of_directions(const gonio_rig_facts *facts, const gonio_pair *pose) {
    const gonio_vec3 wi = gonio_direction(pose->theta_i, pose->phi_i);
    const gonio_vec3 wo = gonio_direction(pose->theta_o, pose->phi_o);
    const double s = sin(pose->phi_o), c = cos(pose->phi_o);
    return (geometry){
        .light = scaled(wi, facts->light_distance_mm),
        .camera = scaled(wo, facts->camera_distance_mm),
        .right = {-s, c, 0},
        .up = {-cos(pose->theta_o) * c, -cos(pose->theta_o) * s, sin(pose->theta_o)},
        .forward = scaled(wo, -1),
        .light_distance_mm = facts->light_distance_mm,
    };
}

geometry gonio_geometry_of_pose(const gonio_rig_facts *facts, const gonio_pair *pose) {
    if (!facts->alignment.known) {
        return gonio_geometry_of_directions(facts, pose);
    }
    const double *value = facts->alignment.value;
    geometry g = {.light = gonio_alignment_light(value, pose->theta_i, pose->phi_i),
                  .light_distance_mm = facts->light_distance_mm};
    gonio_alignment_camera(value, pose->theta_o, pose->phi_o, &g.camera, &g.right, &g.up, &g.forward);
    return g;
}

static void positive(double *theta, double *phi) {
    if (*theta < 0) {
        *theta = -*theta;
        *phi = gonio_angle_canonical(gonio_radians(gonio_degrees(*phi) + (*phi > 0 ? -180 : 180)));
    }
    // A sample's azimuth is within a turn, however far the arm had turned.
    if (fabs(*phi) > 2 * GONIO_PI) {
        *phi = gonio_angle_canonical(gonio_radians(fmod(gonio_degrees(*phi), 360)));
    }
}

gonio_pair gonio_geometry_pair(const gonio_rig_facts *facts, const gonio_pair *pose) {
    if (!facts->alignment.known) { // an arm that leaned to the other side looked from phi + 180
        gonio_pair plain = *pose;
        positive(&plain.theta_i, &plain.phi_i);
        positive(&plain.theta_o, &plain.phi_o);
        return plain;
    }
    gonio_pair p = gonio_alignment_directions(&facts->alignment, pose);
    p.theta_i = gonio_angle_canonical(p.theta_i);
    p.phi_i = gonio_angle_canonical(p.phi_i);
    p.theta_o = gonio_angle_canonical(p.theta_o);
    p.phi_o = gonio_angle_canonical(p.phi_o);
    return p;
}

static gonio_vec3 ray_of(const geometry *g, double x, double y) {
    return (gonio_vec3){g->forward.x + x * g->right.x - y * g->up.x, g->forward.y + x * g->right.y - y * g->up.y,
                        g->forward.z + x * g->right.z - y * g->up.z};
}

static gonio_vec3 along(const geometry *g, gonio_vec3 ray, double s) {
    return (gonio_vec3){g->camera.x + s * ray.x, g->camera.y + s * ray.y, g->camera.z + s * ray.z};
}

static void complete(const geometry *g, gonio_vec3 point, gonio_vec3 normal, geometry_hit *hit) {
    const gonio_vec3 l = difference(g->light, point);
    const double d2 = dot(l, l), d = sqrt(d2);
    hit->point = point;
    hit->normal = normal;
    hit->to_light = scaled(l, 1 / d);
    hit->to_camera = normalised(difference(g->camera, point));
    hit->irradiance = dot(hit->to_light, normal) * g->light_distance_mm * g->light_distance_mm / d2;
}

bool gonio_geometry_plate(const geometry *g, double x, double y, geometry_hit *hit, double *footprint) {
    const gonio_vec3 ray = ray_of(g, x, y);
    if (!(ray.z * g->camera.z < 0)) {
        return false;
    }
    const double s = -g->camera.z / ray.z;
    gonio_vec3 point = along(g, ray, s);
    point.z = 0;
    complete(g, point, (gonio_vec3){0, 0, 1}, hit);
    hit->irradiance = fabs(hit->irradiance); // of a thin sheet, from either side
    if (footprint != NULL) {
        // dx dy / |ray|^3 is the solid angle; over |P - C|^2 / cos(theta_o) that leaves s^2 / |ray.z|.
        *footprint = s * s / fabs(ray.z);
    }
    return true;
}

// Nearest s > 0 with a s^2 + 2 b s + c = 0; in the form that keeps its digits for far, narrow rays.
static bool nearest_root(double a, double b, double c, double *s) {
    const double q = b * b - a * c;
    if (q < 0 || b >= 0) {
        return false;
    }
    *s = c / (-b + sqrt(q));
    return *s > 0;
}

bool gonio_geometry_sphere(const geometry *g, double x, double y, double radius_mm, geometry_hit *hit) {
    const gonio_vec3 ray = ray_of(g, x, y);
    double s;
    if (!nearest_root(dot(ray, ray), dot(ray, g->camera), dot(g->camera, g->camera) - radius_mm * radius_mm, &s)) {
        return false;
    }
    const gonio_vec3 point = along(g, ray, s);
    complete(g, point, normalised(point), hit);
    return true;
}

gonio_pair gonio_geometry_isotropic_pair(const geometry_hit *hit) {
    const double zi = dot(hit->to_light, hit->normal), zo = dot(hit->to_camera, hit->normal);
    const gonio_vec3 side = cross(hit->normal, hit->to_light); // sin(theta_i) times the local y axis
    const double sin_i = sqrt(dot(side, side));
    const gonio_vec3 ahead = cross(side, hit->normal); // sin(theta_i) times the local x axis
    const double ox = dot(hit->to_camera, ahead), oy = dot(hit->to_camera, side);
    gonio_pair pair = {.theta_i = atan2(sin_i, zi)};
    const gonio_vec3 across = cross(hit->normal, hit->to_camera);
    pair.theta_o = atan2(sqrt(dot(across, across)), zo);
    pair.phi_o = sin_i > 0 && (ox != 0 || oy != 0) ? atan2(oy, ox) : 0;
    pair.theta_i = gonio_angle_canonical(pair.theta_i);
    pair.theta_o = gonio_angle_canonical(pair.theta_o);
    pair.phi_o = gonio_angle_canonical(pair.phi_o);
    return pair;
}

bool gonio_geometry_project(const geometry *g, const gonio_camera_info *camera, gonio_vec3 point, double pixel[2]) {
    const gonio_vec3 v = difference(point, g->camera);
    const double z = dot(v, g->forward);
    if (z <= 0) {
        return false;
    }
    const double x = dot(v, g->right) / z, y = -dot(v, g->up) / z, r2 = x * x + y * y;
    const double d = 1 + r2 * (camera->k1 + r2 * (camera->k2 + r2 * camera->k3));
    pixel[0] = camera->cx + camera->fx * (x * d + 2 * camera->p1 * x * y + camera->p2 * (r2 + 2 * x * x));
    pixel[1] = camera->cy + camera->fy * (y * d + camera->p1 * (r2 + 2 * y * y) + 2 * camera->p2 * x * y);
    return true;
}
