// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "kernel": scattered samples, and a weighted mean of those nearest to a pair.
#ifndef GONIO_BRDF_KIND_KERNEL_H
#define GONIO_BRDF_KIND_KERNEL_H

#include "base/nearest.h"
#include "brdf/transform.h"
#include "gonio/model.h"

// What the distance of two pairs is measured in. X(identifier, number in model files, name, what it is).
#define GONIO_DISTANCE_TABLE(X)                                                                                        \
    X(DIRECTIONS, 0, "directions", "both unit vectors")                                                                \
    X(HALF_VECTOR, 1, "half-vector", "the half-vector coordinates of a fit")

#define GONIO_DISTANCE_ENUM(id, number, name, summary) GONIO_DISTANCE_##id = number,
typedef enum gonio_distance { GONIO_DISTANCE_TABLE(GONIO_DISTANCE_ENUM) } gonio_distance;
#undef GONIO_DISTANCE_ENUM
#define GONIO_DISTANCE_COUNT(id, number, name, summary) +1
#define GONIO_DISTANCES (0 GONIO_DISTANCE_TABLE(GONIO_DISTANCE_COUNT)) // how many there are

#define GONIO_KERNEL_DIMS_MAX 6

typedef struct gonio_kernel_parts {
    size_t n; // 1 or more
    const gonio_pair *pairs;
    const double *values; // [n][channels], transformed
    gonio_distance distance;
    int neighbours; // 1 to GONIO_NEAREST_MAX
    bool isotropic; // then mirrored too
    int channels;
    gonio_transform_kind kind;
    const gonio_transform *transforms; // [channels]
    const char (*names)[32];
} gonio_kernel_parts;

// Everything is copied. The caller frees the model.
gonio_status gonio_kernel_model_new(const gonio_kernel_parts *parts, gonio_model **out, gonio_error *error);
// The sum over the channels of the squares by which a mean of the `neighbours` nearest others misses the transformed
// values of sample `index` (of the model's own order), for each of the n numbers of them, ascending.
void gonio_kernel_model_leave_one_out(const gonio_model *model, size_t index, int n, const int *neighbours,
                                      double *misses);
// Before others use the model.
void gonio_kernel_model_set_neighbours(gonio_model *model, int neighbours);

#endif
