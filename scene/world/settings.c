// SPDX-License-Identifier: BSD-3-Clause
#include "scene/world/settings.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/keys.h"
#include "base/text.h"
#include "scene/names.h"

GONIO_KEY_NAMES(light_names, "point", "directional", "environment")
GONIO_KEY_NAMES(up_names, "y", "z")

#define LIMIT 1e6 // of coordinates: float32 keeps a thousandth of a thousandth of the distance there

#define ROW(type, member, kind) GONIO_KEY(scene_##type##_settings, member, kind), .section = #type

static const gonio_key image_keys[] = {
    {ROW(image, width, INTEGER), .low = 1, .high = 16384, .standard = "512"},
    {ROW(image, height, INTEGER), .low = 1, .high = 16384, .standard = "512"},
    {ROW(image, samples, INTEGER), .low = 1, .high = 1 << 20, .standard = "16"},
    {ROW(image, interreflection, BOOLEAN), .standard = "0"},
    {0},
};
static const gonio_key camera_keys[] = {
    {ROW(camera, eye, REALS), .low = -LIMIT, .high = LIMIT, .standard = "0/0/4"},
    {ROW(camera, target, REALS), .low = -LIMIT, .high = LIMIT, .standard = "0"},
    {ROW(camera, up, REALS), .low = -LIMIT, .high = LIMIT, .standard = "0/1/0"},
    {ROW(camera, fov, REAL), .low = 0.01, .high = 170, .standard = "35"},
    {0},
};
static const gonio_key material_keys[] = {
    {ROW(material, model, LINE), .standard = "lambert:rho=0.5"},
    {ROW(material, albedo, REALS), .low = 0, .high = 1e6, .standard = "1"},
    {ROW(material, albedo_map, TEXT), .standard = ""},
    {0},
};
static const gonio_key mesh_keys[] = {
    {ROW(mesh, file, TEXT), .standard = ""},
    {ROW(mesh, material, TEXT), .standard = ""},
    {ROW(mesh, material_map, TEXT), .standard = ""},
    {ROW(mesh, up, CHOICE), .names = up_names, .standard = "y"},
    {ROW(mesh, scale, REAL), .low = 1e-9, .high = 1e9, .standard = "1"},
    {ROW(mesh, rotate, REALS), .low = -360, .high = 360, .standard = "0"},
    {ROW(mesh, move, REALS), .low = -LIMIT, .high = LIMIT, .standard = "0"},
    {ROW(mesh, smooth, BOOLEAN), .standard = "1"},
    {0},
};
static const gonio_key light_keys[] = {
    {ROW(light, kind, CHOICE), .names = light_names, .standard = "directional"},
    {ROW(light, position, REALS), .low = -LIMIT, .high = LIMIT, .standard = "0/0/4"},
    {ROW(light, toward, REALS), .low = -LIMIT, .high = LIMIT, .standard = "0/0/1"},
    {ROW(light, intensity, REALS), .low = 0, .high = 1e12, .standard = "1"},
    {ROW(light, file, TEXT), .standard = ""},
    {ROW(light, up, CHOICE), .names = up_names, .standard = "y"},
    {ROW(light, turn, REAL), .low = -360, .high = 360, .standard = "0"},
    {ROW(light, visible, BOOLEAN), .standard = "1"},
    {0},
};

// The kinds of sections; all but the image may be given several times, each then with a name of its own.
typedef struct kind {
    const char *name;
    const gonio_key *keys;
    size_t first, size, count; // offsets of the first object and of their number, and an object's size
    bool many;
} kind;
#define MANY(member, number)                                                                                           \
    {                                                                                                                  \
#member, member##_keys, offsetof(scene_settings, member), sizeof(scene_##member##_settings),                   \
            offsetof(scene_settings, number), true                                                                     \
    }
static const kind kinds[] = {
    {"image", image_keys, offsetof(scene_settings, image), sizeof(scene_image_settings), 0, false},
    MANY(camera, cameras),
    MANY(material, materials),
    MANY(mesh, meshes),
    MANY(light, lights),
};
#define KINDS ((int)(sizeof kinds / sizeof *kinds))

// All objects of many begin with their name and line.
typedef struct head {
    char name[SCENE_NAME_MAX];
    long long line;
} head;

static void *object_at(scene_settings *s, const kind *k, int i) { return (char *)s + k->first + k->size * (size_t)i; }
static int *count_of(scene_settings *s, const kind *k) { return (int *)(void *)((char *)s + k->count); }

static gonio_status name_object(const gonio_text *text, scene_settings *s, const kind *k, head *object,
                                const char *name, gonio_error *error) {
    const int n = *count_of(s, k);
    if (strlen(name) >= SCENE_NAME_MAX || strchr(name, ',') != NULL) {
        return gonio_text_fail(text, error, "[%s %.80s]: a name has at most %d bytes and no comma", k->name, name,
                               SCENE_NAME_MAX - 1);
    }
    for (int i = 0; i < n - 1; i++) {
        if (strcmp(((head *)object_at(s, k, i))->name, name) == 0) {
            return gonio_text_fail(text, error, "a second [%s%s%s]; the first stands on line %lld", k->name,
                                   name[0] != 0 ? " " : "", name, ((head *)object_at(s, k, i))->line);
        }
    }
    snprintf(object->name, sizeof object->name, "%s", name);
    object->line = text->line;
    return GONIO_OK;
}

