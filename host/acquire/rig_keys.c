// SPDX-License-Identifier: BSD-3-Clause
// The host's own keys of a rig file.
#include "host/acquire/rig_keys.h"

#include <math.h>
#include <string.h>

#include "base/number.h"
#include "io/declaration.h"

// The width and height of the window's pixels: 0, 0 is auto, -1, -1 full.
static bool parse_window(const char *text, void *value) {
    int *size = value;
    char *end, *last;
    double width = 0, height = 0;
    if (strcmp(text, "full") == 0) {
        width = height = -1;
    } else if (strcmp(text, "auto") != 0) {
        width = gonio_number_parse(text, &end);
        height = *end == 'x' ? gonio_number_parse(end + 1, &last) : NAN;
        if (!(width >= 2 && width <= 65536 && height >= 2 && height <= 65536) || *last != 0 || width != floor(width) ||
            height != floor(height)) {
            return false;
        }
    }
    size[0] = (int)width;
    size[1] = (int)height;
    return true;
}

static const gonio_key_form window = {"auto, full, or WIDTHxHEIGHT in pixels", parse_window, NULL};

// Texts that every samples file of the session will declare.
static bool parse_declared(const char *key, const char *text, char *value, size_t size) {
    if (strlen(text) >= size || !gonio_declaration_holds(key, text)) {
        return false;
    }
    strcpy(value, text);
    return true;
}
static bool parse_polarisation(const char *text, void *value) {
    return parse_declared("light_polarisation", text, value, 16);
}
static bool parse_temperature(const char *text, void *value) {
    return parse_declared("temperature_c", text, value, 16);
}
static const gonio_key_form polarisation = {"unpolarised, s, p, h, v, 45, 135, left or right", parse_polarisation,
                                            NULL};
static const gonio_key_form temperature = {"a temperature in degrees Celsius", parse_temperature, NULL};
GONIO_KEY_NAMES(hands, "changer", "operator")
GONIO_KEY_NAMES(shapes, "flat", "sphere")
GONIO_KEY_NAMES(switches, "on", "off")
#define KEY(where, text, kind, member) .section = where, GONIO_KEY_NAMED(rig_keys, member, text, kind)

const gonio_key gonio_rig_keys[] = {
    {KEY("rig", "driver", TEXT, driver), .standard = "sim"},
    {KEY("rig", "operator", TEXT, facts.operator_name)},
    {KEY("rig", "notes", TEXT, facts.notes)},
    {KEY("rig", "serials", TEXT, facts.serials)},
    {KEY("rig", "alignment", TEXT, alignment)},
    {KEY("sample", "id", TEXT, facts.sample_id)},
    {KEY("rig", "light_polarisation", OWN, facts.light_polarisation), .form = &polarisation},
    {KEY("rig", "detector_polarisation", OWN, facts.detector_polarisation), .form = &polarisation},
    {KEY("rig", "temperature_c", OWN, facts.temperature_c), .form = &temperature},
    {KEY("reference", "traceability", TEXT, facts.traceability)},
    {KEY("sample", "spec", TEXT, sample)},
    {KEY("scan", "dark_frames", INTEGER, scan.dark_frames), 4, 1000},
    {KEY("scan", "motion_check", INTEGER, scan.motion_check), 0, 1},
    {KEY("scan", "trap_frames", INTEGER, scan.trap_frames), 0, 64},
    {KEY("scan", "reference_frames", INTEGER, scan.reference_frames), 2, 1000},
    {KEY("scan", "settle_s", REAL, scan.settle_s), 0, 600},
    {KEY("scan", "audit_poses", INTEGER, scan.audit_poses), 0, 1e6},
    {KEY("scan", "encoder_audit_poses", INTEGER, scan.encoder_audit_poses), 0, 1e6},
    {KEY("scan", "exposure_max_s", REAL, scan.exposure_max_s), 0, 3600},
    {KEY("camera", "window", OWN, scan.window_width), .form = &window},
    {KEY("mount", "by", BOOLEAN, scan.hands), .names = hands},
    {KEY("session", "sync", BOOLEAN, scan.unsynced), .names = switches},
    {KEY("reference", "brdf", TEXT, facts.reference_brdf)},
    {KEY("camera", "flat", TEXT, facts.flat_path)},
    {0}};

const gonio_key gonio_rig_fact_keys[] = {
    {KEY("rig", "light_distance_mm", REAL, facts.light_distance_mm), 10, 1e5, "1000"},
    {KEY("rig", "camera_distance_mm", REAL, facts.camera_distance_mm), 10, 1e5, "1000"},
    {KEY("rig", "pointing_random_deg", REAL, facts.pointing_random_deg), 0, 10, "0.01"},
    {KEY("rig", "pointing_systematic_deg", REAL, facts.pointing_systematic_deg), 0, 10, "0.01"},
    {KEY("reference", "radiance_w_m2_sr", REAL, facts.reference_radiance), 0, 1e9},
    {KEY("reference", "irradiance_w_m2", REAL, facts.irradiance), 0, 1e9},
    {KEY("reference", "irradiance_monitor", REAL, facts.irradiance_monitor), 0, 1e9},
    {KEY("rig", "light_radius_mm", REAL, facts.light_radius_mm), 0, 1e3},
    {KEY("rig", "aperture_radius_mm", REAL, facts.aperture_radius_mm), 0, 1e3},
    {KEY("stray", "variation_percent", REAL, facts.stray_variation), 0, 100, "20", .times = 100},
    {KEY("stray", "glare_percent", REAL, facts.glare_sigma), 0, 20, "0.2", .times = 100},
    {KEY("reference", "reflectance", REALS, facts.reference_reflectance), 0.01, 1, "0.99"},
    {KEY("reference", "sigma_percent", REAL, facts.reference_relative_sigma), 0, 100, "1", .times = 100},
    {KEY("lamp", "drift_percent_per_hour", REAL, facts.lamp_drift_per_h), 0, 100, "1", .times = 100},
    {KEY("camera", "response", TEXT, facts.response_path)},
    {KEY("sample", "shape", BOOLEAN, facts.sphere), .names = shapes},
    {KEY("sample", "radius_mm", REAL, facts.sphere_radius_mm), 0.1, 1e4, "20"},
    {KEY("sample", "width_mm", REAL, facts.sample_mm[0]), 0, 1e5},
    {KEY("sample", "height_mm", REAL, facts.sample_mm[1]), 0, 1e5},
    {KEY("rig", "light_spot_mm", REAL, facts.light_spot_mm), 0, 1e5},
    {KEY("sample", "region_radius_mm", REAL, facts.region_radius_mm), 0.01, 1e4, "5"},
    {0}};

void gonio_rig_keys_default(rig_keys *keys) {
    *keys = (rig_keys){0};
    gonio_key_standards(gonio_rig_keys, keys);
    gonio_key_standards(gonio_rig_fact_keys, keys);
    gonio_scan_options_default(&keys->scan);
}
