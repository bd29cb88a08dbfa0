// SPDX-License-Identifier: BSD-3-Clause
// The calibration object: what it is made from, the frames it is given, and its end.
#include "calib/internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "calib/opencv.h"

// Colour of a pixel of the full frame, 0..2 for r g b (rig.h names the colours of the first 2 x 2 pixels).
static uint8_t bayer_channel(gonio_pattern pattern, int u, int v) {
    static const uint8_t colour[5][4] = {[GONIO_MONO] = {0, 0, 0, 0},
                                         [GONIO_RGGB] = {0, 1, 1, 2},
                                         [GONIO_BGGR] = {2, 1, 1, 0},
                                         [GONIO_GRBG] = {1, 0, 2, 1},
                                         [GONIO_GBRG] = {1, 2, 0, 1}};
    return colour[pattern][(v & 1) * 2 + (u & 1)];
}

static gonio_status cast_rays(gonio_calib *calib, gonio_error *error) {
    double *points = malloc(calib->pixels * 2 * sizeof *points);
    if (points == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the rays of %zu pixels", calib->pixels);
    }
    const gonio_window *w = &calib->window;
    for (size_t p = 0; p < calib->pixels; p++) {
        const int u = w->x + (int)(p % (size_t)w->width), v = w->y + (int)(p / (size_t)w->width);
        points[2 * p] = u;
        points[2 * p + 1] = v;
        calib->channel[p] = bayer_channel(calib->camera.pattern, u, v);
    }
    const gonio_status status = gonio_opencv_undistort(&calib->camera, (int)calib->pixels, points, points, error);
    for (size_t i = 0; i < 2 * calib->pixels; i++) {
        calib->ray[i] = (float)points[i];
    }
    free(points);
    return status;
}

