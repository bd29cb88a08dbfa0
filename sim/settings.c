// SPDX-License-Identifier: BSD-3-Clause
// One table holds every setting: where it is stored, what is possible, its default; reading, writing and the list of
// what exists all come from it.
#include "sim/settings.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"

static bool parse_fault(const char *text, void *value) {
    sim_fault fault = {.pose = -1, .frame = -1, .times = 0};
    if (strcmp(text, "never") != 0) {
        char *end;
        errno = 0;
        fault.pose = strtoll(text, &end, 10);
        bool good = end != text && fault.pose >= 0;
        if (good && *end == ':') {
            text = end + 1;
            const long frame = strtol(text, &end, 10);
            good = end != text && frame >= 0 && frame <= INT32_MAX;
            fault.frame = (int32_t)frame;
        }
        if (good && *end == 'x') {
            text = end + 1;
            const long times = strtol(text, &end, 10);
            good = end != text && times > 0 && times <= INT32_MAX;
            fault.times = (int)times;
        }
        if (!good || *end != 0 || errno != 0) {
            return false;
        }
    }
    *(sim_fault *)value = fault;
    return true;
}

static void print_fault(const void *value, char *text, size_t size) {
    const sim_fault *fault = value;
    snprintf(text, size, fault->pose < 0 ? "never" : "%lld", (long long)fault->pose);
    if (fault->pose >= 0 && fault->frame >= 0) {
        gonio_text_append(text, size, ":%d", fault->frame);
    }
    if (fault->pose >= 0 && fault->times > 0) {
        gonio_text_append(text, size, "x%d", fault->times);
    }
}

static const gonio_key_form fault_form = {"POSE, POSE:FRAME, either followed by xTIMES, or never", parse_fault,
                                          print_fault};
GONIO_KEY_NAMES(patterns, "mono", "rggb", "bggr", "grbg", "gbrg") // of gonio_pattern
GONIO_KEY_NAMES(shapes, "flat", "sphere")

#define KEY(where, text, kind, member) .section = where, GONIO_KEY_NAMED(sim_settings, member, text, kind)
#define AXIS(name, index, limit)                                                                                       \
    {KEY("axis " name, "speed_deg_per_s", REAL, axis[index].speed_deg_per_s), 1e-3, 1e4, "20"},                        \
        {KEY("axis " name, "acceleration_deg_per_s2", REAL, axis[index].acceleration_deg_per_s2), 1e-3, 1e6, "40"},    \
        {KEY("axis " name, "jerk_deg_per_s3", REAL, axis[index].jerk_deg_per_s3), 0, 1e9, "0"},                        \
        {KEY("axis " name, "backlash_deg", REAL, axis[index].backlash_deg), 0, 10, "0.05"},                            \
        {KEY("axis " name, "min_deg", REAL, axis[index].min_deg), -720, 0, "-" limit},                                 \
        {KEY("axis " name, "max_deg", REAL, axis[index].max_deg), 0, 720, limit},                                      \
        {KEY("axis " name, "pointing_deg", REAL, axis[index].pointing_deg), 0, 10, "0.01"},                            \
        {KEY("axis " name, "tilt_deg", REAL, axis[index].tilt_deg), 0, 5, "0"}, {                                      \
        KEY("axis " name, "offset_mm", REAL, axis[index].offset_mm), 0, 10, "0"                                        \
    }
#define FAULT_KEY(name, index)                                                                                         \
    { KEY("faults", name, OWN, fault[index]), .standard = "never", .form = &fault_form }

