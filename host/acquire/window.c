// SPDX-License-Identifier: BSD-3-Clause
// Which part of the sensor to read: the sample as the camera sees it, with a margin.
#include <math.h>

#include "gonio/characterise.h"
#include "host/acquire/acquire.h"

// Beyond the sample's outline: pointing errors of a tenth of a degree, and neighbours for interpolation.
#define MARGIN_SHARE 0.12
#define MARGIN_PX 8

void gonio_scan_options_default(gonio_scan_options *options) {
    *options = (gonio_scan_options){.dark_frames = 16,
                                    .trap_frames = 8,
                                    .reference_frames = 16,
                                    .motion_check = 1,
                                    .settle_s = 0.2,
                                    .audit_poses = 50,
                                    .encoder_audit_poses = 500};
}

// Half the sample's largest size on the sensor, along an axis of focal length f.
static double half_size_px(const gonio_camera_info *camera, const gonio_rig_facts *facts, double f) {
    const double d = facts->camera_distance_mm, r = facts->sphere ? facts->sphere_radius_mm : facts->region_radius_mm;
    // A sphere's outline is the tangent cone. A flat region is largest when seen from the front; tilted, its near half
    // comes closer.
    const double tangent = facts->sphere ? r / sqrt(d * d - r * r) : r / (d - r);
    const double r2 = 2 * tangent * tangent; // at the window's corner, where distortion is largest
    const double distortion = fmax(1, 1 + camera->k1 * r2 + camera->k2 * r2 * r2 + camera->k3 * r2 * r2 * r2);
    return f * tangent * distortion * (1 + MARGIN_SHARE) + MARGIN_PX;
}

// An even interval of the given size around c, inside 0..limit: even ends keep a Bayer pattern's phase.
static void place(double c, double size, int limit, int *start, int *length) {
    const int even_limit = limit - limit % 2;
    const int n = (int)fmin(ceil(size / 2) * 2, even_limit);
    const int first = (int)lround((c + 0.5 - n / 2.0) / 2) * 2;
    *start = first < 0 ? 0 : first > even_limit - n ? even_limit - n : first;
    *length = n;
}

// The sample's outline over all of the camera's poses: axes that do not meet move it about in the frame. centre, half:
// of the box that holds it, px.
static void aligned_box(const gonio_camera_info *camera, const gonio_rig_facts *facts, double centre[2],
                        double half[2]) {
    const double d = facts->camera_distance_mm, r = facts->sphere ? facts->sphere_radius_mm : facts->region_radius_mm;
    const double rim = facts->sphere ? r / sqrt(1 - r * r / (d * d)) : r;
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int k = 0; k < 7 * 12 * 16; k++) {
        const gonio_pair axes = {.theta_o = gonio_radians(15 * (k % 7)), .phi_o = gonio_radians(30 * (k / 7 % 12))};
        const double a = GONIO_PI / 8 * (k / 84), x = rim * cos(a), y = rim * sin(a);
        gonio_vec3 position, right, up, forward, at = {x, y, 0};
        double pixel[2];
        gonio_alignment_camera(facts->alignment.value, axes.theta_o, axes.phi_o, &position, &right, &up, &forward);
        if (facts->sphere) {
            at = (gonio_vec3){x * right.x + y * up.x, x * right.y + y * up.y, x * right.z + y * up.z};
        }
        gonio_rig_project(camera, &facts->alignment, &axes, at, pixel);
        for (int c = 0; c < 2; c++) {
            low[c] = fmin(low[c], pixel[c]);
            high[c] = fmax(high[c], pixel[c]);
        }
    }
    for (int c = 0; c < 2; c++) {
        centre[c] = (low[c] + high[c]) / 2;
        half[c] = (high[c] - low[c]) / 2 * (1 + MARGIN_SHARE) + MARGIN_PX;
    }
}

gonio_status gonio_scan_window(const gonio_camera_info *camera, const gonio_rig_facts *facts,
                               const gonio_scan_options *options, gonio_window *window, gonio_error *error) {
    if (options->window_width < 0) {
        *window = (gonio_window){0, 0, camera->width, camera->height};
        return GONIO_OK;
    }
    double width = options->window_width, height = options->window_height, centre[2] = {camera->cx, camera->cy};
    if (facts->alignment.known) {
        double half[2];
        aligned_box(camera, facts, centre, half);
        width = width > 0 ? width : 2 * half[0];
        height = height > 0 ? height : 2 * half[1];
    } else if (options->window_width == 0) {
        width = 2 * half_size_px(camera, facts, camera->fx);
        height = 2 * half_size_px(camera, facts, camera->fy);
    }
    if (options->window_width > camera->width || options->window_height > camera->height) {
        return gonio_fail(error, GONIO_E_INPUT, "window %d x %d: the camera has %d x %d pixels", options->window_width,
                          options->window_height, camera->width, camera->height);
    }
    if (!(width >= 2) || !(height >= 2)) {
        return gonio_fail(error, GONIO_E_INPUT, "the sample (radius %g mm at %g mm) is not in front of the camera",
                          facts->sphere ? facts->sphere_radius_mm : facts->region_radius_mm, facts->camera_distance_mm);
    }
    place(centre[0], width, camera->width, &window->x, &window->width);
    place(centre[1], height, camera->height, &window->y, &window->height);
    return GONIO_OK;
}

gonio_status gonio_setup_of_rig(const gonio_rig *rig, const gonio_scan_options *scan, gonio_setup *setup,
                                gonio_error *error) {
    gonio_status status = rig->camera->info(rig->camera_device, &setup->camera, error);
    if (status != GONIO_OK) {
        return status;
    }
    setup->scan = *scan;
    setup->facts = rig->facts;
    if (scan->exposure_max_s > 0 && scan->exposure_max_s < setup->camera.exposure_max_s) {
        setup->camera.exposure_max_s = fmax(scan->exposure_max_s, setup->camera.exposure_min_s);
    }
    return gonio_scan_window(&setup->camera, &setup->facts, scan, &setup->window, error);
}
