// SPDX-License-Identifier: BSD-3-Clause
// The true axes of both arms, from frames of a board, a polished ball and a flat mirror at known counters.
//
// One least-squares problem (a bundle adjustment; the arms are products of exponentials, alignment.h): parameters are
// the axes and zero poses of both arms, the camera's intrinsics within their stated uncertainty, and how ball and
// mirror lie. A board's frame compares all its corners with their projections; a ball's compares the centre of its
// highlight with the projection of the point whose normal halves the directions of light and camera; a mirror's with
// that of the light's mirror image. A light that turns by d moves the highlight of a ball of radius r by r d / 2, that
// of a mirror by its distance times d, which is why there are mirrors; but a mirror tilted by e looks like a light
// chain turned by 2 e, which is why there is the ball.
//
// Every pose is off by the axes' repeatability, which moves all corners of a frame together. Carrying two angles a
// frame as parameters would cost time and change nothing: they are eliminated by whitening each frame's residuals with
// the inverse root of s^2 I + U U^T, U the corners' motion by one standard deviation of each angle. What the covariance
// says is then true, which counting corners alone would not make it. Wide priors (bundle.c) keep the problem regular
// where an axis never moved, and leave its uncertainty wide.
#include <cminpack.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "calib/rig/bundle.h"
#include "fit/smooth/matrix.h"

#define A GONIO_ALIGNMENT_PARAMETERS
#define BOARDS_MIN 3
#define BALLS_MIN 3
#define ROUNDS 4
#define EVALUATIONS_MAX 200
// As for intrinsics: beyond this factor of the median, and this many pixels, a view is wrong, not noisy.
#define REJECT_FACTOR 4
#define REJECT_PX 1

void gonio_rig_options_default(gonio_rig_options *options) {
    *options = (gonio_rig_options){
        .light_distance_mm = 1000, .camera_distance_mm = 1000, .pointing_random_deg = 0.01, .ball_radius_mm = 20};
}

typedef struct workspace {
    bundle *q;
    double *work;
} workspace;

static int callback(void *context, int m, int n, const double *p, double *r, double *j, int ldj, int iflag) {
    const workspace *w = context;
    (void)m;
    (void)n;
    (void)ldj; // equals the residuals' number
    if (iflag == 1) {
        gonio_bundle_evaluate(w->q, p, r);
    } else {
        gonio_bundle_jacobian(w->q, p, j, w->work);
    }
    return 0;
}

static gonio_status count_views(bundle *q, gonio_error *error) {
    int count[GONIO_RIG_OBJECTS] = {0};
    q->residuals = q->parameters;
    for (int i = 0; i < q->n; i++) {
        const bundle_frame *f = &q->frames[i];
        count[f->view->object] += f->view->used;
        q->residuals += f->view->used ? 2 * f->points : 0;
    }
    if (count[GONIO_RIG_BOARD] < BOARDS_MIN || count[GONIO_RIG_BALL] < BALLS_MIN) {
        return gonio_fail(error, GONIO_E_INPUT,
                          "%d usable views of the board and %d of the ball; at least %d and %d are needed, at several "
                          "positions of every axis",
                          count[GONIO_RIG_BOARD], count[GONIO_RIG_BALL], BOARDS_MIN, BALLS_MIN);
    }
    return GONIO_OK;
}

// ---- the fit ----

static gonio_status minimise(bundle *q, double *p, gonio_error *error) {
    const int m = q->residuals, n = q->parameters;
    // lmder's work: residuals, Jacobian, 6 vectors of n, 1 of m; and two of m for the differences.
    double *r = malloc(((size_t)m * (size_t)(n + 4) + 6 * (size_t)n) * sizeof *r);
    int *pivots = malloc((size_t)n * sizeof *pivots);
    if (r == NULL || pivots == NULL) {
        free(r);
        free(pivots);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to fit %d residuals", m);
    }
    double *j = r + m, *v = j + (size_t)m * (size_t)n, *work = v + 6 * (size_t)n + (size_t)m;
    workspace w = {q, work};
    int evaluations, jacobians;
    const int info = lmder(callback, &w, m, n, p, r, j, m, 1e-9, 1e-9, 0, EVALUATIONS_MAX, v, 1, 10, 0, &evaluations,
                           &jacobians, pivots, v + n, v + 2 * n, v + 3 * n, v + 4 * n, v + 5 * n);
    free(r);
    free(pivots);
    return info > 0 ? GONIO_OK : gonio_fail(error, GONIO_E_CONVERGENCE, "the fit of the axes failed (lmder %d)", info);
}

static void measure_views(const bundle *q, const double *p) {
    const gonio_camera_info camera = gonio_bundle_camera(q, p);
    double r[2 * GONIO_CORNERS_MAX];
    for (int i = 0; i < q->n; i++) {
        const bundle_frame *f = &q->frames[i];
        double total = 0;
        if (f->points > 0 && gonio_bundle_residuals(q, p, &camera, f, r)) {
            for (int k = 0; k < 2 * f->points; k++) {
                total += r[k] * r[k];
            }
            f->view->rms = sqrt(total / f->points);
        }
    }
}

