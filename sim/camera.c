// SPDX-License-Identifier: BSD-3-Clause
// A frame: electrons by the photon transfer model (EMVA 1288 release 4.0, section 2), then response and quantisation.
//   mean = (gain_px rate lamp + dark_px) exposure;  electrons = min(Poisson(mean), 1.1 full well) + offset_px + read
//   word = floor(black + (full scale - black) response(electrons 10^(gain/20) / full well) + 1/2), clipped
// Full well is the charge that fills the converter's scale at 0 dB; the pixel itself holds a tenth more, so that, as in
// ordinary cameras, a saturated pixel reads exactly full scale.
#include <math.h>
#include <stdio.h>

#include "base/thread_pool.h"
#include "sim/internal.h"
#include "sim/random.h"

#define WELL_RESERVE 1.1
#define GAIN_MAX_DB 24
#define MEAN_MAX_E 1e12   // a delta-like BRDF stays finite; far beyond every well
#define BLACK_FRACTION 64 // the black level is full scale / 64

gonio_pattern gonio_sim_camera_pattern(const gonio_sim *sim) {
    if (sim->settings.camera.pattern != SIM_PATTERN_AUTO) {
        return (gonio_pattern)sim->settings.camera.pattern;
    }
    return sim->sample->channels == 3 ? GONIO_RGGB : GONIO_MONO;
}

static double or_auto(double value, double automatic) { return isnan(value) ? automatic : value; }

void gonio_sim_camera_describe(const gonio_sim *sim, gonio_camera_info *info) {
    const sim_settings *s = &sim->settings;
    // 0.1 mm a pixel at the centre of rotation.
    const double f = 10 * s->rig.camera_distance_mm, fx = or_auto(s->camera.fx_px, f);
    *info = (gonio_camera_info){.name = "simulated camera",
                                .width = s->camera.width,
                                .height = s->camera.height,
                                .bits = s->camera.bits,
                                .pattern = gonio_sim_camera_pattern(sim),
                                .exposure_min_s = s->camera.exposure_min_s,
                                .exposure_max_s = s->camera.exposure_max_s,
                                .fx = fx,
                                .fy = or_auto(s->camera.fy_px, fx),
                                .cx = or_auto(s->camera.cx_px, (s->camera.width - 1) / 2.0),
                                .cy = or_auto(s->camera.cy_px, (s->camera.height - 1) / 2.0),
                                .k1 = s->camera.k1,
                                .k2 = s->camera.k2,
                                .p1 = s->camera.p1,
                                .p2 = s->camera.p2,
                                .k3 = s->camera.k3,
                                .read_out_s = s->camera.read_out_s};
    snprintf(info->serial, sizeof info->serial, "SIM-%llu", (unsigned long long)sim->seed);
}

static gonio_status camera_info(void *device, gonio_camera_info *info, gonio_error *error) {
    (void)error;
    gonio_sim_camera_describe(device, info);
    return GONIO_OK;
}

// The colour of each pattern's (0,0), (1,0), (0,1), (1,1).
static const unsigned char colours[][4] = {
    [GONIO_MONO] = {0, 0, 0, 0}, [GONIO_RGGB] = {0, 1, 1, 2}, [GONIO_BGGR] = {2, 1, 1, 0},
    [GONIO_GRBG] = {1, 0, 2, 1}, [GONIO_GBRG] = {1, 2, 0, 1},
};

// A finite aperture: the scene from points of it, which all look at the same point of the plane through the centre of
// rotation.
#define APERTURE_POINTS 16
typedef struct view {
    sim_scene scene;
    double x, y; // how far the image point moves
} view;

typedef struct exposure {
    const gonio_sim *sim;
    const view *views;
    int n_views;
    double stray[3]; // radiance that reaches every pixel, a channel
    gonio_stamp stamp;
    double exposure_s, white_e; // white_e: electrons that a perfect white diffuser gives in this exposure
    double well_e, scale;       // scale: relative exposure an electron
    double black, full_scale;
    const unsigned char *colour;
    const gonio_window *window;
    uint16_t *pixels;
} exposure;

static uint16_t digitise(const exposure *e, double electrons) {
    const double value = gonio_sim_response_value(e->sim->response, electrons * e->scale);
    const double word = floor(e->black + (e->full_scale - e->black) * value + 0.5);
    return (uint16_t)fmin(fmax(word, 0), e->full_scale);
}

static double radiance(const exposure *e, double x, double y, int channel) {
    double sum = 0;
    for (int k = 0; k < e->n_views; k++) {
        sum += gonio_sim_scene_radiance(&e->views[k].scene, x + e->views[k].x, y + e->views[k].y, channel);
    }
    return sum / e->n_views;
}

