// SPDX-License-Identifier: BSD-3-Clause
// Views -> frames of the bundle: the board's corners in the sample's axes, and whether it lies as it was said to.
#include "calib/rig/bundle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void gonio_bundle_frames_free(bundle *q) {
    for (int i = 0; q->frames != NULL && i < q->n; i++) {
        free(q->frames[i].at);
        free(q->frames[i].pixel);
        free(q->frames[i].direction[0]);
    }
    free(q->frames);
}

static gonio_status make_frame(bundle_frame *f, gonio_rig_view *view, double azimuth, gonio_error *error) {
    f->view = view;
    f->band = gonio_bundle_band(view);
    view->rms = 0;
    const bool board = bundle_is_board(f);
    if (board) {
        view->used = view->corners != NULL && view->corners->n >= 6;
    }
    f->points = !board ? 1 : view->corners != NULL ? view->corners->n : 0;
    const size_t points = (size_t)f->points + 1;
    f->at = malloc(points * sizeof *f->at);
    f->pixel = malloc(points * sizeof *f->pixel);
    f->direction[0] = malloc(4 * 2 * points * sizeof(double));
    if (f->at == NULL || f->pixel == NULL || f->direction[0] == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a view");
    }
    for (int d = 1; d < 4; d++) {
        f->direction[d] = f->direction[0] + 2 * points * (size_t)d;
    }
    const double c = cos(azimuth), s = sin(azimuth);
    for (int k = 0; k < f->points && board; k++) {
        const double x = view->corners->board[k][0], y = -view->corners->board[k][1]; // the board's y points down
        f->at[k][0] = c * x - s * y;
        f->at[k][1] = s * x + c * y;
        memcpy(f->pixel[k], view->corners->pixel[k], sizeof *f->pixel);
    }
    if (!board) {
        memcpy(f->pixel[0], view->highlight, sizeof *f->pixel);
    }
    return GONIO_OK;
}

// The middle of the corners that all board frames name, the first guess of the origin.
static void centre_boards(bundle *q, double centre[2]) {
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < q->n; i++) {
        for (int k = 0; k < q->frames[i].points && bundle_is_board(&q->frames[i]); k++) {
            for (int c = 0; c < 2; c++) {
                low[c] = fmin(low[c], q->frames[i].at[k][c]);
                high[c] = fmax(high[c], q->frames[i].at[k][c]);
            }
        }
    }
    for (int c = 0; c < 2; c++) {
        centre[c] = isfinite(low[c]) ? (low[c] + high[c]) / 2 : 0;
    }
}

void gonio_bundle_move_origin(bundle *q, const double by[2]) {
    for (int i = 0; i < q->n; i++) {
        for (int k = 0; k < q->frames[i].points && bundle_is_board(&q->frames[i]); k++) {
            q->frames[i].at[k][0] -= by[0];
            q->frames[i].at[k][1] -= by[1];
        }
    }
}

// Mean squared distance between the corners as seen and as a board that is turned by `azimuth` shows them on the
// nominal rig, each about its own mean.
static double misfit(const bundle *q, const bundle_frame *f, double azimuth) {
    double pixel[GONIO_CORNERS_MAX][2], mean[2] = {0, 0}, total = 0;
    const double c = cos(azimuth), s = sin(azimuth);
    const geometry g = gonio_bundle_geometry(q->nominal, &f->view->axes);
    for (int k = 0; k < f->points; k++) {
        const double x = f->at[k][0], y = f->at[k][1];
        if (!gonio_geometry_project(&g, q->camera, (gonio_vec3){c * x - s * y, s * x + c * y, 0}, pixel[k])) {
            return INFINITY;
        }
        for (int i = 0; i < 2; i++) {
            pixel[k][i] -= f->pixel[k][i];
            mean[i] += pixel[k][i] / f->points;
        }
    }
    for (int k = 0; k < f->points; k++) {
        total += (pixel[k][0] - mean[0]) * (pixel[k][0] - mean[0]) + (pixel[k][1] - mean[1]) * (pixel[k][1] - mean[1]);
    }
    return total / f->points;
}

// A chessboard's corners may be counted from the other end.
static void reverse_if_better(const bundle *q, bundle_frame *f) {
    if (misfit(q, f, GONIO_PI) < misfit(q, f, 0)) {
        for (int a = 0, b = f->points - 1; a < b; a++, b--) {
            for (int c = 0; c < 2; c++) {
                const double kept = f->pixel[a][c];
                f->pixel[a][c] = f->pixel[b][c];
                f->pixel[b][c] = kept;
            }
        }
    }
}

// A board that lies turned would be taken for axes askew by as much: look where it lies, in steps of 10 deg.
static gonio_status check_azimuth(bundle *q, gonio_error *error) {
    double best = INFINITY;
    int found = 0;
    for (int deg = -170; deg <= 180; deg += 10) {
        double total = 0;
        for (int i = 0; i < q->n; i++) {
            const bundle_frame *f = &q->frames[i];
            total += !bundle_is_board(f) || !f->view->used ? 0 : misfit(q, f, gonio_radians(deg));
        }
        if (total < best) {
            best = total;
            found = deg;
        }
    }
    if (found == 0 || (q->options->reversible && abs(found) == 180)) {
        return GONIO_OK;
    }
    return gonio_fail(error, GONIO_E_INPUT,
                      "the board's right side points to an azimuth of about %.0f deg, stated were %.0f deg (or the "
                      "axes' counters in the list are wrong)",
                      q->options->board_azimuth_deg + found, q->options->board_azimuth_deg);
}

gonio_status gonio_bundle_frames_make(bundle *q, int n, gonio_rig_view *views, double centre[2], gonio_error *error) {
    q->frames = calloc((size_t)n, sizeof *q->frames);
    if (q->frames == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %d views", n);
    }
    q->n = n;
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < n; i++) {
        status = make_frame(&q->frames[i], &views[i], gonio_radians(q->options->board_azimuth_deg), error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    centre_boards(q, centre);
    gonio_bundle_move_origin(q, centre);
    for (int i = 0; i < n && q->options->reversible; i++) {
        if (bundle_is_board(&q->frames[i]) && views[i].used) {
            reverse_if_better(q, &q->frames[i]);
        }
    }
    return check_azimuth(q, error);
}
