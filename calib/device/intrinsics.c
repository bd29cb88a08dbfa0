// SPDX-License-Identifier: BSD-3-Clause
// Camera intrinsics from views of a board: which views count, and when they do not suffice. OpenCV fits (Zhang, "A
// flexible new technique for camera calibration", PAMI 2000).
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "base/vector.h"
#include "calib/opencv.h"

// A view whose residuals exceed the others' by this factor, and a pixel, has wrong corners, not noise.
#define REJECT_FACTOR 4
#define REJECT_PX 1
#define VIEWS_MIN 3
#define RADIAL_MAX 3 // k1 k2 k3
// Parallel boards, however many, constrain the camera no more than one does (Zhang, section 3.3), and then OpenCV's own
// uncertainties say nothing: somewhere two boards must differ by this angle, or the focal length stays uncertain.
#define SPREAD_MIN_DEG 8
#define FOCAL_SIGMA_MAX 0.05

static gonio_status check_board(const gonio_board *board, gonio_error *error) {
    const bool charuco = board->kind == GONIO_CHARUCO;
    const int corners = charuco ? (board->columns - 1) * (board->rows - 1) : board->columns * board->rows;
    if (board->columns < 3 || board->rows < 3 || corners > GONIO_CORNERS_MAX || !(board->square_mm > 0)) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "a board of %d x %d, squares of %g mm; 3 x 3 to %d corners are possible", board->columns,
                          board->rows, board->square_mm, GONIO_CORNERS_MAX);
    }
    if (charuco && (!(board->marker_mm > 0 && board->marker_mm < board->square_mm) || board->dictionary < 0 ||
                    board->dictionary > 20)) {
        return gonio_fail(error, GONIO_E_USAGE, "ChArUco markers of %g mm in squares of %g mm, dictionary %d",
                          board->marker_mm, board->square_mm, board->dictionary);
    }
    return GONIO_OK;
}

gonio_status gonio_board_draw(const gonio_board *board, int square_px, gonio_image *image, gonio_error *error) {
    *image = (gonio_image){0};
    gonio_status status = check_board(board, error);
    if (status == GONIO_OK && (square_px < 8 || square_px > 1000)) {
        status = gonio_fail(error, GONIO_E_USAGE, "squares of %d px; 8 to 1000 are possible", square_px);
    }
    return status == GONIO_OK ? gonio_opencv_draw_board(board, square_px, image, error) : status;
}

gonio_status gonio_board_find(const gonio_image *image, const gonio_board *board, int half_window,
                              gonio_corners *corners, gonio_error *error) {
    corners->n = 0;
    gonio_status status = check_board(board, error);
    if (status == GONIO_OK && (half_window < 1 || half_window > 50)) {
        status = gonio_fail(error, GONIO_E_USAGE, "a sub-pixel window of +-%d px; 1 to 50 are possible", half_window);
    }
    return status == GONIO_OK ? gonio_opencv_find_board(image, board, half_window, corners, error) : status;
}

static double median_rms(int n, const gonio_view *views) {
    double values[n];
    int used = 0;
    for (int i = 0; i < n; i++) {
        if (views[i].used) {
            values[used++] = views[i].rms;
        }
    }
    return gonio_upper_median(values, (size_t)used);
}

// Reject the worst view if it stands apart; true: one was.
static bool reject_worst(int n, gonio_view *views) {
    const double median = median_rms(n, views);
    int worst = -1;
    for (int i = 0; i < n; i++) {
        if (views[i].used && (worst < 0 || views[i].rms > views[worst].rms)) {
            worst = i;
        }
    }
    if (worst < 0 || views[worst].rms < REJECT_FACTOR * median || views[worst].rms < REJECT_PX) {
        return false;
    }
    views[worst].used = false;
    snprintf(views[worst].reason, sizeof views[worst].reason, "reprojection error %.2f px; the median is %.2f px",
             views[worst].rms, median);
    return true;
}

// The board's normal in the camera's frame: the third column of the rotation (Rodrigues' formula).
static gonio_vec3 board_normal(const gonio_view *view) {
    const double *r = view->rotation, angle = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    if (angle == 0) {
        return (gonio_vec3){0, 0, 1};
    }
    const double x = r[0] / angle, y = r[1] / angle, z = r[2] / angle, s = sin(angle), c = cos(angle);
    return (gonio_vec3){x * z * (1 - c) + y * s, y * z * (1 - c) - x * s, c + z * z * (1 - c)};
}

