// SPDX-License-Identifier: BSD-3-Clause
// Steps of learning a library (fit/library/learn.c).
#ifndef GONIO_FIT_LIBRARY_LEARN_H
#define GONIO_FIT_LIBRARY_LEARN_H

#include "fit/library/library.h"

// The models' columns: z at the nodes, [columns][nodes].
typedef struct learning {
    gonio_grid grid;
    size_t nodes, models, columns;
    double *z, *reference;
    double *gram; // columns x columns, over the real nodes
    bool *real;   // [nodes]
    size_t *real_nodes, real_n;
    size_t *model_of; // [columns]
} learning;

void gonio_learning_release(learning *l);
// Mean and components of the columns but for those whose model's number leaves `left_out` modulo the parts; node
// values.
gonio_status gonio_learning_components(const learning *l, size_t left_out, int rank, gonio_library **out,
                                       gonio_error *error);

// Fit every model from a few poses with the library that it was left out of, parts[i % parts_n], and see how far that
// is from the model: inflation, limit and trial_error of out->facts.
gonio_status gonio_library_try(const gonio_model *const *models, size_t n, size_t parts_n, gonio_library *const *parts,
                               const gonio_library_options *options, gonio_library *out, gonio_error *error);

#endif
