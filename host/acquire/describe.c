// The setup as JSON texts in the journal: people read them, and a replay needs nothing else.
//
// One table a struct names every member once; writing and reading both follow it.
#include <errno.h>
#include <jansson.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/output.h"
#include "host/acquire/acquire.h"

typedef enum kind { REAL, REALS, INTEGER, BOOLEAN, TEXT, SEED } kind;

typedef struct member {
    const char *name;
    kind kind;
    size_t offset, size; // size: of an array
    bool late;           // sessions of the first releases lack it, and have 0 there
} member;

#define M(type, name, kind)                                                                                            \
    { #name, kind, offsetof(type, name), sizeof(((type *)0)->name), false }
#define LATE(type, name, kind)                                                                                         \
    { #name, kind, offsetof(type, name), sizeof(((type *)0)->name), true }

static const member camera_members[] = {
    M(gonio_camera_info, name, TEXT),
    M(gonio_camera_info, serial, TEXT),
    M(gonio_camera_info, width, INTEGER),
    M(gonio_camera_info, height, INTEGER),
    M(gonio_camera_info, bits, INTEGER),
    M(gonio_camera_info, pattern, INTEGER),
    M(gonio_camera_info, exposure_min_s, REAL),
    M(gonio_camera_info, exposure_max_s, REAL),
    M(gonio_camera_info, fx, REAL),
    M(gonio_camera_info, fy, REAL),
    M(gonio_camera_info, cx, REAL),
    M(gonio_camera_info, cy, REAL),
    M(gonio_camera_info, k1, REAL),
    M(gonio_camera_info, k2, REAL),
    M(gonio_camera_info, p1, REAL),
    M(gonio_camera_info, p2, REAL),
    M(gonio_camera_info, k3, REAL),
    M(gonio_camera_info, read_out_s, REAL),
    {0},
};
static const member facts_members[] = {
    M(gonio_rig_facts, light_distance_mm, REAL),
    M(gonio_rig_facts, camera_distance_mm, REAL),
    M(gonio_rig_facts, pointing_random_deg, REAL),
    M(gonio_rig_facts, pointing_systematic_deg, REAL),
    M(gonio_rig_facts, reference_reflectance, REALS),
    M(gonio_rig_facts, reference_relative_sigma, REAL),
    M(gonio_rig_facts, lamp_drift_per_h, REAL),
    LATE(gonio_rig_facts, reference_radiance, REAL),
    LATE(gonio_rig_facts, irradiance, REAL),
    LATE(gonio_rig_facts, irradiance_monitor, REAL),
    LATE(gonio_rig_facts, stray_variation, REAL),
    LATE(gonio_rig_facts, glare_sigma, REAL),
    LATE(gonio_rig_facts, light_radius_mm, REAL),
    LATE(gonio_rig_facts, light_spot_mm, REAL),
    LATE(gonio_rig_facts, sample_mm, REALS),
    LATE(gonio_rig_facts, aperture_radius_mm, REAL),
    M(gonio_rig_facts, sphere, BOOLEAN),
    M(gonio_rig_facts, sphere_radius_mm, REAL),
    M(gonio_rig_facts, region_radius_mm, REAL),
    M(gonio_rig_facts, response_path, TEXT),
    LATE(gonio_rig_facts, reference_brdf, TEXT),
    LATE(gonio_rig_facts, flat_path, TEXT),
    M(gonio_rig_facts, operator_name, TEXT),
    M(gonio_rig_facts, notes, TEXT),
    M(gonio_rig_facts, sample_id, TEXT),
    M(gonio_rig_facts, serials, TEXT),
    {0},
};
static const member alignment_members[] = {
    M(gonio_alignment, known, BOOLEAN),
    M(gonio_alignment, value, REALS),
    M(gonio_alignment, covariance, REALS),
    M(gonio_alignment, sigma_rad, REAL),
    {0},
};
static const member scan_members[] = {
    M(gonio_scan_options, dark_frames, INTEGER),      LATE(gonio_scan_options, trap_frames, INTEGER),
    LATE(gonio_scan_options, motion_check, INTEGER),
    M(gonio_scan_options, reference_frames, INTEGER), M(gonio_scan_options, settle_s, REAL),
    M(gonio_scan_options, exposure_max_s, REAL),      M(gonio_scan_options, window_width, INTEGER),
    M(gonio_scan_options, window_height, INTEGER),    M(gonio_scan_options, hands, BOOLEAN),
    LATE(gonio_scan_options, audit_poses, INTEGER),   {0},
};
static const member window_members[] = {
    M(gonio_window, x, INTEGER),
    M(gonio_window, y, INTEGER),
    M(gonio_window, width, INTEGER),
    M(gonio_window, height, INTEGER),
    {0},
};
static const member fit_members[] = {
    M(gonio_setup, fit_method, TEXT),   M(gonio_setup, fit.level, INTEGER), M(gonio_setup, fit.tolerance, REAL),
    M(gonio_setup, fit.hold_out, REAL), M(gonio_setup, fit.seed, SEED),     {0},
};

// Every part of the setup: its key in the journal, its members, where it stands in gonio_setup.
static const struct part {
    const char *key;
    const member *members;
    size_t offset;
    bool optional; // sessions from before it had it lack it
} parts[] = {
    {"camera", camera_members, offsetof(gonio_setup, camera), false},
    {"facts", facts_members, offsetof(gonio_setup, facts), false},
    {"alignment", alignment_members, offsetof(gonio_setup, facts.alignment), true},
    {"scan", scan_members, offsetof(gonio_setup, scan), false},
    {"window", window_members, offsetof(gonio_setup, window), false},
    {"fit", fit_members, 0, false},
};
#define PARTS (sizeof parts / sizeof *parts)

static json_t *value_of(const member *m, const void *at) {
    switch (m->kind) {
    case REAL:
        return json_real(*(const double *)at);
    case REALS: {
        json_t *array = json_array();
        for (size_t k = 0; k < m->size / sizeof(double); k++) {
            json_array_append_new(array, json_real(((const double *)at)[k]));
        }
        return array;
    }
    case INTEGER:
        return json_integer(*(const int *)at);
    case BOOLEAN:
        return json_boolean(*(const bool *)at);
    case TEXT:
        return json_string(at);
    case SEED: {
        // JSON's integers are signed; a seed is not.
        char text[24];
        snprintf(text, sizeof text, "%llu", (unsigned long long)*(const uint64_t *)at);
        return json_string(text);
    }
    }
    return NULL;
}

static bool take(const member *m, const json_t *value, void *at) {
    switch (m->kind) {
    case REAL:
        *(double *)at = json_number_value(value);
        return json_is_number(value);
    case REALS:
        for (size_t k = 0; k < m->size / sizeof(double); k++) {
            ((double *)at)[k] = json_number_value(json_array_get(value, k));
        }
        return json_array_size(value) == m->size / sizeof(double);
    case INTEGER:
        *(int *)at = (int)json_integer_value(value);
        return json_is_integer(value);
    case BOOLEAN:
        *(bool *)at = json_is_true(value);
        return json_is_boolean(value);
    case TEXT:
        if (!json_is_string(value) || json_string_length(value) >= m->size) {
            return false;
        }
        strcpy(at, json_string_value(value));
        return true;
    case SEED:
        *(uint64_t *)at = json_is_string(value) ? strtoull(json_string_value(value), NULL, 10) : 0;
        return json_is_string(value);
    }
    return false;
}

static gonio_status put(gonio_session *session, const struct part *part, const gonio_setup *setup, gonio_error *error) {
    json_t *object = json_object();
    bool good = object != NULL;
    for (const member *m = part->members; good && m->name != NULL; m++) {
        good = json_object_set_new(object, m->name, value_of(m, (const char *)setup + part->offset + m->offset)) == 0;
    }
    char *text = good ? json_dumps(object, JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(17) | JSON_COMPACT) : NULL;
    json_decref(object);
    if (text == NULL) {
        return gonio_fail(error, GONIO_E_INPUT, "cannot journal '%s': a text that is not UTF-8, or an infinite number",
                          part->key);
    }
    const gonio_status status = gonio_session_put(session, part->key, text, error);
    free(text);
    return status;
}

static gonio_status get(gonio_session *session, const struct part *part, gonio_setup *setup, gonio_error *error) {
    char *text;
    gonio_status status = gonio_session_get(session, part->key, &text, error);
    if (status == GONIO_E_INPUT && part->optional) {
        return GONIO_OK;
    }
    if (status != GONIO_OK) {
        return status;
    }
    json_t *object = json_loads(text, 0, NULL);
    free(text);
    for (const member *m = part->members; status == GONIO_OK && m->name != NULL; m++) {
        const json_t *value = json_object_get(object, m->name);
        if (!(m->late && value == NULL) && !take(m, value, (char *)setup + part->offset + m->offset)) {
            status = gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                                     "setting '%s' has no sound value of '%s'", part->key, m->name);
        }
    }
    json_decref(object);
    return status;
}

// Files that the facts name are the rig's; the session keeps its own copies.
static const struct own_file {
    const char *what, *name;
    size_t offset; // of the path in gonio_rig_facts, 256 bytes
} own_files[] = {
    {"response curve", "response.csv", offsetof(gonio_rig_facts, response_path)},
    {"reference's BRDF", "reference.model", offsetof(gonio_rig_facts, reference_brdf)},
    {"flat field", "flat.map", offsetof(gonio_rig_facts, flat_path)},
};
#define OWN_FILES (sizeof own_files / sizeof *own_files)

// spec:... names no file.
static bool is_file(const char *path) { return path[0] != 0 && strncmp(path, "spec:", 5) != 0; }

static gonio_status copy_file(const char *what, const char *from, const char *to, gonio_error *error) {
    FILE *source = fopen(from, "rb");
    if (source == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, from, -1, "cannot read the %s: %s", what, strerror(errno));
    }
    gonio_output *output;
    gonio_status status = gonio_output_open(to, &output, error);
    if (status == GONIO_OK) {
        char buffer[4096];
        size_t got;
        while ((got = fread(buffer, 1, sizeof buffer, source)) > 0) {
            fwrite(buffer, 1, got, gonio_output_stream(output));
        }
        status = gonio_output_commit(output, error);
    }
    fclose(source);
    return status;
}

