// SPDX-License-Identifier: BSD-3-Clause
// What frames of board, ball and mirror should show, and how far they are from it (rig_axes.c tells the method).
#include "calib/rig/bundle.h"

#include <math.h>
#include <string.h>

#include "base/vector.h"
#include "fit/smooth/matrix.h"

#define A GONIO_ALIGNMENT_PARAMETERS

// What is known before any frame: an arm stands within 0.1 rad and 20 mm of where it should, the camera's mount within
// 100 mm and 0.2 rad, and so does the light's, whose distance is measured with a rule.
static const double prior_sigma[A] = {0.1, 0.1, 20,  20, 0.1, 0.1, 20,  20, 100, 100, 100, 0.2, 0.2,
                                      0.2, 0.1, 0.1, 20, 20,  0.1, 0.1, 20, 20,  100, 100, 20};
// Of the ball's centre and of the mirror's tilt and height, in this order.
static const double object_sigma[6] = {20, 20, 20, 0.02, 0.02, 5};

// ---- the model ----

gonio_camera_info gonio_bundle_camera(const bundle *q, const double *p) {
    gonio_camera_info camera = *q->camera;
    double *const members[BUNDLE_INTRINSICS] = {&camera.fx, &camera.fy, &camera.cx, &camera.cy, &camera.k1,
                                                &camera.k2, &camera.p1, &camera.p2, &camera.k3};
    for (int k = 0; k < q->intrinsics; k++) {
        *members[q->intrinsic[k]] += p[A + k] * q->options->camera_sigma[q->intrinsic[k]];
    }
    return camera;
}

geometry gonio_bundle_geometry(const double *value, const gonio_pair *axes) {
    geometry g = {.light = gonio_alignment_light(value, axes->theta_i, axes->phi_i)};
    gonio_alignment_camera(value, axes->theta_o, axes->phi_o, &g.camera, &g.right, &g.up, &g.forward);
    return g;
}

// The point of a sphere that mirrors the light into the camera. The half vector at the point found last is the normal
// of the next; it contracts by about radius / distance a step.
static gonio_vec3 highlight_on(gonio_vec3 centre, double radius, gonio_vec3 light, gonio_vec3 camera) {
    gonio_vec3 point = centre;
    for (int k = 0; k < 12; k++) {
        const gonio_vec3 half = sum(normalised(difference(light, point)), normalised(difference(camera, point)));
        point = sum(centre, scaled(normalised(half), radius));
    }
    return point;
}

// The image of a point in the mirror of tilt (m[0], m[1]) and height m[2].
static gonio_vec3 mirrored(const double m[3], gonio_vec3 point) {
    const gonio_vec3 normal = normalised((gonio_vec3){m[0], m[1], 1});
    const double above = dot(normal, difference(point, (gonio_vec3){0, 0, m[2]}));
    return difference(point, scaled(normal, 2 * above));
}

// Where a frame's points should be seen; false: behind the camera.
static bool predict(const bundle *q, const double *p, const gonio_camera_info *camera, const bundle_frame *f,
                    const gonio_pair *axes, double (*pixel)[2]) {
    const geometry g = gonio_bundle_geometry(p, axes);
    if (f->view->object == GONIO_RIG_MIRROR) {
        return gonio_geometry_project(&g, camera, mirrored(p + q->mirror, g.light), pixel[0]);
    }
    if (f->view->object == GONIO_RIG_BALL) {
        const double *c = p + q->ball;
        const gonio_vec3 at =
            highlight_on((gonio_vec3){c[0], c[1], c[2]}, q->options->ball_radius_mm, g.light, g.camera);
        return gonio_geometry_project(&g, camera, at, pixel[0]);
    }
    for (int k = 0; k < f->points; k++) {
        if (!gonio_geometry_project(&g, camera, (gonio_vec3){f->at[k][0], f->at[k][1], 0}, pixel[k])) {
            return false;
        }
    }
    return true;
}

bool gonio_rig_project(const gonio_camera_info *camera, const gonio_alignment *alignment, const gonio_pair *axes,
                       gonio_vec3 point, double pixel[2]) {
    const geometry g = gonio_bundle_geometry(alignment->value, axes);
    return gonio_geometry_project(&g, camera, point, pixel) && pixel[0] >= 0 && pixel[1] >= 0 &&
           pixel[0] <= camera->width - 1 && pixel[1] <= camera->height - 1;
}

// ---- residuals ----

void gonio_bundle_whiten(const bundle_frame *f, double noise, double *r) {
    const int m = 2 * f->points;
    for (int d = 0; d < f->directions; d++) {
        double along = 0;
        for (int k = 0; k < m; k++) {
            along += f->direction[d][k] * r[k];
        }
        const double less = along * (1 - noise / hypot(noise, f->spread[d]));
        for (int k = 0; k < m; k++) {
            r[k] -= less * f->direction[d][k];
        }
    }
    for (int k = 0; k < m; k++) {
        r[k] /= noise;
    }
}

