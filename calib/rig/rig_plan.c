// SPDX-License-Identifier: BSD-3-Clause
// The poses that tell a rig's axes: every axis at several positions, spread over its range.
#include <math.h>
#include <stddef.h>

#include "base/vector.h"
#include "gonio/characterise.h"

int gonio_rig_poses(gonio_rig_pose *poses) {
    static const double board_theta[] = {10, 30, 45, 60}, light_theta[] = {10, 30, 50, 65, 80};
    static const double camera[3][2] = {{15, 120}, {45, -60}, {70, 30}};
    int n = 0;
    // The board: not from straight above, where a tilt barely shows, and not so flat that corners are lost.
    for (int phi = -157; phi <= 158; phi += 45) {
        for (size_t t = 0; t < sizeof board_theta / sizeof *board_theta; t++) {
            poses[n++] = (gonio_rig_pose){
                {gonio_radians(20), gonio_radians(phi + 90), gonio_radians(board_theta[t]), gonio_radians(phi)},
                GONIO_RIG_BOARD};
        }
    }
    // The ball: the camera looks from three sides at each position of the light, so that its place is seen in depth.
    for (int phi = -157; phi <= 158; phi += 45) {
        for (size_t t = 0; t < sizeof light_theta / sizeof *light_theta; t++) {
            for (int side = 0; side < 3; side++) {
                poses[n++] = (gonio_rig_pose){{gonio_radians(light_theta[t]), gonio_radians(phi),
                                               gonio_radians(camera[side][0]), gonio_radians(phi + camera[side][1])},
                                              GONIO_RIG_BALL};
            }
        }
    }
    return n;
}

// Where the ray from the camera to the light's image crosses the mirror, mm from the centre.
static void spot_at(const double *value, const gonio_pair *axes, double spot[2]) {
    gonio_vec3 camera, unused[3];
    gonio_alignment_camera(value, axes->theta_o, axes->phi_o, &camera, &unused[0], &unused[1], &unused[2]);
    const gonio_vec3 light = gonio_alignment_light(value, axes->theta_i, axes->phi_i);
    const double share = camera.z / (camera.z + light.z);
    spot[0] = camera.x + share * (light.x - camera.x);
    spot[1] = camera.y + share * (light.y - camera.y);
}

// Newton's method on the camera's two counters, until the highlight lies in the centre.
static void aim(const double *value, gonio_pair *axes) {
    const double step = 1e-4;
    for (int k = 0; k < 8; k++) {
        double at[2], t[2], p[2];
        gonio_pair moved = *axes;
        spot_at(value, axes, at);
        moved.theta_o += step;
        spot_at(value, &moved, t);
        moved = *axes;
        moved.phi_o += step;
        spot_at(value, &moved, p);
        const double a = (t[0] - at[0]) / step, b = (p[0] - at[0]) / step;
        const double c = (t[1] - at[1]) / step, d = (p[1] - at[1]) / step, determinant = a * d - b * c;
        if (!(fabs(determinant) > 1e-9)) {
            return;
        }
        axes->theta_o -= (d * at[0] - b * at[1]) / determinant;
        axes->phi_o -= (a * at[1] - c * at[0]) / determinant;
    }
}

int gonio_rig_mirror_poses(const gonio_alignment *alignment, gonio_rig_pose *poses) {
    static const double light_theta[] = {5, 15, 25, 35, 45, 55, 65, 75, 85};
    gonio_alignment perfect;
    int n = 0;
    gonio_alignment_nominal(1000, 1000, &perfect);
    for (int phi = -157; phi <= 158; phi += 45) {
        for (size_t t = 0; t < sizeof light_theta / sizeof *light_theta; t++) {
            const double theta = gonio_radians(light_theta[t]);
            const gonio_pair axes = {theta, gonio_radians(phi), theta, gonio_radians(phi > 0 ? phi - 180 : phi + 180)};
            poses[n] = (gonio_rig_pose){axes, GONIO_RIG_MIRROR};
            aim(alignment != NULL ? alignment->value : perfect.value, &poses[n++].axes);
        }
    }
    return n;
}
