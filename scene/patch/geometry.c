// SPDX-License-Identifier: BSD-3-Clause
// The shapes that are made: sawtooth, parallel cylinders, fibres (DeYoung 1996, figures 2.3, 2.6 and 5.7).
#include "scene/patch/geometry.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "gonio/direction.h"
#include "scene/patch/tile_files.h"

// ---- profiles: z over x, the same for every y ----

typedef struct profile_point {
    double x, z;
    int material; // of what follows
} profile_point;

static bool extrude(const profile_point *points, size_t n, patch_mesh *mesh) {
    if (!gonio_patch_mesh_reserve(mesh, 2 * n, 2 * (n - 1))) {
        return false;
    }
    for (size_t k = 0; k < n; k++) {
        gonio_patch_mesh_vertex(mesh, points[k].x, 0, points[k].z);
        gonio_patch_mesh_vertex(mesh, points[k].x, mesh->height, points[k].z);
    }
    for (unsigned k = 0; k + 1 < n; k++) {
        gonio_patch_mesh_triangle(mesh, 2 * k, 2 * k + 2, 2 * k + 3, points[k].material);
        gonio_patch_mesh_triangle(mesh, 2 * k, 2 * k + 3, 2 * k + 1, points[k].material);
    }
    return true;
}

// The side that rises toward +x faces -x and is of the first material; the ridge stands where both meet.
static bool make_sawtooth(const patch_settings *s, patch_mesh *mesh) {
    const double up = tan(gonio_radians(s->slope)), down = tan(gonio_radians(s->slope_2 < 0 ? s->slope : s->slope_2));
    const double ridge = up + down > 0 ? down / (up + down) : 0.5;
    mesh->width = mesh->height = 1;
    return extrude((const profile_point[]){{0, 0, 0}, {ridge, ridge * up, 1}, {1, 0, 0}}, 3, mesh);
}

// Half cylinders along y on the plane z = 0, side by side or `gap` apart, each raised by a random share of `vary`.
static bool make_cylinders(const patch_settings *s, patch_mesh *mesh) {
    const size_t count = s->count < 0 ? (s->vary > 0 ? 16 : 1) : (size_t)s->count;
    const size_t segments = s->segments < 0 ? 128 : (size_t)s->segments;
    const double pitch = 1.0 / (double)count, radius = pitch / (2 * (1 + s->gap));
    profile_point *points = malloc(count * (segments + 3) * sizeof *points + sizeof *points);
    if (points == NULL) {
        return false;
    }
    size_t n = 0;
    for (size_t c = 0; c < count; c++) {
        const double middle = ((double)c + 0.5) * pitch;
        const double lift = radius * s->vary * gonio_random_uniform(s->seed * 0x10001 + c);
        points[n++] = (profile_point){middle - pitch / 2, 0, 1};
        for (size_t k = 0; k <= segments; k++) {
            const double angle = GONIO_PI * (1 - (double)k / (double)segments);
            const double rise = k == 0 || k == segments ? 0 : radius * sin(angle);
            points[n++] = (profile_point){middle + radius * cos(angle), lift + rise, k < segments ? 0 : 1};
        }
        points[n++] = (profile_point){middle + pitch / 2, 0, 1};
    }
    mesh->width = mesh->height = 1;
    const bool good = extrude(points, n, mesh);
    free(points);
    return good;
}

// ---- fibres ----

// A closed prism from the plane up to its slanting end.
static void add_fibre(patch_mesh *mesh, double x, double y, double radius, double length, double lean, double azimuth,
                      size_t segments) {
    const double dx = length * sin(lean) * cos(azimuth), dy = length * sin(lean) * sin(azimuth);
    const double top = length * cos(lean);
    const unsigned tip = gonio_patch_mesh_vertex(mesh, x + dx, y + dy, top + 0.5 * radius);
    const unsigned first = (unsigned)mesh->vertices;
    for (size_t k = 0; k < segments; k++) {
        const double angle = 2 * GONIO_PI * (double)k / (double)segments;
        const double px = x + radius * cos(angle), py = y + radius * sin(angle);
        gonio_patch_mesh_vertex(mesh, px, py, 0);
        gonio_patch_mesh_vertex(mesh, px + dx, py + dy, top);
    }
    for (size_t k = 0; k < segments; k++) {
        const unsigned a = first + 2 * (unsigned)k, b = first + 2 * (unsigned)((k + 1) % segments);
        gonio_patch_mesh_triangle(mesh, a, b, b + 1, 0);
        gonio_patch_mesh_triangle(mesh, a, b + 1, a + 1, 0);
        gonio_patch_mesh_triangle(mesh, a + 1, b + 1, tip, 0);
    }
}

static bool make_velvet(const patch_settings *s, patch_mesh *mesh) {
    const size_t count = s->count < 0 ? 12 : (size_t)s->count, segments = s->segments < 0 ? 8 : (size_t)s->segments;
    const double pitch = 1.0 / (double)count, radius = pitch * (s->radius < 0 ? 0.15 : s->radius);
    if (!gonio_patch_mesh_reserve(mesh, 4 + count * count * (2 * segments + 1), 2 + count * count * 3 * segments)) {
        return false;
    }
    mesh->width = mesh->height = 1;
    for (int k = 0; k < 4; k++) {
        gonio_patch_mesh_vertex(mesh, k % 2, k / 2, 0);
    }
    gonio_patch_mesh_triangle(mesh, 0, 1, 3, 1);
    gonio_patch_mesh_triangle(mesh, 0, 3, 2, 1);
    uint64_t stream = gonio_random(s->seed);
    for (size_t k = 0; k < count * count; k++) {
        const double x = ((double)(k % count) + gonio_random_next(&stream)) * pitch;
        const double y = ((double)(k / count) + gonio_random_next(&stream)) * pitch;
        const double lean = gonio_radians(s->lean) * sqrt(gonio_random_next(&stream));
        const double azimuth = 2 * GONIO_PI * gonio_random_next(&stream);
        const double length = s->length * pitch * (0.8 + 0.4 * gonio_random_next(&stream));
        add_fibre(mesh, x, y, radius, length, lean, azimuth, segments);
    }
    return true;
}

gonio_status gonio_patch_mesh_make(const patch_settings *s, patch_mesh *mesh, gonio_error *error) {
    memset(mesh, 0, sizeof *mesh);
    bool good = false;
    switch ((patch_shape)s->shape) {
    case PATCH_SAWTOOTH:
        good = make_sawtooth(s, mesh);
        break;
    case PATCH_CYLINDERS:
        good = make_cylinders(s, mesh);
        break;
    case PATCH_VELVET:
        good = make_velvet(s, mesh);
        break;
    case PATCH_HEIGHTS:
        return gonio_patch_heights_make(s, mesh, error);
    case PATCH_MESH:
        return gonio_patch_file_make(s, mesh, error);
    }
    return good ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a patch");
}
