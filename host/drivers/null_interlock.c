// SPDX-License-Identifier: BSD-3-Clause
// An interlock that is always closed.
#include <stddef.h>

#include "host/drivers/driver.h"

static gonio_status check(void *device, gonio_error *error) {
    (void)device, (void)error;
    return GONIO_OK;
}

static void nothing_to_close(void *device) { (void)device; }

static const gonio_interlock_ops ops = {.name = "null interlock", .check = check, .close = nothing_to_close};

static gonio_status make(void *settings, const gonio_driver_context *context, void **device, gonio_error *error) {
    (void)settings, (void)context, (void)error;
    *device = NULL;
    return GONIO_OK;
}

const gonio_driver gonio_driver_null_interlock = {.name = "null",
                                                  .device = GONIO_DEVICE_INTERLOCK,
                                                  .summary = "contacts that are always closed",
                                                  .ops = &ops,
                                                  .open = make};
