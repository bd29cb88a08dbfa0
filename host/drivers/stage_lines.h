// SPDX-License-Identifier: BSD-3-Clause
// Axes behind a motion controller that takes commands in text (GRBL, Newport, Thorlabs Elliptec ...): lines_table.h.
#ifndef GONIO_DRIVERS_STAGE_LINES_H
#define GONIO_DRIVERS_STAGE_LINES_H

#include "gonio/rig.h"
#include "host/drivers/free_axes.h"
#include "host/drivers/lines_table.h"
#include "host/transport/line.h"

typedef struct gonio_lines_axis {
    char name[32]; // what the controller calls it; "": there is none
    gonio_free_axis free;
} gonio_lines_axis;

typedef struct gonio_stage_lines_config {
    gonio_line_config line;
    char record[256], replay[256];
    char table[256]; // as gonio_lines_table_read takes it
    int retries;     // of a question
    bool absolute;   // positions survive power: no homing is needed in a run
    gonio_lines_axis axes[GONIO_AXES];
} gonio_stage_lines_config;

void gonio_stage_lines_defaults(gonio_stage_lines_config *config);

extern const gonio_stage_ops gonio_stage_lines;
// Nothing moves on opening.
gonio_status gonio_stage_lines_open(const gonio_stage_lines_config *config, const gonio_driver_context *context,
                                    void **device, gonio_error *error);

#endif
