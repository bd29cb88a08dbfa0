// SPDX-License-Identifier: BSD-3-Clause
// Simulated views of a rig with axes askew, at the level of corners and highlights: what gonio_rig_calibrate is given.
#ifndef TESTS_RIG_VIEWS_H
#define TESTS_RIG_VIEWS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/characterise.h"
#include "tests/pixel.h"

typedef struct rig_views {
    gonio_alignment truth;
    gonio_camera_info camera;
    gonio_rig_view view[2 * GONIO_RIG_POSES_MAX];
    gonio_corners *corners; // one a view
    int n;
    gonio_vec3 ball;
    double shift[2], mirror[2]; // of the board, mm; the mirror's tilt, rad
} rig_views;

// How well things stand and are seen; k = 1.
typedef struct rig_errors {
    double tilt_deg, offset_mm, mount_deg, mount_mm; // of axes; of the camera on its arm and the light on its
    double repeatability_deg, corner_px, highlight_px;
    double oblique; // corner_px times this beyond 52 deg
} rig_errors;

static inline gonio_vec3 rig_unit(gonio_vec3 a, gonio_vec3 b) {
    const gonio_vec3 d = {b.x - a.x, b.y - a.y, b.z - a.z};
    const double l = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    return (gonio_vec3){d.x / l, d.y / l, d.z / l};
}

// Fermat: the point of the sphere with the shortest way from the light to the camera over it, by steepest descent of
// the normal along the surface.
static inline gonio_vec3 rig_highlight(gonio_vec3 centre, double radius, gonio_vec3 light, gonio_vec3 camera) {
    gonio_vec3 n = rig_unit(centre, camera);
    gonio_vec3 at = centre;
    for (int k = 0; k < 400; k++) {
        at = (gonio_vec3){centre.x + radius * n.x, centre.y + radius * n.y, centre.z + radius * n.z};
        const gonio_vec3 a = rig_unit(at, light), b = rig_unit(at, camera);
        const gonio_vec3 s = {a.x + b.x, a.y + b.y, a.z + b.z};
        const double along = s.x * n.x + s.y * n.y + s.z * n.z;
        const gonio_vec3 to = {n.x + 0.4 * (s.x - along * n.x), n.y + 0.4 * (s.y - along * n.y),
                               n.z + 0.4 * (s.z - along * n.z)};
        n = rig_unit((gonio_vec3){0, 0, 0}, to);
    }
    return at;
}

// Where a mirror through the centre shows the light: the point at which the angles of both ways to the normal are
// equal, by halving along the line between their feet.
static inline gonio_vec3 rig_mirror_spot(const double tilt[2], gonio_vec3 light, gonio_vec3 camera) {
    const gonio_vec3 n = rig_unit((gonio_vec3){0, 0, 0}, (gonio_vec3){tilt[0], tilt[1], 1});
    const double a = light.x * n.x + light.y * n.y + light.z * n.z,
                 b = camera.x * n.x + camera.y * n.y + camera.z * n.z;
    const gonio_vec3 f = {light.x - a * n.x, light.y - a * n.y, light.z - a * n.z};
    const gonio_vec3 g = {camera.x - b * n.x, camera.y - b * n.y, camera.z - b * n.z};
    double low = 0, high = 1;
    gonio_vec3 at = f;
    for (int k = 0; k < 60; k++) {
        const double t = (low + high) / 2;
        at = (gonio_vec3){f.x + t * (g.x - f.x), f.y + t * (g.y - f.y), f.z + t * (g.z - f.z)};
        const double to_f = sqrt(pow(at.x - f.x, 2) + pow(at.y - f.y, 2) + pow(at.z - f.z, 2));
        const double to_g = sqrt(pow(at.x - g.x, 2) + pow(at.y - g.y, 2) + pow(at.z - g.z, 2));
        *(to_f * b < to_g * a ? &low : &high) = t;
    }
    return at;
}