static uint16_t expose_pixel(const exposure *e, int column, int row) {
    const sim_sensor *sensor = e->sim->sensor;
    const uint32_t index = (uint32_t)(row * sensor->width + column);
    const sim_pixel *pixel = &sensor->pixels[index];
    double mean = (double)pixel->dark_e_s * e->exposure_s;
    if (e->white_e > 0) {
        const int channel = e->colour[(row & 1) * 2 + (column & 1)];
        mean += (double)pixel->gain * e->white_e * (radiance(e, pixel->x, pixel->y, channel) + e->stray[channel]);
    }
    mean = fmin(mean, MEAN_MAX_E);
    const sim_draw draw = gonio_sim_random(e->sim->seed, SIM_SHOT, e->stamp.pose, e->stamp.frame, index);
    double normals[2], electrons;
    if (mean < SIM_POISSON_EXACT) {
        electrons = gonio_sim_poisson_small(mean, gonio_sim_uniform(&draw, 0));
        normals[1] = gonio_sim_normal(e->sim->seed, SIM_READ, e->stamp.pose, e->stamp.frame, index);
    } else {
        gonio_sim_normals(&draw, normals);
        electrons = gonio_sim_poisson_large(mean, normals[0]);
    }
    electrons = fmin(electrons, e->well_e) + (double)pixel->offset_e;
    return digitise(e, electrons + e->sim->settings.camera.read_noise_e * normals[1]);
}

static void expose_row(void *context, size_t row) {
    const exposure *e = context;
    const gonio_window *window = e->window;
    uint16_t *line = e->pixels + row * (size_t)window->width;
    for (int column = 0; column < window->width; column++) {
        line[column] = expose_pixel(e, window->x + column, window->y + (int)row);
    }
}

static gonio_status check_request(gonio_sim *sim, const gonio_window *w, double exposure_s, double gain_db,
                                  const gonio_stamp *stamp, double timeout_s, gonio_error *error) {
    const sim_settings *s = &sim->settings;
    if (w->x < 0 || w->y < 0 || w->width < 1 || w->height < 1 || w->width > s->camera.width - w->x ||
        w->height > s->camera.height - w->y) {
        return gonio_fail(error, GONIO_E_RANGE, "window %d x %d at (%d, %d) is not inside the %d x %d frame", w->width,
                          w->height, w->x, w->y, s->camera.width, s->camera.height);
    }
    if (!(exposure_s >= s->camera.exposure_min_s && exposure_s <= s->camera.exposure_max_s)) {
        return gonio_fail(error, GONIO_E_RANGE, "exposure %g s; the camera does %g to %g s", exposure_s,
                          s->camera.exposure_min_s, s->camera.exposure_max_s);
    }
    if (!(gain_db >= 0 && gain_db <= GAIN_MAX_DB)) {
        return gonio_fail(error, GONIO_E_RANGE, "gain %g dB; the camera does 0 to %d dB", gain_db, GAIN_MAX_DB);
    }
    const double takes_s = exposure_s + s->camera.read_out_s;
    if (!(timeout_s >= takes_s) || gonio_sim_fault_strikes(sim, SIM_FAULT_CAMERA_TIMEOUT, stamp)) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "camera: no frame within %g s (pose %lld, frame %d; one takes %g s)",
                          timeout_s, (long long)stamp->pose, (int)stamp->frame, takes_s);
    }
    if (gonio_sim_fault_strikes(sim, SIM_FAULT_CAMERA_ERROR, stamp)) {
        return gonio_fail(error, GONIO_E_DEVICE, "camera: the frame arrived incomplete (pose %lld, frame %d)",
                          (long long)stamp->pose, (int)stamp->frame);
    }
    return GONIO_OK;
}

static int place_views(const gonio_sim *sim, const sim_scene *scene, view *views) {
    const double radius = sim->settings.rig.aperture_radius_mm, distance = sim->settings.rig.camera_distance_mm;
    const int n = radius > 0 ? APERTURE_POINTS : 1;
    for (int k = 0; k < n; k++) {
        double right = 0, up = 0;
        gonio_sim_disc_point(k, APERTURE_POINTS, &right, &up);
        right *= radius;
        up *= radius;
        views[k] = (view){.scene = *scene, .x = -right / distance, .y = up / distance};
        gonio_vec3 *c = &views[k].scene.camera;
        c->x += right * scene->right.x + up * scene->up.x;
        c->y += right * scene->right.y + up * scene->up.y;
        c->z += right * scene->right.z + up * scene->up.z;
    }
    return n;
}

// The scene's mean radiance over the whole frame, from this many pixels of it.
#define GLARE_COLUMNS 20
#define GLARE_ROWS 16

static void find_stray(const gonio_sim *sim, const sim_scene *scene, const gonio_stamp *stamp, double stray[3]) {
    const sim_sensor *sensor = sim->sensor;
    const double variation = sim->settings.stray.variation_percent / 100;
    const double ambient =
        sim->truth.ambient * fmax(0, 1 + variation * gonio_sim_normal(sim->seed, SIM_STRAY_POSE, stamp->pose, 0, 0));
    for (int channel = 0; channel < sim->seen->channels; channel++) {
        double sum = 0;
        for (int i = 0; i < GLARE_COLUMNS * GLARE_ROWS && sim->truth.glare > 0; i++) {
            const int column = (2 * (i % GLARE_COLUMNS) + 1) * sensor->width / (2 * GLARE_COLUMNS);
            const int row = (2 * (i / GLARE_COLUMNS) + 1) * sensor->height / (2 * GLARE_ROWS);
            const sim_pixel *pixel = &sensor->pixels[row * sensor->width + column];
            sum += gonio_sim_scene_radiance(scene, pixel->x, pixel->y, channel);
        }
        stray[channel] = ambient + sim->truth.glare * sum / (GLARE_COLUMNS * GLARE_ROWS);
    }
}

