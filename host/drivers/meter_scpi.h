// SPDX-License-Identifier: BSD-3-Clause
// An SCPI meter on a serial line or on TCP (raw port 5025).
#ifndef GONIO_DRIVERS_METER_SCPI_H
#define GONIO_DRIVERS_METER_SCPI_H

#include "gonio/rig.h"
#include "host/drivers/scpi_meter.h"
#include "host/transport/line.h"

typedef struct gonio_meter_scpi_config {
    gonio_line_config line;
    gonio_scpi_config scpi;
} gonio_meter_scpi_config;

void gonio_meter_scpi_defaults(gonio_meter_scpi_config *config);

extern const gonio_meter_ops gonio_meter_scpi;
gonio_status gonio_meter_scpi_open(const gonio_meter_scpi_config *config, void **device, gonio_error *error);

#endif
