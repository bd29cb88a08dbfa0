// SPDX-License-Identifier: BSD-3-Clause
// Preview pictures: lit spheres or meshes of one or several models side by side.
#ifndef GONIO_RENDER_H
#define GONIO_RENDER_H

#include "gonio/export.h"
#include "gonio/model.h"

GONIO_BEGIN

// The camera looks along -z at an object of radius 1 with +y up; the light is directional, light_theta from the view
// axis, light_phi about it from +x (right) toward +y (up); it is the only light. Anisotropic models: +x of the sample
// follows the texture coordinates' u where the mesh has them, else the horizontal (about +y).
#define GONIO_RENDER_MODELS_MAX 64
typedef struct gonio_render_options {
    int width, height; // of one model's tile, 16 to 8192
    const char *mesh;  // PLY or OBJ; NULL: a sphere
    bool mesh_z_up;    // the mesh's +z is up instead of +y
    double light_theta_deg, light_phi_deg;
    bool exposure_auto; // the 99th percentile of the strip becomes nearly white
    double exposure_ev; // else: a white diffuser facing the light is 2^ev
    int threads;        // 0: all
} gonio_render_options;
typedef struct gonio_render_result {
    int width, height;  // of the whole image
    double exposure_ev; // used
} gonio_render_result;
void gonio_render_options_default(gonio_render_options *options);
// A strip of n models side by side, one exposure, 8-bit sRGB PNG, written beside and renamed. Models of three channels
// show as linear sRGB, spectral ones ("550nm" ...) by their CIE colour under equal-energy light, others as the grey of
// their mean. result may be NULL. GONIO_E_INPUT for a mesh that cannot be read, GONIO_E_RANGE for impossible options.
gonio_status gonio_render(const gonio_model *const *models, int n, const gonio_render_options *options,
                          const char *path, gonio_render_result *result, gonio_error *error);
// How far the pictures of two models lie apart: the mean absolute difference of the object's 8-bit sRGB codes at one
// exposure.
gonio_status gonio_render_difference(const gonio_model *a, const gonio_model *b, const gonio_render_options *options,
                                     double *mean, gonio_error *error);

GONIO_END
#endif
