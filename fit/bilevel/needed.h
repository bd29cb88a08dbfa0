// SPDX-License-Identifier: BSD-3-Clause
// CBMBA models that are fine only where a scene asks for it: bricks in the order of what the pictures lose without
// them.
#ifndef GONIO_FIT_BILEVEL_NEEDED_H
#define GONIO_FIT_BILEVEL_NEEDED_H

#include "brdf/spline/sparse.h"
#include "gonio/fit.h"
#include "gonio/needs.h"

typedef struct gonio_needed_form {
    gonio_coordinates coordinates;
    gonio_domain domain;
    int diffuse, level; // D < S
} gonio_needed_form;

// Both lattices of a fit, and its bricks (of hashed storages: single control points), ranked.
typedef struct gonio_needed gonio_needed;
// told: what is to be held, the first n_cells of it at the cells; sigma_random gives the weights. What it holds is
// borrowed. The caller frees it.
gonio_status gonio_needed_new(const gonio_samples *told, const gonio_need *cells, size_t n_cells, bool hashed,
                              const gonio_needed_form *form, int threads, gonio_needed **out, gonio_error *error);
void gonio_needed_free(gonio_needed *needed); // NULL is allowed
// Bricks or control points that pictures lose anything without.
size_t gonio_needed_units(const gonio_needed *needed);
// With the first `units` of them; all else falls back to level D. The caller frees the model.
gonio_status gonio_needed_model(const gonio_needed *needed, size_t units, gonio_storage storage, gonio_model **out,
                                gonio_error *error);
// Bytes that the uncertainty takes beside the model.
size_t gonio_needed_sigma_bytes(int dims);
// The same with an uncertainty: of what it makes of told, beside told's own (sigma_systematic).
gonio_status gonio_needed_finish(const gonio_needed *needed, size_t units, gonio_storage storage, gonio_model **out,
                                 gonio_error *error);

#endif
