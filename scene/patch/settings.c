// SPDX-License-Identifier: BSD-3-Clause
#include "scene/patch/settings.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/keys.h"
#include "base/text.h"
#include "scene/names.h"

GONIO_KEY_NAMES(shape_names, "sawtooth", "cylinders", "velvet", "heights", "mesh")

#define SECTION "patch"
#define ROW(member, kind) GONIO_KEY(patch_settings, member, kind), .section = SECTION

static const gonio_key keys[] = {
    {ROW(shape, CHOICE), .names = shape_names, .standard = "sawtooth"},
    {ROW(slope, REAL), .low = 0, .high = 89, .standard = "45"},
    {ROW(slope_2, REAL), .low = 0, .high = 89, .automatic = -1, .standard = "auto"},
    {ROW(radius, REAL), .low = 1e-3, .high = 0.5, .automatic = -1, .standard = "auto"},
    {ROW(gap, REAL), .low = 0, .high = 100, .standard = "0"},
    {ROW(count, INTEGER), .low = 1, .high = 256, .automatic = -1, .standard = "auto"},
    {ROW(vary, REAL), .low = 0, .high = 1, .standard = "0"},
    {ROW(segments, INTEGER), .low = 3, .high = 4096, .automatic = -1, .standard = "auto"},
    {ROW(length, REAL), .low = 1e-3, .high = 100, .standard = "3"},
    {ROW(lean, REAL), .low = 0, .high = 80, .standard = "25"},
    {ROW(seed, SEED), .standard = "1"},
    {ROW(width, REAL), .low = 1e-6, .high = 1e6, .standard = "1"},
    {ROW(height, REAL), .low = 1e-6, .high = 1e6, .automatic = -1, .standard = "auto"},
    {ROW(depth, REAL), .low = 0, .high = 1e6, .standard = "0.1"},
    {ROW(file, TEXT), .standard = ""},
    {ROW(materials_file, TEXT), .standard = ""},
    {ROW(rho, TEXT), .standard = ""},
    {ROW(rho_2, TEXT), .standard = ""},
    {0},
};

// "material", "material_2" ...: its number from 0 on, or -1.
static int material_number(const char *name) {
    if (strcmp(name, "material") == 0) {
        return 0;
    }
    int number, used = 0;
    const bool good = sscanf(name, "material_%2d%n", &number, &used) == 1 && name[used] == 0;
    return good && number >= 2 && number <= PATCH_MATERIALS_MAX ? number - 1 : -1;
}

static gonio_status set(patch_settings *s, const char *name, const char *value, gonio_error *error) {
    const int material = material_number(name);
    const gonio_key *key = gonio_key_find(keys, SECTION, name);
    if (material >= 0) {
        return (size_t)snprintf(s->material[material], PATCH_TEXT_MAX, "%s", value) < PATCH_TEXT_MAX
                   ? GONIO_OK
                   : gonio_fail(error, GONIO_E_INPUT, "%s: at most %d bytes", name, PATCH_TEXT_MAX - 1);
    }
    if (key == NULL) {
        char list[400] = "";
        gonio_key_list(keys, SECTION, list, sizeof list);
        return gonio_fail(error, GONIO_E_INPUT, "unknown key '%.60s'; there are%s material material_2 ... material_%d",
                          name, list, PATCH_MATERIALS_MAX);
    }
    return gonio_key_parse(key, s, value, error);
}

// ---- a preset ----

// "ggx:alpha=0.2,f0=0.5" holds commas of its own: what follows a material and is no key of the patch belongs to it.
static gonio_status set_item(patch_settings *s, char *item, int *material, gonio_error *error) {
    char *equals = strchr(item, '=');
    const size_t length = strcspn(item, "=");
    char name[64];
    snprintf(name, sizeof name, "%.*s", (int)length, item);
    const bool own = material_number(name) >= 0 || gonio_key_find(keys, SECTION, name) != NULL;
    if (!own && *material >= 0) {
        gonio_text_append(s->material[*material], PATCH_TEXT_MAX, ",%s", item);
        return GONIO_OK;
    }
    if (equals == NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "found '%.60s', expected KEY=VALUE", item);
    }
    *material = material_number(name);
    return set(s, name, equals + 1, error);
}

static gonio_status read_preset(const char *text, patch_settings *s, gonio_error *error) {
    char *copy = strdup(text);
    if (copy == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a patch");
    }
    gonio_error why = {.status = GONIO_OK};
    int material = -1;
    char *rest = copy, *item = strsep(&rest, ":");
    gonio_status status = set(s, "shape", item, &why);
    while (status == GONIO_OK && (item = strsep(&rest, ",")) != NULL) {
        if (item[0] != 0 || rest != NULL) { // nothing may stand behind the colon or the last comma
            status = set_item(s, item, &material, &why);
        }
    }
    free(copy);
    return status == GONIO_OK ? GONIO_OK : gonio_fail(error, GONIO_E_USAGE, "patch '%.100s': %s", text, why.message);
}

// ---- a file ----

static gonio_status read_lines(gonio_text *text, patch_settings *s, gonio_error *error) {
    char *name, *value, *comment;
    bool inside = false;
    while ((name = gonio_text_setting(text, &value, &comment)) != NULL) {
        gonio_error why = {.status = GONIO_OK};
        if (value == NULL && strcmp(name, "[" SECTION "]") == 0) {
            inside = true;
        } else if (value == NULL || !inside) {
            return gonio_text_fail(text, error, "found '%.60s', expected [" SECTION "] and then key = value", name);
        } else if (set(s, name, value, &why) != GONIO_OK) {
            return gonio_text_fail(text, error, "%s", why.message);
        }
    }
    return inside ? GONIO_OK : gonio_text_fail(text, error, "no section [" SECTION "]: not a patch");
}

static gonio_status read_file(const char *path, patch_settings *s, gonio_error *error) {
    gonio_text text;
    gonio_status status = gonio_text_open(path, 1 << 20, &text, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = read_lines(&text, s, error);
    gonio_text_free(&text);
    status = status == GONIO_OK ? gonio_scene_beside(path, s->file, sizeof s->file, error) : status;
    return status == GONIO_OK ? gonio_scene_beside(path, s->materials_file, sizeof s->materials_file, error) : status;
}

gonio_status gonio_patch_settings_read(const char *text, patch_settings *settings, gonio_error *error) {
    memset(settings, 0, sizeof *settings);
    gonio_key_standards(keys, settings);
    const size_t length = strcspn(text, ":");
    for (const char *const *name = shape_names(); *name != NULL; name++) {
        if (strlen(*name) == length && strncmp(*name, text, length) == 0) {
            return read_preset(text, settings, error);
        }
    }
    return read_file(text, settings, error);
}
