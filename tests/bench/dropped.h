// SPDX-License-Identifier: BSD-3-Clause
// Kameya's table 6.1: a dense lattice whose least control points are set to zero.
#ifndef GONIO_TESTS_BENCH_DROPPED_H
#define GONIO_TESTS_BENCH_DROPPED_H

#include <math.h>

#include "brdf/kind/lattice.h"
#include "tests/simulate.h"

// dense without the `percent` % of its control points that lie nearest to zero. The caller frees it; ends the program
// where there is no memory.
static inline gonio_model *dropped_model(const gonio_model *dense, double percent) {
    const gonio_lattice *from = gonio_lattice_model_lattice(dense);
    gonio_lattice l;
    gonio_model *model;
    gonio_error error = {0};
    gonio_coordinates coordinates;
    gonio_transform_kind kind;
    const gonio_transform *transform;
    if (gonio_lattice_init(&l, 3, from->level, 1, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    // The magnitude below which they lie, by bisection: no sorting needed.
    double low = 0, high = 1e9;
    for (int step = 0; step < 100; step++) {
        const double middle = 0.5 * (low + high);
        size_t below = 0;
        for (size_t i = 0; i < from->count; i++) {
            below += fabs((double)from->points[i]) < middle;
        }
        *((double)below < percent / 100 * (double)from->count ? &low : &high) = middle;
    }
    for (size_t i = 0; i < from->count; i++) {
        l.points[i] = fabs((double)from->points[i]) < low ? 0 : from->points[i];
    }
    gonio_lattice_model_about(dense, &coordinates, &kind, &transform);
    if (gonio_lattice_model_new(&l, coordinates, kind, transform, dense->channel_names, &model, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    return model;
}

#endif
