// SPDX-License-Identifier: BSD-3-Clause
// What a ray of the camera sees: sample or reference, lit by the lamp. rig.h states the geometry.
#ifndef GONIO_SIM_SCENE_H
#define GONIO_SIM_SCENE_H

#include "gonio/model.h"
#include "gonio/rig.h"
#include "sim/settings.h"

#define SIM_LIGHT_POINTS 32

// A line in space that an arm turns about; nominally z (azimuths) or y (tilts, at phi = 0) through the origin.
typedef struct sim_axis {
    gonio_vec3 direction, point;
} sim_axis;

// A picture on the fiducial's plate, centred, its right side toward +x and its top toward +y: reflectances 0..1.
typedef struct sim_texture {
    int width, height;
    double mm_per_px;
    float *pixels; // NULL: none
} sim_texture;

typedef struct sim_scene {
    gonio_vec3 light[SIM_LIGHT_POINTS]; // points that share the lamp's power
    int lights;
    double light_distance_mm;
    gonio_vec3 beam;  // unit vector from the lamp to where it is aimed
    double beam_tan2; // of the beam's half angle, squared; INFINITY: it lights all
    gonio_vec3 camera, right, up, forward;
    gonio_target target;
    const gonio_model *sample;        // 1 or 3 channels, as the camera has
    const sim_texture *texture;       // the fiducial's picture
    double pixel;                     // a pixel's side on the plane Z = 1, over which the picture is averaged
    const gonio_model *ball, *mirror; // BRDFs of the polished ball and of the black glass
    gonio_vec3 ball_centre;
    double ball_radius_mm;
    bool sphere;
    double radius_mm, half_plate_mm, half_panel_mm;
    double reflectance[3]; // true one of the white reference
} sim_scene;

// Point k of n (a multiple of 8) that stand for a disc of radius 1.
void gonio_sim_disc_point(int k, int n, double *x, double *y);

// angles: light theta, light phi, camera theta, camera phi (rad), where the arms really stand. axes: the lines that
// they turn about, in the same order; NULL: a perfect rig.
void gonio_sim_scene_place(sim_scene *scene, const sim_settings *settings, const sim_axis *axes,
                           const double angles[GONIO_AXES]);
// The lines of a perfect rig.
void gonio_sim_axes_perfect(sim_axis axes[GONIO_AXES]);

// The radiance along the ray of the undistorted image point (x, y), relative to a perfect white diffuser in the
// sample's plane at the centre, lit at normal incidence from the nominal distance: pi f_r cos(theta_i) (d0/d)^2.
double gonio_sim_scene_radiance(const sim_scene *scene, double x, double y, int channel);

#endif
