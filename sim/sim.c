// SPDX-License-Identifier: BSD-3-Clause
#include "sim/internal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/random.h"
#include "sim/sample.h"

// A polished steel ball: nothing diffuse, a highlight of 1.6 deg (a few pixels, so that its centre is well defined).
#define BALL_SPEC "ward:rho_d=0.001,rho_s=0.5,alpha=0.02"
// Black glass behind a grey filter; the slight roughness makes the lamp's image a spot of about 1 mm on it.
#define MIRROR_SPEC "ward:rho_d=0.001,rho_s=0.002,alpha=0.001"

gonio_status gonio_sim_new(const char *spec, uint64_t seed, gonio_sim **out, gonio_error *error) {
    *out = NULL;
    gonio_sim *sim = calloc(1, sizeof *sim);
    if (sim == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the simulated rig");
    }
    sim->seed = seed;
    gonio_sim_settings_default(&sim->settings);
    const gonio_status status = gonio_sim_sample_parse(spec, &sim->settings, &sim->sample, error);
    if (status != GONIO_OK) {
        gonio_sim_free(sim);
        return status;
    }
    *out = sim;
    return GONIO_OK;
}

static void release_devices(gonio_sim *sim) {
    if (sim->seen != sim->sample) {
        gonio_model_free(sim->seen);
    }
    gonio_model_free(sim->ball);
    gonio_model_free(sim->mirror);
    sim->ball = sim->mirror = NULL;
    gonio_sim_sensor_free(sim->sensor);
    gonio_sim_response_free(sim->response);
    sim->seen = NULL;
    sim->sensor = NULL;
    sim->response = NULL;
}

void gonio_sim_free(gonio_sim *sim) {
    if (sim != NULL) {
        release_devices(sim);
        gonio_model_free(sim->sample);
        free(sim->texture.pixels);
        free(sim);
    }
}

gonio_status gonio_sim_set(gonio_sim *sim, const char *section, const char *key, const char *value,
                           gonio_error *error) {
    const gonio_status status = gonio_sim_settings_set(&sim->settings, section, key, value, error);
    sim->loses_steps = sim->loses_steps || sim->settings.fault[SIM_FAULT_LOST_STEPS].pose >= 0;
    return status;
}

bool gonio_sim_has_key(const char *section, const char *key) {
    return gonio_key_find(gonio_sim_setting_keys, section, key) != NULL;
}

void gonio_sim_keys(const char *section, char *text, size_t size) {
    text[0] = 0;
    gonio_key_list(gonio_sim_setting_keys, section, text, size);
}

gonio_status gonio_sim_fiducial(gonio_sim *sim, int width, int height, const uint16_t *pixels, double mm_per_px,
                                gonio_error *error) {
    if (width < 1 || height < 1 || !(mm_per_px > 0)) {
        return gonio_fail(error, GONIO_E_USAGE, "a fiducial of %d x %d pixels, %g mm each", width, height, mm_per_px);
    }
    const size_t n = (size_t)width * (size_t)height;
    float *copy = malloc(n * sizeof *copy);
    if (copy == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a fiducial of %d x %d pixels", width, height);
    }
    for (size_t i = 0; i < n; i++) {
        copy[i] = (float)fmin(pixels[i] / 255.0, 1);
    }
    free(sim->texture.pixels);
    sim->texture = (sim_texture){width, height, mm_per_px, copy};
    return GONIO_OK;
}

char *gonio_sim_settings(const gonio_sim *sim) { return gonio_sim_settings_text(&sim->settings); }

const gonio_model *gonio_sim_truth(const gonio_sim *sim) { return sim->seen != NULL ? sim->seen : sim->sample; }

void gonio_sim_true_facts(const gonio_sim *sim, double clock_s, gonio_sim_facts *facts) {
    memcpy(facts->angles_rad, sim->actual_rad, sizeof facts->angles_rad);
    memcpy(facts->reference_reflectance, sim->truth.reflectance, sizeof facts->reference_reflectance);
    facts->lamp_output = gonio_sim_lamp_curve(sim, clock_s);
    for (int k = 0; k < GONIO_AXES; k++) {
        facts->axis[k].direction = sim->truth.axis[k].direction;
        facts->axis[k].point = sim->truth.axis[k].point;
    }
    facts->ball_centre_mm = sim->truth.ball_centre;
}

// Periods of the lamp's wander: slower than a pose, faster than a session.
#define WANDER_PERIOD_MIN_S 600.0
#define WANDER_PERIOD_MAX_S 3600.0

