// SPDX-License-Identifier: BSD-3-Clause
// A picture: tiles that threads share, each pixel by itself, so that their number changes nothing.
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/random.h"
#include "base/thread_pool.h"
#include "scene/image.h"
#include "scene/world/camera.h"
#include "scene/world/path.h"

#define TILE 16 // pixels a side
#define ASK 256 // paths after which it may be stopped
#define SIDE_MAX 16384
#define SAMPLES_MAX (1 << 20)

typedef struct frame {
    const gonio_scene *scene;
    const gonio_scene_options *options;
    world_camera camera;
    int light; // 1 + the number of the one that shines; 0: all
    gonio_picture *picture;
    int tiles_across;
    size_t tiles, finished;
    uint64_t rays;
    bool stopped;
    double started_s;
    pthread_mutex_t mutex;
} frame;

void gonio_scene_options_default(const gonio_scene *scene, gonio_scene_options *options) {
    const scene_image_settings *s = &scene->settings->image;
    *options = (gonio_scene_options){.width = s->width,
                                     .height = s->height,
                                     .samples = s->samples,
                                     .interreflection = s->interreflection,
                                     .seed = 1};
}

static void tell(frame *f) {
    const gonio_scene_options *o = f->options;
    if (o->progress != NULL && !f->stopped) {
        const double done = (double)f->finished / (double)f->tiles,
                     seconds = fmax(gonio_clock_s() - f->started_s, 1e-9);
        f->stopped =
            !o->progress(o->progress_context, done, done * o->width * o->height * (double)o->samples / seconds);
    }
}

static bool is_stopped(frame *f) {
    pthread_mutex_lock(&f->mutex);
    tell(f);
    const bool stopped = f->stopped;
    pthread_mutex_unlock(&f->mutex);
    return stopped;
}

static uint64_t trace_pixel(frame *f, int x, int y) {
    const gonio_scene_options *o = f->options;
    const int pixel = y * o->width + x;
    world_path path = {.scene = f->scene,
                       .interreflection = o->interreflection,
                       .light = f->light,
                       .seed = gonio_random(o->seed ^ gonio_random((uint64_t)pixel)),
                       .pixel = pixel,
                       .scale = 1.0 / o->samples,
                       .use = o->use,
                       .use_context = o->use_context};
    double total[3] = {0};
    for (int k = 0; k < o->samples && (k % ASK != ASK - 1 || !is_stopped(f)); k++) {
        double u[2], rgb[3];
        path.index = (uint32_t)k;
        gonio_world_path_random(&path, 0, u);
        gonio_world_path_trace(&path, f->camera.eye, gonio_world_camera_ray(&f->camera, x + u[0], y + u[1]), rgb, NULL);
        for (int c = 0; c < 3; c++) {
            total[c] += rgb[c];
        }
    }
    for (int c = 0; c < 3; c++) {
        f->picture->rgb[3 * (size_t)pixel + (size_t)c] = (float)(total[c] / o->samples);
    }
    return path.rays;
}

static void trace_tile(void *context, size_t item) {
    frame *f = context;
    const int left = (int)(item % (size_t)f->tiles_across) * TILE, top = (int)(item / (size_t)f->tiles_across) * TILE;
    uint64_t rays = 0;
    for (int y = top; y < top + TILE && y < f->options->height; y++) {
        const bool stopped = is_stopped(f);
        for (int x = left; x < left + TILE && x < f->options->width && !stopped; x++) {
            rays += trace_pixel(f, x, y);
        }
    }
    pthread_mutex_lock(&f->mutex);
    f->rays += rays;
    f->finished++;
    tell(f);
    pthread_mutex_unlock(&f->mutex);
}

static gonio_status check(const gonio_scene_options *o, gonio_error *error) {
    if (o->width < 1 || o->width > SIDE_MAX || o->height < 1 || o->height > SIDE_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "a picture of %d x %d pixels; 1 to %d are possible", o->width,
                          o->height, SIDE_MAX);
    }
    if (o->samples < 1 || o->samples > SAMPLES_MAX) {
        return gonio_fail(error, GONIO_E_RANGE, "%d samples a pixel; 1 to %d are possible", o->samples, SAMPLES_MAX);
    }
    return GONIO_OK;
}

static gonio_status find_light(const gonio_scene *scene, const char *name, int *light, gonio_error *error) {
    for (int i = 0; name != NULL && i < scene->settings->lights; i++) {
        if (strcmp(scene->settings->light[i].name, name) == 0) {
            *light = i + 1;
            return GONIO_OK;
        }
    }
    return name == NULL ? GONIO_OK : gonio_fail(error, GONIO_E_INPUT, "the scene has no [light %.80s]", name);
}

gonio_status gonio_scene_render(const gonio_scene *scene, const gonio_scene_options *options, gonio_picture **out,
                                gonio_scene_report *report, gonio_error *error) {
    *out = NULL;
    frame f = {.scene = scene, .options = options, .started_s = gonio_clock_s()};
    gonio_status status = check(options, error);
    status = status == GONIO_OK ? gonio_world_camera(scene, options, &f.camera, error) : status;
    status = status == GONIO_OK ? find_light(scene, options->light, &f.light, error) : status;
    status = status == GONIO_OK ? gonio_scene_picture_new(options->width, options->height, &f.picture, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    f.tiles_across = (options->width + TILE - 1) / TILE;
    f.tiles = (size_t)f.tiles_across * (size_t)((options->height + TILE - 1) / TILE);
    pthread_mutex_init(&f.mutex, NULL);
    gonio_pool_for(options->threads, f.tiles, trace_tile, &f);
    pthread_mutex_destroy(&f.mutex);
    if (f.stopped) {
        gonio_picture_free(f.picture);
        return gonio_fail(error, GONIO_E_INTERRUPTED, "stopped after %zu of %zu tiles", f.finished, f.tiles);
    }
    if (report != NULL) {
        *report =
            (gonio_scene_report){(uint64_t)options->width * (uint64_t)options->height * (uint64_t)options->samples,
                                 f.rays, gonio_clock_s() - f.started_s};
    }
    *out = f.picture;
    return GONIO_OK;
}