// "[mesh ball]": the object that the settings below it are of.
static gonio_status begin(const gonio_text *text, scene_settings *s, char *line, const kind **k, void **object,
                          gonio_error *error) {
    const size_t length = strlen(line);
    if (line[0] != '[' || line[length - 1] != ']') {
        return gonio_text_fail(text, error, "found '%.60s', expected [SECTION] or key = value", line);
    }
    line[length - 1] = 0;
    char *name = line + 1 + strcspn(line + 1, " \t");
    if (*name != 0) {
        *name++ = 0;
    }
    name = gonio_text_trim(name);
    for (int i = 0; i < KINDS; i++) {
        if (strcmp(kinds[i].name, line + 1) != 0) {
            continue;
        }
        *k = &kinds[i];
        if (!kinds[i].many) {
            *object = object_at(s, *k, 0);
            return GONIO_OK;
        }
        if (*count_of(s, *k) >= SCENE_SECTIONS_MAX) {
            return gonio_text_fail(text, error, "more than %d sections [%s]", SCENE_SECTIONS_MAX, line + 1);
        }
        *object = object_at(s, *k, (*count_of(s, *k))++);
        gonio_key_standards(kinds[i].keys, *object);
        return name_object(text, s, *k, *object, name, error);
    }
    return gonio_text_fail(text, error, "unknown section [%.60s]; there are image, camera, material, mesh and light",
                           line + 1);
}

static gonio_status set(const gonio_text *text, const kind *k, void *object, const char *name, const char *value,
                        gonio_error *error) {
    const gonio_key *key = gonio_key_find(k->keys, k->name, name);
    if (key == NULL) {
        char list[400] = "";
        gonio_key_list(k->keys, k->name, list, sizeof list);
        return gonio_text_fail(text, error, "[%s] has no key '%.60s'; it has%s", k->name, name, list);
    }
    gonio_error why = {.status = GONIO_OK};
    return gonio_key_parse(key, object, value, &why) == GONIO_OK ? GONIO_OK
                                                                 : gonio_text_fail(text, error, "%s", why.message);
}

static gonio_status read_lines(gonio_text *text, scene_settings *s, gonio_error *error) {
    const kind *k = NULL;
    void *object = NULL;
    char *name, *value, *comment;
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && (name = gonio_text_setting(text, &value, &comment)) != NULL) {
        if (value == NULL) {
            status = begin(text, s, name, &k, &object, error);
        } else if (k == NULL) {
            status =
                gonio_text_fail(text, error, "found '%.60s' before any section, expected [mesh], [light] ...", name);
        } else {
            status = set(text, k, object, name, value, error);
        }
    }
    return status;
}

static gonio_status resolve_paths(const char *path, scene_settings *s, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; i < s->materials && status == GONIO_OK; i++) {
        scene_material_settings *m = &s->material[i];
        status = gonio_scene_model_name(path, m->model, sizeof m->model, error);
        status = status == GONIO_OK ? gonio_scene_beside(path, m->albedo_map, sizeof m->albedo_map, error) : status;
    }
    for (int i = 0; i < s->meshes && status == GONIO_OK; i++) {
        scene_mesh_settings *m = &s->mesh[i];
        status = gonio_scene_beside(path, m->file, sizeof m->file, error);
        status = status == GONIO_OK ? gonio_scene_beside(path, m->material_map, sizeof m->material_map, error) : status;
        if (status == GONIO_OK && m->file[0] == 0) {
            status = gonio_fail_line(error, GONIO_E_INPUT, path, m->line, "[mesh %s] has no file", m->name);
        }
    }
    for (int i = 0; i < s->lights && status == GONIO_OK; i++) {
        status = gonio_scene_beside(path, s->light[i].file, sizeof s->light[i].file, error);
    }
    return status;
}

gonio_status gonio_scene_settings_read(const char *path, scene_settings **out, gonio_error *error) {
    *out = NULL;
    gonio_text text;
    scene_settings *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a scene");
    }
    gonio_status status = gonio_text_open(path, 1 << 20, &text, error);
    if (status == GONIO_OK) {
        gonio_key_standards(image_keys, &s->image);
        status = read_lines(&text, s, error);
        gonio_text_free(&text);
    }
    if (status == GONIO_OK && s->meshes == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "no [mesh] in it: not a scene");
    }
    if (status == GONIO_OK && s->lights == 0) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "no [light] in it: the picture would be black");
    }
    status = status == GONIO_OK ? resolve_paths(path, s, error) : status;
    if (status != GONIO_OK) {
        free(s);
        return status;
    }
    *out = s;
    return GONIO_OK;
}