static gonio_status check_rig(const gonio_camera_info *camera, const gonio_rig_facts *facts, const gonio_window *w,
                              gonio_error *error) {
    if (camera->bits < 8 || camera->bits > 16) {
        return gonio_fail(error, GONIO_E_INPUT, "a camera of %d bits; 8 to 16 are possible", camera->bits);
    }
    if (w->width < 1 || w->height < 1 || w->x < 0 || w->y < 0 || w->x + w->width > camera->width ||
        w->y + w->height > camera->height) {
        return gonio_fail(error, GONIO_E_INPUT, "window %dx%d+%d+%d outside the camera's %dx%d", w->width, w->height,
                          w->x, w->y, camera->width, camera->height);
    }
    if (!(camera->fx > 0 && camera->fy > 0) || (unsigned)camera->pattern > GONIO_GBRG) {
        return gonio_fail(error, GONIO_E_INPUT, "a camera with focal lengths %g, %g px and pattern %d", camera->fx,
                          camera->fy, (int)camera->pattern);
    }
    if (!(facts->light_distance_mm > 0 && facts->camera_distance_mm > 0)) {
        return gonio_fail(error, GONIO_E_INPUT, "light at %g mm and camera at %g mm; both must be above 0",
                          facts->light_distance_mm, facts->camera_distance_mm);
    }
    if (facts->sphere ? !(facts->sphere_radius_mm > 0) : !(facts->region_radius_mm > 0)) {
        return gonio_fail(error, GONIO_E_INPUT, "the radius of the sphere or of the averaged region must be above 0");
    }
    const int channels = camera->pattern == GONIO_MONO ? 1 : 3;
    for (int c = 0; c < channels; c++) {
        if (!(facts->reference_reflectance[c] > 0 && facts->reference_reflectance[c] <= 2)) {
            return gonio_fail(error, GONIO_E_INPUT, "reference reflectance %g in channel %d",
                              facts->reference_reflectance[c], c);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_calib_new(const gonio_camera_info *camera, const gonio_rig_facts *facts, const gonio_window *window,
                             gonio_calib **out, gonio_error *error) {
    *out = NULL;
    gonio_status status = check_rig(camera, facts, window, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t pixels = (size_t)window->width * (size_t)window->height;
    gonio_calib *calib = calloc(1, sizeof *calib);
    if (calib == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a calibration");
    }
    calib->camera = *camera;
    calib->facts = *facts;
    calib->window = *window;
    calib->pixels = pixels;
    calib->channels = camera->pattern == GONIO_MONO ? 1 : 3;
    static const char names[4][32] = {"r", "g", "b", "value"};
    memcpy(calib->names, names[calib->channels == 1 ? 3 : 0], (size_t)calib->channels * sizeof *names);
    calib->saturation = (1 << camera->bits) - 1;
    calib->ray = malloc(pixels * 2 * sizeof *calib->ray);
    calib->channel = malloc(pixels);
    calib->defect = calloc(pixels, 1);
    calib->bias = calloc(pixels, sizeof *calib->bias);
    calib->dark_rate = calloc(pixels, sizeof *calib->dark_rate);
    calib->stray = calloc(pixels, sizeof *calib->stray);
    calib->flat = calloc(pixels, sizeof *calib->flat);
    calib->flat_variance = calloc(pixels, sizeof *calib->flat_variance);
    if (calib->ray == NULL || calib->channel == NULL || calib->defect == NULL || calib->bias == NULL ||
        calib->dark_rate == NULL || calib->stray == NULL || calib->flat == NULL || calib->flat_variance == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the maps of %zu pixels", pixels);
    }
    status = status == GONIO_OK ? cast_rays(calib, error) : status;
    if (status == GONIO_OK && facts->response_path[0] != '\0') {
        status = gonio_response_load(facts->response_path, camera->bits, &calib->response, error);
    }
    status = status == GONIO_OK && facts->reference_brdf[0] != '\0' ? gonio_white_open(calib, error) : status;
    status = status == GONIO_OK && facts->flat_path[0] != '\0' ? gonio_flat_open(calib, error) : status;
    if (status != GONIO_OK) {
        gonio_calib_free(calib);
        return status;
    }
    *out = calib;
    return GONIO_OK;
}

static void free_frames(stored_frames *frames) {
    for (int i = 0; i < frames->n; i++) {
        free(frames->items[i].pixels);
    }
    free(frames->items);
    *frames = (stored_frames){0};
}

void gonio_calib_free(gonio_calib *calib) {
    if (calib == NULL) {
        return;
    }
    free_frames(&calib->dark);
    free_frames(&calib->trap);
    free_frames(&calib->reference);
    free_frames(&calib->later);
    gonio_response_free(&calib->response);
    gonio_model_free(calib->white);
    free(calib->known_flat);
    free(calib->ray);
    free(calib->channel);
    free(calib->defect);
    free(calib->bias);
    free(calib->dark_rate);
    free(calib->stray);
    free(calib->flat);
    free(calib->flat_variance);
    free(calib);
}

int gonio_calib_channels(const gonio_calib *calib) { return calib->channels; }
const char (*gonio_calib_channel_names(const gonio_calib *calib))[32] { return calib->names; }

gonio_status gonio_exposure_check(const gonio_calib *calib, const gonio_exposure *exposure, gonio_error *error) {
    const gonio_frame *f = &exposure->frame;
    const gonio_window *w = &calib->window;
    const long long pose = f->stamp.pose;
    const int frame = f->stamp.frame;
    if (f->window.x != w->x || f->window.y != w->y || f->window.width != w->width || f->window.height != w->height) {
        return gonio_fail_frame(error, GONIO_E_INPUT, pose, frame, "window %dx%d+%d+%d, expected %dx%d+%d+%d",
                                f->window.width, f->window.height, f->window.x, f->window.y, w->width, w->height, w->x,
                                w->y);
    }
    if (f->pixels == NULL || !(f->exposure_s > 0) || !isfinite(f->exposure_s)) {
        return gonio_fail_frame(error, GONIO_E_INPUT, pose, frame, "exposure of %g s", f->exposure_s);
    }
    if ((calib->dark.n > 0 || calib->prepared) && f->gain_db != calib->gain_db) {
        return gonio_fail_frame(error, GONIO_E_INPUT, pose, frame, "gain %g dB; the dark frames had %g dB", f->gain_db,
                                calib->gain_db);
    }
    if (exposure->monitor <= 0) {
        return gonio_fail_frame(error, GONIO_E_DEVICE, pose, frame, "the lamp is off (monitor reads %g)",
                                exposure->monitor);
    }
    return GONIO_OK;
}

static gonio_status keep(const gonio_calib *calib, stored_frames *frames, const gonio_pair *pose,
                         const gonio_exposure *exposure, gonio_error *error) {
    if (frames->n == MERGE_MAX) {
        return gonio_fail(error, GONIO_E_INPUT, "more than %d frames of one kind", MERGE_MAX);
    }
    const size_t bytes = calib->pixels * sizeof(uint16_t);
    stored_frame *items = realloc(frames->items, ((size_t)frames->n + 1) * sizeof *items);
    uint16_t *pixels = malloc(bytes);
    if (items != NULL) {
        frames->items = items;
    }
    if (items == NULL || pixels == NULL) {
        free(pixels);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a frame of %zu bytes", bytes);
    }
    memcpy(pixels, exposure->frame.pixels, bytes);
    items[frames->n++] = (stored_frame){.pixels = pixels,
                                        .exposure_s = exposure->frame.exposure_s,
                                        .gain_db = exposure->frame.gain_db,
                                        .monitor = exposure->monitor,
                                        .monitor_sigma = exposure->monitor_sigma,
                                        .stamp = exposure->frame.stamp,
                                        .pose = *pose};
    return GONIO_OK;
}

gonio_status gonio_calib_add_dark(gonio_calib *calib, const gonio_exposure *exposure, gonio_error *error) {
    if (calib->prepared) {
        return gonio_fail(error, GONIO_E_USAGE, "a dark frame after the calibration was prepared");
    }
    gonio_exposure unlit = *exposure;
    unlit.monitor = NAN; // the shutter may stand before or behind the monitor
    const gonio_status status = gonio_exposure_check(calib, &unlit, error);
    if (status == GONIO_OK && calib->dark.n == 0) {
        calib->gain_db = exposure->frame.gain_db;
    }
    return status == GONIO_OK ? keep(calib, &calib->dark, &(gonio_pair){0}, &unlit, error) : status;
}

gonio_status gonio_calib_add_trap(gonio_calib *calib, const gonio_exposure *exposure, gonio_error *error) {
    if (calib->prepared) {
        return gonio_fail(error, GONIO_E_USAGE, "a light-trap frame after the calibration was prepared");
    }
    const gonio_status status = gonio_exposure_check(calib, exposure, error);
    return status == GONIO_OK ? keep(calib, &calib->trap, &(gonio_pair){0}, exposure, error) : status;
}

gonio_status gonio_calib_add_reference(gonio_calib *calib, const gonio_pair *pose, const gonio_exposure *exposure,
                                       gonio_error *error) {
    const gonio_status status = gonio_exposure_check(calib, exposure, error);
    stored_frames *frames = calib->prepared ? &calib->later : &calib->reference;
    return status == GONIO_OK ? keep(calib, frames, pose, exposure, error) : status;
}

gonio_status gonio_calib_prepare(gonio_calib *calib, gonio_error *error) {
    if (calib->prepared) {
        return gonio_fail(error, GONIO_E_USAGE, "the calibration is prepared already");
    }
    gonio_status status = gonio_dark_prepare(calib, error);
    status = status == GONIO_OK ? gonio_transfer_prepare(calib, error) : status;
    status = status == GONIO_OK ? gonio_stray_prepare(calib, error) : status;
    status = status == GONIO_OK ? gonio_flat_prepare(calib, error) : status;
    if (status == GONIO_OK) {
        gonio_stray_describe(calib);
        free_frames(&calib->dark);
        free_frames(&calib->trap);
        free_frames(&calib->reference);
        calib->prepared = true;
    }
    return status;
}

const float *gonio_calib_flat(const gonio_calib *calib) { return calib->flat; }
const float *gonio_calib_flat_variance(const gonio_calib *calib) { return calib->flat_variance; }
gonio_window gonio_calib_window(const gonio_calib *calib) { return calib->window; }
const uint8_t *gonio_calib_defects(const gonio_calib *calib) { return calib->defect; }

void gonio_calib_describe(const gonio_calib *calib, gonio_calib_report *report) { *report = calib->report; }