const gonio_key gonio_sim_setting_keys[] = {
    {KEY("rig", "light_distance_mm", REAL, rig.light_distance_mm), 10, 1e5, "1000"},
    {KEY("rig", "camera_distance_mm", REAL, rig.camera_distance_mm), 10, 1e5, "1000"},
    {KEY("rig", "light_spot_mm", REAL, rig.light_spot_mm), 0, 1e5, "0"},
    {KEY("rig", "light_radius_mm", REAL, rig.light_radius_mm), 0, 1e3, "0"},
    {KEY("rig", "aperture_radius_mm", REAL, rig.aperture_radius_mm), 0, 1e3, "0"},
    {KEY("rig", "backlash_takeup", INTEGER, rig.backlash_takeup), 0, 1, "1"},
    AXIS("light_theta", GONIO_LIGHT_THETA, "95"),
    AXIS("light_phi", GONIO_LIGHT_PHI, "370"),
    AXIS("camera_theta", GONIO_CAMERA_THETA, "95"),
    AXIS("camera_phi", GONIO_CAMERA_PHI, "370"),
    {KEY("camera", "width", INTEGER, camera.width), 8, 8192, "640"},
    {KEY("camera", "height", INTEGER, camera.height), 8, 8192, "512"},
    {KEY("camera", "bits", INTEGER, camera.bits), 8, 16, "12"},
    {KEY("camera", "pattern", CHOICE, camera.pattern), .standard = "auto", .names = patterns,
     .automatic = SIM_PATTERN_AUTO},
    {KEY("camera", "full_well_e", REAL, camera.full_well_e), 10, 1e7, "10000"},
    {KEY("camera", "read_noise_e", REAL, camera.read_noise_e), 0, 1e4, "5"},
    {KEY("camera", "dark_e_per_s", REAL, camera.dark_e_per_s), 0, 1e5, "5"},
    {KEY("camera", "dark_nonuniformity_percent", REAL, camera.dark_nonuniformity_percent), 0, 30, "10"},
    {KEY("camera", "offset_nonuniformity_e", REAL, camera.offset_nonuniformity_e), 0, 1e3, "1"},
    {KEY("camera", "prnu_percent", REAL, camera.prnu_percent), 0, 15, "1"},
    {KEY("camera", "hot_pixel_percent", REAL, camera.hot_pixel_percent), 0, 100, "0.01"},
    {KEY("camera", "vignetting_percent", REAL, camera.vignetting_percent), 0, 90, "3"},
    {KEY("camera", "white_e_per_s", REAL, camera.white_e_per_s), 1, 1e12, "500000"},
    {KEY("camera", "fx_px", REAL, camera.fx_px), 1, 1e7, "auto", .automatic = NAN},
    {KEY("camera", "fy_px", REAL, camera.fy_px), 1, 1e7, "auto", .automatic = NAN},
    {KEY("camera", "cx_px", REAL, camera.cx_px), -1e5, 1e5, "auto", .automatic = NAN},
    {KEY("camera", "cy_px", REAL, camera.cy_px), -1e5, 1e5, "auto", .automatic = NAN},
    {KEY("camera", "k1", REAL, camera.k1), -1e3, 1e3, "-2"},
    {KEY("camera", "k2", REAL, camera.k2), -1e6, 1e6, "0"},
    {KEY("camera", "p1", REAL, camera.p1), -10, 10, "0"},
    {KEY("camera", "p2", REAL, camera.p2), -10, 10, "0"},
    {KEY("camera", "k3", REAL, camera.k3), -1e9, 1e9, "0"},
    {KEY("camera", "exposure_min_s", REAL, camera.exposure_min_s), 1e-9, 1e3, "20e-6"},
    {KEY("camera", "exposure_max_s", REAL, camera.exposure_max_s), 1e-9, 1e6, "20"},
    {KEY("camera", "read_out_s", REAL, camera.read_out_s), 0, 100, "0.02"},
    {KEY("camera", "moved_px", REAL, camera.moved_px), -1e3, 1e3, "0"},
    {KEY("camera", "moved_at", INTEGER, camera.moved_at), -1, 1e9, "-1"},
    {KEY("camera", "response", LINE, camera.response), .standard = "linear"},
    {KEY("camera", "response_known", INTEGER, camera.response_known), 0, 1, "1"},
    {KEY("lamp", "drift_percent_per_hour", REAL, lamp.drift_percent_per_hour), 0, 100, "0.5"},
    {KEY("lamp", "wander_percent", REAL, lamp.wander_percent), 0, 30, "0.05"},
    {KEY("lamp", "warm_up_percent", REAL, lamp.warm_up_percent), 0, 99, "5"},
    {KEY("lamp", "warm_up_s", REAL, lamp.warm_up_s), 1e-3, 1e6, "120"},
    {KEY("stray", "ambient_percent", REAL, stray.ambient_percent), 0, 50, "0.02"},
    {KEY("stray", "variation_percent", REAL, stray.variation_percent), 0, 30, "10"},
    {KEY("stray", "glare_percent", REAL, stray.glare_percent), 0, 20, "0.1"},
    {KEY("meter", "present", INTEGER, meter.present), 0, 1, "1"},
    {KEY("meter", "noise_percent", REAL, meter.noise_percent), 0, 100, "0.05"},
    {KEY("reference", "reflectance", REALS, reference.reflectance), 0.01, 1, "0.99"},
    {KEY("reference", "sigma_percent", REAL, reference.sigma_percent), 0, 30, "0.2"},
    {KEY("reference", "panel_mm", REAL, reference.panel_mm), 0.1, 1e5, "100"},
    {KEY("sample", "shape", CHOICE, sample.sphere), .standard = "flat", .names = shapes},
    {KEY("sample", "radius_mm", REAL, sample.radius_mm), 0.1, 1e4, "20"},
    {KEY("sample", "plate_mm", REAL, sample.plate_mm), 0.1, 1e5, "50"},
    {KEY("sample", "region_radius_mm", REAL, sample.region_radius_mm), 0.01, 1e4, "5"},
    {KEY("ball", "radius_mm", REAL, ball.radius_mm), 1, 1e3, "20"},
    {KEY("ball", "offset_mm", REAL, ball.offset_mm), 0, 100, "0.5"},
    FAULT_KEY("camera_timeout", SIM_FAULT_CAMERA_TIMEOUT),
    FAULT_KEY("camera_error", SIM_FAULT_CAMERA_ERROR),
    FAULT_KEY("stage_stall", SIM_FAULT_STAGE_STALL),
    FAULT_KEY("stage_timeout", SIM_FAULT_STAGE_TIMEOUT),
    FAULT_KEY("stage_estop", SIM_FAULT_STAGE_ESTOP),
    FAULT_KEY("lamp_off", SIM_FAULT_LAMP_OFF),
    FAULT_KEY("meter_error", SIM_FAULT_METER_ERROR),
    FAULT_KEY("interlock_open", SIM_FAULT_INTERLOCK_OPEN),
    FAULT_KEY("lost_steps", SIM_FAULT_LOST_STEPS),
    FAULT_KEY("encoder_silent", SIM_FAULT_ENCODER_SILENT),
    FAULT_KEY("encoder_frozen", SIM_FAULT_ENCODER_FROZEN),
    {0}};