static gonio_status camera_capture(void *device, const gonio_window *window, double exposure_s, double gain_db,
                                   const gonio_stamp *stamp, double timeout_s, gonio_frame *frame, gonio_error *error) {
    gonio_sim *sim = device;
    const gonio_status status = check_request(sim, window, exposure_s, gain_db, stamp, timeout_s, error);
    if (status != GONIO_OK) {
        return status;
    }
    const sim_settings *s = &sim->settings;
    gonio_camera_info info;
    gonio_sim_camera_describe(sim, &info);
    sim_scene scene = {.target = sim->target,
                       .sample = sim->seen,
                       .texture = &sim->texture,
                       .pixel = 1 / info.fx,
                       .ball = sim->ball,
                       .mirror = sim->mirror,
                       .ball_centre = sim->truth.ball_centre,
                       .ball_radius_mm = s->ball.radius_mm};
    gonio_sim_scene_place(&scene, s, sim->truth.axis, sim->actual_rad);
    if (s->camera.moved_at >= 0 && stamp->pose >= s->camera.moved_at) {
        const double x = s->camera.moved_px / info.fx; // turned, which is a shift over so narrow a field
        scene.forward.x -= x * scene.right.x;
        scene.forward.y -= x * scene.right.y;
        scene.forward.z -= x * scene.right.z;
    }
    for (int c = 0; c < 3; c++) {
        scene.reflectance[c] = sim->truth.reflectance[c];
    }
    // The lamp changes too slowly to matter within a frame: its output in the middle is the mean over it.
    const double lamp = sim->shutter_open ? gonio_sim_lamp_output(sim, stamp, exposure_s / 2) : 0;
    const double full_scale = (double)((1 << s->camera.bits) - 1);
    view views[APERTURE_POINTS];
    exposure e = {.sim = sim,
                  .views = views,
                  .n_views = place_views(sim, &scene, views),
                  .stamp = *stamp,
                  .exposure_s = exposure_s,
                  .white_e = s->camera.white_e_per_s * lamp * exposure_s,
                  .well_e = WELL_RESERVE * s->camera.full_well_e,
                  .scale = pow(10, gain_db / 20) / s->camera.full_well_e,
                  .black = floor((full_scale + 1) / BLACK_FRACTION),
                  .full_scale = full_scale,
                  .colour = colours[gonio_sim_camera_pattern(sim)],
                  .window = window,
                  .pixels = frame->pixels};
    if (e.white_e > 0) {
        find_stray(sim, &scene, stamp, e.stray);
    }
    gonio_pool_for(sim->threads, (size_t)window->height, expose_row, &e);
    frame->window = *window;
    frame->exposure_s = exposure_s;
    frame->gain_db = gain_db;
    frame->stamp = *stamp;
    return GONIO_OK;
}

static void camera_close(void *device) { (void)device; }

// ---- frames at the camera's own rate, which is 1 / (exposure + read-out); as fast as they are computed ----

static gonio_status camera_stream(void *device, double exposure_s, double gain_db, double timeout_s,
                                  gonio_error *error) {
    gonio_sim *sim = device;
    const gonio_window pixel = {0, 0, 1, 1};
    sim->stream.exposure_s = exposure_s;
    sim->stream.gain_db = gain_db;
    sim->stream.next = 0;
    const gonio_stamp first = {0};
    return check_request(sim, &pixel, exposure_s, gain_db, &first, timeout_s, error);
}

static gonio_status camera_next(void *device, const gonio_window *window, double timeout_s, gonio_frame *frame,
                                int64_t *lost, gonio_error *error) {
    gonio_sim *sim = device;
    const double period_s = sim->stream.exposure_s + sim->settings.camera.read_out_s;
    const gonio_stamp stamp = {.frame = sim->stream.next, .clock_s = sim->stream.next * period_s};
    *lost = 0;
    sim->stream.next++;
    return camera_capture(sim, window, sim->stream.exposure_s, sim->stream.gain_db, &stamp, timeout_s, frame, error);
}

// Every frame is computed with the exposure that was asked for.
static gonio_status camera_latency(void *device, double low_s, double high_s, int *frames, gonio_error *error) {
    (void)device, (void)low_s, (void)high_s, (void)error;
    *frames = 0;
    return GONIO_OK;
}

const gonio_camera_ops gonio_sim_camera_ops = {.name = "simulated camera",
                                               .info = camera_info,
                                               .capture = camera_capture,
                                               .close = camera_close,
                                               .stream = camera_stream,
                                               .next = camera_next,
                                               .latency = camera_latency};
