// SPDX-License-Identifier: BSD-3-Clause
// The lamp's monitor photodiode behind the controller.
#ifndef GONIO_DRIVERS_METER_MODBUS_H
#define GONIO_DRIVERS_METER_MODBUS_H

#include "gonio/rig.h"
#include "host/drivers/controller.h"

extern const gonio_meter_ops gonio_meter_modbus;
// scale: readings of a full-scale photodiode. relative_sigma: stated, of one reading. Shares the controller.
gonio_status gonio_meter_modbus_open(gonio_controller *controller, double scale, double relative_sigma, void **device,
                                     gonio_error *error);

#endif
