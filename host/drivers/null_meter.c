// SPDX-License-Identifier: BSD-3-Clause
// A lamp monitor that sees a constant lamp.
#include "host/drivers/driver.h"

static gonio_status read_value(void *device, const gonio_stamp *stamp, double integration_s, double *value,
                               double *sigma, gonio_error *error) {
    (void)device, (void)stamp, (void)integration_s, (void)error;
    *value = 1;
    *sigma = 1e-3;
    return GONIO_OK;
}

static const gonio_meter_ops ops = {.name = "null meter", .read = read_value, .close = gonio_driver_nothing_to_close};

const gonio_driver gonio_driver_null_meter = {.name = "null",
                                              .device = GONIO_DEVICE_METER,
                                              .summary = "reads 1 +- 0.1 %",
                                              .ops = &ops,
                                              .open = gonio_driver_no_device};
