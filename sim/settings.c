// SPDX-License-Identifier: BSD-3-Clause
// One table holds every setting: where it is stored, what is possible, its default; reading, writing and the list of
// what exists all come from it.
#include "sim/settings.h"

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"

typedef enum kind { REAL, AUTO_REAL, TRIPLE, INTEGER, CHOICE, TEXT, FAULT } kind;

typedef struct entry {
    const char *section, *key;
    kind kind;
    size_t offset;
    double low, high;
    const char *standard; // the default, as text
    const char *choices;  // CHOICE: the names of 0, 1, ... (first_choice, ...), each followed by a space
    int first_choice;
} entry;

#define AT(member) offsetof(sim_settings, member)
#define AXIS(name, index, limit)                                                                                         \
    {"axis " name, "speed_deg_per_s", REAL, AT(axis[index].speed_deg_per_s), 1e-3, 1e4, "20", 0, 0},                     \
        {"axis " name, "acceleration_deg_per_s2", REAL, AT(axis[index].acceleration_deg_per_s2), 1e-3, 1e6, "40", 0, 0}, \
        {"axis " name, "jerk_deg_per_s3", REAL, AT(axis[index].jerk_deg_per_s3), 0, 1e9, "0", 0, 0},                     \
        {"axis " name, "backlash_deg", REAL, AT(axis[index].backlash_deg), 0, 10, "0.05", 0, 0},                         \
        {"axis " name, "min_deg", REAL, AT(axis[index].min_deg), -720, 0, "-" limit, 0, 0},                              \
        {"axis " name, "max_deg", REAL, AT(axis[index].max_deg), 0, 720, limit, 0, 0},                                   \
        {"axis " name, "pointing_deg", REAL, AT(axis[index].pointing_deg), 0, 10, "0.01", 0, 0},                         \
        {"axis " name, "tilt_deg", REAL, AT(axis[index].tilt_deg), 0, 5, "0", 0, 0}, {                                   \
        "axis " name, "offset_mm", REAL, AT(axis[index].offset_mm), 0, 10, "0", 0, 0                                     \
    }
#define FAULT_KEY(name, index)                                                                                         \
    { "faults", name, FAULT, AT(fault[index]), 0, 0, "never", 0, 0 }

