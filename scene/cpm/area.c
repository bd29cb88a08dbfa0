// SPDX-License-Identifier: BSD-3-Clause
#include "scene/cpm/area.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/vector.h"

#define ROOT_HALF 0.70710678118654752f

gonio_vec3 gonio_cpm_area_direction(int side, size_t pixel) {
    const size_t pixels = (size_t)(side * side);
    const int face = (int)(pixel / pixels), x = (int)(pixel % pixels) % side, y = (int)(pixel % pixels) / side;
    const double a = (2 * x + 1.0) / side - 1, b = (2 * y + 1.0) / side - 1, c = face % 2 == 0 ? 1 : -1;
    const double v[3] = {c, a, b}; // along the face's axis and the two after it
    const int axis = face / 2;
    return normalised((gonio_vec3){v[(3 - axis) % 3], v[(4 - axis) % 3], v[(5 - axis) % 3]});
}

// ---- the transform ----

// One step over a row or column of n values, `stride` apart.
static void step(float *v, int n, int stride, float *room) {
    for (int i = 0; i < n / 2; i++) {
        const float a = v[2 * i * stride], b = v[(2 * i + 1) * stride];
        room[i] = (a + b) * ROOT_HALF;
        room[n / 2 + i] = (a - b) * ROOT_HALF;
    }
    for (int i = 0; i < n; i++) {
        v[i * stride] = room[i];
    }
}

static void step_back(float *v, int n, int stride, float *room) {
    for (int i = 0; i < n / 2; i++) {
        const float a = v[i * stride], b = v[(n / 2 + i) * stride];
        room[2 * i] = (a + b) * ROOT_HALF;
        room[2 * i + 1] = (a - b) * ROOT_HALF;
    }
    for (int i = 0; i < n; i++) {
        v[i * stride] = room[i];
    }
}

void gonio_cpm_haar(float *values, int side) {
    float room[CPM_FACE_MAX];
    for (int face = 0; face < 6; face++) {
        float *v = values + face * side * side;
        for (int n = side; n > 1; n /= 2) {
            for (int i = 0; i < n; i++) {
                step(v + i * side, n, 1, room);
            }
            for (int i = 0; i < n; i++) {
                step(v + i, n, side, room);
            }
        }
    }
}

void gonio_cpm_haar_back(float *values, int side) {
    float room[CPM_FACE_MAX];
    for (int face = 0; face < 6; face++) {
        float *v = values + face * side * side;
        for (int n = 2; n <= side; n *= 2) {
            for (int i = 0; i < n; i++) {
                step_back(v + i, n, side, room);
            }
            for (int i = 0; i < n; i++) {
                step_back(v + i * side, n, 1, room);
            }
        }
    }
}

// ---- what is kept ----

typedef struct ranked {
    float size;
    uint16_t index;
} ranked;

static int by_size(const void *left, const void *right) {
    const ranked *a = left, *b = right;
    return a->size != b->size ? (a->size < b->size) - (a->size > b->size)
                              : (a->index > b->index) - (a->index < b->index);
}

static int by_index(const void *left, const void *right) {
    const cpm_coefficient *a = left, *b = right;
    return (a->index > b->index) - (a->index < b->index);
}

size_t gonio_cpm_area_keep(const float *transformed, int side, size_t keep, cpm_coefficient *kept, float *scale) {
    const size_t values = (size_t)(6 * side * side);
    ranked all[6 * CPM_FACE_MAX * CPM_FACE_MAX];
    for (size_t i = 0; i < values; i++) {
        all[i] = (ranked){fabsf(transformed[i]), (uint16_t)i};
    }
    qsort(all, values, sizeof *all, by_size);
    *scale = all[0].size / 32767;
    size_t n = 0;
    for (size_t i = 0; i < values && n < keep && all[i].size > 0; i++) {
        const float value = transformed[all[i].index] / *scale;
        if (lrintf(value) != 0) {
            kept[n++] = (cpm_coefficient){all[i].index, (int16_t)lrintf(value)};
        }
    }
    qsort(kept, n, sizeof *kept, by_index);
    return n;
}

void gonio_cpm_area_restore(const cpm_coefficient *kept, size_t n, float scale, int side, float *values) {
    memset(values, 0, (size_t)(6 * side * side) * sizeof *values);
    for (size_t i = 0; i < n; i++) {
        values[kept[i].index] = scale * (float)kept[i].value;
    }
    gonio_cpm_haar_back(values, side);
}

// The four pixels of a face that a direction lies between.
typedef struct corners {
    int face, x, y;          // of the first
    double weight[2], up[2]; // along x and y
} corners;

static corners find_corners(int side, gonio_vec3 w) {
    const double v[3] = {w.x, w.y, w.z};
    int axis = fabs(w.x) >= fabs(w.y) ? 0 : 1;
    axis = fabs(v[axis]) >= fabs(w.z) ? axis : 2;
    const double along = fabs(v[axis]);
    const double x = (v[(axis + 1) % 3] / along + 1) / 2 * side - 0.5,
                 y = (v[(axis + 2) % 3] / along + 1) / 2 * side - 0.5;
    const double left = fmin(fmax(x, 0), side - 1), top = fmin(fmax(y, 0), side - 1);
    const int i = (int)fmin(floor(left), side - 2), j = (int)fmin(floor(top), side - 2);
    return (corners){2 * axis + (v[axis] < 0), i, j, {1 - left + i, left - i}, {1 - top + j, top - j}};
}

double gonio_cpm_area_at(const float *values, int side, gonio_vec3 w) {
    const corners c = find_corners(side, w);
    const float *at = values + (c.face * side + c.y) * side + c.x;
    return c.up[0] * (c.weight[0] * (double)at[0] + c.weight[1] * (double)at[1]) +
           c.up[1] * (c.weight[0] * (double)at[side] + c.weight[1] * (double)at[side + 1]);
}

// What a coefficient's function is along one axis, between two pixels: 1 over the support that begins at `start`, or
// (fine) 1 over its first half and -1 over the second.
static double along_axis(int first, const double weight[2], int start, int support, bool fine) {
    double sum = 0;
    for (int k = 0; k < 2; k++) {
        const int at = first + k - start;
        if (at >= 0 && at < support) {
            sum += fine && at >= support / 2 ? -weight[k] : weight[k];
        }
    }
    return sum;
}

// Only a few coefficients' functions reach a pixel; all of a face's are looked at, which is less than its transform.
double gonio_cpm_area_of(const cpm_coefficient *kept, size_t n, float scale, int side, gonio_vec3 w) {
    const corners c = find_corners(side, w);
    const size_t pixels = (size_t)(side * side), begin = (size_t)c.face * pixels;
    size_t low = 0, high = n;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (kept[middle].index < begin) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    double total = 0;
    for (size_t k = low; k < n && kept[k].index < begin + pixels; k++) {
        const int index = (int)(kept[k].index - begin), x = index % side, y = index / side;
        int half = 1; // side of the square of coarser coefficients
        while (2 * half <= (x > y ? x : y)) {
            half *= 2;
        }
        const bool coarsest = index == 0, fine_x = !coarsest && x >= half, fine_y = !coarsest && y >= half;
        const int support = side / half, i = fine_x ? x - half : x, j = fine_y ? y - half : y;
        total += (double)kept[k].value / support * along_axis(c.x, c.weight, i * support, support, fine_x) *
                 along_axis(c.y, c.up, j * support, support, fine_y);
    }
    return total * (double)scale;
}
