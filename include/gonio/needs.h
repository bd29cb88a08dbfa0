// SPDX-License-Identifier: BSD-3-Clause
// What scenes ask of materials: which pairs of directions their pixels see, and how much of the picture hangs on each
// (docs/scene-driven.md). gonio_scene_needs makes them of a scene, a fit and a plan go by them.
#ifndef GONIO_NEEDS_H
#define GONIO_NEEDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/direction.h"
#include "gonio/export.h"
#include "gonio/model.h"
#include "gonio/plan.h"
#include "gonio/status.h"

GONIO_BEGIN

// Immutable once made: any number of threads may ask it.
typedef struct gonio_needs gonio_needs;

// A cell of pairs that are asked for: the mean of their directions, in front of the surface. The two measures are means
// over all pixels of all frames, those of background among them.
typedef struct gonio_need {
    gonio_vec3 wi, wo; // unit; of an isotropic material turned so that phi_i = 0 and 0 <= phi_o <= 180 deg
    double codes;      // by how many 8-bit codes (length of red, green and blue) the picture is off where f_r is off by
                       // 100 % here
    double squares;    // the same of the squares of codes: the variance of the picture over that of ln f_r, if one
                       // pixel's errors go together
    double value;      // f_r of the scene's own model there, mean of red, green and blue
} gonio_need;

typedef struct gonio_needs_facts {
    const char *name; // of the material in the scene; borrowed
    bool isotropic;   // the scene's model is
    int resolution;   // cells along each axis of the half-vector-narrow coordinates
    size_t cells;
    double codes, squares; // of all cells
    double behind;         // codes of pairs behind the surface, which are not in the cells
} gonio_needs_facts;

// One picture of the scene.
#define GONIO_NEEDS_NAME_MAX 64
typedef struct gonio_needs_frame {
    char camera[GONIO_NEEDS_NAME_MAX]; // "": the scene's first
    char light[GONIO_NEEDS_NAME_MAX];  // the one that shines; "": all
    double turn_deg;                   // of the camera about its target, around its upward direction
    double exposure;                   // linear light times this is shown, 1 as white
} gonio_needs_frame;

typedef struct gonio_needs_scene {
    const char *path; // of the scene's file, as it is found from here; borrowed
    int width, height, samples;
    bool interreflection;
    int frames;
    const gonio_needs_frame *frame; // borrowed
} gonio_needs_scene;

// Does the file begin as one of needs does? False where it cannot be read.
bool gonio_needs_file_is(const char *path);
// GONIO_E_INPUT with file and line. The caller frees it.
gonio_status gonio_needs_open(const char *path, gonio_needs **out, gonio_error *error);
gonio_status gonio_needs_save(const gonio_needs *needs, const char *path, gonio_error *error);
void gonio_needs_free(gonio_needs *needs); // NULL is allowed

void gonio_needs_describe_scene(const gonio_needs *needs, gonio_needs_scene *scene);
int gonio_needs_materials(const gonio_needs *needs);
// name NULL: the one that asks for anything; GONIO_E_USAGE, with a list, where several do, or where there is none of
// that name.
gonio_status gonio_needs_material(const gonio_needs *needs, const char *name, int *material, gonio_error *error);
void gonio_needs_describe(const gonio_needs *needs, int material, gonio_needs_facts *facts);
// [facts.cells], borrowed, in an order that depends on what is asked alone.
const gonio_need *gonio_needs_cells(const gonio_needs *needs, int material);

// How much hangs on a pair of directions: the density of `squares` about it, in half-vector coordinates over a 32nd of
// each axis (4-D: a 16th), over the mean density of what is asked for; 0 where nothing is. Mean 1 over the cells, each
// counted by its squares; reciprocal and mirrored pairs are not asked.
double gonio_needs_weight(const gonio_needs *needs, int material, gonio_vec3 wi, gonio_vec3 wo);

// How many cells of a lattice (2^level along each axis of the coordinates, of 3 or 4 dimensions as the material) pixels
// ask for. No pair of directions in front of the surface lies in those that are not reachable, so no scene asks for
// them.
typedef struct gonio_needs_count {
    size_t cells, reachable, asked;
} gonio_needs_count;
#define GONIO_NEEDS_LEVEL_MAX 7 // of 3 dimensions; 4: of 4
gonio_status gonio_needs_count_cells(const gonio_needs *needs, int material, gonio_coordinates coordinates, int level,
                                     gonio_needs_count *count, gonio_error *error);

// ---- plans ----

// Seconds that a pose takes of the rig, settling and exposures included, where f_r is about `value`; with the way from
// another pose where that is not NULL.
typedef double gonio_pose_seconds(void *context, const gonio_pair *from, const gonio_pair *to, double value);

typedef struct gonio_needs_plan_options {
    size_t poses;
    double seconds_max;          // no more poses than take so long by `seconds`; 0: no limit
    double explore;              // share of the poses that is spread over all directions
    double theta_max_deg;        // of the poses
    uint64_t seed;               // of that share
    int threads;                 // 0: all
    const gonio_model *model;    // a fit so far, whose sigma or support tells what is known already; NULL: nothing is
    gonio_pose_seconds *seconds; // NULL: all poses take alike
    void *seconds_context;
} gonio_needs_plan_options;

// Of the variance of the pictures, in squares of codes, where an unknown material deviates from what is expected of it
// by as much as materials do.
typedef struct gonio_needs_plan_report {
    double before, after;
} gonio_needs_plan_report;

void gonio_needs_plan_options_default(gonio_needs_plan_options *options);
// Poses in the order in which they are worth most: each makes the variance of the pictures fall most a second of the
// rig, given those before it, so that any number of the first ones is a plan. Deterministic; the caller frees it.
gonio_status gonio_needs_plan(const gonio_needs *needs, int material, const gonio_needs_plan_options *options,
                              gonio_plan **out, gonio_needs_plan_report *report, gonio_error *error);

// gonio_plan_make, "scene:NEEDS[,N=400][,material=NAME][,model=MODEL][,explore=0.1][,theta_max=85][,seconds=S]" and
// "prior:PRIOR[,N=20][,theta_max=85]" (gonio/library.h). seconds may be NULL; report (may be NULL) is of plans of
// scenes, else 0.
gonio_status gonio_plan_resolve(const char *text, uint64_t seed, gonio_pose_seconds *seconds, void *seconds_context,
                                gonio_plan **out, gonio_needs_plan_report *report, gonio_error *error);

GONIO_END
#endif