static inline void rig_truth(rig_views *v, const rig_errors *e, uint64_t *random) {
    gonio_alignment_nominal(1000, 1000, &v->truth);
    const int axes[] = {GONIO_CAMERA_AZIMUTH_AXIS, GONIO_CAMERA_TILT_AXIS, GONIO_LIGHT_AZIMUTH_AXIS,
                        GONIO_LIGHT_TILT_AXIS};
    for (int k = 0; k < 4; k++) {
        for (int c = 0; c < 2; c++) {
            v->truth.value[axes[k] + c] += tan(gonio_radians(e->tilt_deg)) * pixel_normal(random);
            v->truth.value[axes[k] + 2 + c] += e->offset_mm * pixel_normal(random);
        }
    }
    for (int c = 0; c < 3; c++) {
        v->truth.value[GONIO_CAMERA_ZERO + c] += e->mount_mm * pixel_normal(random);
        v->truth.value[GONIO_CAMERA_ZERO + 3 + c] += gonio_radians(e->mount_deg) * pixel_normal(random);
        v->truth.value[GONIO_LIGHT_ZERO + c] += e->mount_mm * pixel_normal(random);
    }
    // The sample's frame begins where the camera's azimuth axis meets the board: that is what calibration calls origin.
    v->truth.value[GONIO_CAMERA_AZIMUTH_AXIS + 2] = v->truth.value[GONIO_CAMERA_AZIMUTH_AXIS + 3] = 0;
}

// Add the views of these poses: a ChArUco board of 8 x 6 squares of 5 mm, 1 mm or so off the centre; a ball of 20 mm; a
// mirror that lies askew by 0.05 deg.
static inline void rig_views_add(rig_views *v, const rig_errors *e, uint64_t *random, const gonio_rig_pose *poses,
                                 int n) {
    const gonio_vec3 ball = v->ball;
    for (int i = v->n; i < v->n + n; i++) {
        gonio_rig_view *view = &v->view[i];
        *view = (gonio_rig_view){
            .axes = poses[i - v->n].axes, .object = poses[i - v->n].object, .corners = &v->corners[i], .used = true};
        gonio_pair true_axes = view->axes;
        double *const angles[4] = {&true_axes.theta_i, &true_axes.phi_i, &true_axes.theta_o, &true_axes.phi_o};
        for (int a = 0; a < 4; a++) {
            *angles[a] += gonio_radians(e->repeatability_deg) * pixel_normal(random);
        }
        gonio_corners *c = &v->corners[i];
        c->n = 0;
        const double corner_px = e->corner_px * (gonio_degrees(view->axes.theta_o) > 52 ? e->oblique : 1);
        for (int k = 0; k < 35 && view->object == GONIO_RIG_BOARD; k++) {
            const double bx = 5 * (k % 7), by = 5 * (k / 7); // from the board's first inner corner
            const gonio_vec3 at = {bx - 15 + v->shift[0], 10 - by + v->shift[1], 0};
            double pixel[2];
            if (gonio_rig_project(&v->camera, &v->truth, &true_axes, at, pixel)) {
                c->board[c->n][0] = bx;
                c->board[c->n][1] = by;
                c->pixel[c->n][0] = pixel[0] + corner_px * pixel_normal(random);
                c->pixel[c->n++][1] = pixel[1] + corner_px * pixel_normal(random);
            }
        }
        if (view->object == GONIO_RIG_BOARD) {
            continue;
        }
        gonio_vec3 camera, unused[3];
        gonio_alignment_camera(v->truth.value, true_axes.theta_o, true_axes.phi_o, &camera, &unused[0], &unused[1],
                               &unused[2]);
        const gonio_vec3 light = gonio_alignment_light(v->truth.value, true_axes.theta_i, true_axes.phi_i);
        const gonio_vec3 at = view->object == GONIO_RIG_BALL ? rig_highlight(ball, 20, light, camera)
                                                             : rig_mirror_spot(v->mirror, light, camera);
        view->used = gonio_rig_project(&v->camera, &v->truth, &true_axes, at, view->highlight);
        view->highlight[0] += e->highlight_px * pixel_normal(random);
        view->highlight[1] += e->highlight_px * pixel_normal(random);
    }
    v->n += n;
}

