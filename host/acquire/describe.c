// SPDX-License-Identifier: BSD-3-Clause
// The setup as JSON texts in the journal: people read them, and a replay needs nothing else.
//
// One table a struct names every member once (base/keys.h); writing and reading both follow it.
#include <jansson.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/keys.h"
#include "base/text.h"
#include "fit/options.h"
#include "gonio/output.h"
#include "host/acquire/acquire.h"
#include "io/spec.h"

// Bounds are wide, far beyond any rig: they keep what is computed finite, and what is allocated within a machine.
#define M(type, name, kind, low, high)                                                                                 \
    { GONIO_KEY(type, name, kind), low, high }
#define LATE(type, name, kind, low, high)                                                                              \
    { GONIO_KEY(type, name, kind), low, high, .late = true }
// Pixels of the full frame.
#define PIXELS_MAX ((int64_t)1 << 28)

static const gonio_key camera_members[] = {
    M(gonio_camera_info, name, TEXT, 0, 0),
    M(gonio_camera_info, serial, TEXT, 0, 0),
    M(gonio_camera_info, width, INTEGER, 1, 65536),
    M(gonio_camera_info, height, INTEGER, 1, 65536),
    M(gonio_camera_info, bits, INTEGER, 1, 16),
    M(gonio_camera_info, pattern, INTEGER, GONIO_MONO, GONIO_GBRG),
    M(gonio_camera_info, exposure_min_s, REAL, 0, 1e6),
    M(gonio_camera_info, exposure_max_s, REAL, 0, 1e6),
    M(gonio_camera_info, fx, REAL, 0, 1e9),
    M(gonio_camera_info, fy, REAL, 0, 1e9),
    M(gonio_camera_info, cx, REAL, -1e6, 1e6),
    M(gonio_camera_info, cy, REAL, -1e6, 1e6),
    M(gonio_camera_info, k1, REAL, -1e6, 1e6),
    M(gonio_camera_info, k2, REAL, -1e6, 1e6),
    M(gonio_camera_info, p1, REAL, -1e6, 1e6),
    M(gonio_camera_info, p2, REAL, -1e6, 1e6),
    M(gonio_camera_info, k3, REAL, -1e6, 1e6),
    M(gonio_camera_info, read_out_s, REAL, 0, 1e6),
    {0},
};
static const gonio_key facts_members[] = {
    M(gonio_rig_facts, light_distance_mm, REAL, 0, 1e6),
    M(gonio_rig_facts, camera_distance_mm, REAL, 0, 1e6),
    M(gonio_rig_facts, pointing_random_deg, REAL, 0, 90),
    M(gonio_rig_facts, pointing_systematic_deg, REAL, 0, 90),
    M(gonio_rig_facts, reference_reflectance, REALS, 0, 10),
    M(gonio_rig_facts, reference_relative_sigma, REAL, 0, 100),
    M(gonio_rig_facts, lamp_drift_per_h, REAL, 0, 100),
    LATE(gonio_rig_facts, reference_radiance, REAL, 0, 1e12),
    LATE(gonio_rig_facts, irradiance, REAL, 0, 1e12),
    LATE(gonio_rig_facts, irradiance_monitor, REAL, 0, 1e12),
    LATE(gonio_rig_facts, stray_variation, REAL, 0, 100),
    LATE(gonio_rig_facts, glare_sigma, REAL, 0, 100),
    LATE(gonio_rig_facts, light_radius_mm, REAL, 0, 1e6),
    LATE(gonio_rig_facts, light_spot_mm, REAL, 0, 1e6),
    LATE(gonio_rig_facts, sample_mm, REALS, 0, 1e6),
    LATE(gonio_rig_facts, aperture_radius_mm, REAL, 0, 1e6),
    M(gonio_rig_facts, sphere, BOOLEAN, 0, 0),
    M(gonio_rig_facts, sphere_radius_mm, REAL, 0, 1e6),
    M(gonio_rig_facts, region_radius_mm, REAL, 0, 1e6),
    M(gonio_rig_facts, response_path, TEXT, 0, 0),
    LATE(gonio_rig_facts, reference_brdf, TEXT, 0, 0),
    LATE(gonio_rig_facts, flat_path, TEXT, 0, 0),
    M(gonio_rig_facts, operator_name, TEXT, 0, 0),
    M(gonio_rig_facts, notes, TEXT, 0, 0),
    M(gonio_rig_facts, sample_id, TEXT, 0, 0),
    M(gonio_rig_facts, serials, TEXT, 0, 0),
    LATE(gonio_rig_facts, light_polarisation, TEXT, 0, 0),
    LATE(gonio_rig_facts, detector_polarisation, TEXT, 0, 0),
    LATE(gonio_rig_facts, temperature_c, TEXT, 0, 0),
    LATE(gonio_rig_facts, traceability, TEXT, 0, 0),
    {0},
};
static const gonio_key alignment_members[] = {
    M(gonio_alignment, known, BOOLEAN, 0, 0),
    M(gonio_alignment, value, REALS, -1e6, 1e6),
    M(gonio_alignment, covariance, REALS, -1e12, 1e12),
    M(gonio_alignment, sigma_rad, REAL, 0, 10),
    {0},
};
static const gonio_key scan_members[] = {
    M(gonio_scan_options, dark_frames, INTEGER, 0, 100000),
    LATE(gonio_scan_options, trap_frames, INTEGER, 0, 100000),
    LATE(gonio_scan_options, motion_check, INTEGER, 0, 1),
    M(gonio_scan_options, reference_frames, INTEGER, 0, 100000),
    M(gonio_scan_options, settle_s, REAL, 0, 1e6),
    M(gonio_scan_options, exposure_max_s, REAL, 0, 1e6),
    M(gonio_scan_options, window_width, INTEGER, -1, 65536),
    M(gonio_scan_options, window_height, INTEGER, -1, 65536),
    M(gonio_scan_options, hands, BOOLEAN, 0, 0),
    LATE(gonio_scan_options, audit_poses, INTEGER, 0, 1e9),
    LATE(gonio_scan_options, encoder_audit_poses, INTEGER, 0, 1e9),
    LATE(gonio_scan_options, needs, TEXT, 0, 0),
    {0},
};
static const gonio_key window_members[] = {
    M(gonio_window, x, INTEGER, 0, 65535),
    M(gonio_window, y, INTEGER, 0, 65535),
    M(gonio_window, width, INTEGER, 1, 65536),
    M(gonio_window, height, INTEGER, 1, 65536),
    {0},
};
// Every part of the setup: its key in the journal, its members, where it stands in gonio_setup.
static const struct part {
    const char *key;
    const gonio_key *members;
    size_t offset;
    bool optional;      // sessions from before it had it lack it
    const char *prefix; // of the members' names
} parts[] = {
    {"camera", camera_members, offsetof(gonio_setup, camera), false, ""},
    {"facts", facts_members, offsetof(gonio_setup, facts), false, ""},
    {"alignment", alignment_members, offsetof(gonio_setup, facts.alignment), true, ""},
    {"scan", scan_members, offsetof(gonio_setup, scan), false, ""},
    {"window", window_members, offsetof(gonio_setup, window), false, ""},
    {"fit", gonio_fit_keys, offsetof(gonio_setup, fit), false, "fit."},
};
#define PARTS (sizeof parts / sizeof *parts)

