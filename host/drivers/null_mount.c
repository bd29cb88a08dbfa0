// SPDX-License-Identifier: BSD-3-Clause
// A sample changer without samples.
#include "host/drivers/driver.h"

static gonio_status mount(void *device, gonio_target target, gonio_error *error) {
    (void)device, (void)target, (void)error;
    return GONIO_OK;
}

static const gonio_mount_ops ops = {
    .name = "null sample changer", .mount = mount, .close = gonio_driver_nothing_to_close};

const gonio_driver gonio_driver_null_mount = {.name = "null",
                                              .device = GONIO_DEVICE_MOUNT,
                                              .summary = "a sample changer without samples",
                                              .ops = &ops,
                                              .open = gonio_driver_no_device};
