// SPDX-License-Identifier: BSD-3-Clause
#include "scene/world/geometry.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vector.h"
#include "scene/patch/picture.h"

// ---- the mesh's place ----

static gonio_vec3 turn(const double degrees[3], gonio_vec3 v) {
    v = turned(v, (gonio_vec3){1, 0, 0}, gonio_radians(degrees[0]));
    v = turned(v, (gonio_vec3){0, 1, 0}, gonio_radians(degrees[1]));
    return turned(v, (gonio_vec3){0, 0, 1}, gonio_radians(degrees[2]));
}

static void put(float *at, const scene_mesh_settings *s, double scale, bool moves) {
    gonio_vec3 v = turn(s->rotate, (gonio_vec3){scale * (double)at[0], scale * (double)at[1], scale * (double)at[2]});
    if (moves) {
        v = sum(v, (gonio_vec3){s->move[0], s->move[1], s->move[2]});
    }
    at[0] = (float)v.x;
    at[1] = (float)v.y;
    at[2] = (float)v.z;
}

static void place_mesh(scene_mesh *mesh, const scene_mesh_settings *s) {
    for (size_t v = 0; v < mesh->vertices; v++) {
        put(mesh->positions + 3 * v, s, s->scale, true);
        put(mesh->normals + 3 * v, s, 1, false);
        if (mesh->tangents != NULL) {
            put(mesh->tangents + 3 * v, s, 1, false);
        }
    }
}

// Every corner's normal becomes its facet's; corners of different faces are different vertices (mesh.c).
static void flatten(scene_mesh *mesh) {
    for (size_t t = 0; t < mesh->triangles; t++) {
        gonio_vec3 p[3];
        for (size_t k = 0; k < 3; k++) {
            const float *at = mesh->positions + 3 * (size_t)mesh->indices[3 * t + k];
            p[k] = (gonio_vec3){(double)at[0], (double)at[1], (double)at[2]};
        }
        const gonio_vec3 normal = cross(difference(p[1], p[0]), difference(p[2], p[0]));
        const double length = sqrt(dot(normal, normal)), scale = length > 0 ? 1 / length : 0;
        for (size_t k = 0; k < 3; k++) {
            float *at = mesh->normals + 3 * (size_t)mesh->indices[3 * t + k];
            at[0] = (float)(scale * normal.x);
            at[1] = (float)(scale * normal.y);
            at[2] = (float)(scale * normal.z);
        }
    }
}

// ---- materials of faces ----

int gonio_world_material_find(const scene_settings *settings, const char *name, size_t length) {
    for (int i = 0; i < settings->materials; i++) {
        if (strlen(settings->material[i].name) == length && strncmp(settings->material[i].name, name, length) == 0) {
            return i;
        }
    }
    return -1;
}

// The materials that a mesh's settings list; where they name none, the first.
static gonio_status list_materials(const char *path, const scene_settings *all, const scene_mesh_settings *s,
                                   uint16_t *list, int *n, gonio_error *error) {
    *n = 0;
    for (const char *at = s->material; *at != 0;) {
        at += strspn(at, ", \t");
        const size_t length = strcspn(at, ",");
        size_t name = length;
        while (name > 0 && (at[name - 1] == ' ' || at[name - 1] == '\t')) {
            name--;
        }
        const int found = gonio_world_material_find(all, at, name);
        if (name > 0 && found < 0) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, s->line, "[mesh %s]: no section [material %.*s]",
                                   s->name, (int)(name < 80 ? name : 80), at);
        }
        if (name > 0 && *n < SCENE_SECTIONS_MAX) {
            list[(*n)++] = (uint16_t)found;
        }
        at += length;
    }
    if (*n == 0) {
        list[(*n)++] = 0;
    }
    return GONIO_OK;
}

static gonio_status read_map(const char *path, const scene_mesh_settings *s, const uint16_t *list, int n,
                             world_material_map *map, gonio_error *error) {
    patch_picture picture = {0};
    if (s->material_map[0] == 0) {
        return GONIO_OK;
    }
    gonio_status status = gonio_patch_picture_read(s->material_map, &picture, error);
    const size_t pixels = (size_t)picture.width * (size_t)picture.height;
    for (size_t i = 0; i < pixels && status == GONIO_OK; i++) {
        if (picture.codes[i] >= n) {
            status = gonio_fail_line(
                error, GONIO_E_INPUT, s->material_map, -1,
                "code %d at column %zu, row %zu; the %d materials that line %lld of %s lists are 0 "
                "to %d",
                picture.codes[i], i % (size_t)picture.width, i / (size_t)picture.width, n, s->line, path, n - 1);
        } else {
            picture.codes[i] = list[picture.codes[i]];
        }
    }
    if (status != GONIO_OK) {
        free(picture.codes);
        return status;
    }
    *map = (world_material_map){picture.width, picture.height, picture.codes};
    return GONIO_OK;
}

// ---- joining ----

typedef struct joining {
    scene_mesh *all;
    uint16_t *material, *mesh; // [triangles]
} joining;