static gonio_status median_rms(const bundle *q, int object, double *median, gonio_error *error) {
    double *values = malloc(((size_t)q->n + 1) * sizeof *values);
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for residuals");
    }
    size_t n = 0;
    for (int i = 0; i < q->n; i++) {
        if (q->frames[i].view->used && (int)q->frames[i].view->object == object) {
            values[n++] = q->frames[i].view->rms;
        }
    }
    *median = gonio_upper_median(values, n);
    free(values);
    return GONIO_OK;
}

// Leave out the worst view of each kind that stands apart; *any: there was one.
static gonio_status reject_worst(bundle *q, bool *any, gonio_error *error) {
    *any = false;
    for (int object = 0; object < GONIO_RIG_OBJECTS; object++) {
        double median = 0;
        gonio_rig_view *worst = NULL;
        const gonio_status status = median_rms(q, object, &median, error);
        if (status != GONIO_OK) {
            return status;
        }
        for (int i = 0; i < q->n; i++) {
            gonio_rig_view *view = q->frames[i].view;
            if (view->used && (int)view->object == object && (worst == NULL || view->rms > worst->rms)) {
                worst = view;
            }
        }
        if (worst != NULL && worst->rms > REJECT_FACTOR * median && worst->rms > REJECT_PX) {
            worst->used = false;
            snprintf(worst->reason, sizeof worst->reason, "reprojection error %.2f px; the median is %.2f px",
                     worst->rms, median);
            *any = true;
        }
    }
    return GONIO_OK;
}

// One round: the frames' common motion where p stands, fit, reject, and the noise for the next.
static gonio_status fit_round(bundle *q, double *p, gonio_error *error) {
    bool again;
    gonio_status status;
    do {
        again = false;
        for (int i = 0; i < q->n; i++) {
            gonio_bundle_common_motion(q, p, &q->frames[i]);
        }
        status = count_views(q, error);
        status = status == GONIO_OK ? minimise(q, p, error) : status;
        if (status == GONIO_OK) {
            gonio_bundle_measure_noise(q, p);
            measure_views(q, p);
            status = reject_worst(q, &again, error);
        }
    } while (status == GONIO_OK && again);
    return status;
}

// The sample's origin: where the camera's azimuth axis meets the board.
static void take_origin(bundle *q, double *p, double origin[2]) {
    const double by[2] = {p[GONIO_CAMERA_AZIMUTH_AXIS + 2], p[GONIO_CAMERA_AZIMUTH_AXIS + 3]};
    gonio_bundle_move_origin(q, by);
    for (int arm = 0; arm < 2; arm++) {
        double *azimuth = p + (arm == 0 ? GONIO_CAMERA_AZIMUTH_AXIS : GONIO_LIGHT_AZIMUTH_AXIS);
        double *tilt = p + (arm == 0 ? GONIO_CAMERA_TILT_AXIS : GONIO_LIGHT_TILT_AXIS);
        double *zero = p + (arm == 0 ? GONIO_CAMERA_ZERO : GONIO_LIGHT_ZERO);
        for (int c = 0; c < 2; c++) {
            azimuth[2 + c] -= by[c];
            zero[c] -= by[c];
        }
        // Its point with y = 0 slides along the axis.
        tilt[2] += by[1] * tilt[0] - by[0];
        tilt[3] += by[1] * tilt[1];
    }
    for (int c = 0; c < 2; c++) {
        p[q->ball + c] -= by[c];
        p[q->mirror + 2] += by[c] * p[q->mirror + c];
        origin[c] += by[c];
    }
}

// (J^T J)^-1, the block of the alignment.
static gonio_status find_covariance(bundle *q, const double *p, double *out, gonio_error *error) {
    const size_t m = (size_t)q->residuals, n = (size_t)q->parameters;
    double *j = malloc((m * (n + 2) + 2 * n * n) * sizeof *j);
    if (j == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the covariance");
    }
    double *normal = j + m * (n + 2), scale[BUNDLE_PARAMETERS_MAX];
    gonio_bundle_jacobian(q, p, j, j + m * n);
    for (size_t a = 0; a < n; a++) {
        scale[a] = 0;
        for (size_t i = 0; i < m; i++) {
            scale[a] += j[a * m + i] * j[a * m + i];
        }
        scale[a] = sqrt(scale[a]);
    }
    for (size_t a = 0; a < n; a++) {
        for (size_t b = 0; b <= a; b++) {
            double total = 0;
            for (size_t i = 0; i < m; i++) {
                total += j[a * m + i] * j[b * m + i];
            }
            normal[b * n + a] = total / (scale[a] * scale[b]);
        }
    }
    gonio_status status = GONIO_OK;
    if (gonio_cholesky(n, normal)) {
        gonio_cholesky_invert(n, normal, normal + n * n);
    } else {
        status = gonio_fail(error, GONIO_E_CONVERGENCE, "the axes are not determined by these frames");
    }
    for (size_t a = 0; a < A; a++) {
        for (size_t b = 0; b < A; b++) {
            out[a * A + b] = normal[(a < b ? a : b) * n + (a < b ? b : a)] / (scale[a] * scale[b]);
        }
    }
    free(j);
    return status;
}

