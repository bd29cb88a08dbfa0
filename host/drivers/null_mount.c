// SPDX-License-Identifier: BSD-3-Clause
// A sample changer without samples.
#include <stddef.h>

#include "host/drivers/driver.h"

static gonio_status mount(void *device, gonio_target target, gonio_error *error) {
    (void)device, (void)target, (void)error;
    return GONIO_OK;
}

static void nothing_to_close(void *device) { (void)device; }

static const gonio_mount_ops ops = {.name = "null sample changer", .mount = mount, .close = nothing_to_close};

static gonio_status make(void *settings, const gonio_driver_context *context, void **device, gonio_error *error) {
    (void)settings, (void)context, (void)error;
    *device = NULL;
    return GONIO_OK;
}

const gonio_driver gonio_driver_null_mount = {.name = "null",
                                              .device = GONIO_DEVICE_MOUNT,
                                              .summary = "a sample changer without samples",
                                              .ops = &ops,
                                              .open = make};
