// SPDX-License-Identifier: BSD-3-Clause
#include "scene/world/camera.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vector.h"

#define FOV 35.0
#define MARGIN 1.1

static gonio_vec3 vector(const double v[3]) { return (gonio_vec3){v[0], v[1], v[2]}; }

static void add_standard(gonio_scene *scene) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * scene->mesh->vertices; i++) {
        low[i % 3] = fmin(low[i % 3], (double)scene->mesh->positions[i]);
        high[i % 3] = fmax(high[i % 3], (double)scene->mesh->positions[i]);
    }
    const scene_image_settings *image = &scene->settings->image;
    double radius = 0;
    scene_camera_settings *c = &scene->settings->camera[0];
    *c = (scene_camera_settings){.up = {0, 1, 0}, .fov = FOV};
    for (int k = 0; k < 3; k++) {
        c->target[k] = c->eye[k] = (low[k] + high[k]) / 2;
        radius += (high[k] - low[k]) * (high[k] - low[k]) / 4;
    }
    const double narrow = fmin(1, (double)image->width / image->height);
    c->eye[2] += MARGIN * sqrt(radius) / sin(atan(narrow * tan(gonio_radians(FOV / 2))));
    scene->settings->cameras = 1;
}

gonio_status gonio_world_cameras_check(const char *path, gonio_scene *scene, gonio_error *error) {
    if (scene->settings->cameras == 0) {
        add_standard(scene);
    }
    for (int i = 0; i < scene->settings->cameras; i++) {
        const scene_camera_settings *c = &scene->settings->camera[i];
        const gonio_vec3 ahead = difference(vector(c->target), vector(c->eye)), right = cross(ahead, vector(c->up));
        if (!(dot(right, right) > 1e-18 * dot(ahead, ahead) * dot(vector(c->up), vector(c->up)))) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, c->line,
                                   "[camera %s]: eye and target are one, or up points along the view", c->name);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_world_camera(const gonio_scene *scene, const gonio_scene_options *options, world_camera *camera,
                                gonio_error *error) {
    const scene_settings *s = scene->settings;
    const char *name = options->camera;
    int found = name == NULL ? 0 : -1;
    for (int i = 0; i < s->cameras && found < 0; i++) {
        found = strcmp(s->camera[i].name, name) == 0 ? i : -1;
    }
    if (found < 0) {
        return gonio_fail(error, GONIO_E_INPUT, "the scene has no [camera %.80s]", name);
    }
    const scene_camera_settings *c = &s->camera[found];
    camera->eye = vector(c->eye);
    if (options->turn_deg != 0) {
        const gonio_vec3 from = difference(camera->eye, vector(c->target));
        camera->eye = sum(vector(c->target), turned(from, normalised(vector(c->up)), gonio_radians(options->turn_deg)));
    }
    camera->ahead = normalised(difference(vector(c->target), camera->eye));
    camera->right = normalised(cross(camera->ahead, vector(c->up)));
    camera->up = cross(camera->right, camera->ahead);
    camera->tangent = 2 * tan(gonio_radians(c->fov / 2)) / options->height;
    camera->width = options->width;
    camera->height = options->height;
    return GONIO_OK;
}

gonio_vec3 gonio_world_camera_ray(const world_camera *c, double x, double y) {
    const double right = (x - c->width / 2.0) * c->tangent, up = (c->height / 2.0 - y) * c->tangent;
    return normalised(sum(c->ahead, sum(scaled(c->right, right), scaled(c->up, up))));
}