static bool grow(void *array, size_t count, size_t item) {
    void **pointer = array;
    void *longer = realloc(*pointer, count * item);
    *pointer = longer != NULL ? longer : *pointer;
    return longer != NULL;
}

static bool reserve(joining *j, size_t vertices, size_t triangles) {
    scene_mesh *all = j->all;
    return grow(&all->positions, 3 * vertices, sizeof(float)) && grow(&all->normals, 3 * vertices, sizeof(float)) &&
           grow(&all->tangents, 3 * vertices, sizeof(float)) && grow(&all->uvs, 2 * vertices, sizeof(float)) &&
           grow(&all->indices, 3 * triangles, sizeof(unsigned)) && grow(&j->material, triangles, sizeof(uint16_t)) &&
           grow(&j->mesh, triangles, sizeof(uint16_t));
}

static bool join(joining *j, const scene_mesh *one, int number) {
    scene_mesh *all = j->all;
    const size_t vertices = all->vertices, triangles = all->triangles;
    if (vertices + one->vertices > UINT32_MAX || !reserve(j, vertices + one->vertices, triangles + one->triangles)) {
        return false;
    }
    memcpy(all->positions + 3 * vertices, one->positions, 3 * one->vertices * sizeof(float));
    memcpy(all->normals + 3 * vertices, one->normals, 3 * one->vertices * sizeof(float));
    memset(all->tangents + 3 * vertices, 0, 3 * one->vertices * sizeof(float));
    memset(all->uvs + 2 * vertices, 0, 2 * one->vertices * sizeof(float));
    if (one->uvs != NULL) {
        memcpy(all->tangents + 3 * vertices, one->tangents, 3 * one->vertices * sizeof(float));
        memcpy(all->uvs + 2 * vertices, one->uvs, 2 * one->vertices * sizeof(float));
    }
    for (size_t c = 0; c < 3 * one->triangles; c++) {
        all->indices[3 * triangles + c] = one->indices[c] + (unsigned)vertices;
    }
    for (size_t t = 0; t < one->triangles; t++) {
        j->mesh[triangles + t] = (uint16_t)number;
    }
    all->vertices += one->vertices;
    all->triangles += one->triangles;
    return true;
}

// A face's own material where a section has its name; else what the mesh's settings say.
static void name_faces(const scene_settings *all, const scene_mesh *one, uint16_t standard, uint16_t *material) {
    for (size_t t = 0; t < one->triangles; t++) {
        const char *name = one->material_names[one->materials[t]];
        const int own = name[0] != 0 ? gonio_world_material_find(all, name, strlen(name)) : -1;
        material[t] = own >= 0 ? (uint16_t)own : standard;
    }
}

static gonio_status add(const char *path, gonio_scene *scene, joining *j, int number, gonio_error *error) {
    const scene_mesh_settings *s = &scene->settings->mesh[number];
    world_mesh *m = &scene->meshes[number];
    scene_mesh *one;
    uint16_t list[SCENE_SECTIONS_MAX];
    int n;
    gonio_status status = list_materials(path, scene->settings, s, list, &n, error);
    status = status == GONIO_OK ? gonio_scene_mesh_load(s->file, s->up == SCENE_UP_Z, &one, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    *m = (world_mesh){
        .first = j->all->triangles, .triangles = one->triangles, .vertices = one->vertices, .has_uv = one->uvs != NULL};
    place_mesh(one, s);
    if (!s->smooth) {
        flatten(one);
    }
    if (s->material_map[0] != 0 && !m->has_uv) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, s->file, -1,
                            "it has no texture coordinates, which material_map (%s, line %lld) needs", path, s->line);
    } else {
        status = read_map(path, s, list, n, &m->map, error);
    }
    if (status == GONIO_OK && !join(j, one, number)) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", s->file);
    }
    if (status == GONIO_OK) {
        name_faces(scene->settings, one, list[0], j->material + m->first);
    }
    gonio_scene_mesh_free(one);
    return status;
}

gonio_status gonio_world_geometry_read(const char *path, gonio_scene *scene, gonio_error *error) {
    joining j = {.all = calloc(1, sizeof *j.all)};
    gonio_status status = j.all != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a scene");
    scene->mesh = j.all;
    for (int i = 0; i < scene->settings->meshes && status == GONIO_OK; i++) {
        status = add(path, scene, &j, i, error);
    }
    scene->triangle_material = j.material;
    scene->triangle_mesh = j.mesh;
    for (int i = 0; i < scene->settings->meshes && status == GONIO_OK; i++) {
        size_t degenerate, open_edges;
        const world_mesh *m = &scene->meshes[i];
        if (!gonio_world_geometry_count(scene->mesh, m->first, m->triangles, &degenerate, &open_edges)) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a scene");
        }
        if (degenerate == m->triangles) {
            return gonio_fail_line(error, GONIO_E_INPUT, scene->settings->mesh[i].file, -1,
                                   "its faces have no area (%zu triangles)", m->triangles);
        }
        scene->facts.degenerate += degenerate;
        scene->facts.open_edges += open_edges;
    }
    scene->facts.triangles = scene->mesh->triangles;
    return status;
}
