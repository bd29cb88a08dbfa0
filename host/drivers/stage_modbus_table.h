// SPDX-License-Identifier: BSD-3-Clause
// Axes behind stepper drives of other makers on a Modbus line: modbus_table.h.
#ifndef GONIO_DRIVERS_STAGE_MODBUS_TABLE_H
#define GONIO_DRIVERS_STAGE_MODBUS_TABLE_H

#include "gonio/rig.h"
#include "host/drivers/free_axes.h"
#include "host/drivers/modbus_bus.h"
#include "host/drivers/modbus_table.h"

typedef struct gonio_drive_axis {
    int slave;  // 0: there is no such axis
    int offset; // of its registers, where a slave has several axes
    int speed;  // into the register `speed`, in the drive's unit; 0: the drive keeps what it has
    gonio_free_axis free;
} gonio_drive_axis;

typedef struct gonio_stage_modbus_table_config {
    gonio_modbus_bus_config line;
    char table[256]; // as gonio_modbus_table_read takes it
    gonio_modbus_texts texts;
    bool absolute; // positions survive power: no homing is needed in a run
    gonio_drive_axis axes[GONIO_AXES];
} gonio_stage_modbus_table_config;

void gonio_stage_modbus_table_defaults(gonio_stage_modbus_table_config *config);

extern const gonio_stage_ops gonio_stage_modbus_table;
// Nothing moves on opening.
gonio_status gonio_stage_modbus_table_open(const gonio_stage_modbus_table_config *config,
                                           const gonio_driver_context *context, void **device, gonio_error *error);
// Its line, for encoders on it; borrowed.
gonio_modbus_bus *gonio_stage_modbus_table_bus(const void *device);

#endif
