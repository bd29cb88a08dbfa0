// SPDX-License-Identifier: BSD-3-Clause
// What a map is held against: the simplified mesh with the original's normals and materials, many samples a pixel. That
// is the limit of all methods that filter normals (Wu, Dorsey and Rushmeier 2009, fig. 1b): nothing of the fine
// geometry hides or shadows anything.
#include <math.h>
#include <pthread.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/random.h"
#include "base/thread_pool.h"
#include "base/vector.h"
#include "scene/cpm/map.h"
#include "scene/image.h"
#include "scene/world/camera.h"
#include "scene/world/path.h"

#define GRAZING 1e-3

typedef struct frame {
    const gonio_cpm *cpm;
    const gonio_scene_options *options;
    world_camera camera;
    gonio_picture *picture;
    pthread_mutex_t mutex; // of what follows
    int rows;
    bool stopped;
} frame;

typedef struct looking {
    const gonio_cpm *cpm;
    gonio_vec3 point, normal; // of the simplified mesh, toward the eye
    world_place place;        // of the original
    gonio_vec3 wo;            // in the place's frame
    double *rgb;
} looking;

// The original's place that lies straight above or below one of the simplified mesh, the nearer of both, as normal maps
// are made.
static bool find_place(const gonio_cpm *cpm, gonio_vec3 point, gonio_vec3 normal, world_place *place) {
    const scene_caster *caster = cpm->scene->caster;
    scene_hit best = {.distance = INFINITY};
    for (int side = -1; side <= 1; side += 2) {
        const gonio_vec3 toward = scaled(normal, side);
        scene_hit hit;
        const gonio_vec3 start = gonio_scene_caster_leave(caster, point, toward, scaled(toward, -1));
        if (gonio_scene_caster_hit(caster, start, toward, &hit) && hit.distance < best.distance) {
            best = hit;
        }
    }
    cpm_place found;
    if (best.distance < INFINITY) {
        gonio_cpm_place(cpm->scene, (uint32_t)best.triangle, best.u, best.v, &found);
        *place = found.place;
    }
    return best.distance < INFINITY;
}

static void receive(const looking *l, gonio_vec3 toward, double distance, const double light[3], double weight) {
    gonio_vec3 wi = gonio_world_local(&l->place, toward);
    double f[3];
    if (!(wi.z > 0) || !(dot(l->normal, toward) > 0) ||
        gonio_cpm_surface_blocked(l->cpm->store.surface, l->point, l->normal, toward, distance)) {
        return;
    }
    gonio_world_eval(l->cpm->scene, l->place.material, wi, l->wo, f);
    for (int c = 0; c < 3; c++) {
        l->rgb[c] += f[c] * l->place.albedo[c] * wi.z * light[c] * weight;
    }
}

static void light_place(const looking *l, const world_path *path) {
    const scene_settings *s = l->cpm->scene->settings;
    for (int i = 0; i < s->lights; i++) {
        const scene_light_settings *light = &s->light[i];
        gonio_vec3 toward = {light->toward[0], light->toward[1], light->toward[2]};
        double distance = INFINITY;
        if (light->kind == SCENE_LIGHT_POINT) {
            toward = difference((gonio_vec3){light->position[0], light->position[1], light->position[2]}, l->point);
            distance = sqrt(dot(toward, toward));
            toward = scaled(toward, 1 / fmax(distance, 1e-300));
        }
        if (light->kind != SCENE_LIGHT_ENVIRONMENT) {
            receive(l, toward, distance, light->intensity, distance < INFINITY ? 1 / (distance * distance) : 1);
        }
    }
    if (l->cpm->scene->environment != NULL) {
        double u[2], radiance[3];
        gonio_vec3 toward;
        gonio_world_path_random(path, 1, u);
        const double pdf = gonio_world_environment_sample(l->cpm->scene->environment, u, &toward, radiance);
        if (pdf > 0) {
            receive(l, toward, INFINITY, radiance, 1 / pdf);
        }
    }
}

static void trace(const frame *f, const world_path *path, gonio_vec3 direction, double rgb[3]) {
    looking l = {.cpm = f->cpm, .rgb = rgb};
    const world_environment *environment = f->cpm->scene->environment;
    if (!gonio_cpm_surface_hit(f->cpm->store.surface, f->camera.eye, direction, &l.point, &l.normal)) {
        if (environment != NULL && gonio_world_environment_visible(environment)) {
            gonio_world_environment_radiance(environment, direction, rgb);
        }
        return;
    }
    if (find_place(f->cpm, l.point, l.normal, &l.place)) {
        l.wo = gonio_world_local(&l.place, scaled(direction, -1));
        if (l.wo.z < GRAZING) { // the original's normal may turn away from the eye
            l.wo.z = GRAZING;
            l.wo = normalised(l.wo);
        }
        light_place(&l, path);
    }
}

static bool is_stopped(frame *f) {
    const gonio_scene_options *o = f->options;
    pthread_mutex_lock(&f->mutex);
    const double done = (double)f->rows++ / o->height;
    f->stopped = f->stopped || (o->progress != NULL && !o->progress(o->progress_context, done, 0));
    const bool stopped = f->stopped;
    pthread_mutex_unlock(&f->mutex);
    return stopped;
}

static void trace_row(void *context, size_t y) {
    frame *f = context;
    const gonio_scene_options *o = f->options;
    if (is_stopped(f)) {
        return;
    }
    for (int x = 0; x < o->width; x++) {
        const int pixel = (int)y * o->width + x;
        world_path path = {.seed = gonio_random(o->seed ^ gonio_random((uint64_t)pixel))};
        double total[3] = {0};
        for (int k = 0; k < o->samples; k++) {
            double u[2], one[3] = {0};
            path.index = (uint32_t)k;
            gonio_world_path_random(&path, 0, u);
            trace(f, &path, gonio_world_camera_ray(&f->camera, x + u[0], (double)y + u[1]), one);
            for (int c = 0; c < 3; c++) {
                total[c] += one[c];
            }
        }
        for (size_t c = 0; c < 3; c++) {
            f->picture->rgb[3 * (size_t)pixel + c] = (float)(total[c] / o->samples);
        }
    }
}

gonio_status gonio_cpm_render_normal_map(const gonio_cpm *cpm, const gonio_scene_options *options, gonio_picture **out,
                                         double *seconds, gonio_error *error) {
    *out = NULL;
    frame f = {.cpm = cpm, .options = options};
    const double started_s = gonio_clock_s();
    gonio_status status = options->samples >= 1
                              ? GONIO_OK
                              : gonio_fail(error, GONIO_E_RANGE, "%d samples a pixel; at least 1", options->samples);
    status = status == GONIO_OK ? gonio_world_camera(cpm->scene, options, &f.camera, error) : status;
    status = status == GONIO_OK ? gonio_scene_picture_new(options->width, options->height, &f.picture, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    pthread_mutex_init(&f.mutex, NULL);
    gonio_pool_for(options->threads, (size_t)options->height, trace_row, &f);
    pthread_mutex_destroy(&f.mutex);
    if (f.stopped) {
        gonio_picture_free(f.picture);
        return gonio_fail(error, GONIO_E_INTERRUPTED, "stopped before the picture was whole");
    }
    if (seconds != NULL) {
        *seconds = gonio_clock_s() - started_s;
    }
    *out = f.picture;
    return GONIO_OK;
}