static const entry entries[] = {
    {"rig", "light_distance_mm", REAL, AT(rig.light_distance_mm), 10, 1e5, "1000", 0, 0},
    {"rig", "camera_distance_mm", REAL, AT(rig.camera_distance_mm), 10, 1e5, "1000", 0, 0},
    {"rig", "light_spot_mm", REAL, AT(rig.light_spot_mm), 0, 1e5, "0", 0, 0},
    {"rig", "light_radius_mm", REAL, AT(rig.light_radius_mm), 0, 1e3, "0", 0, 0},
    {"rig", "aperture_radius_mm", REAL, AT(rig.aperture_radius_mm), 0, 1e3, "0", 0, 0},
    {"rig", "backlash_takeup", INTEGER, AT(rig.backlash_takeup), 0, 1, "1", 0, 0},
    AXIS("light_theta", GONIO_LIGHT_THETA, "95"),
    AXIS("light_phi", GONIO_LIGHT_PHI, "370"),
    AXIS("camera_theta", GONIO_CAMERA_THETA, "95"),
    AXIS("camera_phi", GONIO_CAMERA_PHI, "370"),
    {"camera", "width", INTEGER, AT(camera.width), 8, 8192, "640", 0, 0},
    {"camera", "height", INTEGER, AT(camera.height), 8, 8192, "512", 0, 0},
    {"camera", "bits", INTEGER, AT(camera.bits), 8, 16, "12", 0, 0},
    {"camera", "pattern", CHOICE, AT(camera.pattern), 0, 0, "auto", "auto mono rggb bggr grbg gbrg ", SIM_PATTERN_AUTO},
    {"camera", "full_well_e", REAL, AT(camera.full_well_e), 10, 1e7, "10000", 0, 0},
    {"camera", "read_noise_e", REAL, AT(camera.read_noise_e), 0, 1e4, "5", 0, 0},
    {"camera", "dark_e_per_s", REAL, AT(camera.dark_e_per_s), 0, 1e5, "5", 0, 0},
    {"camera", "dark_nonuniformity_percent", REAL, AT(camera.dark_nonuniformity_percent), 0, 30, "10", 0, 0},
    {"camera", "offset_nonuniformity_e", REAL, AT(camera.offset_nonuniformity_e), 0, 1e3, "1", 0, 0},
    {"camera", "prnu_percent", REAL, AT(camera.prnu_percent), 0, 15, "1", 0, 0},
    {"camera", "hot_pixel_percent", REAL, AT(camera.hot_pixel_percent), 0, 100, "0.01", 0, 0},
    {"camera", "vignetting_percent", REAL, AT(camera.vignetting_percent), 0, 90, "3", 0, 0},
    {"camera", "white_e_per_s", REAL, AT(camera.white_e_per_s), 1, 1e12, "500000", 0, 0},
    {"camera", "fx_px", AUTO_REAL, AT(camera.fx_px), 1, 1e7, "auto", 0, 0},
    {"camera", "fy_px", AUTO_REAL, AT(camera.fy_px), 1, 1e7, "auto", 0, 0},
    {"camera", "cx_px", AUTO_REAL, AT(camera.cx_px), -1e5, 1e5, "auto", 0, 0},
    {"camera", "cy_px", AUTO_REAL, AT(camera.cy_px), -1e5, 1e5, "auto", 0, 0},
    {"camera", "k1", REAL, AT(camera.k1), -1e3, 1e3, "-2", 0, 0},
    {"camera", "k2", REAL, AT(camera.k2), -1e6, 1e6, "0", 0, 0},
    {"camera", "p1", REAL, AT(camera.p1), -10, 10, "0", 0, 0},
    {"camera", "p2", REAL, AT(camera.p2), -10, 10, "0", 0, 0},
    {"camera", "k3", REAL, AT(camera.k3), -1e9, 1e9, "0", 0, 0},
    {"camera", "exposure_min_s", REAL, AT(camera.exposure_min_s), 1e-9, 1e3, "20e-6", 0, 0},
    {"camera", "exposure_max_s", REAL, AT(camera.exposure_max_s), 1e-9, 1e6, "20", 0, 0},
    {"camera", "read_out_s", REAL, AT(camera.read_out_s), 0, 100, "0.02", 0, 0},
    {"camera", "moved_px", REAL, AT(camera.moved_px), -1e3, 1e3, "0", 0, 0},
    {"camera", "moved_at", INTEGER, AT(camera.moved_at), -1, 1e9, "-1", 0, 0},
    {"camera", "response", TEXT, AT(camera.response), 0, 0, "linear", 0, 0},
    {"camera", "response_known", INTEGER, AT(camera.response_known), 0, 1, "1", 0, 0},
    {"lamp", "drift_percent_per_hour", REAL, AT(lamp.drift_percent_per_hour), 0, 100, "0.5", 0, 0},
    {"lamp", "wander_percent", REAL, AT(lamp.wander_percent), 0, 30, "0.05", 0, 0},
    {"lamp", "warm_up_percent", REAL, AT(lamp.warm_up_percent), 0, 99, "5", 0, 0},
    {"lamp", "warm_up_s", REAL, AT(lamp.warm_up_s), 1e-3, 1e6, "120", 0, 0},
    {"stray", "ambient_percent", REAL, AT(stray.ambient_percent), 0, 50, "0.02", 0, 0},
    {"stray", "variation_percent", REAL, AT(stray.variation_percent), 0, 30, "10", 0, 0},
    {"stray", "glare_percent", REAL, AT(stray.glare_percent), 0, 20, "0.1", 0, 0},
    {"meter", "present", INTEGER, AT(meter.present), 0, 1, "1", 0, 0},
    {"meter", "noise_percent", REAL, AT(meter.noise_percent), 0, 100, "0.05", 0, 0},
    {"reference", "reflectance", TRIPLE, AT(reference.reflectance), 0.01, 1, "0.99", 0, 0},
    {"reference", "sigma_percent", REAL, AT(reference.sigma_percent), 0, 30, "0.2", 0, 0},
    {"reference", "panel_mm", REAL, AT(reference.panel_mm), 0.1, 1e5, "100", 0, 0},
    {"sample", "shape", CHOICE, AT(sample.sphere), 0, 0, "flat", "flat sphere ", 0},
    {"sample", "radius_mm", REAL, AT(sample.radius_mm), 0.1, 1e4, "20", 0, 0},
    {"sample", "plate_mm", REAL, AT(sample.plate_mm), 0.1, 1e5, "50", 0, 0},
    {"sample", "region_radius_mm", REAL, AT(sample.region_radius_mm), 0.01, 1e4, "5", 0, 0},
    {"ball", "radius_mm", REAL, AT(ball.radius_mm), 1, 1e3, "20", 0, 0},
    {"ball", "offset_mm", REAL, AT(ball.offset_mm), 0, 100, "0.5", 0, 0},
    FAULT_KEY("camera_timeout", SIM_FAULT_CAMERA_TIMEOUT),
    FAULT_KEY("camera_error", SIM_FAULT_CAMERA_ERROR),
    FAULT_KEY("stage_stall", SIM_FAULT_STAGE_STALL),
    FAULT_KEY("stage_timeout", SIM_FAULT_STAGE_TIMEOUT),
    FAULT_KEY("stage_estop", SIM_FAULT_STAGE_ESTOP),
    FAULT_KEY("lamp_off", SIM_FAULT_LAMP_OFF),
    FAULT_KEY("meter_error", SIM_FAULT_METER_ERROR),
    FAULT_KEY("interlock_open", SIM_FAULT_INTERLOCK_OPEN),
    FAULT_KEY("lost_steps", SIM_FAULT_LOST_STEPS),
};
#define COUNT (sizeof entries / sizeof *entries)

