// SPDX-License-Identifier: BSD-3-Clause
// A simulated rig for tests: opened with settings, homed, lit, and posed, in few lines.
#ifndef GONIO_TESTS_SIM_RIG_H
#define GONIO_TESTS_SIM_RIG_H

#include <stdlib.h>
#include <string.h>

#include "gonio/sim.h"

#define SIM_LONG_S 1e6

typedef struct sim_rig {
    gonio_sim *sim;
    gonio_rig rig;
    gonio_camera_info info;
} sim_rig;

// A perfect rig, from which a test switches on the one effect it looks at.
static const char *const sim_perfect[] = {"axis light_theta.pointing_deg=0",
                                          "axis light_phi.pointing_deg=0",
                                          "axis camera_theta.pointing_deg=0",
                                          "axis camera_phi.pointing_deg=0",
                                          "camera.read_noise_e=0",
                                          "camera.dark_e_per_s=0",
                                          "camera.dark_nonuniformity_percent=0",
                                          "camera.offset_nonuniformity_e=0",
                                          "camera.prnu_percent=0",
                                          "camera.hot_pixel_percent=0",
                                          "camera.vignetting_percent=0",
                                          "camera.k1=0",
                                          "lamp.drift_percent_per_hour=0",
                                          "lamp.wander_percent=0",
                                          "lamp.warm_up_percent=0",
                                          "stray.ambient_percent=0",
                                          "stray.glare_percent=0",
                                          "meter.noise_percent=0",
                                          "reference.sigma_percent=0",
                                          NULL};

// "section.key=value"; the section ends at the last dot before '='.
static inline gonio_status sim_rig_set(gonio_sim *sim, const char *line, gonio_error *error) {
    char text[400];
    snprintf(text, sizeof text, "%s", line);
    char *equals = strchr(text, '=');
    *equals = 0;
    char *dot = strrchr(text, '.');
    *dot = 0;
    return gonio_sim_set(sim, text, dot + 1, equals + 1, error);
}

static inline void sim_rig_apply(gonio_sim *sim, const char *const *lines) {
    gonio_error error = {0};
    for (; lines != NULL && *lines != NULL; lines++) {
        if (sim_rig_set(sim, *lines, &error) != GONIO_OK) {
            fail_msg("%s: %s", *lines, error.message);
        }
    }
}

// basis and extra end with NULL and may be NULL.
static inline void sim_rig_open(sim_rig *r, const char *spec, uint64_t seed, int threads, const char *const *basis,
                                const char *const *extra) {
    gonio_error error = {0};
    if (gonio_sim_new(spec, seed, &r->sim, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    sim_rig_apply(r->sim, basis);
    sim_rig_apply(r->sim, extra);
    if (gonio_sim_open(r->sim, threads, &r->rig, &error) != GONIO_OK) {
        fail_msg("%s", error.message);
    }
    assert_int_equal(r->rig.camera->info(r->rig.camera_device, &r->info, NULL), GONIO_OK);
    assert_int_equal(r->rig.stage->home(r->rig.stage_device, SIM_LONG_S, NULL), GONIO_OK);
    assert_int_equal(r->rig.lamp->set_shutter(r->rig.lamp_device, true, NULL), GONIO_OK);
}

static inline void sim_rig_close(sim_rig *r) { gonio_sim_free(r->sim); }

static inline gonio_stamp sim_rig_move(sim_rig *r, int64_t pose, double ti, double pi, double to, double po) {
    const gonio_stamp stamp = {.pose = pose, .clock_s = 10000};
    const double target[GONIO_AXES] = {gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
    assert_int_equal(r->rig.stage->move(r->rig.stage_device, target, 1, &stamp, SIM_LONG_S, NULL), GONIO_OK);
    return stamp;
}

static inline gonio_window sim_rig_full(const sim_rig *r) {
    return (gonio_window){0, 0, r->info.width, r->info.height};
}

// The caller frees the pixels.
static inline uint16_t *sim_rig_capture(sim_rig *r, gonio_window window, double exposure_s, gonio_stamp stamp) {
    gonio_error error = {0};
    gonio_frame frame = {.pixels = malloc((size_t)window.width * (size_t)window.height * sizeof(uint16_t))};
    assert_non_null(frame.pixels);
    if (r->rig.camera->capture(r->rig.camera_device, &window, exposure_s, 0, &stamp, SIM_LONG_S, &frame, &error) !=
        GONIO_OK) {
        fail_msg("%s", error.message);
    }
    return frame.pixels;
}

#endif
