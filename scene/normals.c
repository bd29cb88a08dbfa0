// SPDX-License-Identifier: BSD-3-Clause
// Weighted by area, because scanned meshes hold slivers along their seams whose directions mean nothing; Assimp's own
// step gives every face the same weight, and polished scans then show bright cracks.
#include "scene/normals.h"

#include <math.h>
#include <stdlib.h>

// cos 80 deg: edges sharper than this stay edges.
#define SMOOTHING_COS 0.17364817766693033
// Among more faces at one point than this, edges are not looked for: it takes the square of their number.
#define MEETING_MAX 256

typedef struct corner {
    float position[3];
    size_t vertex;
    double face[3]; // its face's normal times twice the area
} corner;

static int by_position(const void *left, const void *right) {
    const corner *a = left, *b = right;
    for (int k = 0; k < 3; k++) {
        if (a->position[k] != b->position[k]) {
            return a->position[k] < b->position[k] ? -1 : 1;
        }
    }
    return (a->vertex > b->vertex) - (a->vertex < b->vertex);
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Adds a triangle's normal times twice its area to its corners.
static void add_face(const float *positions, const unsigned *index, corner *corners) {
    double e[2][3];
    for (size_t k = 0; k < 3; k++) {
        const double origin = (double)positions[3 * index[0] + k];
        e[0][k] = (double)positions[3 * index[1] + k] - origin;
        e[1][k] = (double)positions[3 * index[2] + k] - origin;
    }
    for (size_t k = 0; k < 3; k++) {
        const size_t a = (k + 1) % 3, b = (k + 2) % 3;
        const double n = e[0][a] * e[1][b] - e[0][b] * e[1][a];
        for (size_t c = 0; c < 3; c++) {
            corners[index[c]].face[k] += n;
        }
    }
}

static void blend(const corner *meeting, size_t n, const corner *own, float *normal) {
    double sum[3] = {0};
    const double length = sqrt(dot(own->face, own->face));
    for (size_t m = 0; m < n; m++) {
        const double *other = meeting[m].face;
        if (n > MEETING_MAX || dot(own->face, other) >= SMOOTHING_COS * length * sqrt(dot(other, other))) {
            for (int k = 0; k < 3; k++) {
                sum[k] += other[k];
            }
        }
    }
    const double total = sqrt(dot(sum, sum));
    for (int k = 0; k < 3; k++) {
        normal[k] = total > 0 ? (float)(sum[k] / total) : 0;
    }
}

gonio_status gonio_scene_normals_smooth(scene_mesh *mesh, gonio_error *error) {
    const size_t count = mesh->vertices;
    corner *corners = calloc(count + 1, sizeof *corners);
    if (corners == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a mesh of %zu vertices", count);
    }
    for (size_t v = 0; v < count; v++) {
        const float *p = mesh->positions + 3 * v;
        corners[v] = (corner){.position = {p[0], p[1], p[2]}, .vertex = v};
    }
    for (size_t t = 0; t < mesh->triangles; t++) {
        add_face(mesh->positions, mesh->indices + 3 * t, corners);
    }
    qsort(corners, count, sizeof *corners, by_position);
    for (size_t start = 0, end; start < count; start = end) {
        const float *p = corners[start].position;
        for (end = start + 1; end < count; end++) {
            const float *q = corners[end].position;
            if (p[0] != q[0] || p[1] != q[1] || p[2] != q[2]) {
                break;
            }
        }
        for (size_t i = start; i < end; i++) {
            blend(corners + start, end - start, &corners[i], mesh->normals + 3 * corners[i].vertex);
        }
    }
    free(corners);
    return GONIO_OK;
}
