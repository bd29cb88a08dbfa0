// Are the stated uncertainties of camera and axes true, and how good are they? 200 simulated cameras and 200 simulated
// rigs at the level of corners and highlights, with the noise that rendered frames show; then rigs and a camera from
// rendered frames. usage: calib_geometry [TRIALS [RENDERED]] (200, 5)
#include <stdio.h>

#include "tests/camera_views.h"
#include "tests/rig_frames.h"
#include "tests/rig_views.h"

// Of one coordinate, px; what the rendered rigs below show (printed there): corners, highlights.
#define CORNER_PX 0.05
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
    const rig_errors e = {1, 1, 0.3, 3, REPEATABILITY_DEG, CORNER_PX, HIGHLIGHT_PX};
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
    bool ok = rig_frames_open(&f, seed, settings);
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

int main(int argc, char **argv) {
    const int trials = argc > 1 ? atoi(argv[1]) : 200, rendered = argc > 2 ? atoi(argv[2]) : 5;
    int within = 0, n = 0;
    if (trials > 0) {
        cameras(trials, 12, false);
        cameras(trials, 30, true);
        rigs(trials);
    }
    bool ok = true;
    for (int seed = 1; seed <= rendered; seed++) {
        ok = rendered_rig((uint64_t)seed, &within, &n) && ok;
    }
    if (n > 0) {
        printf("%d rendered rigs: within 2 sigma %.1f %% of %d parameters\n", rendered, 100.0 * within / n, n);
    }
    return ok ? 0 : 1;
}
