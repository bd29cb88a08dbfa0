// SPDX-License-Identifier: BSD-3-Clause
// The pixel maps: the undistorted coordinates against the forward model, the fixed patterns by their moments.
//
// Statistics: fixed seeds; bounds are 5 standard errors, 6e-7 each for fresh seeds, five of them.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "sim/sensor.h"
#include "tests/unit/near.h"

static const gonio_camera_info camera = {.width = 320,
                                         .height = 240,
                                         .fx = 900,
                                         .fy = 870,
                                         .cx = 150,
                                         .cy = 125,
                                         .k1 = -0.6,
                                         .k2 = 0.9,
                                         .p1 = 0.02,
                                         .p2 = -0.05,
                                         .k3 = -0.4};

static sim_sensor *make(const sim_settings *settings, const gonio_camera_info *info) {
    sim_sensor *sensor;
    assert_int_equal(gonio_sim_sensor_new(settings, info, 5, 2, &sensor, NULL), GONIO_OK);
    return sensor;
}

// Every pixel's ray, distorted by rig.h's formulas, comes back to its centre.
static void rays_come_back(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    sim_sensor *sensor = make(&settings, &camera);
    double moved = 0;
    for (int v = 0; v < camera.height; v++) {
        for (int u = 0; u < camera.width; u++) {
            const sim_pixel *pixel = &sensor->pixels[v * camera.width + u];
            const double x = (double)pixel->x, y = (double)pixel->y, r2 = x * x + y * y;
            const double d = 1 + camera.k1 * r2 + camera.k2 * r2 * r2 + camera.k3 * r2 * r2 * r2;
            const double xd = x * d + 2 * camera.p1 * x * y + camera.p2 * (r2 + 2 * x * x);
            const double yd = y * d + camera.p1 * (r2 + 2 * y * y) + 2 * camera.p2 * x * y;
            assert_near(camera.fx * xd + camera.cx, u, 2e-4);
            assert_near(camera.fy * yd + camera.cy, v, 2e-4);
            moved = fmax(moved, fabs(camera.fx * x + camera.cx - u));
        }
    }
    assert_true(moved > 3); // the distortion was worth undoing
    gonio_sim_sensor_free(sensor);
}

static void patterns_have_their_moments(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    settings.camera.vignetting_percent = 0;
    settings.camera.hot_pixel_percent = 2;
    sim_sensor *sensor = make(&settings, &camera);
    const double n = camera.width * camera.height;
    double gain = 0, offset = 0, dark = 0, cold = 0, hot = 0, log_hot = 0;
    for (int i = 0; i < camera.width * camera.height; i++) {
        const sim_pixel *pixel = &sensor->pixels[i];
        gain += pow((double)pixel->gain - 1, 2) / n;
        offset += pow((double)pixel->offset_e, 2) / n;
        if (pixel->dark_e_s < 50) {
            dark += pow((double)pixel->dark_e_s / 5 - 1, 2);
            cold++;
        } else {
            log_hot += log10((double)pixel->dark_e_s / 5);
            hot++;
        }
    }
    const double bound = 5 * sqrt(2 / n);
    assert_near(gain / (0.01 * 0.01), 1, bound);
    assert_near(offset, 1, bound);
    assert_near(dark / cold / (0.1 * 0.1), 1, bound);
    assert_near(hot / n, 0.02, 5 * sqrt(0.02 * 0.98 / n));
    assert_near(log_hot / hot, 2.5, 5 * sqrt((1.0 / 12 + 0.002) / hot)); // 100 to 1000 times, even in the logarithm
    gonio_sim_sensor_free(sensor);
}

static void corners_lose_the_stated_light(void **state) {
    (void)state;
    sim_settings settings;
    gonio_sim_settings_default(&settings);
    settings.camera.vignetting_percent = 12;
    settings.camera.prnu_percent = 0;
    sim_sensor *sensor = make(&settings, &camera);
    assert_near((double)sensor->pixels[0].gain, 0.88, 0.002); // its centre is half a pixel inside the corner
    assert_near((double)sensor->pixels[120 * 320 + 160].gain, 1, 1e-4);
    gonio_sim_sensor_free(sensor);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rays_come_back),
        cmocka_unit_test(patterns_have_their_moments),
        cmocka_unit_test(corners_lose_the_stated_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
