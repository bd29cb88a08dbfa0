// SPDX-License-Identifier: BSD-3-Clause
// How far the pictures of one model lie from those of another.
#ifndef GONIO_SCENE_MODEL_PICTURES_H
#define GONIO_SCENE_MODEL_PICTURES_H

#include "gonio/model.h"

typedef struct gonio_image_scene gonio_image_scene;

// The four pictures' geometry; the caller frees it.
gonio_status gonio_image_scene_new(gonio_image_scene **out, gonio_error *error);
void gonio_image_scene_free(gonio_image_scene *scene); // NULL is allowed
// The pictures of a model in linear light; the caller frees *rgb. What is not finite is black. threads 0: all.
gonio_status gonio_image_render(const gonio_image_scene *scene, const gonio_model *model, int threads, float **rgb,
                                gonio_error *error);
// Mean distance of 8-bit sRGB colours over the objects' pixels, 0 to 442; every picture exposed for `reference`.
gonio_status gonio_image_error(const gonio_image_scene *scene, const float *reference, const float *rgb,
                               double *distance, gonio_error *error);

#endif
