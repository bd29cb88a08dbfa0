// SPDX-License-Identifier: BSD-3-Clause
// A camera behind a cap: frames of the right size that are black.
#include <string.h>

#include "host/drivers/driver.h"

enum { WIDTH = 640, HEIGHT = 512 };

static gonio_status info(void *device, gonio_camera_info *camera, gonio_error *error) {
    (void)device, (void)error;
    *camera = (gonio_camera_info){.name = "null camera",
                                  .serial = "0",
                                  .width = WIDTH,
                                  .height = HEIGHT,
                                  .bits = 12,
                                  .pattern = GONIO_MONO,
                                  .exposure_min_s = 1e-5,
                                  .exposure_max_s = 1,
                                  .fx = 1e4,
                                  .fy = 1e4,
                                  .cx = (WIDTH - 1) / 2.0,
                                  .cy = (HEIGHT - 1) / 2.0,
                                  .read_out_s = 0.02};
    return GONIO_OK;
}

static gonio_status capture(void *device, const gonio_window *window, double exposure_s, double gain_db,
                            const gonio_stamp *stamp, double timeout_s, gonio_frame *frame, gonio_error *error) {
    (void)device, (void)timeout_s;
    if (window->x < 0 || window->y < 0 || window->width < 1 || window->height < 1 ||
        window->x + window->width > WIDTH || window->y + window->height > HEIGHT) {
        return gonio_fail(error, GONIO_E_RANGE, "window %d x %d at (%d, %d) is not inside %d x %d", window->width,
                          window->height, window->x, window->y, WIDTH, HEIGHT);
    }
    frame->window = *window;
    frame->exposure_s = exposure_s;
    frame->gain_db = gain_db;
    frame->stamp = *stamp;
    memset(frame->pixels, 0, (size_t)window->width * (size_t)window->height * sizeof *frame->pixels);
    return GONIO_OK;
}

static const gonio_camera_ops ops = {
    .name = "null camera", .info = info, .capture = capture, .close = gonio_driver_nothing_to_close};

const gonio_driver gonio_driver_null_camera = {.name = "null",
                                               .device = GONIO_DEVICE_CAMERA,
                                               .summary = "a camera behind a cap: 640 x 512, 12 bit, black",
                                               .ops = &ops,
                                               .open = gonio_driver_no_device};
