// SPDX-License-Identifier: BSD-3-Clause
// The reference detector: an optical power meter or photodiode amplifier that speaks SCPI over USBTMC / USB488.
#ifndef GONIO_DRIVERS_METER_USBTMC_H
#define GONIO_DRIVERS_METER_USBTMC_H

#include "gonio/rig.h"
#include "host/drivers/scpi_meter.h"
#include "host/transport/usbtmc.h"

typedef struct gonio_meter_usbtmc_config {
    gonio_usbtmc_match match;
    gonio_scpi_config scpi;
    int timeout_ms; // of one query; 2000
} gonio_meter_usbtmc_config;

void gonio_meter_usbtmc_defaults(gonio_meter_usbtmc_config *config);

extern const gonio_meter_ops gonio_meter_usbtmc;
// Open, identify by *IDN? and set up. *device goes to gonio_meter_usbtmc's operations, whose close frees it.
gonio_status gonio_meter_usbtmc_open(const gonio_meter_usbtmc_config *config, void **device, gonio_error *error);
// The answer to *IDN?; lives as long as the device.
const char *gonio_meter_usbtmc_identity(const void *device);

#endif
