// SPDX-License-Identifier: BSD-3-Clause
// The host's own keys of a rig file, in one table.
#include "host/acquire/rig_keys.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"

typedef enum kind { TEXT, INTEGER, REAL, PERCENT, REFLECTANCE, WINDOW, MOUNT, SHAPE } kind;

typedef struct entry {
    const char *section, *key;
    kind kind;
    bool always; // also where the driver states the rig's numbers itself
    size_t offset, size;
    double low, high;
} entry;

#define AT(member) offsetof(rig_keys, member), sizeof(((rig_keys *)0)->member)

static const entry entries[] = {
    {"rig", "driver", TEXT, true, AT(driver), 0, 0},
    {"rig", "operator", TEXT, true, AT(facts.operator_name), 0, 0},
    {"rig", "notes", TEXT, true, AT(facts.notes), 0, 0},
    {"rig", "serials", TEXT, true, AT(facts.serials), 0, 0},
    {"rig", "alignment", TEXT, true, AT(alignment), 0, 0},
    {"sample", "id", TEXT, true, AT(facts.sample_id), 0, 0},
    {"sample", "spec", TEXT, true, AT(sample), 0, 0},
    {"scan", "dark_frames", INTEGER, true, AT(scan.dark_frames), 4, 1000},
    {"scan", "motion_check", INTEGER, true, AT(scan.motion_check), 0, 1},
    {"scan", "trap_frames", INTEGER, true, AT(scan.trap_frames), 0, 64},
    {"scan", "reference_frames", INTEGER, true, AT(scan.reference_frames), 2, 1000},
    {"scan", "settle_s", REAL, true, AT(scan.settle_s), 0, 600},
    {"scan", "audit_poses", INTEGER, true, AT(scan.audit_poses), 0, 1e6},
    {"scan", "exposure_max_s", REAL, true, AT(scan.exposure_max_s), 0, 3600},
    {"camera", "window", WINDOW, true, AT(scan.window_width), 2, 65536},
    {"mount", "by", MOUNT, true, AT(scan.hands), 0, 0},
    {"rig", "light_distance_mm", REAL, false, AT(facts.light_distance_mm), 10, 1e5},
    {"rig", "camera_distance_mm", REAL, false, AT(facts.camera_distance_mm), 10, 1e5},
    {"rig", "pointing_random_deg", REAL, false, AT(facts.pointing_random_deg), 0, 10},
    {"rig", "pointing_systematic_deg", REAL, false, AT(facts.pointing_systematic_deg), 0, 10},
    {"reference", "radiance_w_m2_sr", REAL, false, AT(facts.reference_radiance), 0, 1e9},
    {"reference", "irradiance_w_m2", REAL, false, AT(facts.irradiance), 0, 1e9},
    {"reference", "irradiance_monitor", REAL, false, AT(facts.irradiance_monitor), 0, 1e9},
    {"reference", "brdf", TEXT, true, AT(facts.reference_brdf), 0, 0},
    {"camera", "flat", TEXT, true, AT(facts.flat_path), 0, 0},
    {"rig", "light_radius_mm", REAL, false, AT(facts.light_radius_mm), 0, 1e3},
    {"rig", "aperture_radius_mm", REAL, false, AT(facts.aperture_radius_mm), 0, 1e3},
    {"stray", "variation_percent", PERCENT, false, AT(facts.stray_variation), 0, 100},
    {"stray", "glare_percent", PERCENT, false, AT(facts.glare_sigma), 0, 20},
    {"reference", "reflectance", REFLECTANCE, false, AT(facts.reference_reflectance), 0.01, 1},
    {"reference", "sigma_percent", PERCENT, false, AT(facts.reference_relative_sigma), 0, 100},
    {"lamp", "drift_percent_per_hour", PERCENT, false, AT(facts.lamp_drift_per_h), 0, 100},
    {"camera", "response", TEXT, false, AT(facts.response_path), 0, 0},
    {"sample", "shape", SHAPE, false, AT(facts.sphere), 0, 0},
    {"sample", "radius_mm", REAL, false, AT(facts.sphere_radius_mm), 0.1, 1e4},
    {"sample", "width_mm", REAL, false, AT(facts.sample_mm[0]), 0, 1e5},
    {"sample", "height_mm", REAL, false, AT(facts.sample_mm[1]), 0, 1e5},
    {"rig", "light_spot_mm", REAL, false, AT(facts.light_spot_mm), 0, 1e5},
    {"sample", "region_radius_mm", REAL, false, AT(facts.region_radius_mm), 0.01, 1e4},
};
#define COUNT (sizeof entries / sizeof *entries)

