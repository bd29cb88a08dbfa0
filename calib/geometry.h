// SPDX-License-Identifier: BSD-3-Clause
// Where light, camera and pixel rays are for a pose (the convention of rig.h), and what a ray meets.
#ifndef CALIB_GEOMETRY_H
#define CALIB_GEOMETRY_H

#include "gonio/rig.h"

// A pose's light and camera in the sample's frame, mm.
typedef struct geometry {
    gonio_vec3 light, camera;
    gonio_vec3 right, up, forward;
    double light_distance_mm; // nominal, to the centre of rotation: where relative irradiance is 1
} geometry;

// A point of the sample seen by a pixel.
typedef struct geometry_hit {
    gonio_vec3 point, normal;
    gonio_vec3 to_light, to_camera; // unit vectors
    double irradiance;              // cos(theta_i) (d0 / d)^2: relative to perpendicular light at the centre
} geometry_hit;

// pose: the axes' counters. Where the rig's alignment is known, its arms stand where that says.
geometry gonio_geometry_of_pose(const gonio_rig_facts *facts, const gonio_pair *pose);
// The directions that a sample of this pose has at the centre: the pose itself on a rig that is taken as perfect.
gonio_pair gonio_geometry_pair(const gonio_rig_facts *facts, const gonio_pair *pose);
// The geometry that a perfect rig has at these directions.
geometry gonio_geometry_of_directions(const gonio_rig_facts *facts, const gonio_pair *pair);

// The ray through (x, y) of the plane Z = 1 (an undistorted pixel), on the face toward the camera. false: it misses.
// *footprint (may be NULL): area on the plate, mm^2, per unit of x and of y.
bool gonio_geometry_plate(const geometry *g, double x, double y, geometry_hit *hit, double *footprint);
// A sphere about the origin.
bool gonio_geometry_sphere(const geometry *g, double x, double y, double radius_mm, geometry_hit *hit);

// The local directions of a hit, turned so that phi_i = 0: for samples that are isotropic.
gonio_pair gonio_geometry_isotropic_pair(const geometry_hit *hit);

// Project a point of the sample's frame to a pixel (u, v), with distortion. false: behind the camera.
bool gonio_geometry_project(const geometry *g, const gonio_camera_info *camera, gonio_vec3 point, double pixel[2]);

#endif