// Where the axes stand in space: each direction and point off by normal errors across the axis.
static void draw_axes(gonio_sim *sim) {
    gonio_sim_axes_perfect(sim->truth.axis);
    for (int k = 0; k < GONIO_AXES; k++) {
        const sim_axis_settings *s = &sim->settings.axis[k];
        const bool tilt = k == GONIO_LIGHT_THETA || k == GONIO_CAMERA_THETA; // along y; the azimuths along z
        double n[4];
        for (uint32_t i = 0; i < 2; i++) {
            const sim_draw draw = gonio_sim_random(sim->seed, SIM_AXES, 0, 0, (uint32_t)k * 2 + i);
            gonio_sim_normals(&draw, n + 2 * i);
        }
        const double a = tan(gonio_radians(s->tilt_deg)) * n[0], b = tan(gonio_radians(s->tilt_deg)) * n[1];
        const double length = sqrt(1 + a * a + b * b), c = s->offset_mm * n[2], d = s->offset_mm * n[3];
        sim->truth.axis[k] = tilt ? (sim_axis){{a / length, 1 / length, b / length}, {c, 0, d}}
                                  : (sim_axis){{a / length, b / length, 1 / length}, {c, d, 0}};
    }
    double n[4];
    for (uint32_t i = 0; i < 2; i++) {
        const sim_draw draw = gonio_sim_random(sim->seed, SIM_AXES, 0, 0, 2 * GONIO_AXES + i);
        gonio_sim_normals(&draw, n + 2 * i);
    }
    const double offset = sim->settings.ball.offset_mm;
    sim->truth.ball_centre = (gonio_vec3){offset * n[0], offset * n[1], offset * n[2]};
}

static void draw_truth(gonio_sim *sim) {
    const sim_settings *s = &sim->settings;
    sim_truth *truth = &sim->truth;
    for (int k = 0; k < GONIO_AXES; k++) {
        truth->zero_error_rad[k] = gonio_radians(s->axis[k].pointing_deg / sqrt(2)) *
                                   gonio_sim_normal(sim->seed, SIM_ZERO_ERROR, 0, 0, (uint32_t)k);
    }
    const double scale = 1 + s->reference.sigma_percent / 100 * gonio_sim_normal(sim->seed, SIM_REFERENCE, 0, 0, 0);
    for (int c = 0; c < 3; c++) {
        truth->reflectance[c] = s->reference.reflectance[c] * scale;
    }
    // Scatter is positive and known to its order of magnitude: log-normal. Glare is positive too.
    truth->ambient = s->stray.ambient_percent / 100 * exp(0.5 * gonio_sim_normal(sim->seed, SIM_STRAY, 0, 0, 0));
    truth->glare = s->stray.glare_percent / 100 * fabs(gonio_sim_normal(sim->seed, SIM_STRAY, 0, 0, 1));
    truth->drift_per_s = s->lamp.drift_percent_per_hour / 100 / 3600 * gonio_sim_normal(sim->seed, SIM_DRIFT, 0, 0, 0);
    truth->wander_amplitude = s->lamp.wander_percent / 100 * sqrt(2.0 / SIM_WANDER_TERMS);
    for (uint32_t k = 0; k < SIM_WANDER_TERMS; k++) {
        const sim_draw draw = gonio_sim_random(sim->seed, SIM_WANDER, 0, 0, k);
        const double period_s =
            WANDER_PERIOD_MIN_S * pow(WANDER_PERIOD_MAX_S / WANDER_PERIOD_MIN_S, gonio_sim_uniform(&draw, 0));
        truth->wander_rad_per_s[k] = 2 * GONIO_PI / period_s;
        truth->wander_rad[k] = 2 * GONIO_PI * gonio_sim_uniform(&draw, 1);
    }
}

static gonio_status check_settings(const gonio_sim *sim, gonio_error *error) {
    const sim_settings *s = &sim->settings;
    if (s->sample.sphere && !sim->sample->isotropic) {
        return gonio_fail(error, GONIO_E_USAGE,
                          "an anisotropic sample cannot be a sphere: its mark has no direction "
                          "there; choose shape=flat");
    }
    if (s->sample.sphere && s->sample.radius_mm >= fmin(s->rig.camera_distance_mm, s->rig.light_distance_mm)) {
        return gonio_fail(error, GONIO_E_USAGE, "a sphere of radius %g mm would swallow the camera or the light",
                          s->sample.radius_mm);
    }
    if (s->camera.exposure_min_s > s->camera.exposure_max_s) {
        return gonio_fail(error, GONIO_E_INPUT, "[camera] exposure_min_s %g is above exposure_max_s %g",
                          s->camera.exposure_min_s, s->camera.exposure_max_s);
    }
    return GONIO_OK;
}

