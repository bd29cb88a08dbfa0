// SPDX-License-Identifier: BSD-3-Clause
// What is wrong with a mesh: triangles without an area, edges that only one triangle has.
#include <stdlib.h>
#include <string.h>

#include "scene/world/geometry.h"

typedef struct end {
    float position[3];
    unsigned vertex;
} end;

static int by_position(const void *left, const void *right) {
    const end *a = left, *b = right;
    for (int k = 0; k < 3; k++) {
        if (a->position[k] != b->position[k]) {
            return a->position[k] < b->position[k] ? -1 : 1;
        }
    }
    return (a->vertex > b->vertex) - (a->vertex < b->vertex);
}

// For every corner of the triangles the number of its position. false: no memory.
static bool weld(const scene_mesh *mesh, size_t first, size_t triangles, unsigned *numbers) {
    const size_t corners = 3 * triangles;
    end *ends = malloc(corners * sizeof *ends);
    if (ends == NULL) {
        return false;
    }
    for (size_t c = 0; c < corners; c++) {
        const float *p = mesh->positions + 3 * (size_t)mesh->indices[3 * first + c];
        ends[c] = (end){{p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f}, (unsigned)c};
    }
    qsort(ends, corners, sizeof *ends, by_position);
    unsigned number = 0;
    for (size_t c = 0; c < corners; c++) {
        number += c > 0 && memcmp(ends[c].position, ends[c - 1].position, sizeof ends[c].position) != 0;
        numbers[ends[c].vertex] = number;
    }
    free(ends);
    return true;
}

static int by_value(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

bool gonio_world_geometry_count(const scene_mesh *mesh, size_t first, size_t triangles, size_t *degenerate,
                                size_t *open_edges) {
    unsigned *numbers = malloc(3 * triangles * sizeof *numbers);
    uint64_t *edges = malloc(3 * triangles * sizeof *edges);
    const bool good = numbers != NULL && edges != NULL && weld(mesh, first, triangles, numbers);
    size_t n = 0;
    *degenerate = *open_edges = 0;
    for (size_t t = 0; good && t < triangles; t++) {
        const unsigned *c = numbers + 3 * t;
        if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) {
            ++*degenerate;
            continue;
        }
        for (int k = 0; k < 3; k++) {
            const unsigned a = c[k], b = c[(k + 1) % 3];
            edges[n++] = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
        }
    }
    if (good) {
        qsort(edges, n, sizeof *edges, by_value);
    }
    for (size_t start = 0, stop; good && start < n; start = stop) {
        for (stop = start + 1; stop < n && edges[stop] == edges[start]; stop++) {
        }
        *open_edges += stop - start == 1;
    }
    free(numbers);
    free(edges);
    return good;
}
