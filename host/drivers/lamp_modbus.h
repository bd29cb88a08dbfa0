// SPDX-License-Identifier: BSD-3-Clause
// Lamp and shutter behind the controller.
#ifndef GONIO_DRIVERS_LAMP_MODBUS_H
#define GONIO_DRIVERS_LAMP_MODBUS_H

#include "gonio/rig.h"
#include "host/drivers/controller.h"

extern const gonio_lamp_ops gonio_lamp_modbus;
// Nothing is switched on opening. Shares the controller. shutter_settle_s: waited after each switching of the shutter.
gonio_status gonio_lamp_modbus_open(gonio_controller *controller, double shutter_settle_s, void **device,
                                    gonio_error *error);

#endif
