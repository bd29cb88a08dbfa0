// SPDX-License-Identifier: BSD-3-Clause
// One pixel of a pose: whether it sees the sample, and its exposures merged.
#include "base/vector.h"
#include "calib/internal.h"

#include <math.h>

// Thetas of a sphere's samples; beyond, a pixel's footprint covers several degrees.
#define SPHERE_THETA_MAX_DEG 85

bool gonio_pixel_used(const gonio_calib *calib, const geometry *g, size_t p, geometry_hit *hit, double *footprint) {
    if (calib->defect[p]) {
        return false;
    }
    const double x = calib->ray[2 * p], y = calib->ray[2 * p + 1];
    if (!calib->facts.sphere) {
        const double r = calib->facts.region_radius_mm;
        return gonio_geometry_plate(g, x, y, hit, footprint) && hit->irradiance > 0 &&
               hit->point.x * hit->point.x + hit->point.y * hit->point.y <= r * r;
    }
    if (!gonio_geometry_sphere(g, x, y, calib->facts.sphere_radius_mm, hit)) {
        return false;
    }
    const double limit = cos(gonio_radians(SPHERE_THETA_MAX_DEG));
    const gonio_vec3 n = hit->normal, i = hit->to_light, o = hit->to_camera;
    return dot(n, i) >= limit && dot(n, o) >= limit;
}

void gonio_pixel_merge(const gonio_calib *calib, size_t pixel, int n, const gonio_exposure *exposures,
                       const double *scale, merge_result *result) {
    merge_term terms[MERGE_MAX];
    for (int j = 0; j < n; j++) {
        terms[j] = term_of(calib, pixel, exposures[j].frame.pixels[pixel], exposures[j].frame.exposure_s, scale[j],
                           calib->flat[pixel] * scale[j]);
    }
    gonio_merge_pixel(&calib->noise, n, terms, result);
}