void gonio_rig_keys_default(rig_keys *keys) {
    *keys = (rig_keys){.driver = "sim",
                       .facts = {.light_distance_mm = 1000,
                                 .camera_distance_mm = 1000,
                                 .pointing_random_deg = 0.01,
                                 .pointing_systematic_deg = 0.01,
                                 .reference_reflectance = {0.99, 0.99, 0.99},
                                 .reference_relative_sigma = 0.01,
                                 .lamp_drift_per_h = 0.01,
                                 .stray_variation = 0.2,
                                 .glare_sigma = 0.002,
                                 .sphere_radius_mm = 20,
                                 .region_radius_mm = 5}};
    gonio_scan_options_default(&keys->scan);
}

static gonio_status bad(const entry *e, const char *value, const char *expected, gonio_error *error) {
    return gonio_fail(error, GONIO_E_INPUT, "[%s] %s: found '%s', expected %s", e->section, e->key, value, expected);
}

static bool number(const entry *e, const char *text, char **end, double *value) {
    *value = gonio_number_parse(text, end);
    return *end != text && *value >= e->low && *value <= e->high; // false for NaN too
}

static gonio_status set_number(const entry *e, void *at, const char *value, gonio_error *error) {
    char *end, expected[96];
    double v;
    if (!number(e, value, &end, &v) || *end != 0 || (e->kind == INTEGER && v != floor(v))) {
        snprintf(expected, sizeof expected, "%s from %g to %g", e->kind == INTEGER ? "a whole number" : "a number",
                 e->low, e->high);
        return bad(e, value, expected, error);
    }
    if (e->kind == INTEGER) {
        *(int *)at = (int)v;
    } else {
        *(double *)at = e->kind == PERCENT ? v / 100 : v;
    }
    return GONIO_OK;
}

static gonio_status set_reflectance(const entry *e, double *at, const char *value, gonio_error *error) {
    double v[3];
    char *end;
    const char *text = value;
    int n = 0;
    while (n < 3 && number(e, text, &end, &v[n])) {
        n++;
        if (*end != '/') {
            break;
        }
        text = end + 1;
    }
    if ((n != 1 && n != 3) || *end != 0) {
        return bad(e, value, "a number from 0.01 to 1, or three as r/g/b", error);
    }
    for (int c = 0; c < 3; c++) {
        at[c] = v[n == 3 ? c : 0];
    }
    return GONIO_OK;
}

static gonio_status set_window(const entry *e, rig_keys *keys, const char *value, gonio_error *error) {
    char *end;
    double width = 0, height = 0;
    if (strcmp(value, "full") == 0) {
        width = height = -1;
    } else if (strcmp(value, "auto") != 0) {
        const bool good = number(e, value, &end, &width) && *end == 'x' && number(e, end + 1, &end, &height) &&
                          *end == 0 && width == floor(width) && height == floor(height);
        if (!good) {
            return bad(e, value, "auto, full, or WIDTHxHEIGHT in pixels", error);
        }
    }
    keys->scan.window_width = (int)width;
    keys->scan.window_height = (int)height;
    return GONIO_OK;
}

static gonio_status set_choice(const entry *e, bool *at, const char *value, const char *no, const char *yes,
                               gonio_error *error) {
    char expected[64];
    snprintf(expected, sizeof expected, "%s or %s", no, yes);
    if (strcmp(value, yes) != 0 && strcmp(value, no) != 0) {
        return bad(e, value, expected, error);
    }
    *at = strcmp(value, yes) == 0;
    return GONIO_OK;
}

static gonio_status set_entry(const entry *e, rig_keys *keys, const char *value, gonio_error *error) {
    void *at = (char *)keys + e->offset;
    char expected[48];
    switch (e->kind) {
    case TEXT:
        if (strlen(value) >= e->size) {
            snprintf(expected, sizeof expected, "at most %zu bytes", e->size - 1);
            return bad(e, value, expected, error);
        }
        strcpy(at, value);
        return GONIO_OK;
    case INTEGER:
    case REAL:
    case PERCENT:
        return set_number(e, at, value, error);
    case REFLECTANCE:
        return set_reflectance(e, at, value, error);
    case WINDOW:
        return set_window(e, keys, value, error);
    case MOUNT:
        return set_choice(e, at, value, "changer", "operator", error);
    case SHAPE:
        return set_choice(e, at, value, "flat", "sphere", error);
    }
    return GONIO_E_FAILED;
}

gonio_status gonio_rig_keys_set(rig_keys *keys, bool stated, const char *section, const char *key, const char *value,
                                bool *known, gonio_error *error) {
    *known = false;
    for (size_t i = 0; i < COUNT; i++) {
        const entry *e = &entries[i];
        if ((e->always || !stated) && strcmp(e->section, section) == 0 && strcmp(e->key, key) == 0) {
            *known = true;
            return set_entry(e, keys, value, error);
        }
    }
    return GONIO_OK;
}

void gonio_rig_keys_list(bool stated, const char *section, char *text, size_t size) {
    size_t at = 0;
    for (size_t i = 0; i < COUNT && at < size; i++) {
        if ((entries[i].always || !stated) && strcmp(entries[i].section, section) == 0) {
            at += (size_t)snprintf(text + at, size - at, " %s", entries[i].key);
        }
    }
}
