// SPDX-License-Identifier: BSD-3-Clause
// Rendered frames of the simulated rig's board, ball and mirror, and what is found in them.
#ifndef TESTS_RIG_FRAMES_H
#define TESTS_RIG_FRAMES_H

#include <stdio.h>
#include <stdlib.h>

#include "gonio/characterise.h"
#include "gonio/sim.h"

static const gonio_board rig_board = {GONIO_CHARUCO, 8, 6, 5, 3.75, 5};

typedef struct rig_frames {
    gonio_sim *sim;
    gonio_rig rig;
    gonio_camera_info camera;
    gonio_image image;
    const gonio_board *board;
    int64_t pose;
    gonio_error error;
} rig_frames;

static inline bool rig_frames_ok(rig_frames *f, gonio_status status, const char *what) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s: %s\n", what, f->error.message);
    }
    return status == GONIO_OK;
}

// settings: "section", "key", "value" triples, NULL-terminated.
static inline bool rig_frames_open(rig_frames *f, const gonio_board *board, uint64_t seed,
                                   const char *const *settings) {
    *f = (rig_frames){.board = board};
    gonio_image drawn;
    const int square_px = 100;
    if (!rig_frames_ok(f, gonio_sim_new("ward:rho_d=0.3,rho_s=0.2,alpha=0.15", seed, &f->sim, &f->error), "sim") ||
        !rig_frames_ok(f, gonio_board_draw(board, square_px, &drawn, &f->error), "board") ||
        !rig_frames_ok(f,
                       gonio_sim_fiducial(f->sim, drawn.width, drawn.height, drawn.pixels, board->square_mm / square_px,
                                          &f->error),
                       "fiducial")) {
        return false;
    }
    gonio_image_free(&drawn);
    for (int i = 0; settings != NULL && settings[i] != NULL; i += 3) {
        if (!rig_frames_ok(f, gonio_sim_set(f->sim, settings[i], settings[i + 1], settings[i + 2], &f->error), "set")) {
            return false;
        }
    }
    if (!rig_frames_ok(f, gonio_sim_open(f->sim, 0, &f->rig, &f->error), "open") ||
        !rig_frames_ok(f, f->rig.camera->info(f->rig.camera_device, &f->camera, &f->error), "camera") ||
        !rig_frames_ok(f, f->rig.stage->home(f->rig.stage_device, 1e6, &f->error), "home") ||
        !rig_frames_ok(f, f->rig.lamp->set_shutter(f->rig.lamp_device, true, &f->error), "shutter")) {
        return false;
    }
    f->image = (gonio_image){f->camera.width, f->camera.height, 1, 16, NULL};
    return true;
}

static inline void rig_frames_close(rig_frames *f) {
    gonio_image_free(&f->image);
    gonio_rig_close(&f->rig);
    gonio_sim_free(f->sim);
}

static inline bool rig_frames_capture(rig_frames *f, double exposure_s, int32_t number, double *peak) {
    const gonio_window all = {0, 0, f->camera.width, f->camera.height};
    const gonio_stamp stamp = {f->pose, number, 1000 + 10 * (double)f->pose};
    const size_t n = (size_t)f->camera.width * (size_t)f->camera.height;
    gonio_frame frame = {.pixels = malloc(n * sizeof(uint16_t))};
    gonio_image_free(&f->image);
    f->image = (gonio_image){f->camera.width, f->camera.height, 1, 16, frame.pixels};
    const bool ok = rig_frames_ok(
        f, f->rig.camera->capture(f->rig.camera_device, &all, exposure_s, 0, &stamp, 1e6, &frame, &f->error), "frame");
    *peak = 0;
    for (size_t i = 0; ok && i < n; i++) {
        *peak = frame.pixels[i] > *peak ? frame.pixels[i] : *peak;
    }
    return ok;
}

// Move, put the object down and take a frame whose brightest parts use the range; it is in f->image.
static inline bool rig_frames_take(rig_frames *f, const gonio_rig_pose *pose) {
    static const gonio_target targets[] = {GONIO_TARGET_FIDUCIAL, GONIO_TARGET_BALL, GONIO_TARGET_MIRROR};
    const double to[GONIO_AXES] = {pose->axes.theta_i, pose->axes.phi_i, pose->axes.theta_o, pose->axes.phi_o};
    const gonio_stamp stamp = {++f->pose, 0, 1000 + 10 * (double)f->pose};
    double exposure_s = pose->object == GONIO_RIG_BOARD ? 0.01 : 2e-5, peak;
    if (!rig_frames_ok(f, f->rig.mount->mount(f->rig.mount_device, targets[pose->object], &f->error), "mount") ||
        !rig_frames_ok(f, f->rig.stage->move(f->rig.stage_device, to, (uint32_t)f->pose, &stamp, 1e6, &f->error),
                       "move")) {
        return false;
    }
    for (int32_t k = 0; k < 8; k++) {
        if (!rig_frames_capture(f, exposure_s, k, &peak)) {
            return false;
        }
        const double full = (1 << f->camera.bits) - 1, share = (peak - full / 64) / full;
        if (share >= 0.3 && share < 0.95) {
            break;
        }
        exposure_s = share >= 0.95 ? exposure_s / 4 : exposure_s * (share > 0.02 ? 0.7 / share : 20);
        if (exposure_s < f->camera.exposure_min_s || exposure_s > 1) {
            break;
        }
    }
    return true;
}

// The view of a pose as rendered; corners: room for the board's. False where the rig failed; view->used and ->reason
// tell whether something was found.
static inline bool rig_frames_view(rig_frames *f, const gonio_rig_pose *pose, gonio_corners *corners,
                                   gonio_rig_view *view) {
    gonio_error why = {0};
    *view = (gonio_rig_view){.axes = pose->axes, .object = pose->object, .corners = corners};
    corners->n = 0;
    if (!rig_frames_take(f, pose)) {
        return false;
    }
    const gonio_status status = pose->object == GONIO_RIG_BOARD
                                    ? gonio_board_find(&f->image, f->board, 5, corners, &why)
                                    : gonio_highlight_find(&f->image, view->highlight, &why);
    view->used = status == GONIO_OK;
    snprintf(view->reason, sizeof view->reason, "%.150s", why.message);
    return true;
}

// The alignment that the simulator draws: what calibration should find.
static inline void rig_frames_truth(const rig_frames *f, gonio_alignment *out) {
    static const int first[GONIO_AXES] = {GONIO_LIGHT_TILT_AXIS, GONIO_LIGHT_AZIMUTH_AXIS, GONIO_CAMERA_TILT_AXIS,
                                          GONIO_CAMERA_AZIMUTH_AXIS};
    gonio_sim_facts facts;
    gonio_sim_true_facts(f->sim, 0, &facts);
    gonio_alignment_nominal(f->rig.facts.light_distance_mm, f->rig.facts.camera_distance_mm, out);
    for (int k = 0; k < GONIO_AXES; k++) {
        const gonio_vec3 d = facts.axis[k].direction, p = facts.axis[k].point;
        const bool tilt = first[k] == GONIO_LIGHT_TILT_AXIS || first[k] == GONIO_CAMERA_TILT_AXIS;
        out->value[first[k]] = tilt ? d.x / d.y : d.x / d.z;
        out->value[first[k] + 1] = tilt ? d.z / d.y : d.y / d.z;
        out->value[first[k] + 2] = p.x;
        out->value[first[k] + 3] = tilt ? p.z : p.y;
    }
}

#endif