// Numbers as JSON's own where those hold them; what they do not hold, and names, as the texts of the command line.
static json_t *value_of(const gonio_key *m, const void *object) {
    const void *at = (const char *)object + m->offset;
    char text[256];
    switch (m->kind) {
    case GONIO_KEY_REAL:
        return json_real(*(const double *)at);
    case GONIO_KEY_REALS: {
        json_t *array = json_array();
        for (size_t k = 0; k < m->size / sizeof(double); k++) {
            json_array_append_new(array, json_real(((const double *)at)[k]));
        }
        return array;
    }
    case GONIO_KEY_INTEGER:
        return json_integer(*(const int *)at);
    case GONIO_KEY_BOOLEAN:
        return json_boolean(*(const bool *)at);
    case GONIO_KEY_TEXT:
    case GONIO_KEY_LINE:
        return json_string(at);
    case GONIO_KEY_SEED: // JSON's integers are signed; a seed is not
    case GONIO_KEY_SIZE:
    case GONIO_KEY_NAME:
    case GONIO_KEY_CHOICE:
    case GONIO_KEY_FLAGS:
    case GONIO_KEY_OWN:
        gonio_key_print(m, object, text, sizeof text);
        return json_string(text);
    }
    return NULL;
}

static bool within(const gonio_key *m, double value) {
    const bool bounded = m->low != 0 || m->high != 0;
    return isfinite(value) &&
           (!bounded || (value >= m->low && value <= m->high) || (m->automatic != 0 && value == m->automatic));
}

