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

GONIO_END
#endif
