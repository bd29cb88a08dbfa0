// SPDX-License-Identifier: BSD-3-Clause
// Scenes: meshes, materials, lights and cameras of an INI file (docs/scenes.md), and their pictures.
#ifndef GONIO_SCENE_H
#define GONIO_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/direction.h"
#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/needs.h"
#include "gonio/status.h"

GONIO_BEGIN

// Immutable once open: any number of threads may render it.
typedef struct gonio_scene gonio_scene;

typedef struct gonio_scene_facts {
    size_t triangles;
    size_t degenerate; // of them without an area, which no ray meets
    size_t open_edges; // of the meshes: edges of one triangle alone
    int meshes, materials, lights, cameras;
    int width, height, samples; // what the file says
    bool interreflection;
} gonio_scene_facts;

// GONIO_E_INPUT with file and line for the scene and for every model, mesh and picture that it names. The caller frees
// it.
gonio_status gonio_scene_open(const char *path, gonio_scene **out, gonio_error *error);
void gonio_scene_free(gonio_scene *scene); // NULL is allowed
void gonio_scene_describe(const gonio_scene *scene, gonio_scene_facts *facts);
// Of its materials, in the file's order; borrowed. NULL beyond the last one.
const char *gonio_scene_material_name(const gonio_scene *scene, int material);
// Of its cameras (of a scene without any: "", the one that sees all of it) and lights, likewise.
const char *gonio_scene_camera_name(const gonio_scene *scene, int camera);
const char *gonio_scene_light_name(const gonio_scene *scene, int light);
const gonio_model *gonio_scene_material_model(const gonio_scene *scene, int material);
// GONIO_E_USAGE, with a list, where there is none of that name.
gonio_status gonio_scene_material_find(const gonio_scene *scene, const char *name, int *material, gonio_error *error);
// Another model for a material: *model becomes the one that it had, which is the caller's then. On failure nothing
// changes. Not while another thread renders.
gonio_status gonio_scene_exchange_model(gonio_scene *scene, int material, gonio_model **model, gonio_error *error);

// A place where a path is lit: what a picture asks of a material. wi and wo are unit vectors in the material's own
// frame; weight is what f_r of each of red, green and blue is multiplied by in the picture's pixel, and light what
// comes of it there.
typedef struct gonio_scene_use {
    int pixel; // row x width + column
    int material;
    gonio_vec3 wi, wo;
    double weight[3], light[3];
} gonio_scene_use;

// gonio_scene_options_default() first, which takes what the file says.
typedef struct gonio_scene_options {
    int width, height;
    int samples; // paths a pixel
    bool interreflection;
    const char *camera; // its name; NULL: the first
    double turn_deg;    // the camera goes round its target, about its upward direction
    const char *light;  // the name of the one that shines; NULL: all
    uint64_t seed;
    int threads; // 0: all; the picture does not depend on it
    // Called now and then with the fraction done; returning false stops the call, which gives GONIO_E_INTERRUPTED.
    bool (*progress)(void *context, double fraction, double paths_per_s);
    void *progress_context;
    // Called for every place where a path is lit, by several threads at once; NULL: not wanted.
    void (*use)(void *context, const gonio_scene_use *use);
    void *use_context;
} gonio_scene_options;
void gonio_scene_options_default(const gonio_scene *scene, gonio_scene_options *options);

// Linear sRGB light, rows from the top.
typedef struct gonio_picture {
    int width, height;
    float *rgb;
} gonio_picture;

typedef struct gonio_scene_report {
    uint64_t paths, rays;
    double seconds;
} gonio_scene_report;

// The same bits for any number of threads. report may be NULL. GONIO_E_RANGE for impossible options, GONIO_E_INPUT for
// an unknown camera. The caller frees the picture.
gonio_status gonio_scene_render(const gonio_scene *scene, const gonio_scene_options *options, gonio_picture **out,
                                gonio_scene_report *report, gonio_error *error);

// .png (by the sRGB curve), .exr, .hdr, .pic or .pfm. GONIO_E_INPUT names the file and what is wrong with it.
gonio_status gonio_picture_read(const char *path, gonio_picture **out, gonio_error *error);
// .png: 8-bit sRGB of `scale` times the light; .exr and .pfm: the light itself. Written beside and renamed.
gonio_status gonio_picture_write(const gonio_picture *picture, const char *path, double scale, gonio_error *error);
// GONIO_E_USAGE where a file of this name cannot be written.
gonio_status gonio_picture_check_name(const char *path, gonio_error *error);
// What makes the 99th percentile of the pixels that are not black nearly white; 1 where all are.
gonio_status gonio_picture_exposure(const gonio_picture *picture, double *scale, gonio_error *error);
void gonio_picture_free(gonio_picture *picture); // NULL is allowed

typedef struct gonio_picture_error {
    double mae; // mean over the pixels of the length of the difference of their 8-bit sRGB codes (Park and Lee 2015,
                // eq. 16)
    double psnr_db; // of the codes, peak 255; infinite for equal pictures
    double largest; // difference of two codes
    double snr_db;  // of the light: 10 log10 of the reference's squares over those of the difference
} gonio_picture_error;

// Both at one scale, as gonio_picture_write has it. GONIO_E_RANGE for pictures of different sizes.
gonio_status gonio_picture_compare(const gonio_picture *picture, const gonio_picture *reference, double scale,
                                   gonio_picture_error *result, gonio_error *error);
// A picture of the difference: .png: 8 times the absolute differences of the codes; .exr and .pfm: light less the
// reference's.
gonio_status gonio_picture_write_difference(const gonio_picture *picture, const gonio_picture *reference, double scale,
                                            const char *path, gonio_error *error);

GONIO_END
#endif