static double prior_residual(const bundle *q, const double *p, int k) {
    if (k < A) {
        return (p[k] - q->nominal[k]) / prior_sigma[k];
    }
    return k < q->ball ? p[k] : p[k] / object_sigma[k - q->ball];
}

void gonio_bundle_evaluate(const bundle *q, const double *p, double *r) {
    const gonio_camera_info camera = gonio_bundle_camera(q, p);
    double pixel[GONIO_CORNERS_MAX][2];
    int row = 0;
    for (int i = 0; i < q->n; i++) {
        const bundle_frame *f = &q->frames[i];
        if (!f->view->used) {
            continue;
        }
        const bool seen = predict(q, p, &camera, f, &f->view->axes, pixel);
        for (int k = 0; k < f->points; k++) {
            for (int c = 0; c < 2; c++) {
                r[row + 2 * k + c] = seen ? f->pixel[k][c] - pixel[k][c] : 1e6;
            }
        }
        gonio_bundle_whiten(f, bundle_noise(q, f), r + row);
        row += 2 * f->points;
    }
    for (int k = 0; k < q->parameters; k++) {
        r[row + k] = prior_residual(q, p, k);
    }
}

// Central differences; lengths, angles and sigmas all bear this step: 1e-5 rad moves a corner by a tenth of a pixel.
#define STEP 1e-5

void gonio_bundle_jacobian(const bundle *q, const double *p, double *j, double *work) {
    const size_t m = (size_t)q->residuals;
    double moved[BUNDLE_PARAMETERS_MAX], *high = work, *low = work + m;
    memcpy(moved, p, (size_t)q->parameters * sizeof *p);
    for (int k = 0; k < q->parameters; k++) {
        moved[k] = p[k] + STEP;
        gonio_bundle_evaluate(q, moved, high);
        moved[k] = p[k] - STEP;
        gonio_bundle_evaluate(q, moved, low);
        moved[k] = p[k];
        for (size_t i = 0; i < m; i++) {
            j[(size_t)k * m + i] = (high[i] - low[i]) / (2 * STEP);
        }
    }
}

bool gonio_bundle_residuals(const bundle *q, const double *p, const gonio_camera_info *camera, const bundle_frame *f,
                            double *r) {
    double pixel[GONIO_CORNERS_MAX][2];
    if (!predict(q, p, camera, f, &f->view->axes, pixel)) {
        return false;
    }
    for (int k = 0; k < 2 * f->points; k++) {
        r[k] = f->pixel[k / 2][k % 2] - pixel[k / 2][k % 2];
    }
    return true;
}

// The directions in which a frame's points move together when its axes are off by their repeatability: the principal
// ones of U, found from the eigenvectors of U^T U.
void gonio_bundle_common_motion(const bundle *q, const double *p, bundle_frame *f) {
    const gonio_camera_info camera = gonio_bundle_camera(q, p);
    const double sigma = gonio_radians(q->options->pointing_random_deg), step = 1e-5;
    const int m = 2 * f->points, axes = bundle_is_board(f) ? 2 : 4;
    double high[GONIO_CORNERS_MAX][2], low[GONIO_CORNERS_MAX][2];
    double gram[16], eigen[4];
    double *u[4] = {f->direction[0], f->direction[1], f->direction[2], f->direction[3]};
    for (int a = 0; a < axes; a++) {
        gonio_pair up = f->view->axes, down = f->view->axes;
        double *const members[2][4] = {{&up.theta_o, &up.phi_o, &up.theta_i, &up.phi_i},
                                       {&down.theta_o, &down.phi_o, &down.theta_i, &down.phi_i}};
        *members[0][a] += step;
        *members[1][a] -= step;
        predict(q, p, &camera, f, &up, high);
        predict(q, p, &camera, f, &down, low);
        for (int k = 0; k < m; k++) {
            u[a][k] = sigma * (high[k / 2][k % 2] - low[k / 2][k % 2]) / (2 * step);
        }
    }
    for (int a = 0; a < axes; a++) {
        for (int b = 0; b < axes; b++) {
            gram[a * axes + b] = 0;
            for (int k = 0; k < m; k++) {
                gram[a * axes + b] += u[a][k] * u[b][k];
            }
        }
    }
    f->directions = 0;
    if (!gonio_eigen((size_t)axes, gram, eigen)) {
        return;
    }
    const double largest = eigen[axes - 1];
    int first = 0; // of those that count: a ball's four angles move its one point in two directions
    while (first < axes && !(eigen[first] > 1e-10 * largest && eigen[first] > 1e-12)) {
        first++;
    }
    for (int k = 0; k < m; k++) {
        double row[4];
        for (int a = 0; a < axes; a++) {
            row[a] = u[a][k];
        }
        for (int d = first; d < axes; d++) {
            double along = 0;
            for (int a = 0; a < axes; a++) {
                along += row[a] * gram[d * axes + a];
            }
            f->direction[d - first][k] = along / sqrt(eigen[d]);
        }
    }
    f->directions = axes - first;
    for (int d = first; d < axes; d++) {
        f->spread[d - first] = sqrt(eigen[d]);
    }
}
