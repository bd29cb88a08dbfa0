// SPDX-License-Identifier: BSD-3-Clause
#include "scene/patch/tile_files.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "gonio/scene.h"
#include "scene/mesh.h"
#include "scene/patch/picture.h"

// The material of every triangle by the code of the picture at its middle, seen from above: 0 is the first.
static gonio_status paint(const patch_settings *s, patch_mesh *mesh, gonio_error *error) {
    patch_picture picture;
    if (s->materials_file[0] == 0) {
        return GONIO_OK;
    }
    gonio_status status = gonio_patch_picture_read(s->materials_file, &picture, error);
    for (size_t t = 0; status == GONIO_OK && t < mesh->triangles; t++) {
        double x = 0, y = 0;
        for (int k = 0; k < 3; k++) {
            const float *p = mesh->positions + 3 * (size_t)mesh->corners[3 * t + (size_t)k];
            x += (double)p[0] / (3 * mesh->width);
            y += (double)p[1] / (3 * mesh->height);
        }
        const int column = (int)((x - floor(x)) * picture.width) % picture.width;
        const int row = (int)((1 - (y - floor(y))) * picture.height) % picture.height;
        const int code = picture.codes[row * picture.width + column];
        if (code >= PATCH_MATERIALS_MAX) {
            status = gonio_fail_line(error, GONIO_E_INPUT, s->materials_file, -1,
                                     "code %d at column %d, row %d; materials are 0 to %d", code, column, row,
                                     PATCH_MATERIALS_MAX - 1);
        } else {
            mesh->materials[t] = (uint8_t)code;
        }
    }
    free(picture.codes);
    return status;
}

// ---- heights ----

typedef struct height_field {
    int width, height;
    float *z; // 1 is white; rows from the top
} height_field;

static bool is_png(const char *path) {
    const char *dot = strrchr(path, '.');
    return dot == NULL || strcasecmp(dot, ".png") == 0;
}

static gonio_status check_size(const char *path, int width, int height, gonio_error *error) {
    return width <= PATCH_PICTURE_SIDE_MAX && height <= PATCH_PICTURE_SIDE_MAX
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_INPUT, path, -1, "%d x %d heights; at most %d a side are possible",
                                 width, height, PATCH_PICTURE_SIDE_MAX);
}

// A PNG's codes are heights as they stand; pictures of light (.exr, .pfm, .hdr) hold numbers, of which red is taken.
static gonio_status read_heights(const char *path, height_field *field, gonio_error *error) {
    patch_picture codes = {0};
    gonio_picture *light = NULL;
    gonio_status status =
        is_png(path) ? gonio_patch_picture_read(path, &codes, error) : gonio_picture_read(path, &light, error);
    if (status == GONIO_OK) {
        field->width = light != NULL ? light->width : codes.width;
        field->height = light != NULL ? light->height : codes.height;
        status = check_size(path, field->width, field->height, error);
    }
    const size_t pixels = status == GONIO_OK ? (size_t)field->width * (size_t)field->height : 0;
    field->z = pixels > 0 ? malloc(pixels * sizeof *field->z) : NULL;
    if (status == GONIO_OK && field->z == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", path);
    }
    for (size_t i = 0; status == GONIO_OK && i < pixels; i++) {
        field->z[i] =
            light != NULL ? light->rgb[3 * i] : (float)codes.codes[i] / (codes.bits == 16 ? 65535.0f : 255.0f);
    }
    free(codes.codes);
    gonio_picture_free(light);
    return status;
}

// A vertex a pixel, at its middle; the last column and row are the first ones again.
static void add_grid(const patch_settings *s, const height_field *p, patch_mesh *mesh) {
    const unsigned across = (unsigned)p->width + 1;
    for (int y = 0; y <= p->height; y++) {
        for (int x = 0; x <= p->width; x++) {
            const int row = p->height - 1 - y % p->height; // the picture's top is at +y
            gonio_patch_mesh_vertex(mesh, mesh->width * x / p->width, mesh->height * y / p->height,
                                    s->depth * (double)p->z[row * p->width + x % p->width]);
        }
    }
    for (unsigned y = 0; y < (unsigned)p->height; y++) {
        for (unsigned x = 0; x < (unsigned)p->width; x++) {
            const unsigned a = y * across + x;
            gonio_patch_mesh_triangle(mesh, a, a + 1, a + across + 1, 0);
            gonio_patch_mesh_triangle(mesh, a, a + across + 1, a + across, 0);
        }
    }
}

gonio_status gonio_patch_heights_make(const patch_settings *s, patch_mesh *mesh, gonio_error *error) {
    height_field field = {.z = NULL};
    if (s->file[0] == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "a patch of heights needs file = PICTURE");
    }
    gonio_status status = read_heights(s->file, &field, error);
    if (status == GONIO_OK) {
        const size_t pixels = (size_t)field.width * (size_t)field.height;
        mesh->width = s->width;
        mesh->height = s->height < 0 ? s->width * field.height / field.width : s->height;
        if (gonio_patch_mesh_reserve(mesh, (size_t)(field.width + 1) * (size_t)(field.height + 1), 2 * pixels)) {
            add_grid(s, &field, mesh);
            status = paint(s, mesh, error);
        } else {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu heights", pixels);
        }
    }
    free(field.z);
    return status;
}

// ---- meshes ----

static void bounds(const scene_mesh *from, double low[3], double high[3]) {
    for (int k = 0; k < 3; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        for (size_t v = 0; v < from->vertices; v++) {
            const double p = (double)from->positions[3 * v + (size_t)k];
            low[k] = fmin(low[k], p);
            high[k] = fmax(high[k], p);
        }
    }
}

static gonio_status copy(const scene_mesh *from, const patch_settings *s, patch_mesh *mesh, gonio_error *error) {
    double low[3], high[3];
    bounds(from, low, high);
    if (!(high[0] > low[0] && high[1] > low[1])) {
        return gonio_fail_line(error, GONIO_E_INPUT, s->file, -1, "it has no extent in x or in y; z is the normal");
    }
    if (!gonio_patch_mesh_reserve(mesh, from->vertices, from->triangles)) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", s->file);
    }
    const double scale = s->width / (high[0] - low[0]);
    mesh->width = s->width;
    mesh->height = s->height < 0 ? scale * (high[1] - low[1]) : s->height;
    for (size_t v = 0; v < from->vertices; v++) {
        const float *p = from->positions + 3 * v;
        gonio_patch_mesh_vertex(mesh, scale * ((double)p[0] - low[0]), scale * ((double)p[1] - low[1]),
                                scale * ((double)p[2] - low[2]));
    }
    for (size_t t = 0; t < from->triangles; t++) {
        const unsigned *c = from->indices + 3 * t;
        gonio_patch_mesh_triangle(mesh, c[0], c[1], c[2], 0);
    }
    return paint(s, mesh, error);
}

gonio_status gonio_patch_file_make(const patch_settings *s, patch_mesh *mesh, gonio_error *error) {
    scene_mesh *from;
    if (s->file[0] == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "a patch of a mesh needs file = MESH");
    }
    gonio_status status = gonio_scene_mesh_read(s->file, false, &from, error);
    if (status == GONIO_OK) {
        status = copy(from, s, mesh, error);
        gonio_scene_mesh_free(from);
    }
    return status;
}
