// SPDX-License-Identifier: BSD-3-Clause
// Pinhole cameras.
#ifndef GONIO_SCENE_WORLD_CAMERA_H
#define GONIO_SCENE_WORLD_CAMERA_H

#include "scene/world/world.h"

typedef struct world_camera {
    gonio_vec3 eye, right, up, ahead; // unit
    double tangent;                   // a pixel's side at distance 1
    int width, height;
} world_camera;

// A scene without cameras gets one that sees all of it along -z. GONIO_E_INPUT for one that looks nowhere.
gonio_status gonio_world_cameras_check(const char *path, gonio_scene *scene, gonio_error *error);
// As the options have it. GONIO_E_INPUT where there is none of that name.
gonio_status gonio_world_camera(const gonio_scene *scene, const gonio_scene_options *options, world_camera *camera,
                                gonio_error *error);
// Toward the place (x, y) of the picture, in pixels from its upper left corner.
gonio_vec3 gonio_world_camera_ray(const world_camera *camera, double x, double y);

#endif