static bool take_number(const gonio_key *m, const json_t *value, double *number) {
    *number = json_number_value(value);
    return json_is_number(value) && within(m, *number);
}

static bool take_numbers(const gonio_key *m, const json_t *value, double *numbers) {
    const size_t n = m->size / sizeof *numbers;
    bool good = json_array_size(value) == n; // 0 of what is no array
    for (size_t k = 0; good && k < n; k++) {
        good = take_number(m, json_array_get(value, k), &numbers[k]);
    }
    return good;
}

static bool take_integer(const gonio_key *m, const json_t *value, int *number) {
    const json_int_t given = json_integer_value(value);
    const bool good = json_is_integer(value) && given >= INT_MIN && given <= INT_MAX && within(m, (double)given);
    *number = good ? (int)given : 0;
    return good;
}

static bool take(const gonio_key *m, const json_t *value, void *object) {
    void *at = (char *)object + m->offset;
    switch (m->kind) {
    case GONIO_KEY_REAL:
        return take_number(m, value, at);
    case GONIO_KEY_REALS:
        return take_numbers(m, value, at);
    case GONIO_KEY_INTEGER:
        return take_integer(m, value, at);
    case GONIO_KEY_BOOLEAN:
        *(bool *)at = json_is_true(value);
        return json_is_boolean(value);
    case GONIO_KEY_NAME:
        if (json_is_string(value) && json_string_length(value) == 0) {
            *(const char **)at = NULL;
            return true;
        }
        break;
    case GONIO_KEY_TEXT:
    case GONIO_KEY_SEED:
    case GONIO_KEY_SIZE:
    case GONIO_KEY_CHOICE:
    case GONIO_KEY_FLAGS:
    case GONIO_KEY_LINE:
    case GONIO_KEY_OWN:
        break;
    }
    return json_is_string(value) && gonio_key_parse(m, object, json_string_value(value), NULL) == GONIO_OK;
}

static json_t *find_value(const json_t *object, const char *prefix, const gonio_key *m) {
    char name[96];
    snprintf(name, sizeof name, "%s%s", prefix, m->name);
    json_t *value = json_object_get(object, name);
    return value != NULL || m->was == NULL ? value : json_object_get(object, m->was);
}

static gonio_status put(gonio_session *session, const struct part *part, const gonio_setup *setup, gonio_error *error) {
    json_t *object = json_object();
    bool good = object != NULL;
    for (const gonio_key *m = part->members; good && m->name != NULL; m++) {
        char name[96];
        snprintf(name, sizeof name, "%s%s", part->prefix, m->name);
        good = json_object_set_new(object, name, value_of(m, (const char *)setup + part->offset)) == 0;
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

static gonio_status fail_value(gonio_session *session, const struct part *part, const char *member, const json_t *value,
                               const char *expected, gonio_error *error) {
    char *text = value != NULL ? json_dumps(value, JSON_ENCODE_ANY | JSON_COMPACT) : NULL;
    char found[80] = "nothing";
    if (text != NULL) {
        gonio_text_printable(text, found, sizeof found);
    }
    free(text);
    return gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                           "table settings, row key = '%s', column value: found %s%s%s, expected %s", part->key, found,
                           member[0] != 0 ? " as " : "", member, expected);
}

static gonio_status take_all(gonio_session *session, const struct part *part, const json_t *object, gonio_setup *setup,
                             gonio_error *error) {
    if (!json_is_object(object)) {
        return fail_value(session, part, "", object, "a JSON object", error);
    }
    for (const gonio_key *m = part->members; m->name != NULL; m++) {
        const json_t *value = find_value(object, part->prefix, m);
        if (!(m->late && value == NULL) && !take(m, value, (char *)setup + part->offset)) {
            char expected[256];
            gonio_key_expected(m, expected, sizeof expected);
            return fail_value(session, part, m->name, value, expected, error);
        }
    }
    return GONIO_OK;
}

static gonio_status get(gonio_session *session, const struct part *part, gonio_setup *setup, gonio_error *error) {
    char *text;
    gonio_status status = gonio_session_find(session, part->key, &text, error);
    if (status != GONIO_OK || (text == NULL && part->optional)) {
        return status;
    }
    if (text == NULL) {
        return gonio_session_get(session, part->key, &text, error); // which says that it is missing
    }
    json_t *object = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
    free(text);
    status = take_all(session, part, object, setup, error);
    json_decref(object);
    return status;
}

// What no member tells by itself.
static gonio_status check_setup(gonio_session *session, const gonio_setup *setup, gonio_error *error) {
    const gonio_camera_info *c = &setup->camera;
    const gonio_window *w = &setup->window;
    if ((int64_t)c->width * c->height > PIXELS_MAX) {
        return gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                               "setting 'camera': found %d x %d pixels, expected at most %lld in all", c->width,
                               c->height, (long long)PIXELS_MAX);
    }
    if (w->x + w->width > c->width || w->y + w->height > c->height) {
        return gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                               "setting 'window': found %d x %d pixels at (%d, %d), expected a part of the camera's "
                               "%d x %d",
                               w->width, w->height, w->x, w->y, c->width, c->height);
    }
    return gonio_spec_check_file(setup->facts.reference_brdf, gonio_session_path(session), error);
}