static gonio_status bad(const entry *e, const char *value, const char *expected, gonio_error *error) {
    return gonio_fail(error, GONIO_E_INPUT, "[%s] %s: found '%s', expected %s", e->section, e->key, value, expected);
}

static gonio_status bad_range(const entry *e, const char *value, gonio_error *error) {
    char expected[96];
    snprintf(expected, sizeof expected, "%s from %g to %g%s", e->kind == INTEGER ? "a whole number" : "a number",
             e->low, e->high, e->kind == AUTO_REAL ? ", or auto" : "");
    return bad(e, value, expected, error);
}

static bool parse_real(const entry *e, const char *text, char **end, double *value) {
    *value = gonio_number_parse(text, end);
    return *end != text && *value >= e->low && *value <= e->high; // false for NaN too
}

static gonio_status set_triple(const entry *e, double *at, const char *value, gonio_error *error) {
    double parsed[3];
    const char *text = value;
    int n = 0;
    for (; n < 3; n++) {
        char *end;
        if (!parse_real(e, text, &end, &parsed[n])) {
            return bad_range(e, value, error);
        }
        text = end + 1;
        if (*end == 0) {
            n++;
            break;
        }
        if (*end != '/' || n == 2) {
            return bad(e, value, "one number, or three as r/g/b", error);
        }
    }
    if (n == 2) {
        return bad(e, value, "one number, or three as r/g/b", error);
    }
    for (int c = 0; c < 3; c++) {
        at[c] = parsed[n == 3 ? c : 0];
    }
    return GONIO_OK;
}

static gonio_status set_choice(const entry *e, int *at, const char *value, gonio_error *error) {
    int index = e->first_choice;
    for (const char *name = e->choices; *name != 0; name += strcspn(name, " ") + 1, index++) {
        if (strlen(value) == strcspn(name, " ") && strncmp(name, value, strlen(value)) == 0) {
            *at = index;
            return GONIO_OK;
        }
    }
    char expected[96];
    snprintf(expected, sizeof expected, "one of: %s", e->choices);
    return bad(e, value, expected, error);
}

// POSE, POSE:FRAME or either with xTIMES; "never".
static gonio_status set_fault(const entry *e, sim_fault *at, const char *value, gonio_error *error) {
    sim_fault fault = {.pose = -1, .frame = -1, .times = 0};
    if (strcmp(value, "never") != 0) {
        char *end;
        errno = 0;
        fault.pose = strtoll(value, &end, 10);
        bool good = end != value && fault.pose >= 0;
        if (good && *end == ':') {
            const char *text = end + 1;
            const long frame = strtol(text, &end, 10);
            good = end != text && frame >= 0 && frame <= INT32_MAX;
            fault.frame = (int32_t)frame;
        }
        if (good && *end == 'x') {
            const char *text = end + 1;
            const long times = strtol(text, &end, 10);
            good = end != text && times > 0 && times <= INT32_MAX;
            fault.times = (int)times;
        }
        if (!good || *end != 0 || errno != 0) {
            return bad(e, value, "POSE, POSE:FRAME, either followed by xTIMES, or never", error);
        }
    }
    *at = fault;
    return GONIO_OK;
}

static gonio_status set_entry(const entry *e, sim_settings *settings, const char *value, gonio_error *error) {
    void *at = (char *)settings + e->offset;
    char *end;
    double real;
    switch (e->kind) {
    case AUTO_REAL:
        if (strcmp(value, "auto") == 0) {
            *(double *)at = NAN;
            return GONIO_OK;
        }
        // fall through
    case REAL:
        if (!parse_real(e, value, &end, &real) || *end != 0) {
            return bad_range(e, value, error);
        }
        *(double *)at = real;
        return GONIO_OK;
    case INTEGER:
        if (!parse_real(e, value, &end, &real) || *end != 0 || real != floor(real)) {
            return bad_range(e, value, error);
        }
        *(int *)at = (int)real;
        return GONIO_OK;
    case TRIPLE:
        return set_triple(e, at, value, error);
    case CHOICE:
        return set_choice(e, at, value, error);
    case TEXT:
        if (value[0] == 0 || strlen(value) >= sizeof settings->camera.response || strpbrk(value, "\r\n") != NULL) {
            return bad(e, value, "one line of 1 to 255 characters", error);
        }
        strcpy(at, value);
        return GONIO_OK;
    case FAULT:
        return set_fault(e, at, value, error);
    }
    return GONIO_E_FAILED;
}