static void fill_facts(const gonio_sim *sim, gonio_rig_facts *facts) {
    const sim_settings *s = &sim->settings;
    double variance = 0; // the facts hold one figure for all axes: the root of their mean square
    double tilt = 0;     // an axis that stands askew turns its arm like a zero error
    for (int k = 0; k < GONIO_AXES; k++) {
        variance += s->axis[k].pointing_deg * s->axis[k].pointing_deg / GONIO_AXES;
        tilt += s->axis[k].tilt_deg * s->axis[k].tilt_deg / GONIO_AXES;
    }
    *facts = (gonio_rig_facts){.light_distance_mm = s->rig.light_distance_mm,
                               .camera_distance_mm = s->rig.camera_distance_mm,
                               .pointing_random_deg = sqrt(variance / 2),
                               .pointing_systematic_deg = sqrt(variance / 2 + 2 * tilt), // both axes of an arm
                               .reference_relative_sigma = s->reference.sigma_percent / 100,
                               .sample_mm = {s->sample.plate_mm, s->sample.plate_mm},
                               .light_spot_mm = s->rig.light_spot_mm,
                               .light_radius_mm = s->rig.light_radius_mm,
                               .aperture_radius_mm = s->rig.aperture_radius_mm,
                               .stray_variation = s->stray.variation_percent / 100,
                               .glare_sigma = s->stray.glare_percent / 100,
                               .lamp_drift_per_h = s->lamp.drift_percent_per_hour / 100,
                               .sphere = s->sample.sphere == 1,
                               .sphere_radius_mm = s->sample.radius_mm,
                               .region_radius_mm = s->sample.region_radius_mm};
    for (int c = 0; c < 3; c++) {
        facts->reference_reflectance[c] = s->reference.reflectance[c];
    }
    const bool is_file = s->camera.response[0] != 0 && strncmp(s->camera.response, "gamma:", 6) != 0 &&
                         strcmp(s->camera.response, "linear") != 0;
    if (is_file && s->camera.response_known) {
        snprintf(facts->response_path, sizeof facts->response_path, "%s", s->camera.response);
    }
    snprintf(facts->serials, sizeof facts->serials, "simulated rig, seed %llu", (unsigned long long)sim->seed);
}

static gonio_status prepare_devices(gonio_sim *sim, gonio_error *error) {
    gonio_camera_info info;
    gonio_sim_camera_describe(sim, &info);
    gonio_status status = gonio_sim_sample_seen(sim->sample, info.pattern == GONIO_MONO ? 1 : 3, &sim->seen, error);
    if (status == GONIO_OK) {
        status = gonio_sim_response_new(sim->settings.camera.response, &sim->response, error);
    }
    status = status == GONIO_OK ? gonio_model_from_spec(BALL_SPEC, &sim->ball, error) : status;
    status = status == GONIO_OK ? gonio_model_from_spec(MIRROR_SPEC, &sim->mirror, error) : status;
    if (status == GONIO_OK) {
        status = gonio_sim_sensor_new(&sim->settings, &info, sim->seed, sim->threads, &sim->sensor, error);
    }
    return status;
}

gonio_status gonio_sim_open(gonio_sim *sim, int threads, gonio_rig *rig, gonio_error *error) {
    gonio_status status = check_settings(sim, error);
    if (status != GONIO_OK) {
        return status;
    }
    release_devices(sim);
    sim->threads = threads;
    draw_truth(sim);
    draw_axes(sim);
    status = gonio_sim_stage_start(sim, error);
    status = status == GONIO_OK ? prepare_devices(sim, error) : status;
    if (status != GONIO_OK) {
        release_devices(sim);
        return status;
    }
    memset(sim->fault_hits, 0, sizeof sim->fault_hits);
    sim->moved = (gonio_stamp){.pose = -1};
    sim->lamp_level = 1;
    sim->shutter_open = false;
    sim->target = GONIO_TARGET_SAMPLE;
    *rig = (gonio_rig){.stage = &gonio_sim_stage_ops,
                       .stage_device = sim,
                       .lamp = &gonio_sim_lamp_ops,
                       .lamp_device = sim,
                       .camera = &gonio_sim_camera_ops,
                       .camera_device = sim,
                       .interlock = &gonio_sim_interlock_ops,
                       .interlock_device = sim,
                       .mount = &gonio_sim_mount_ops,
                       .mount_device = sim};
    if (sim->settings.meter.present) {
        rig->meter = &gonio_sim_meter_ops;
        rig->meter_device = sim;
    }
    fill_facts(sim, &rig->facts);
    return GONIO_OK;
}
