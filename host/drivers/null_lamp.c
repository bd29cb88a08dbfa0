// SPDX-License-Identifier: BSD-3-Clause
// A lamp that is always warm and a shutter that always obeys.
#include "host/drivers/driver.h"

static gonio_status set_level(void *device, double level, gonio_error *error) {
    (void)device;
    return level >= 0 && level <= 1 ? GONIO_OK
                                    : gonio_fail(error, GONIO_E_RANGE, "lamp level %g; 0 to 1 is possible", level);
}

static gonio_status set_shutter(void *device, bool open, gonio_error *error) {
    (void)device, (void)open, (void)error;
    return GONIO_OK;
}

static gonio_status wait_ready(void *device, const gonio_stamp *stamp, double timeout_s, double *waited_s,
                               gonio_error *error) {
    (void)device, (void)stamp, (void)timeout_s, (void)error;
    *waited_s = 0;
    return GONIO_OK;
}

static const gonio_lamp_ops ops = {.name = "null lamp",
                                   .set_level = set_level,
                                   .set_shutter = set_shutter,
                                   .wait_ready = wait_ready,
                                   .close = gonio_driver_nothing_to_close};

const gonio_driver gonio_driver_null_lamp = {.name = "null",
                                             .device = GONIO_DEVICE_LAMP,
                                             .summary = "a lamp that is always warm",
                                             .ops = &ops,
                                             .open = gonio_driver_no_device};