static gonio_status own_path(gonio_session *session, const struct own_file *file, char path[256], gonio_error *error) {
    return snprintf(path, 256, "%s/%s", gonio_session_path(session), file->name) < 256
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_INPUT, "the session's path is too long for its %s", file->what);
}

gonio_status gonio_setup_put(gonio_session *session, const gonio_setup *setup, gonio_error *error) {
    char bits[16], path[256];
    snprintf(bits, sizeof bits, "%d", setup->camera.bits);
    gonio_status status = gonio_session_put(session, "camera.bits", bits, error);
    for (size_t i = 0; status == GONIO_OK && i < PARTS; i++) {
        status = put(session, &parts[i], setup, error);
    }
    for (size_t i = 0; status == GONIO_OK && i < OWN_FILES; i++) {
        const char *from = (const char *)&setup->facts + own_files[i].offset;
        if (is_file(from)) {
            status = own_path(session, &own_files[i], path, error);
            status = status == GONIO_OK ? copy_file(own_files[i].what, from, path, error) : status;
        }
    }
    return status;
}

gonio_status gonio_setup_get(gonio_session *session, gonio_setup *setup, gonio_error *error) {
    *setup = (gonio_setup){0};
    gonio_fit_options_default(&setup->fit);
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < PARTS; i++) {
        status = get(session, &parts[i], setup, error);
    }
    for (size_t i = 0; status == GONIO_OK && i < OWN_FILES; i++) {
        char *path = (char *)&setup->facts + own_files[i].offset;
        if (is_file(path)) {
            status = own_path(session, &own_files[i], path, error);
        }
    }
    return status;
}

gonio_fit_options gonio_setup_fit(const gonio_setup *setup) {
    gonio_fit_options options = setup->fit;
    options.method = setup->fit_method[0] != 0 ? setup->fit_method : NULL;
    return options;
}

gonio_fit_options gonio_setup_slope_fit(const gonio_setup *setup) {
    gonio_fit_options options = gonio_setup_fit(setup);
    options.hold_out = 0;
    options.folds = 0;
    if (setup->facts.sphere) {
        options.method = "mba";
    }
    return options;
}
