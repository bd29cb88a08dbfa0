// SPDX-License-Identifier: BSD-3-Clause
// What a session knows of its measurement, as the lines that go with its samples. Nothing in them differs between equal
// measures: where no real device took part there is neither instrument nor date.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "base/number.h"
#include "base/text.h"
#include "host/session/internal.h"

typedef struct head {
    gonio_session *session;
    const json_t *facts, *camera;
    char *lines;
    gonio_status status;
    gonio_error *error;
} head;

static void add(head *h, const char *key, const char *value) {
    if (h->status == GONIO_OK && value != NULL) {
        h->status = gonio_head_add(&h->lines, key, value, h->error);
    }
}

static void add_number(head *h, const char *key, double value) {
    char text[32];
    if (isfinite(value)) {
        gonio_text_shortest(value, text);
        add(h, key, text);
    }
}

static const char *text_of(const json_t *object, const char *member) {
    return json_string_value(json_object_get(object, member));
}

static double number_of(const head *h, const char *member) {
    return json_number_value(json_object_get(h->facts, member));
}

static void add_length(head *h, const char *key, double mm) {
    if (mm > 0) {
        add_number(h, key, mm);
    }
}

// A disc of that radius at that distance: half angle and solid angle. %.10g: libm's last digits are not part of it.
static void add_disc(head *h, const char *key, double radius_mm, double distance_mm) {
    if (!(radius_mm > 0 && distance_mm > 0)) {
        return;
    }
    char name[64], text[48];
    const double half = atan(radius_mm / distance_mm);
    snprintf(name, sizeof name, "%s_half_angle_deg", key);
    gonio_number_format(text, sizeof text, "%.10g", half * 180 / GONIO_PI);
    add(h, name, text);
    snprintf(name, sizeof name, "%s_solid_angle_sr", key);
    gonio_number_format(text, sizeof text, "%.10g", 4 * GONIO_PI * sin(half / 2) * sin(half / 2));
    add(h, name, text);
}

static void add_geometry(head *h) {
    const double light = number_of(h, "light_distance_mm"), camera = number_of(h, "camera_distance_mm");
    add_length(h, "light_distance_mm", light);
    add_length(h, "camera_distance_mm", camera);
    add_disc(h, "light", number_of(h, "light_radius_mm"), light);
    add_disc(h, "aperture", number_of(h, "aperture_radius_mm"), camera);
    add_length(h, "spot_mm", 2 * number_of(h, "light_spot_mm"));
    if (json_is_true(json_object_get(h->facts, "sphere"))) {
        add_length(h, "sphere_radius_mm", number_of(h, "sphere_radius_mm"));
    } else {
        add_length(h, "measured_mm", 2 * number_of(h, "region_radius_mm"));
    }
}

static void add_reference(head *h) {
    char text[128] = "", number[32];
    const json_t *reflectance = json_object_get(h->facts, "reference_reflectance");
    size_t i;
    json_t *value;
    if (number_of(h, "reference_radiance") > 0) {
        add(h, "reference", "a source of known radiance");
    } else {
        json_array_foreach((json_t *)reflectance, i, value) {
            gonio_text_shortest(json_number_value(value), number);
            gonio_text_append(text, sizeof text, "%s%s", i > 0 ? "/" : "", number);
        }
        add(h, "reference", "white panel");
        add(h, "reference_reflectance", text);
    }
    gonio_number_format(number, sizeof number, "%.10g", 100 * number_of(h, "reference_relative_sigma"));
    add(h, "reference_sigma_percent", number);
    add(h, "traceability", text_of(h->facts, "traceability"));
}

static char *setting(head *h, const char *key) {
    char *text = NULL;
    if (h->status == GONIO_OK) {
        h->status = gonio_session_find(h->session, key, &text, h->error);
    }
    return text;
}

// The first event's time; the caller frees it.
static char *begun(head *h) {
    sqlite3_stmt *rows;
    char *text = NULL;
    if (h->status != GONIO_OK ||
        gonio_session_prepare(h->session, "SELECT min(utc) FROM events", &rows, h->error) != GONIO_OK) {
        return NULL;
    }
    if (sqlite3_step(rows) == SQLITE_ROW && sqlite3_column_type(rows, 0) == SQLITE_TEXT) {
        text = strdup((const char *)sqlite3_column_text(rows, 0));
    }
    sqlite3_finalize(rows);
    return text;
}

static void add_instrument(head *h) {
    const char *name = text_of(h->camera, "name"), *serial = text_of(h->camera, "serial");
    if (name == NULL || strncmp(name, "simulated", strlen("simulated")) == 0) {
        return;
    }
    char text[160];
    snprintf(text, sizeof text, "%s%s%s", name, serial != NULL && serial[0] != 0 ? ", serial " : "",
             serial != NULL ? serial : "");
    add(h, "instrument", text);
    add(h, "serials", text_of(h->facts, "serials"));
    char *date = begun(h);
    add(h, "date", date);
    free(date);
}

static json_t *parsed(head *h, const char *key) {
    char *text = setting(h, key);
    json_t *object = text != NULL ? json_loads(text, 0, NULL) : NULL;
    free(text);
    return object;
}

gonio_status gonio_session_head(gonio_session *session, char **lines, gonio_error *error) {
    head h = {.session = session, .error = error};
    json_t *facts = parsed(&h, "facts"), *camera = parsed(&h, "camera");
    h.facts = facts;
    h.camera = camera;
    add(&h, "sample", text_of(facts, "sample_id"));
    char *spec = setting(&h, "sim.spec");
    add(&h, "simulated", spec);
    free(spec);
    add_instrument(&h);
    add(&h, "operator", text_of(facts, "operator_name"));
    add(&h, "light_polarisation", text_of(facts, "light_polarisation"));
    add(&h, "detector_polarisation", text_of(facts, "detector_polarisation"));
    add(&h, "temperature_c", text_of(facts, "temperature_c"));
    if (facts != NULL) {
        add_geometry(&h);
        add_reference(&h);
    }
    add(&h, "notes", text_of(facts, "notes"));
    json_decref(facts);
    json_decref(camera);
    if (h.status != GONIO_OK) {
        free(h.lines);
        h.lines = NULL;
    }
    *lines = h.lines;
    return h.status;
}
