// SPDX-License-Identifier: BSD-3-Clause
// A scan of the simulated rig without a session: sim -> frames -> calib -> samples, in this process. What a test or a
// bench of calib needs; every function returns false and prints why when something fails.
#ifndef TESTS_SIM_SCAN_H
#define TESTS_SIM_SCAN_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/session_calibration.h"
#include "gonio/sim.h"

#define SCAN_EXPOSURES 16

typedef struct sim_scan {
    gonio_sim *sim;
    gonio_rig rig;
    gonio_camera_info camera;
    gonio_window window;
    gonio_calib *calib;
    gonio_stamp stamp; // the next frame's
    double exposure_s; // that a pose begins with
    uint16_t *pixels;  // SCAN_EXPOSURES frames
    gonio_exposure exposures[SCAN_EXPOSURES];
    int n; // of the pose just taken
    int dark_frames, trap_frames, reference_frames;
    gonio_error error;
} sim_scan;

static inline bool scan_ok(sim_scan *scan, gonio_status status, const char *what) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s: %s\n", what, scan->error.message);
    }
    return status == GONIO_OK;
}

// settings: "section.key=value" texts, NULL-terminated. side: of the read-out window, centred; 0 for 160 x 128 (the
// whole frame for a sphere).
static inline bool scan_open(sim_scan *scan, const char *spec, uint64_t seed, const char *const *settings, int side) {
    *scan = (sim_scan){.exposure_s = 0.01, .dark_frames = 8, .trap_frames = 4, .reference_frames = 16};
    if (!scan_ok(scan, gonio_sim_new(spec, seed, &scan->sim, &scan->error), "sim")) {
        return false;
    }
    for (int i = 0; settings != NULL && settings[i] != NULL; i++) {
        char section[64], key[64], value[256];
        if (sscanf(settings[i], "%63[^.].%63[^=]=%255s", section, key, value) != 3 ||
            !scan_ok(scan, gonio_sim_set(scan->sim, section, key, value, &scan->error), settings[i])) {
            return false;
        }
    }
    if (!scan_ok(scan, gonio_sim_open(scan->sim, 1, &scan->rig, &scan->error), "open") ||
        !scan_ok(scan, scan->rig.camera->info(scan->rig.camera_device, &scan->camera, &scan->error), "camera") ||
        !scan_ok(scan, scan->rig.stage->home(scan->rig.stage_device, 1e6, &scan->error), "home")) {
        return false;
    }
    const bool whole = scan->rig.facts.sphere;
    const int width = side > 0 ? side : whole ? scan->camera.width : 160;
    const int height = side > 0 ? side : whole ? scan->camera.height : 128;
    scan->window =
        (gonio_window){(scan->camera.width - width) / 2 & ~1, (scan->camera.height - height) / 2 & ~1, width, height};
    scan->pixels = malloc(SCAN_EXPOSURES * (size_t)width * (size_t)height * sizeof *scan->pixels);
    return scan->pixels != NULL &&
           scan_ok(scan, gonio_calib_new(&scan->camera, &scan->rig.facts, &scan->window, &scan->calib, &scan->error),
                   "calib");
}

static inline void scan_close(sim_scan *scan) {
    gonio_calib_free(scan->calib);
    free(scan->pixels);
    gonio_sim_free(scan->sim);
}

// Capture into slot `index`; the lamp's monitor is read where there is one.
static inline bool scan_capture(sim_scan *scan, int index, double exposure_s) {
    gonio_exposure *e = &scan->exposures[index];
    const size_t size = (size_t)scan->window.width * (size_t)scan->window.height;
    *e = (gonio_exposure){.frame = {.pixels = scan->pixels + (size_t)index * size}, .monitor = NAN};
    if (!scan_ok(scan,
                 scan->rig.camera->capture(scan->rig.camera_device, &scan->window, exposure_s, 0, &scan->stamp, 1e6,
                                           &e->frame, &scan->error),
                 "capture")) {
        return false;
    }
    if (scan->rig.meter != NULL && !scan_ok(scan,
                                            scan->rig.meter->read(scan->rig.meter_device, &scan->stamp, exposure_s,
                                                                  &e->monitor, &e->monitor_sigma, &scan->error),
                                            "meter")) {
        return false;
    }
    e->monitor_sigma /= fabs(e->monitor); // a meter states its unit, an exposure a relative figure
    scan->stamp.clock_s += exposure_s + scan->camera.read_out_s;
    scan->stamp.frame++;
    return true;
}

