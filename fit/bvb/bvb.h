// SPDX-License-Identifier: BSD-3-Clause
#ifndef GONIO_FIT_BVB_BVB_H
#define GONIO_FIT_BVB_BVB_H

#include "fit/bvb/loft.h"
#include "gonio/fit.h"

// How well a volume fits its table.
typedef struct gonio_bvb_report {
    int order;
    gonio_bvb_lengths table, error; // of the transformed values
    size_t count[GONIO_BVB_AXES];
} gonio_bvb_report;

// A model of the table by --order, --knots, --points and --rate of the options. kind and transforms are those of its
// values. In the domain of logarithms the table is changed: its least value becomes 0.
gonio_status gonio_bvb_fit_table(gonio_bvb_table *table, gonio_transform_kind kind, const gonio_transform *transforms,
                                 const char (*names)[32], const gonio_fit_options *options, gonio_model **out,
                                 gonio_bvb_report *report, gonio_error *error);

#endif
