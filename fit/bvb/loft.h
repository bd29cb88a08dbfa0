// SPDX-License-Identifier: BSD-3-Clause
// B-spline volumes of tables by approximate lofting (Park and Lee 2015, sections 3.2 to 3.4).
#ifndef GONIO_FIT_BVB_LOFT_H
#define GONIO_FIT_BVB_LOFT_H

#include "base/thread_pool.h"
#include "brdf/kind/bvb.h"

// Transformed values at equally spaced angles: [phi_i][theta_i][theta_o][phi_d][channel], both ends of every axis
// among them; size 1 along an axis that is not there.
typedef struct gonio_bvb_table {
    int dims, channels;
    size_t size[GONIO_BVB_AXES];
    float *values;
} gonio_bvb_table;

static inline size_t gonio_bvb_nodes(const gonio_bvb_table *t) {
    return t->size[0] * t->size[1] * t->size[2] * t->size[3];
}

// Where knots stand. X(identifier, name, what it is).
#define GONIO_KNOTS_TABLE(X)                                                                                           \
    X(ADAPTIVE, "adaptive", "dominant columns: chord heights of values over the largest, lengths over the mean value") \
    X(DOMINANT, "dominant", "means of dominant columns, by the largest chord height; values over the largest one")     \
    X(DOMINANT_MEAN, "dominant-mean", "the same by the mean chord height")                                             \
    X(DOMINANT_RAW, "dominant-raw", "by the largest chord height of values as they are")                               \
    X(DOMINANT_MEAN_RAW, "dominant-mean-raw", "by the mean chord height of values as they are")                        \
    X(KTP, "ktp", "as many points between them (Piegl and Tiller 1995, eq. 9.68, 9.69)")                               \
    X(NKTP, "nktp", "means of equal groups of points (Piegl and Tiller 2000)")

#define GONIO_KNOTS_ENUM(id, name, summary) GONIO_KNOTS_##id,
typedef enum gonio_knots { GONIO_KNOTS_TABLE(GONIO_KNOTS_ENUM) } gonio_knots;
#undef GONIO_KNOTS_ENUM

typedef struct gonio_loft {
    int order;
    gonio_knots knots;
    size_t count[GONIO_BVB_AXES]; // control points; 0: as few as the tolerance allows
    double tolerance;             // largest error of all passes together, in units of the table
    double unit;                  // of values, for the errors of knots that take them as they are: f_r = unit * value
    bool equal;                   // the passes share the tolerance equally, however little they use of it
    int threads;
} gonio_loft;

// Fit; the caller releases *out with gonio_bvb_parts_release unless a model took it over.
gonio_status gonio_bvb_loft(const gonio_bvb_table *table, const gonio_loft *loft, gonio_bvb_parts *out,
                            gonio_error *error);

// Lengths of the vectors of channels: of the table's values, and of what the volume leaves of them, its own held within
// range[2 channels] (NULL: not held).
typedef struct gonio_bvb_lengths {
    double largest, mean;
} gonio_bvb_lengths;
gonio_bvb_lengths gonio_bvb_table_lengths(const gonio_bvb_table *table);
gonio_status gonio_bvb_errors(const gonio_bvb_table *table, const gonio_bvb_parts *parts, const double *range,
                              int threads, gonio_bvb_lengths *out, gonio_error *error);

// ---- columns: where the knots of one pass stand ----

typedef struct gonio_column_span {
    size_t begin, end;
    double deviation;
} gonio_column_span;

// The polylines of a pass: |p| / unit over the column's parameter j / last.
typedef struct gonio_columns {
    size_t lines, last;
    bool mean;
    double stretch; // of heights, for the lengths
    float *height;  // [lines][last + 1]
    double *length; // [last + 1]: of all polylines up to a column
    size_t *chosen; // [last + 1]: dominant columns in the order in which they are found
    size_t found;
    gonio_column_span *spans; // [found - 1]
    double *partial;          // a chunk of lines each
    gonio_pool *pool;
} gonio_columns;

// Of a view [outer][last + 1][inner], channels fastest. Release it also where this fails.
gonio_status gonio_columns_init(gonio_columns *columns, const float *values, size_t outer, size_t size, size_t inner,
                                int channels, double unit, double stretch, bool mean, gonio_pool *pool,
                                gonio_error *error);
void gonio_columns_release(gonio_columns *columns);
// knots[count + order] by the first `count` dominant columns, which are found where they are not known yet.
void gonio_columns_knots(gonio_columns *columns, size_t count, int order, double *knots);
// The same without columns, of `size` equally spaced parameters.
void gonio_knots_place(gonio_knots how, size_t size, size_t count, int order, double *knots);

#endif
