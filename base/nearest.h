// SPDX-License-Identifier: BSD-3-Clause
// The few nearest of many candidates, shown one after another.
#ifndef GONIO_BASE_NEAREST_H
#define GONIO_BASE_NEAREST_H

#include <math.h>
#include <stddef.h>

#define GONIO_NEAREST_MAX 24

// {.wanted = k} to begin with, k <= GONIO_NEAREST_MAX.
typedef struct gonio_nearest {
    size_t wanted, found;
    double distance[GONIO_NEAREST_MAX]; // ascending; of equal ones the first that was shown stands first
    size_t index[GONIO_NEAREST_MAX];
} gonio_nearest;

static inline void gonio_nearest_show(gonio_nearest *n, double distance, size_t index) {
    if (n->found == n->wanted && distance >= n->distance[n->wanted - 1]) {
        return;
    }
    size_t at = n->found < n->wanted ? n->found++ : n->wanted - 1;
    for (; at > 0 && n->distance[at - 1] > distance; at--) {
        n->distance[at] = n->distance[at - 1];
        n->index[at] = n->index[at - 1];
    }
    n->distance[at] = distance;
    n->index[at] = index;
}

// To the last of the nearest; INFINITY where nothing was shown.
static inline double gonio_nearest_reach(const gonio_nearest *n) {
    return n->found > 0 ? n->distance[n->found - 1] : INFINITY;
}

#endif
