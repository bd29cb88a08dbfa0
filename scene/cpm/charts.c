// SPDX-License-Identifier: BSD-3-Clause
// Box charts: neighbouring triangles that face the same of the six axes are one chart, which is their projection along
// it; charts are packed in rows of falling height at one scale, the largest that fits.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scene/cpm/surface.h"

typedef struct chart {
    double low[2], size[2]; // of the projection
    double at[2];           // of its corner in the texture
    int number;
} chart;

typedef struct edge {
    unsigned a, b, triangle;
} edge;

static int by_ends(const void *left, const void *right) {
    const edge *x = left, *y = right;
    return x->a != y->a   ? (x->a > y->a) - (x->a < y->a)
           : x->b != y->b ? (x->b > y->b) - (x->b < y->b)
                          : (x->triangle > y->triangle) - (x->triangle < y->triangle);
}

static int by_height(const void *left, const void *right) {
    const chart *x = left, *y = right;
    return x->size[1] != y->size[1] ? (x->size[1] < y->size[1]) - (x->size[1] > y->size[1]) : x->number - y->number;
}

// 0 to 5: the axis that the triangle faces.
static int facing(const float *positions, const unsigned *corner) {
    double e[2][3], n[3];
    for (size_t k = 0; k < 3; k++) {
        const double a = (double)positions[3 * corner[0] + k];
        e[0][k] = (double)positions[3 * corner[1] + k] - a;
        e[1][k] = (double)positions[3 * corner[2] + k] - a;
    }
    int best = 0;
    for (int k = 0; k < 3; k++) {
        n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
        best = fabs(n[k]) > fabs(n[best]) ? k : best;
    }
    return 2 * best + (n[best] < 0);
}

static unsigned root(unsigned *parent, unsigned i) {
    while (parent[i] != i) {
        i = parent[i] = parent[parent[i]];
    }
    return i;
}

// parent: the first triangle of each one's chart.
static bool join(const unsigned *indices, size_t triangles, const int *faces, unsigned *parent) {
    edge *edges = malloc(3 * triangles * sizeof *edges);
    if (edges == NULL) {
        return false;
    }
    for (size_t t = 0; t < triangles; t++) {
        parent[t] = (unsigned)t;
        for (size_t k = 0; k < 3; k++) {
            const unsigned a = indices[3 * t + k], b = indices[3 * t + (k + 1) % 3];
            edges[3 * t + k] = a < b ? (edge){a, b, (unsigned)t} : (edge){b, a, (unsigned)t};
        }
    }
    qsort(edges, 3 * triangles, sizeof *edges, by_ends);
    for (size_t i = 1; i < 3 * triangles; i++) {
        const edge *x = &edges[i - 1], *y = &edges[i];
        if (x->a == y->a && x->b == y->b && faces[x->triangle] == faces[y->triangle]) {
            const unsigned p = root(parent, x->triangle), q = root(parent, y->triangle);
            parent[p > q ? p : q] = p > q ? q : p;
        }
    }
    free(edges);
    return true;
}

static void project(const float *position, int face, double to[2]) {
    to[0] = (double)position[(face / 2 + 1) % 3];
    to[1] = (double)position[(face / 2 + 2) % 3];
}

// Places the charts at a scale; false: they do not fit.
static bool pack(chart *charts, size_t n, double scale, double gap) {
    double x = gap, y = gap, row = 0;
    for (size_t i = 0; i < n; i++) {
        const double width = scale * charts[i].size[0] + gap, height = scale * charts[i].size[1] + gap;
        if (x + width > 1) {
            x = gap;
            y += row;
            row = 0;
        }
        if (x + width > 1 || y + height > 1) {
            return false;
        }
        charts[i].at[0] = x;
        charts[i].at[1] = y;
        x += width;
        row = fmax(row, height);
    }
    return true;
}

static double largest_scale(chart *charts, size_t n, double gap) {
    double area = 1e-300;
    for (size_t i = 0; i < n; i++) {
        area += charts[i].size[0] * charts[i].size[1];
    }
    double scale = 1 / sqrt(area);
    while (!pack(charts, n, scale, gap)) {
        scale *= 0.97;
        gap *= scale * sqrt(area) < 0.1 ? 0.5 : 1; // so many charts that the gaps alone take all the room
    }
    return scale;
}

// The charts' boxes; charts[parent] are those of the triangles that are their own parents.
static void measure(const float *positions, const unsigned *indices, size_t triangles, const int *faces,
                    unsigned *parent, chart *charts) {
    for (size_t t = 0; t < triangles; t++) {
        charts[t] = (chart){.low = {INFINITY, INFINITY}, .size = {-INFINITY, -INFINITY}, .number = (int)t};
    }
    for (size_t c = 0; c < 3 * triangles; c++) {
        chart *to = &charts[root(parent, (unsigned)(c / 3))];
        double at[2];
        project(positions + 3 * (size_t)indices[c], faces[c / 3], at);
        for (int k = 0; k < 2; k++) {
            to->low[k] = fmin(to->low[k], at[k]);
            to->size[k] = fmax(to->size[k], at[k]); // the upper end, for now
        }
    }
    for (size_t t = 0; t < triangles; t++) {
        for (int k = 0; k < 2; k++) {
            charts[t].size[k] -= charts[t].low[k];
        }
    }
}

bool gonio_cpm_charts(const float *positions, const unsigned *indices, size_t triangles, int resolution, float *uv) {
    int *faces = malloc(triangles * sizeof *faces);
    unsigned *parent = malloc(triangles * sizeof *parent);
    chart *charts = malloc(triangles * sizeof *charts), *packed = malloc(triangles * sizeof *packed);
    bool good = faces != NULL && parent != NULL && charts != NULL && packed != NULL;
    for (size_t t = 0; good && t < triangles; t++) {
        faces[t] = facing(positions, indices + 3 * t);
    }
    if (good && join(indices, triangles, faces, parent)) {
        size_t n = 0;
        measure(positions, indices, triangles, faces, parent, charts);
        for (size_t t = 0; t < triangles; t++) {
            if (root(parent, (unsigned)t) == t) {
                packed[n++] = charts[t];
            }
        }
        qsort(packed, n, sizeof *packed, by_height);
        const double scale = largest_scale(packed, n, 1.0 / resolution);
        for (size_t i = 0; i < n; i++) {
            memcpy(charts[packed[i].number].at, packed[i].at, sizeof packed[i].at);
        }
        for (size_t c = 0; c < 3 * triangles; c++) {
            const chart *from = &charts[root(parent, (unsigned)(c / 3))];
            double at[2];
            project(positions + 3 * (size_t)indices[c], faces[c / 3], at);
            for (size_t k = 0; k < 2; k++) {
                uv[2 * c + k] = (float)(from->at[k] + scale * (at[k] - from->low[k]));
            }
        }
    } else {
        good = false;
    }
    free(faces);
    free(parent);
    free(charts);
    free(packed);
    return good;
}
