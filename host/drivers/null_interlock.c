// SPDX-License-Identifier: BSD-3-Clause
// An interlock that is always closed.
#include "host/drivers/driver.h"

static gonio_status check(void *device, gonio_error *error) {
    (void)device, (void)error;
    return GONIO_OK;
}

static const gonio_interlock_ops ops = {
    .name = "null interlock", .check = check, .close = gonio_driver_nothing_to_close};

const gonio_driver gonio_driver_null_interlock = {.name = "null",
                                                  .device = GONIO_DEVICE_INTERLOCK,
                                                  .summary = "contacts that are always closed",
                                                  .ops = &ops,
                                                  .open = gonio_driver_no_device};