void gonio_sim_settings_default(sim_settings *settings) {
    memset(settings, 0, sizeof *settings);
    gonio_key_standards(gonio_sim_setting_keys, settings);
}

// The sections, with a blank before each.
static void list_sections(char *text, size_t size) {
    for (const gonio_key *key = gonio_sim_setting_keys; key->name != NULL; key++) {
        if (key == gonio_sim_setting_keys || strcmp(key->section, key[-1].section) != 0) {
            gonio_text_append(text, size, " [%s]", key->section);
        }
    }
}

gonio_status gonio_sim_settings_set(sim_settings *settings, const char *section, const char *name, const char *value,
                                    gonio_error *error) {
    const gonio_key *key = gonio_key_find(gonio_sim_setting_keys, section, name);
    if (key != NULL) {
        return gonio_key_parse(key, settings, value, error);
    }
    char known[400] = "";
    gonio_key_list(gonio_sim_setting_keys, section, known, sizeof known);
    if (known[0] == 0) {
        list_sections(known, sizeof known);
    }
    return gonio_fail(error, GONIO_E_INPUT, "the simulated rig has no [%.60s] %.60s; it has:%s", section, name, known);
}

char *gonio_sim_settings_text(const sim_settings *settings) {
    char *text = NULL;
    size_t size = 0;
    FILE *stream = open_memstream(&text, &size);
    if (stream == NULL) {
        return NULL;
    }
    for (const gonio_key *key = gonio_sim_setting_keys; key->name != NULL; key++) {
        char value[300];
        gonio_key_print(key, settings, value, sizeof value);
        fprintf(stream, "%s.%s=%s\n", key->section, key->name, value);
    }
    if (fclose(stream) != 0) {
        free(text);
        return NULL;
    }
    return text;
}
