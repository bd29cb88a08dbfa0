// SPDX-License-Identifier: BSD-3-Clause
// Arithmetic of gonio_vec3.
#ifndef GONIO_BASE_VECTOR_H
#define GONIO_BASE_VECTOR_H

#include <math.h>

#include "gonio/direction.h"

static inline gonio_vec3 scaled(gonio_vec3 a, double s) { return (gonio_vec3){a.x * s, a.y * s, a.z * s}; }
static inline gonio_vec3 sum(gonio_vec3 a, gonio_vec3 b) { return (gonio_vec3){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline gonio_vec3 difference(gonio_vec3 a, gonio_vec3 b) {
    return (gonio_vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}
static inline double dot(gonio_vec3 a, gonio_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline gonio_vec3 cross(gonio_vec3 a, gonio_vec3 b) {
    return (gonio_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline gonio_vec3 normalised(gonio_vec3 a) { return scaled(a, 1 / sqrt(dot(a, a))); }
// v turned by `angle` about the unit vector `axis`, right-handed (Rodrigues' formula).
static inline gonio_vec3 turned(gonio_vec3 v, gonio_vec3 axis, double angle) {
    const double c = cos(angle), s = sin(angle);
    return sum(sum(scaled(v, c), scaled(cross(axis, v), s)), scaled(axis, dot(axis, v) * (1 - c)));
}

#endif
