// SPDX-License-Identifier: BSD-3-Clause
#include "sim/sensor.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "base/thread_pool.h"
#include "sim/random.h"

// OpenCV's forward model (rig.h) and its Jacobian [[xx, xy], [xy, yy]], which is symmetric.
static void distort(const gonio_camera_info *c, double x, double y, double image[2], double jacobian[3]) {
    const double r2 = x * x + y * y, d = 1 + r2 * (c->k1 + r2 * (c->k2 + r2 * c->k3));
    const double slope = 2 * (c->k1 + r2 * (2 * c->k2 + r2 * 3 * c->k3)); // dd/dx = slope x
    image[0] = x * d + 2 * c->p1 * x * y + c->p2 * (r2 + 2 * x * x);
    image[1] = y * d + c->p1 * (r2 + 2 * y * y) + 2 * c->p2 * x * y;
    jacobian[0] = d + slope * x * x + 2 * c->p1 * y + 6 * c->p2 * x;
    jacobian[1] = slope * x * y + 2 * c->p1 * x + 2 * c->p2 * y;
    jacobian[2] = d + slope * y * y + 6 * c->p1 * y + 2 * c->p2 * x;
}

// Newton's method; it fails where the distortion folds (its Jacobian is not positive definite).
static bool undistort(const gonio_camera_info *c, double u, double v, double *x, double *y) {
    const double target[2] = {(u - c->cx) / c->fx, (v - c->cy) / c->fy};
    *x = target[0];
    *y = target[1];
    for (int step = 0; step < 30; step++) {
        double image[2], j[3];
        distort(c, *x, *y, image, j);
        const double a = target[0] - image[0], b = target[1] - image[1], det = j[0] * j[2] - j[1] * j[1];
        if (!(det > 0) || !(j[0] > 0)) {
            return false;
        }
        const double dx = (j[2] * a - j[1] * b) / det, dy = (j[0] * b - j[1] * a) / det;
        *x += dx;
        *y += dy;
        if (fabs(dx) + fabs(dy) < 1e-12) {
            return true;
        }
    }
    return false;
}

// Mechanical and natural vignetting as one cos^4 law of the distance from the image's centre, whose corner loses
// `percent`: cos^4(atan t) = 1/(1 + t^2)^2.
static double vignetting(double percent, double relative_r2) {
    const double t2 = (1 / sqrt(1 - percent / 100) - 1) * relative_r2;
    return 1 / ((1 + t2) * (1 + t2));
}

// A hot pixel's dark current is 100 to 1000 times the usual one.
static double hot_factor(const sim_settings *s, uint64_t seed, uint32_t index) {
    const sim_draw draw = gonio_sim_random(seed, SIM_HOT, 0, 0, index);
    return gonio_sim_uniform(&draw, 0) < s->camera.hot_pixel_percent / 100 ? pow(10, 2 + gonio_sim_uniform(&draw, 1))
                                                                           : 1;
}

static bool make_pixel(const sim_settings *s, const gonio_camera_info *c, uint64_t seed, int column, int row,
                       sim_pixel *pixel) {
    const uint32_t index = (uint32_t)(row * c->width + column);
    double x, y;
    if (!undistort(c, column, row, &x, &y)) {
        return false;
    }
    const double du = column - (c->width - 1) / 2.0, dv = row - (c->height - 1) / 2.0;
    const double corner2 = (c->width * c->width + c->height * c->height) / 4.0;
    const double prnu = s->camera.prnu_percent / 100 * gonio_sim_normal(seed, SIM_PRNU, 0, 0, index);
    const double dark = 1 + s->camera.dark_nonuniformity_percent / 100 * gonio_sim_normal(seed, SIM_DARK, 0, 0, index);
    *pixel = (sim_pixel){
        .x = (float)x,
        .y = (float)y,
        .gain = (float)(fmax(0, 1 + prnu) * vignetting(s->camera.vignetting_percent, (du * du + dv * dv) / corner2)),
        .dark_e_s = (float)(s->camera.dark_e_per_s * fmax(0, dark) * hot_factor(s, seed, index)),
        .offset_e = (float)(s->camera.offset_nonuniformity_e * gonio_sim_normal(seed, SIM_OFFSET, 0, 0, index)),
    };
    return true;
}

typedef struct making {
    const sim_settings *settings;
    const gonio_camera_info *info;
    uint64_t seed;
    sim_pixel *pixels;
    atomic_int folded;
} making;

static void make_row(void *context, size_t row) {
    making *m = context;
    const int width = m->info->width;
    for (int column = 0; column < width; column++) {
        m->folded += !make_pixel(m->settings, m->info, m->seed, column, (int)row,
                                 &m->pixels[row * (size_t)width + (size_t)column]);
    }
}

gonio_status gonio_sim_sensor_new(const sim_settings *settings, const gonio_camera_info *info, uint64_t seed,
                                  int threads, sim_sensor **out, gonio_error *error) {
    *out = NULL;
    sim_sensor *sensor = calloc(1, sizeof *sensor);
    const size_t n = (size_t)info->width * (size_t)info->height;
    if (sensor != NULL) {
        *sensor = (sim_sensor){info->width, info->height, malloc(n * sizeof *sensor->pixels)};
    }
    if (sensor == NULL || sensor->pixels == NULL) {
        gonio_sim_sensor_free(sensor);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a sensor of %d x %d pixels (%.3g MB)", info->width,
                          info->height, (double)(n * sizeof(sim_pixel)) / 1e6);
    }
    making m = {.settings = settings, .info = info, .seed = seed, .pixels = sensor->pixels};
    gonio_pool_for(threads, (size_t)info->height, make_row, &m);
    if (m.folded > 0) {
        gonio_sim_sensor_free(sensor);
        return gonio_fail(error, GONIO_E_INPUT,
                          "[camera] k1, k2, p1, p2, k3: the distortion folds the image over at %d pixels; choose "
                          "smaller ones",
                          m.folded);
    }
    *out = sensor;
    return GONIO_OK;
}

void gonio_sim_sensor_free(sim_sensor *sensor) {
    if (sensor != NULL) {
        free(sensor->pixels);
        free(sensor);
    }
}
