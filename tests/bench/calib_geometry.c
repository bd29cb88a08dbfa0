// SPDX-License-Identifier: BSD-3-Clause
// Are the stated uncertainties of camera and axes true, and how good are they? 200 simulated cameras and 200 simulated
// rigs at the level of corners and highlights, with the noise that rendered frames show; then cameras and rigs from
// rendered frames, of cameras three times as many. usage: calib_geometry [TRIALS [RENDERED]] (200, 5)
#include <stdio.h>

#include "tests/camera_views.h"
#include "tests/rig_frames.h"
#include "tests/rig_views.h"

// Of one coordinate, px; what the rendered rigs below show (printed there): corners, highlights.
#define CORNER_PX 0.05
#define RIG_CORNER_PX 0.035 // and twice that at 60 deg
#define HIGHLIGHT_PX 0.015
#define REPEATABILITY_DEG 0.00707 // the default axis: 0.01 deg, half of its variance

static int by_value(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print_spread(const char *what, double *values, int n, double limit) {
    int within = 0;
    qsort(values, (size_t)n, sizeof *values, by_value);
    for (int i = 0; i < n; i++) {
        within += values[i] <= limit;
    }
    printf("  %-44s median %.4f  95th percentile %.4f  largest %.4f; %.1f %% at most %g\n", what, values[n / 2],
           values[(int)(0.95 * n)], values[n - 1], 100.0 * within / n, limit);
}

static void cameras(int trials, int views, bool reaching) {
    static const double truth[9] = {1500, 1495, 330, 250, -0.25, 0.1, 1e-3, -5e-4, 0};
    gonio_corners *corners = calloc((size_t)views, sizeof *corners);
    gonio_view *view = calloc((size_t)views, sizeof *view);
    double *left = malloc((size_t)trials * sizeof *left);
    uint64_t random = 12;
    int within = 0, n = 0, failed = 0;
    for (int trial = 0; trial < trials; trial++) {
        gonio_camera_calibration c;
        gonio_error error = {0};
        for (int i = 0; i < views; i++) {
            view[i] = (gonio_view){0};
            camera_view(&random, truth, 640, 512, 1.2, CORNER_PX, reaching ? i : -1, &corners[i]);
        }
        if (gonio_camera_calibrate(views, corners, 640, 512, view, &c, &error) != GONIO_OK) {
            failed++;
            fprintf(stderr, "%s\n", error.message);
            left[trial] = INFINITY;
            continue;
        }
        for (int k = 0; k < 9; k++) {
            if (c.sigma[k] > 0) { // the others are held
                within += fabs(c.value[k] - truth[k]) <= 2 * c.sigma[k];
                n++;
            }
        }
        left[trial] = camera_distortion_left(truth, c.value, 640, 512);
    }
    printf("%d cameras, %d views of 54 corners, %.2f px%s: within 2 sigma %.1f %% of %d parameters; %d failed\n",
           trials, views, CORNER_PX, reaching ? ", every other view in a corner of the frame" : "", 100.0 * within / n,
           n, failed);
    print_spread("distortion left over the whole frame, px", left, trials, 0.1);
    free(corners);
    free(view);
    free(left);
}

static void rigs(int trials) {
    const rig_errors e = {1, 1, 0.3, 3, REPEATABILITY_DEG, RIG_CORNER_PX, HIGHLIGHT_PX, 2};
    rig_views v = {.camera = rig_camera(), .corners = calloc(2 * GONIO_RIG_POSES_MAX, sizeof *v.corners)};
    double *axis = malloc((size_t)trials * sizeof *axis), *direction = malloc((size_t)trials * sizeof *direction);
    uint64_t random = 77;
    int within = 0, n = 0, done = 0;
    gonio_rig_options options;
    gonio_rig_options_default(&options);
    options.pointing_random_deg = REPEATABILITY_DEG;
    for (int trial = 0; trial < trials; trial++) {
        gonio_alignment found;
        gonio_rig_report report;
        gonio_error error = {0};
        rig_truth(&v, &e, &random);
        if (rig_views_calibrate(&v, &e, &random, &options, &found, &report, &error) != GONIO_OK) {
            fprintf(stderr, "%s\n", error.message);
            continue;
        }
        rig_count_within(&found, &v.truth, &within, &n);
        axis[done] = rig_axis_error_deg(&found, &v.truth);
        direction[done++] = rig_direction_error_deg(&found, &v.truth);
    }
    printf("%d of %d rigs, axes 1 deg askew: within 2 sigma %.1f %% of %d parameters\n", done, trials,
           100.0 * within / n, n);
    print_spread("worst of the four axes, deg", axis, done, 0.02);
    print_spread("worst of 60 directions, deg", direction, done, 0.02);
    free(v.corners);
    free(axis);
    free(direction);
}

// The simulator's truth, with the zero errors of the counters, which calibration sees as part of the arms.
static double rendered_error_deg(const rig_frames *f, const gonio_alignment *found, double *axis_deg) {
    gonio_alignment truth;
    rig_frames_truth(f, &truth);
    *axis_deg = rig_axis_error_deg(found, &truth);
    return rig_direction_error_deg(found, &truth);
}

static bool rendered_rig(uint64_t seed, int *within, int *n) {
    static const char *const axes[] = {"axis light_theta", "axis light_phi", "axis camera_theta", "axis camera_phi"};
    const char *settings[4 * 6 + 1] = {NULL};
    for (int k = 0; k < 4; k++) {
        const char *const one[] = {axes[k], "tilt_deg", "0.5", axes[k], "pointing_deg", "0"};
        memcpy(settings + 6 * k, one, sizeof one);
    }
    rig_frames f;
    gonio_rig_pose poses[2 * GONIO_RIG_POSES_MAX];
    gonio_rig_view *view = calloc(2 * GONIO_RIG_POSES_MAX, sizeof *view);
    gonio_corners *corners = calloc(2 * GONIO_RIG_POSES_MAX, sizeof *corners);
    gonio_rig_options options;
    gonio_rig_report report = {0};
    gonio_alignment found = {0};
    gonio_error error = {0};
    double axis_deg;
    gonio_rig_options_default(&options);
    options.pointing_random_deg = 0;
    bool ok = rig_frames_open(&f, &rig_board, seed, settings);
    int count = gonio_rig_poses(poses), from = 0;
    for (int round = 0; ok && round < 2; round++) {
        for (int i = from; ok && i < count; i++) {
            ok = rig_frames_view(&f, &poses[i], &corners[i], &view[i]);
        }
        ok = ok && gonio_rig_calibrate(&f.camera, &options, count, view, &found, &report, &error) == GONIO_OK;
        from = count;
        count += round == 0 && ok ? gonio_rig_mirror_poses(&found, poses + count) : 0;
    }
    if (ok) {
        gonio_alignment truth;
        const double direction = rendered_error_deg(&f, &found, &axis_deg);
        rig_frames_truth(&f, &truth);
        rig_count_within(&found, &truth, within, n);
        printf(
            "  rendered rig, seed %llu: worst axis %.4f deg, worst direction %.4f deg (stated +- %.4f); noise %.3f px "
            "board, %.3f ball, %.3f mirror\n",
            (unsigned long long)seed, axis_deg, direction, report.direction_sigma_deg, report.noise_px[0],
            report.noise_px[1], report.noise_px[2]);
    } else {
        fprintf(stderr, "seed %llu: %s\n", (unsigned long long)seed, error.message);
    }
    rig_frames_close(&f);
    free(view);
    free(corners);
    fflush(stdout);
    return ok;
}

#define CAMERA_VIEWS 24
// A large ChArUco board, which fills most of the frame.
static const gonio_board camera_board = {GONIO_CHARUCO, 8, 6, 45, 33.75, 5};

// Open a rig whose camera is drawn by the seed.
static bool open_camera(uint64_t seed, uint64_t *random, double truth[9], rig_frames *f) {
    static const char *const keys[9] = {"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3"};
    static const double middle[9] = {1500, 1500, 319.5, 255.5, -0.2, 0.1, 0, 0, 0},
                        spread[9] = {30, 30, 10, 10, 0.05, 0.05, 1e-3, 1e-3, 0};
    char text[9][32];
    const char *settings[3 * 9 + 1] = {NULL};
    for (int k = 0; k < 9; k++) {
        truth[k] = middle[k] + spread[k] * pixel_normal(random);
        snprintf(text[k], sizeof text[k], "%.17g", truth[k]);
        const char *const one[] = {"camera", keys[k], text[k]};
        memcpy(settings + 3 * k, one, sizeof one);
    }
    return rig_frames_open(f, &camera_board, seed, settings);
}

// Its intrinsics from frames of the board, seen from 24 sides.
static bool rendered_camera(uint64_t seed, int *within, int *n) {
    static const double theta[] = {15, 25, 35, 45};
    uint64_t random = 100 + seed;
    double truth[9];
    rig_frames f;
    gonio_corners *corners = calloc(CAMERA_VIEWS, sizeof *corners);
    gonio_view view[CAMERA_VIEWS] = {0};
    gonio_camera_calibration c = {0};
    gonio_error error = {0};
    bool ok = open_camera(seed, &random, truth, &f);
    for (int i = 0; ok && i < CAMERA_VIEWS; i++) {
        gonio_rig_view found;
        const double phi = gonio_radians(60 * (i / 4) - 180 + 60 * pixel_uniform(&random));
        const gonio_rig_pose pose = {{gonio_radians(20), -phi, gonio_radians(theta[i % 4]), phi}, GONIO_RIG_BOARD};
        ok = rig_frames_view(&f, &pose, &corners[i], &found);
    }
    ok = ok &&
         gonio_camera_calibrate(CAMERA_VIEWS, corners, f.camera.width, f.camera.height, view, &c, &error) == GONIO_OK;
    for (int k = 0; ok && k < 9; k++) {
        if (c.sigma[k] > 0) { // the others are held
            *within += fabs(c.value[k] - truth[k]) <= 2 * c.sigma[k];
            ++*n;
        }
    }
    if (ok) {
        printf("  rendered camera, seed %llu: %d views, rms %.3f px, fx %.2f +- %.2f (true %.2f)\n",
               (unsigned long long)seed, c.views_used, c.rms, c.value[0], c.sigma[0], truth[0]);
    } else {
        fprintf(stderr, "seed %llu: %s%s\n", (unsigned long long)seed, error.message, f.error.message);
    }
    rig_frames_close(&f);
    free(corners);
    fflush(stdout);
    return ok;
}

int main(int argc, char **argv) {
    const int trials = argc > 1 ? atoi(argv[1]) : 200, rendered = argc > 2 ? atoi(argv[2]) : 5;
    int within = 0, n = 0;
    if (trials > 0) {
        cameras(trials, 12, false);
        cameras(trials, 30, true);
        rigs(trials);
    }
    bool ok = true;
    // A camera's eight parameters go together: one that is 2.5 sigma off takes six of them along, so five say little.
    const int cameras_rendered = 3 * rendered;
    for (int seed = 1; seed <= cameras_rendered; seed++) {
        ok = rendered_camera((uint64_t)seed, &within, &n) && ok;
    }
    if (n > 0) {
        printf("%d rendered cameras: within 2 sigma %.1f %% of %d parameters\n", cameras_rendered, 100.0 * within / n,
               n);
    }
    within = n = 0;
    for (int seed = 1; seed <= rendered; seed++) {
        ok = rendered_rig((uint64_t)seed, &within, &n) && ok;
    }
    if (n > 0) {
        printf("%d rendered rigs: within 2 sigma %.1f %% of %d parameters\n", rendered, 100.0 * within / n, n);
    }
    return ok ? 0 : 1;
}
