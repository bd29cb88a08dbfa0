// SPDX-License-Identifier: BSD-3-Clause
// Parts of the search for the smallest model that a scene's pictures show no difference with (scene/needs/fit.c).
#ifndef GONIO_SCENE_NEEDS_SEARCH_H
#define GONIO_SCENE_NEEDS_SEARCH_H

#include "fit/bilevel/needed.h"
#include "gonio/scene_needs.h"
#include "io/colour.h"

#define GONIO_SEARCH_FILL 8000      // pairs over all directions beside the cells
#define GONIO_SEARCH_SAFETY 0.95    // of the limit is asked for, so that it is met at once most often
#define GONIO_SEARCH_CANDIDATES 512 // at most

typedef struct search_candidate {
    const char *formula; // method; NULL: a CBMBA model
    gonio_needed_form form;
    gonio_storage storage;
    size_t units, bytes;
    double cost; // bytes or ns
    double ns, predicted, target;
    bool out; // does not meet the limit with anything
} search_candidate;

typedef struct search_work {
    const gonio_samples *samples;
    const gonio_fit_options *options;
    const gonio_needs *needs;
    int material;
    const gonio_scene_fit_options *how;
    gonio_scene_fit_report *report;
    double limit; // of the measure: mean distance, or the root of the mean square
    gonio_scene *scene;
    gonio_scene_options render;
    gonio_needs_scene about;
    gonio_frames *truth;
    gonio_model *best;
    gonio_samples *told; // cells first
    const gonio_need *cells;
    size_t n_cells;
    gonio_colour_weights colour;
    double *reference; // n_cells x 3: red, green and blue of the best fit
    search_candidate *candidates;
    int n;
} search_work;

gonio_status gonio_search_checkpoint(const search_work *w, const char *what, gonio_error *error);

// ---- told.c ----
// The values that smaller models are made of, and red, green and blue at the cells.
gonio_status gonio_search_tell(search_work *w, gonio_error *error);
// What a model's values at the cells promise of the measure.
double gonio_search_promise(const search_work *w, const gonio_model *model);

// ---- candidates.c ----
gonio_status gonio_search_formulae(search_work *w, gonio_error *error);
gonio_status gonio_search_bricks(search_work *w, gonio_error *error);
// Another target for a candidate; *keeps: some model keeps it.
gonio_status gonio_search_retarget(const search_work *w, search_candidate *c, double target, bool *keeps,
                                   gonio_error *error);
// final: with its uncertainty. The caller frees the model.
gonio_status gonio_search_model(const search_work *w, const search_candidate *c, bool final, gonio_model **out,
                                gonio_error *error);
void gonio_search_describe(const search_candidate *c, char *text, size_t size);

#endif
