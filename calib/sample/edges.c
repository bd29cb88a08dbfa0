// SPDX-License-Identifier: BSD-3-Clause
// Does a pose reach over the sample's edge? At 85 deg a beam's spot is eleven times as long as wide, and a pixel sees
// eleven times its width; what then lies beyond the sample would be taken for it.
#include "calib/internal.h"

#include <math.h>
#include <stdio.h>

// Half the size along x and y of an ellipse about the centre whose half axes are `along` the azimuth and `across` it.
static void extent(double along, double across, double azimuth, double half[2]) {
    half[0] = hypot(along * cos(azimuth), across * sin(azimuth));
    half[1] = hypot(along * sin(azimuth), across * cos(azimuth));
}

// How far the beam reaches from the centre along its azimuth, on its far side. A beam of `spot` radius on a plane that
// faces it is a cone from the lamp; a ray of its rim at theta + delta meets the sample at d (cos theta tan(theta +
// delta) - sin theta).
static double spot_reach(const gonio_rig_facts *facts, double theta_i) {
    const double theta = fmin(theta_i, GONIO_PI - theta_i); // behind the sample as in front
    const double d = facts->light_distance_mm, rim = theta + atan(facts->light_spot_mm / d);
    return rim < gonio_radians(89.99) ? d * (cos(theta) * tan(rim) - sin(theta)) : 1e6; // beyond any table
}

// The averaged region: a disc, and at its rim half of a pixel's footprint, which grows along the camera's azimuth.
static void region_extent(const gonio_camera_info *camera, const gonio_rig_facts *facts, const gonio_pair *pair,
                          double half[2]) {
    const double pixel = facts->camera_distance_mm / fmin(camera->fx, camera->fy) / 2;
    double blur[2];
    extent(pixel / fmax(fabs(cos(pair->theta_o)), 1e-6), pixel, pair->phi_o, blur);
    for (int c = 0; c < 2; c++) {
        half[c] = facts->region_radius_mm + blur[c];
    }
}

static bool beyond(const gonio_rig_facts *facts, const double half[2]) {
    return (facts->sample_mm[0] > 0 && half[0] > facts->sample_mm[0] / 2) ||
           (facts->sample_mm[1] > 0 && half[1] > facts->sample_mm[1] / 2);
}

int gonio_calib_edges(const gonio_camera_info *camera, const gonio_rig_facts *facts, const gonio_pair *pose,
                      char text[256]) {
    const gonio_pair pair = gonio_geometry_pair(facts, pose);
    double region[2], spot[2];
    int flags = 0;
    text[0] = '\0';
    if (facts->sphere) {
        return 0; // every pixel is looked at by itself, and its own point is on the sphere or it is not used
    }
    region_extent(camera, facts, &pair, region);
    if (beyond(facts, region)) {
        flags |= GONIO_EDGE_REGION;
        snprintf(text, 256,
                 "the averaged region (%.3g x %.3g mm with a pixel's footprint at theta_o %.4g deg) reaches "
                 "over the sample's edge (%.3g x %.3g mm)",
                 2 * region[0], 2 * region[1], gonio_degrees(pair.theta_o), facts->sample_mm[0], facts->sample_mm[1]);
    }
    if (facts->light_spot_mm > 0 && facts->light_spot_mm < facts->region_radius_mm) {
        flags |= GONIO_EDGE_UNLIT;
        snprintf(text, 256, "the lit spot (%.3g mm wide across the beam) does not cover the averaged region (%.3g mm)",
                 2 * facts->light_spot_mm, 2 * facts->region_radius_mm);
    }
    if (facts->light_spot_mm > 0) {
        extent(spot_reach(facts, pair.theta_i), facts->light_spot_mm, pair.phi_i, spot);
        if (beyond(facts, spot)) {
            if (flags == 0) {
                snprintf(text, 256,
                         "at theta_i %.4g deg the lit spot reaches %.3g mm from the centre, over the "
                         "sample's edge (%.3g x %.3g mm)",
                         gonio_degrees(pair.theta_i), fmax(spot[0], spot[1]), facts->sample_mm[0], facts->sample_mm[1]);
            }
            flags |= GONIO_EDGE_SPILL;
        }
    }
    return flags;
}
