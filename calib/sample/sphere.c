// SPDX-License-Identifier: BSD-3-Clause
// A sphere's frame -> thousands of samples: one a pixel (mono) or one a 2 x 2 quad (Bayer), each with the local
// directions of its own point. The sample is isotropic, so phi_i is turned to 0.
#include "calib/internal.h"

typedef struct sphere_frame {
    const gonio_calib *calib;
    geometry g;
    int n;
    const gonio_exposure *exposures;
    double scale[MERGE_MAX], surroundings[3];
} sphere_frame;

// One pixel's part in a sample.
typedef struct pixel_sums {
    double value, removed, irradiance;
    double frame[MERGE_MAX];
} pixel_sums;

// Add one pixel's value and variances to its channel; false: it has none.
static bool add_pixel(const sphere_frame *f, size_t p, uncertainty *u, pixel_sums *sums) {
    const gonio_calib *calib = f->calib;
    geometry_hit hit;
    if (!gonio_pixel_used(calib, &f->g, p, &hit, NULL)) {
        return false;
    }
    merge_result merged;
    gonio_pixel_merge(calib, p, f->n, f->exposures, f->scale, &merged);
    if (merged.used == 0) {
        return false;
    }
    const double a = 1 / hit.irradiance, v = a * merged.value;
    for (int j = 0; j < f->n; j++) {
        sums->frame[j] += merged.weight[j] * calib->flat[p] * f->scale[j] * v;
    }
    const sensitivity s = gonio_sensitivity_of(calib, f->n, f->exposures, f->scale, &merged);
    sums->value += v;
    sums->removed += a * s.stray * calib->stray[p];
    sums->irradiance += hit.irradiance;
    u->photon += a * a * merged.photon_variance;
    // The maps' errors vary from pixel to pixel, hence from sample to sample: with the read noise, not systematic.
    u->read += a * a * (merged.read_variance + gonio_dark_variance(calib, &s)) + v * v * calib->flat_variance[p];
    u->stray_random += a * a * s.stray * s.stray * calib->stray_variance;
    return true;
}

// One sample of the block of `side` x `side` pixels at (column, row). false: a pixel is missing, no sample.
static bool block_estimate(const sphere_frame *f, int column, int row, int side, estimate *e) {
    const gonio_calib *calib = f->calib;
    const int width = calib->window.width;
    pixel_sums sums[3] = {{0}};
    double x = 0, y = 0;
    int count[3] = {0};
    *e = (estimate){0};
    for (int i = 0; i < side * side; i++) {
        const size_t p = (size_t)(row + i / side) * (size_t)width + (size_t)(column + i % side);
        const int k = calib->channel[p];
        if (!add_pixel(f, p, &e->variance[k], &sums[k])) {
            return false;
        }
        count[k]++;
        x += calib->ray[2 * p] / (double)(side * side);
        y += calib->ray[2 * p + 1] / (double)(side * side);
    }
    geometry_hit hit;
    if (!gonio_geometry_sphere(&f->g, x, y, calib->facts.sphere_radius_mm, &hit)) {
        return false;
    }
    e->pair = gonio_geometry_isotropic_pair(&hit);
    for (int k = 0; k < calib->channels; k++) {
        const double m = count[k];
        e->value[k] = sums[k].value / m;
        uncertainty *u = &e->variance[k];
        u->photon /= m * m;
        u->read /= m * m;
        for (int j = 0; j < f->n && calib->monitored; j++) {
            const double share = sums[k].frame[j] / m * f->exposures[j].monitor_sigma;
            u->monitor += f->exposures[j].monitor > 0 ? share * share : 0;
        }
        const double removed = calib->facts.stray_variation * sums[k].removed / m, irradiance = sums[k].irradiance / m;
        u->stray_random = u->stray_random / (m * m) + removed * removed;
        u->stray = removed * removed + gonio_glare_variance(calib, e->value[k] * irradiance, f->surroundings[k]) /
                                           (irradiance * irradiance);
        gonio_uncertainty_common(calib, f->n, f->exposures, e->value[k], u);
    }
    return true;
}

gonio_status gonio_sphere_estimate(const gonio_calib *calib, const gonio_pair *pose, int n,
                                   const gonio_exposure *exposures, estimate_sink sink, void *context,
                                   gonio_error *error) {
    sphere_frame f = {.calib = calib, .g = gonio_geometry_of_pose(&calib->facts, pose), .n = n, .exposures = exposures};
    for (int j = 0; j < n; j++) {
        f.scale[j] = exposure_scale(calib, exposures[j].frame.exposure_s, exposures[j].monitor);
    }
    gonio_stray_surroundings(calib, n, exposures, f.scale, f.surroundings);
    const int side = calib->channels == 1 ? 1 : 2;
    size_t made = 0;
    for (int row = 0; row + side <= calib->window.height; row += side) {
        for (int column = 0; column + side <= calib->window.width; column += side) {
            estimate e;
            if (block_estimate(&f, column, row, side, &e)) {
                const gonio_status status = sink(context, &e, error);
                if (status != GONIO_OK) {
                    return status;
                }
                made++;
            }
        }
    }
    if (made == 0) {
        return gonio_fail_frame(error, GONIO_E_RANGE, exposures[0].frame.stamp.pose, exposures[0].frame.stamp.frame,
                                "no pixel of the sphere has a valid exposure");
    }
    return GONIO_OK;
}
