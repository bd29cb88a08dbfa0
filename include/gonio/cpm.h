// SPDX-License-Identifier: BSD-3-Clause
// Characteristic point maps (Wu, Dorsey and Rushmeier 2009): a scene's appearance from afar, as few weighted points of
// it for each texel of a simplified mesh.
#ifndef GONIO_CPM_H
#define GONIO_CPM_H

#include "gonio/export.h"
#include "gonio/scene.h"

GONIO_BEGIN

// What a texel is the mean over: its own square, or one twice as wide whose weight falls off linearly.
typedef enum gonio_cpm_filter { GONIO_CPM_BOX, GONIO_CPM_TENT } gonio_cpm_filter;

// gonio_cpm_options_default() first.
typedef struct gonio_cpm_options {
    int resolution; // texels a side of the finest level, a power of two, 1 to 1024
    size_t points;  // dense points for a finest texel, on average
    size_t dense;   // a coarser texel's at most
    size_t batch;   // columns of one matrix at most
    int pairs;      // of directions
    double snr_db;  // that the chosen points must reach at pairs of other directions
    gonio_cpm_filter filter;
    size_t most;     // points of a texel and channel at most
    int faces;       // pixels a side of the cube's faces over which the visible area is kept: a power of two, 4 to 64
    double keep;     // share of its Haar coefficients
    double share;    // of the triangles that the simplified mesh keeps
    bool own_charts; // even where the meshes have texture coordinates of their own
    bool separate;   // points are chosen for each channel by itself
    bool paper;      // the paper's random choice in place of the greedy one
    double energy;   // of that: share of the squares that the approximation of rank k keeps
    uint64_t seed;
    int threads;   // 0: all; the map does not depend on it
    size_t memory; // bytes for points and texels in work at most; 0: no bound. The map does not depend on it
    bool (*progress)(void *context, double fraction, double texels_per_s); // false stops, as elsewhere
    void *progress_context;
} gonio_cpm_options;
void gonio_cpm_options_default(gonio_cpm_options *options);

typedef struct gonio_cpm_facts {
    int resolution, levels;
    size_t triangles, simplified; // of the scene and of the simplified mesh
    bool own_charts;
    size_t open_edges;    // of the scene, whose other sides no texel knows
    size_t texels, empty; // of all levels: with points, and of the square's without
    size_t points;        // chosen
    size_t coefficients;
    size_t missed; // texels that stayed below the signal-to-noise ratio
    uint64_t bytes;
    double mean_snr_db;
    double seconds; // of this call of gonio_cpm_build; 0 of an open map
    // Of the whole build, of all threads together: visible areas, reflectances, the choice of points; 0: not known.
    double area_s, reflectance_s, choice_s;
} gonio_cpm_facts;

// Builds the map of all of a scene's meshes into a folder, which is made. A build that was stopped or killed goes on
// with the same bytes. GONIO_E_INPUT where the folder holds another build.
gonio_status gonio_cpm_build(const gonio_scene *scene, const char *folder, const gonio_cpm_options *options,
                             gonio_cpm_facts *facts, gonio_error *error);

typedef struct gonio_cpm gonio_cpm;
// A map of that scene, whose lights, cameras and sizes may be others. Mapped: texels are read, and held against their
// checksums, where they are used. GONIO_E_INPUT for damage, and for a map of another scene. The caller frees it.
gonio_status gonio_cpm_open(const char *folder, const gonio_scene *scene, gonio_cpm **out, gonio_error *error);
void gonio_cpm_free(gonio_cpm *cpm); // NULL is allowed
void gonio_cpm_describe(const gonio_cpm *cpm, gonio_cpm_facts *facts);

typedef enum gonio_cpm_show {
    GONIO_CPM_LIGHT,
    GONIO_CPM_LEVELS,  // as colours
    GONIO_CPM_DENSITY, // points of texels, 1 for the most
    GONIO_CPM_COVERAGE // 1 where the object covers a pixel wholly
} gonio_cpm_show;

typedef struct gonio_cpm_render_options {
    gonio_cpm_show show;
    double bias;  // of the level; below 0: finer
    int fallback; // paths in place of a ray whose texel would be finer than the finest
    int edge;     // rays that tell how much of a pixel at an edge is covered
    int sky;      // directions that a texel takes of an environment, for all its points
    double near;  // a point light is this many texel sizes away, or a finer level is taken
} gonio_cpm_render_options;
void gonio_cpm_render_options_default(gonio_cpm_render_options *options);

typedef struct gonio_cpm_render_report {
    size_t texels;           // evaluated
    uint64_t rays, original; // rays of the camera, and those that the original was rendered for
    double seconds;
} gonio_cpm_render_report;

// gonio_scene_render by the map; options->samples are rays a pixel (4 are usual). Direct light only.
gonio_status gonio_cpm_render(const gonio_cpm *cpm, const gonio_scene_options *options,
                              const gonio_cpm_render_options *how, gonio_picture **out, gonio_cpm_render_report *report,
                              gonio_error *error);
// What it competes with: the simplified mesh with the original's normals and materials, options->samples a pixel. seconds may be NULL.
gonio_status gonio_cpm_render_normal_map(const gonio_cpm *cpm, const gonio_scene_options *options, gonio_picture **out,
                                         double *seconds, gonio_error *error);

GONIO_END
#endif
