// SPDX-License-Identifier: BSD-3-Clause
#include "fit/check/neighbours.h"

#include <stdlib.h>

// Points before points: by the axis, equal ones by number, so that the tree follows from the points alone.
static bool before(const gonio_neighbours *t, size_t a, size_t b, int axis) {
    const double x = t->at[a * (size_t)t->dims + (size_t)axis], y = t->at[b * (size_t)t->dims + (size_t)axis];
    return x < y || (x == y && a < b);
}

// Hoare's selection: order[middle] stands where sorting would put it.
static void select_middle(gonio_neighbours *t, size_t low, size_t high, size_t middle, int axis) {
    size_t *o = t->order;
    while (high - low > 1) {
        const size_t pivot = o[low + (high - low) / 2];
        size_t i = low, j = high - 1;
        for (;;) {
            while (before(t, o[i], pivot, axis)) {
                i++;
            }
            while (before(t, pivot, o[j], axis)) {
                j--;
            }
            if (i >= j) {
                break;
            }
            const size_t x = o[i];
            o[i] = o[j];
            o[j] = x;
        }
        // The pivot stands at i == j.
        if (i == middle) {
            return;
        }
        *(i < middle ? &low : &high) = i < middle ? i + 1 : i;
    }
}

static int widest(const gonio_neighbours *t, size_t low, size_t high) {
    int best = 0;
    double most = -1;
    for (int d = 0; d < t->dims; d++) {
        double least = INFINITY, largest = -INFINITY;
        for (size_t k = low; k < high; k++) {
            const double x = t->at[t->order[k] * (size_t)t->dims + (size_t)d];
            least = fmin(least, x);
            largest = fmax(largest, x);
        }
        if (largest - least > most) {
            most = largest - least;
            best = d;
        }
    }
    return best;
}

static void split(gonio_neighbours *t, size_t low, size_t high) {
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        const int axis = widest(t, low, high);
        select_middle(t, low, high, middle, axis);
        t->axis[middle] = (unsigned char)axis;
        split(t, low, middle);
        low = middle + 1;
    }
}

gonio_status gonio_neighbours_new(const double *at, size_t n, int dims, gonio_neighbours *out, gonio_error *error) {
    *out = (gonio_neighbours){n, dims, at, malloc((n + 1) * sizeof(size_t)), calloc(n + 1, 1)};
    if (out->order == NULL || out->axis == NULL) {
        gonio_neighbours_free(out);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to order %zu samples", n);
    }
    for (size_t i = 0; i < n; i++) {
        out->order[i] = i;
    }
    split(out, 0, n);
    return GONIO_OK;
}

void gonio_neighbours_free(gonio_neighbours *t) {
    free(t->order);
    free(t->axis);
    *t = (gonio_neighbours){0};
}

static void search(const gonio_neighbours *t, const double *x, size_t low, size_t high, const size_t skip[2],
                   gonio_nearest *nearest) {
    while (low < high) {
        const size_t middle = low + (high - low) / 2, point = t->order[middle];
        const double *p = t->at + point * (size_t)t->dims;
        double distance = 0;
        for (int d = 0; d < t->dims; d++) {
            distance += (x[d] - p[d]) * (x[d] - p[d]);
        }
        if (point < skip[0] || point >= skip[1]) {
            gonio_nearest_show(nearest, distance, point);
        }
        const int axis = t->axis[middle];
        const double beyond = x[axis] - p[axis];
        const bool left = beyond < 0;
        search(t, x, left ? low : middle + 1, left ? middle : high, skip, nearest);
        if (nearest->found == nearest->wanted && beyond * beyond >= gonio_nearest_reach(nearest)) {
            return;
        }
        if (left) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
}

void gonio_neighbours_find(const gonio_neighbours *t, const double *x, const size_t skip[2], gonio_nearest *nearest) {
    search(t, x, 0, t->n, skip, nearest);
}