static inline void rig_views_make(rig_views *v, const rig_errors *e, uint64_t *random) {
    gonio_rig_pose poses[GONIO_RIG_POSES_MAX];
    v->ball = (gonio_vec3){pixel_normal(random), pixel_normal(random), pixel_normal(random)};
    for (int c = 0; c < 2; c++) {
        v->shift[c] = pixel_normal(random);
        v->mirror[c] = gonio_radians(e->mount_deg > 0 ? 0.05 : 0) * pixel_normal(random);
    }
    v->n = 0;
    rig_views_add(v, e, random, poses, gonio_rig_poses(poses));
}

// As a rig does: board and ball, then the mirror aimed with what those told, then all together.
static inline gonio_status rig_views_calibrate(rig_views *v, const rig_errors *e, uint64_t *random,
                                               const gonio_rig_options *options, gonio_alignment *found,
                                               gonio_rig_report *report, gonio_error *error) {
    rig_views_make(v, e, random);
    gonio_status status = gonio_rig_calibrate(&v->camera, options, v->n, v->view, found, report, error);
    if (status == GONIO_OK) {
        gonio_rig_pose poses[GONIO_RIG_POSES_MAX];
        rig_views_add(v, e, random, poses, gonio_rig_mirror_poses(found, poses));
        status = gonio_rig_calibrate(&v->camera, options, v->n, v->view, found, report, error);
    }
    return status;
}

// The largest angle (deg) between true and found directions of both arms over many counters.
static inline double rig_direction_error_deg(const gonio_alignment *found, const gonio_alignment *truth) {
    double worst = 0;
    for (int t = 0; t <= 80; t += 20) {
        for (int p = -150; p <= 150; p += 60) {
            const gonio_pair axes = {gonio_radians(t), gonio_radians(p), gonio_radians(t), gonio_radians(p)};
            const gonio_pair a = gonio_alignment_directions(found, &axes), b = gonio_alignment_directions(truth, &axes);
            const gonio_vec3 wa[2] = {gonio_direction(a.theta_i, a.phi_i), gonio_direction(a.theta_o, a.phi_o)};
            const gonio_vec3 wb[2] = {gonio_direction(b.theta_i, b.phi_i), gonio_direction(b.theta_o, b.phi_o)};
            for (int k = 0; k < 2; k++) {
                const double d =
                    sqrt(pow(wa[k].x - wb[k].x, 2) + pow(wa[k].y - wb[k].y, 2) + pow(wa[k].z - wb[k].z, 2));
                worst = fmax(worst, gonio_degrees(d));
            }
        }
    }
    return worst;
}

// The angle (deg) by which the worst of the four axes is found wrong.
static inline double rig_axis_error_deg(const gonio_alignment *found, const gonio_alignment *truth) {
    const int axes[] = {GONIO_CAMERA_AZIMUTH_AXIS, GONIO_CAMERA_TILT_AXIS, GONIO_LIGHT_AZIMUTH_AXIS,
                        GONIO_LIGHT_TILT_AXIS};
    double worst = 0;
    for (int k = 0; k < 4; k++) {
        const double *a = found->value + axes[k], *b = truth->value + axes[k];
        worst = fmax(worst, gonio_degrees(hypot(atan(a[0]) - atan(b[0]), atan(a[1]) - atan(b[1]))));
    }
    return worst;
}

// Count the parameters within 2 stated sigmas, all but the two that the choice of the origin makes zero.
static inline void rig_count_within(const gonio_alignment *found, const gonio_alignment *truth, int *within, int *n) {
    for (int k = 0; k < GONIO_ALIGNMENT_PARAMETERS; k++) {
        if (k != GONIO_CAMERA_AZIMUTH_AXIS + 2 && k != GONIO_CAMERA_AZIMUTH_AXIS + 3) {
            const double sigma = sqrt(found->covariance[k * (GONIO_ALIGNMENT_PARAMETERS + 1)]);
            *within += fabs(found->value[k] - truth->value[k]) <= 2 * sigma;
            ++*n;
        }
    }
}

static inline gonio_camera_info rig_camera(void) {
    return (gonio_camera_info){
        .width = 640, .height = 512, .bits = 12, .fx = 10000, .fy = 10000, .cx = 319.5, .cy = 255.5, .k1 = -2};
}

#endif