// The largest angle between the boards of any two used views.
static double spread_deg(int n, const gonio_view *views) {
    double least = 1;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++) {
            if (views[i].used && views[j].used) {
                const gonio_vec3 a = board_normal(&views[i]), b = board_normal(&views[j]);
                least = fmin(least, fabs(dot(a, b)));
            }
        }
    }
    return gonio_degrees(acos(least));
}

// Hold k3 at 0 where the corners do not ask for it: what is not needed fits noise, and beyond the corners, at the
// frame's edge, the highest power of r then bends everything. It is held unless Schwarz's criterion (1978) is for it: n
// coordinates must fit better by ln(n) times their mean square. k2 stays in any case: held against a lens that has a
// little of it, the other uncertainties were no longer true (87 instead of 95 % within 2 sigma).
static gonio_status hold_k3(int n, const gonio_corners *corners, gonio_view *views, gonio_camera_calibration *out,
                            gonio_error *error) {
    double coordinates = 0;
    for (int i = 0; i < n; i++) {
        coordinates += views[i].used ? 2 * corners[i].n : 0;
    }
    gonio_view *kept = malloc((size_t)n * sizeof *kept);
    if (kept == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d views", n);
    }
    memcpy(kept, views, (size_t)n * sizeof *kept);
    gonio_camera_calibration fewer = *out;
    const gonio_status status = gonio_opencv_calibrate(n, corners, RADIAL_MAX - 1, views, &fewer, error);
    const double left = fmax(coordinates - 6 * out->views_used - 9, 1);
    if (status == GONIO_OK &&
        fewer.rms * fewer.rms - out->rms * out->rms < log(fmax(coordinates, 3)) * out->rms * out->rms / left) {
        *out = fewer;
    } else {
        memcpy(views, kept, (size_t)n * sizeof *kept);
    }
    free(kept);
    return status;
}

gonio_status gonio_camera_calibrate(int n, const gonio_corners *corners, int width, int height, gonio_view *views,
                                    gonio_camera_calibration *out, gonio_error *error) {
    *out = (gonio_camera_calibration){.width = width, .height = height};
    if (n < 1 || n > 10000) {
        return gonio_fail(error, GONIO_E_USAGE, "%d views", n);
    }
    int used = 0;
    for (int i = 0; i < n; i++) {
        views[i].used = corners[i].n >= 6;
        if (corners[i].n > 0 && !views[i].used) {
            snprintf(views[i].reason, sizeof views[i].reason, "%d corners; at least 6 are needed", corners[i].n);
        }
        used += views[i].used;
    }
    gonio_status status = GONIO_OK;
    do {
        if (used < VIEWS_MIN) {
            return gonio_fail(error, GONIO_E_INPUT, "%d usable views of the board; at least %d are needed", used,
                              VIEWS_MIN);
        }
        status = gonio_opencv_calibrate(n, corners, RADIAL_MAX, views, out, error);
        out->views_used = used--;
    } while (status == GONIO_OK && reject_worst(n, views));
    status = status == GONIO_OK ? hold_k3(n, corners, views, out, error) : status;
    const double spread = spread_deg(n, views);
    if (status == GONIO_OK && !(spread >= SPREAD_MIN_DEG && out->sigma[0] < FOCAL_SIGMA_MAX * out->value[0])) {
        status =
            gonio_fail(error, GONIO_E_INPUT,
                       "the views are too alike: boards differ by at most %.1f deg (focal length %.0f +- %.0f px); "
                       "tilt the board by 20 deg or more in some of them",
                       spread, out->value[0], out->sigma[0]);
    }
    return status;
}

void gonio_camera_apply(const gonio_camera_calibration *calibration, gonio_camera_info *camera) {
    double *const members[9] = {&camera->fx, &camera->fy, &camera->cx, &camera->cy, &camera->k1,
                                &camera->k2, &camera->p1, &camera->p2, &camera->k3};
    for (int k = 0; k < 9; k++) {
        *members[k] = calibration->value[k];
    }
}

gonio_status gonio_camera_undistortion_map(const gonio_camera_info *camera, float *map, gonio_error *error) {
    return gonio_opencv_undistortion_map(camera, map, error);
}