void gonio_sim_settings_default(sim_settings *settings) {
    memset(settings, 0, sizeof *settings);
    for (size_t i = 0; i < COUNT; i++) {
        set_entry(&entries[i], settings, entries[i].standard, NULL);
    }
}

bool gonio_sim_settings_has(const char *section, const char *key) {
    for (size_t i = 0; i < COUNT; i++) {
        if (strcmp(entries[i].section, section) == 0 && strcmp(entries[i].key, key) == 0) {
            return true;
        }
    }
    return false;
}

void gonio_sim_settings_list(const char *section, char *text, size_t size) {
    size_t used = 0;
    text[0] = 0;
    for (size_t i = 0; i < COUNT && used < size; i++) {
        if (strcmp(entries[i].section, section) == 0) {
            used += (size_t)snprintf(text + used, size - used, " %s", entries[i].key);
        }
    }
}

// The sections, with a blank before each.
static void list_sections(char *text, size_t size) {
    size_t used = 0;
    text[0] = 0;
    for (size_t i = 0; i < COUNT && used < size; i++) {
        if (i == 0 || strcmp(entries[i].section, entries[i - 1].section) != 0) {
            used += (size_t)snprintf(text + used, size - used, " [%s]", entries[i].section);
        }
    }
}

gonio_status gonio_sim_settings_set(sim_settings *settings, const char *section, const char *key, const char *value,
                                    gonio_error *error) {
    for (size_t i = 0; i < COUNT; i++) {
        if (strcmp(entries[i].section, section) == 0 && strcmp(entries[i].key, key) == 0) {
            return set_entry(&entries[i], settings, value, error);
        }
    }
    char known[400];
    gonio_sim_settings_list(section, known, sizeof known);
    if (known[0] == 0) {
        list_sections(known, sizeof known);
    }
    return gonio_fail(error, GONIO_E_INPUT, "the simulated rig has no [%.60s] %.60s; it has:%s", section, key, known);
}

static int print_fault(char *text, size_t size, const sim_fault *fault) {
    if (fault->pose < 0) {
        return snprintf(text, size, "never");
    }
    char frame[16] = "", times[16] = "";
    if (fault->frame >= 0) {
        snprintf(frame, sizeof frame, ":%d", fault->frame);
    }
    if (fault->times > 0) {
        snprintf(times, sizeof times, "x%d", fault->times);
    }
    return snprintf(text, size, "%lld%s%s", (long long)fault->pose, frame, times);
}

static void print_value(const entry *e, const sim_settings *settings, char *text, size_t size) {
    const void *at = (const char *)settings + e->offset;
    const double *real = at;
    const char *name = e->choices;
    switch (e->kind) {
    case AUTO_REAL:
    case REAL:
        gonio_number_format(text, size, isnan(*real) ? "auto" : "%.17g", *real);
        return;
    case INTEGER:
        snprintf(text, size, "%d", *(const int *)at);
        return;
    case TRIPLE:
        gonio_number_format(text, size, "%.17g/%.17g/%.17g", real[0], real[1], real[2]);
        return;
    case CHOICE:
        for (int index = e->first_choice; index < *(const int *)at; index++) {
            name += strcspn(name, " ") + 1;
        }
        snprintf(text, size, "%.*s", (int)strcspn(name, " "), name);
        return;
    case TEXT:
        snprintf(text, size, "%s", (const char *)at);
        return;
    case FAULT:
        print_fault(text, size, at);
        return;
    }
}

char *gonio_sim_settings_text(const sim_settings *settings) {
    char *text = NULL;
    size_t size = 0;
    FILE *stream = open_memstream(&text, &size);
    if (stream == NULL) {
        return NULL;
    }
    for (size_t i = 0; i < COUNT; i++) {
        char value[300];
        print_value(&entries[i], settings, value, sizeof value);
        fprintf(stream, "%s.%s=%s\n", entries[i].section, entries[i].key, value);
    }
    if (fclose(stream) != 0) {
        free(text);
        return NULL;
    }
    return text;
}