static inline bool scan_move(sim_scan *scan, const gonio_pair *pose) {
    const double target[GONIO_AXES] = {pose->theta_i, pose->phi_i, pose->theta_o, pose->phi_o};
    scan->stamp.pose++;
    scan->stamp.frame = 0;
    scan->stamp.clock_s += 4;
    return scan_ok(scan,
                   scan->rig.stage->move(scan->rig.stage_device, target, (uint32_t)scan->stamp.pose, &scan->stamp, 1e6,
                                         &scan->error),
                   "move");
}

// Exposures of the pose until calib is content; they stay in scan->exposures[0..n).
static inline bool scan_bracket(sim_scan *scan, const gonio_pair *pose) {
    double next = scan->exposure_s;
    for (scan->n = 0;;) {
        if (!scan_capture(scan, scan->n, next)) {
            return false;
        }
        scan->n++;
        if (scan->n == SCAN_EXPOSURES - 1 ||
            gonio_calib_bracket(scan->calib, pose, scan->n, scan->exposures, &next) != GONIO_EXPOSURE_MORE) {
            scan->exposure_s = scan->exposures[scan->n - 1].frame.exposure_s;
            return true;
        }
    }
}

static inline bool scan_reference(sim_scan *scan) {
    const gonio_pair pose = {.theta_i = gonio_radians(GONIO_REFERENCE_THETA_I_DEG)};
    bool ok =
        scan_ok(scan, scan->rig.mount->mount(scan->rig.mount_device, GONIO_TARGET_REFERENCE, &scan->error), "mount") &&
        scan_move(scan, &pose) && scan_bracket(scan, &pose);
    const int taken = scan->n;
    for (int i = 0; ok && i < scan->reference_frames + 1; i++) {
        if (i >= taken) { // the repeats, and a saturated one at the end
            ok = scan_capture(scan, SCAN_EXPOSURES - 1, scan->exposure_s * (i < scan->reference_frames ? 1 : 8));
        }
        ok = ok && scan_ok(scan,
                           gonio_calib_add_reference(
                               scan->calib, &pose, &scan->exposures[i < taken ? i : SCAN_EXPOSURES - 1], &scan->error),
                           "reference");
    }
    return ok &&
           scan_ok(scan, scan->rig.mount->mount(scan->rig.mount_device, GONIO_TARGET_SAMPLE, &scan->error), "mount");
}

static inline bool scan_trap(sim_scan *scan) {
    const gonio_pair pose = {.theta_i = gonio_radians(GONIO_REFERENCE_THETA_I_DEG)};
    bool ok = scan_ok(scan, scan->rig.mount->mount(scan->rig.mount_device, GONIO_TARGET_TRAP, &scan->error), "mount") &&
              scan_move(scan, &pose);
    for (int i = 0; ok && i < scan->trap_frames; i++) {
        ok = scan_capture(scan, 0, 1) &&
             scan_ok(scan, gonio_calib_add_trap(scan->calib, &scan->exposures[0], &scan->error), "trap");
    }
    return ok;
}

// Warm-up, dark frames, light trap, reference, prepare.
static inline bool scan_prepare(sim_scan *scan) {
    double waited = 0;
    bool ok = scan_ok(scan, scan->rig.lamp->wait_ready(scan->rig.lamp_device, &scan->stamp, 1e6, &waited, &scan->error),
                      "warm-up");
    scan->stamp.clock_s += waited;
    for (int i = 0; ok && i < 2 * scan->dark_frames; i++) {
        const double exposure_s = i < scan->dark_frames ? scan->camera.exposure_min_s : scan->camera.exposure_max_s;
        ok = scan_capture(scan, 0, exposure_s) &&
             scan_ok(scan, gonio_calib_add_dark(scan->calib, &scan->exposures[0], &scan->error), "dark");
    }
    return ok && scan_ok(scan, scan->rig.lamp->set_shutter(scan->rig.lamp_device, true, &scan->error), "shutter") &&
           scan_trap(scan) && scan_reference(scan) &&
           scan_ok(scan, gonio_calib_prepare(scan->calib, &scan->error), "prepare");
}

// One pose into the samples.
static inline bool scan_pose(sim_scan *scan, const gonio_pair *pose, gonio_samples *samples) {
    return scan_move(scan, pose) && scan_bracket(scan, pose) &&
           scan_ok(scan, gonio_calib_pose(scan->calib, pose, scan->n, scan->exposures, samples, &scan->error), "pose");
}

#endif
