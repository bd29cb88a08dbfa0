// SPDX-License-Identifier: BSD-3-Clause
// One texel: its matrix of reflectances, the choice of its characteristic points, its visible area; and the record that
// is made of them.
#ifndef GONIO_SCENE_CPM_TEXEL_H
#define GONIO_SCENE_CPM_TEXEL_H

#include "scene/cpm/area.h"
#include "scene/cpm/points.h"
#include "scene/cpm/select.h"

// Where a chosen point lies, and what its f is multiplied by for red, green and blue: an area.
typedef struct cpm_record_point {
    uint32_t triangle;
    float u, v;
    float weight[3];
} cpm_record_point;

// A record: this, the points, the coefficients. Its length is a multiple of 8.
typedef struct cpm_record {
    uint32_t points, coefficients;
    float centre[3], radius; // of all its dense points
    float floor;             // below this visible area the texel counts as this large
    float scale;             // of the coefficients
    float snr_db;            // at pairs of directions that it was not chosen by
    uint32_t dense;          // points it was chosen from
} cpm_record;

size_t gonio_cpm_record_bytes(const cpm_record *record);
const cpm_record_point *gonio_cpm_record_points(const cpm_record *record);
const cpm_coefficient *gonio_cpm_record_coefficients(const cpm_record *record);

typedef struct cpm_texel_options {
    int pairs;     // of directions: rows of the matrix
    double snr_db; // that the points must reach at other pairs
    size_t most;   // points of one texel
    size_t batch;  // columns of a matrix at most
    int side;      // of the faces of the visible area
    double keep;   // share of its coefficients
    bool separate; // points are chosen for each channel by itself
    bool paper;    // the paper's way of choosing
    double energy; // of that
} cpm_texel_options;

// A place as the matrix needs it.
typedef struct cpm_place {
    world_place place;
    gonio_vec3 start; // off the surface
} cpm_place;
void gonio_cpm_place(const gonio_scene *scene, uint32_t triangle, double u, double v, cpm_place *place);
// f_r cos cos, without visibility.
void gonio_cpm_apparent(const gonio_scene *scene, const cpm_place *place, gonio_vec3 wi, gonio_vec3 wo, double f[3]);

// The directions that a texel is looked at from, which of its points are seen from each, and the area seen.
typedef struct cpm_views {
    size_t n, points;
    gonio_vec3 *directions;
    uint8_t *seen; // n x points
    double *area;  // [n]
} cpm_views;
// About n directions, evenly spread over those from which some of it is seen; areas: that each point stands for.
// false: no memory.
bool gonio_cpm_views_new(const gonio_scene *scene, const cpm_place *places, size_t points, const double *areas,
                         size_t n, uint64_t seed, cpm_views *views);
void gonio_cpm_views_free(cpm_views *views);
// The area seen from one direction; room for a byte a point.
double gonio_cpm_area_seen(const gonio_scene *scene, const cpm_place *places, size_t points, const double *areas,
                           gonio_vec3 w, uint8_t *room);

// What a texel took.
typedef struct cpm_seconds {
    double area, reflectance, choice;
} cpm_seconds;
// The record of a texel's dense points; malloc'd. NULL: no memory.
cpm_record *gonio_cpm_texel_make(const gonio_scene *scene, const cpm_dense *dense, const cpm_texel_options *options,
                                 uint64_t seed, cpm_seconds *seconds);

#endif