// Files that the setup names are the rig's or a library's; the session keeps its own copies.
static const struct own_file {
    const char *what, *name;
    size_t offset; // of the path in gonio_setup, 256 bytes
    int64_t limit; // bytes
} own_files[] = {
    {"response curve", "response.csv", offsetof(gonio_setup, facts.response_path), 1 << 24},
    {"reference's BRDF", "reference.model", offsetof(gonio_setup, facts.reference_brdf), 1 << 30},
    {"flat field", "flat.map", offsetof(gonio_setup, facts.flat_path), 17 * PIXELS_MAX},
    {"prior", "library.prior", offsetof(gonio_setup, fit.prior), 1 << 30},
    {"needs", "scene.needs", offsetof(gonio_setup, scan.needs), 1 << 30},
};
#define OWN_FILES (sizeof own_files / sizeof *own_files)

// spec:... names no file.
static bool is_file(const char *path) { return path[0] != 0 && strncmp(path, "spec:", 5) != 0; }

// What another run left under the copy's name goes to lost+found/.
static gonio_status copy_file(gonio_session *session, const char *what, const char *from, const char *name,
                              const char *to, gonio_error *error) {
    char *data;
    size_t size;
    gonio_output *output;
    gonio_status status = gonio_file_read(from, 0, &data, &size, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_session_make_way(session, name, "a copy is made anew", error);
    status = status == GONIO_OK ? gonio_output_open(to, &output, error) : status;
    if (status == GONIO_OK) {
        fwrite(data, 1, size, gonio_output_stream(output));
        status = gonio_output_commit(output, error);
    }
    status = status == GONIO_OK ? gonio_session_put_file(session, what, from, data, size, error) : status;
    free(data);
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
        const char *from = (const char *)setup + own_files[i].offset;
        if (is_file(from)) {
            status = own_path(session, &own_files[i], path, error);
            status = status == GONIO_OK ? copy_file(session, own_files[i].what, from, own_files[i].name, path, error)
                                        : status;
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
        char *path = (char *)setup + own_files[i].offset;
        if (is_file(path)) {
            status = own_path(session, &own_files[i], path, error);
            status = status == GONIO_OK
                         ? gonio_session_check_file(session, own_files[i].name, own_files[i].limit, error)
                         : status;
        }
    }
    return status == GONIO_OK ? check_setup(session, setup, error) : status;
}

gonio_status gonio_spec_check_file(const char *spec, const char *file, gonio_error *error) {
    const char *path = strncmp(spec, "spec:", 5) == 0 ? spec + 5 : spec;
    if (strncmp(path, "file:", 5) != 0) {
        return GONIO_OK;
    }
    char *text = strdup(path + 5);
    if (text == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a path");
    }
    const char *key;
    struct stat info;
    while (gonio_spec_take_body(text, &key) != NULL) {
    }
    const bool other = stat(text, &info) == 0 && !S_ISREG(info.st_mode); // a missing one is told by who opens it
    free(text);
    return other ? gonio_fail_line(error, GONIO_E_INPUT, file, -1,
                                   "'%.200s' names a folder, a pipe or a device, expected a file", spec)
                 : GONIO_OK;
}

gonio_fit_options gonio_setup_slope_fit(const gonio_setup *setup) {
    gonio_fit_options options = setup->fit;
    options.hold_out = 0;
    options.folds = 0;
    // Samples do not depend on what the clock or the machine's memory allowed.
    options.max_ns = options.max_seconds = 0;
    options.max_memory = 0;
    options.prior[0] = 0;
    if (setup->facts.sphere) {
        gonio_fit_options_for(&options, "mba");
    }
    return options;
}
