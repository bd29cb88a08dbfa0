// SPDX-License-Identifier: BSD-3-Clause
// Between scenes and the models that they need (docs/scene-driven.md): what a scene asks for, how far its pictures are
// off with another model, and the smallest model that they show no difference with.
#ifndef GONIO_SCENE_NEEDS_H
#define GONIO_SCENE_NEEDS_H

#include "gonio/fit.h"
#include "gonio/needs.h"
#include "gonio/scene.h"

GONIO_BEGIN

typedef struct gonio_scene_needs_options {
    gonio_scene_options render; // of each frame; camera, turn_deg and light are the frames'
    size_t cells;               // of a material at most: where pixels ask for more, cells are coarser. 0: 200,000
} gonio_scene_needs_options;

// What the frames ask for. Their exposures, where they are 0, become what makes each frame's 99th percentile nearly
// white. path: the scene's file, which the needs name. The same for any number of threads. The caller frees the needs.
gonio_status gonio_scene_needs(const gonio_scene *scene, const char *path, const gonio_scene_needs_options *options,
                               const gonio_needs_frame *frames, int n, gonio_needs **out, gonio_error *error);

// The scene of the needs, once it is known to be the one that they were made of: GONIO_E_INPUT where its file has
// changed. The caller frees it.
gonio_status gonio_needs_open_scene(const gonio_needs *needs, gonio_scene **scene, gonio_error *error);

// How the needs' frames are rendered; without threads and callback.
void gonio_needs_render_options(const gonio_needs *needs, const gonio_scene *scene, gonio_scene_options *options);

// Pictures of frames.
typedef struct gonio_frames gonio_frames;
// One of each, turned by turn_deg more; exposures of 0 are each picture's own. The caller frees them.
gonio_status gonio_frames_render(const gonio_scene *scene, const gonio_scene_options *render,
                                 const gonio_needs_frame *frames, int n, double turn_deg, gonio_frames **out,
                                 gonio_error *error);
void gonio_frames_free(gonio_frames *frames); // NULL is allowed
// At the reference's exposures: mean, PSNR of all pixels, largest.
gonio_status gonio_frames_compare(const gonio_frames *frames, const gonio_frames *reference,
                                  gonio_picture_error *result, gonio_error *error);

// ---- the smallest model that pictures show no difference with ----

typedef struct gonio_scene_fit_options {
    double
        image_error; // mean distance of 8-bit RGB that the frames may have (gonio_picture_error.mae); 0: psnr_db counts
    double psnr_db;  // that they must have; 0: image_error counts
    bool least_ns;   // the quickest model in place of the smallest; depends on the machine
    const char *truth; // the model that the frames should show (gonio_model_resolve); NULL: the fit at its best
    double turn_deg;   // the frames are also compared from cameras so far round their targets; 0: they are not
    // Called before each step with what is done; returning false stops the call, which gives GONIO_E_INTERRUPTED.
    bool (*progress)(void *context, const char *what);
    void *progress_context;
} gonio_scene_fit_options;

// A model that was tried. Errors are NaN where they were not found out.
typedef struct gonio_scene_fit_step {
    char what[160]; // the method and its options
    size_t bytes, bricks;
    double ns;           // an evaluation; NaN unless it counts
    double predicted;    // mean distance that its values at the cells promise
    double mae, psnr_db; // of the frames, against the truth
    bool met, chosen;
} gonio_scene_fit_step;

#define GONIO_SCENE_FIT_STEPS 32
typedef struct gonio_scene_fit_report {
    int compared; // models that were tried on the cells; steps: those that were rendered
    int steps;
    gonio_scene_fit_step step[GONIO_SCENE_FIT_STEPS];
    gonio_picture_error image;  // of the chosen model, against the truth
    gonio_picture_error turned; // the same from the cameras that are turned
    gonio_picture_error best;   // of the fit at its best, against a truth that was given; else 0
    double expected;            // mean distance that the fit's own sigma at the cells lets expect; NaN: it has none
    size_t best_bytes;          // of the fit at its best
    // Of a chosen CBMBA model: bytes of a lattice of its level (float32), and of one of which all that directions
    // reach is kept in its storage; else 0.
    size_t lattice_bytes, reachable_bytes;
} gonio_scene_fit_report;

// Fit the samples as the options say (at its best), then search the smallest model that shows the scene's frames as the
// truth does: formulae, and CBMBA models in every coordinate system, of which only bricks that the frames ask for are
// fine, each weighted by what hangs on it; render, compare and adjust until the limit is met. method "cbmba" in the
// options: only such models, with its other options. report->held_out is the fit's at its best.
// GONIO_E_CONVERGENCE where nothing meets the limit, with the best that was reached.
gonio_status gonio_fit_scene(const gonio_samples *samples, const gonio_fit_options *options, const gonio_needs *needs,
                             int material, const gonio_scene_fit_options *how, gonio_model **out,
                             gonio_fit_report *report, gonio_scene_fit_report *steps, gonio_error *error);

GONIO_END
#endif