// ---- the report ----

static const int first_of_axis[4] = {GONIO_LIGHT_TILT_AXIS, GONIO_LIGHT_AZIMUTH_AXIS, GONIO_CAMERA_TILT_AXIS,
                                     GONIO_CAMERA_AZIMUTH_AXIS};

static void describe(const bundle *q, const gonio_alignment *a, const double origin[2], gonio_rig_report *report) {
    *report = (gonio_rig_report){0};
    gonio_bundle_mean_noise(q, report->noise_px);
    for (int axis = 0; axis < 4; axis++) {
        const int k = first_of_axis[axis];
        report->tilt_deg[axis] = gonio_degrees(atan(hypot(a->value[k], a->value[k + 1])));
        report->tilt_sigma_deg[axis] =
            gonio_degrees(sqrt((a->covariance[k * A + k] + a->covariance[(k + 1) * A + k + 1]) / 2));
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < q->n; i++) {
            const gonio_rig_view *v = q->frames[i].view;
            const double at[4] = {v->axes.theta_i, v->axes.phi_i, v->axes.theta_o, v->axes.phi_o};
            // The light's axes show in the frames of ball and mirror alone, the camera's are wanted in the board's.
            if (v->used && (v->object != GONIO_RIG_BOARD) == (axis < 2)) {
                low = fmin(low, at[axis]);
                high = fmax(high, at[axis]);
            }
        }
        report->range_deg[axis] = high >= low ? gonio_degrees(high - low) : 0;
    }
    for (int i = 0; i < q->n; i++) {
        report->views[q->frames[i].view->object] += q->frames[i].view->used;
    }
    memcpy(report->origin_mm, origin, sizeof report->origin_mm);
    report->direction_sigma_deg = gonio_degrees(a->sigma_rad);
}

static void start(bundle *q, const gonio_camera_info *camera, const gonio_rig_options *options, double *p) {
    gonio_alignment nominal;
    static const double first_px[GONIO_RIG_OBJECTS] = {0.5, 0.5, 5};
    *q = (bundle){.camera = camera, .options = options};
    for (int k = 0; k < GONIO_RIG_OBJECTS * BUNDLE_BANDS; k++) {
        q->noise_px[k / BUNDLE_BANDS][k % BUNDLE_BANDS] = first_px[k / BUNDLE_BANDS];
    }
    for (int k = 0; k < BUNDLE_INTRINSICS; k++) {
        if (options->camera_sigma[k] > 0) {
            q->intrinsic[q->intrinsics++] = k;
        }
    }
    q->ball = A + q->intrinsics;
    q->mirror = q->ball + 3;
    q->parameters = q->mirror + 3;
    gonio_alignment_nominal(options->light_distance_mm, options->camera_distance_mm, &nominal);
    memcpy(q->nominal, nominal.value, sizeof q->nominal);
    memset(p, 0, BUNDLE_PARAMETERS_MAX * sizeof *p);
    memcpy(p, nominal.value, sizeof nominal.value);
}

gonio_status gonio_rig_calibrate(const gonio_camera_info *camera, const gonio_rig_options *options, int n,
                                 gonio_rig_view *views, gonio_alignment *out, gonio_rig_report *report,
                                 gonio_error *error) {
    bundle q;
    double p[BUNDLE_PARAMETERS_MAX], origin[2];
    *out = (gonio_alignment){.known = false};
    if (n < 1 || n > 10000 || !(options->ball_radius_mm > 0)) {
        return gonio_fail(error, GONIO_E_USAGE, "%d views, a ball of %g mm radius", n, options->ball_radius_mm);
    }
    start(&q, camera, options, p);
    gonio_status status = gonio_bundle_frames_make(&q, n, views, origin, error);
    for (int round = 0; status == GONIO_OK && round < ROUNDS; round++) {
        status = fit_round(&q, p, error);
        if (status == GONIO_OK && round + 1 < ROUNDS) {
            take_origin(&q, p, origin);
        }
    }
    status = status == GONIO_OK ? find_covariance(&q, p, out->covariance, error) : status;
    if (status == GONIO_OK) {
        memcpy(out->value, p, sizeof out->value);
        out->sigma_rad = gonio_alignment_sigma(out);
        out->known = true;
        describe(&q, out, origin, report);
    }
    gonio_bundle_frames_free(&q);
    return status;
}
