// SPDX-License-Identifier: BSD-3-Clause
// Axes behind a motion controller that takes commands in text (GRBL, Newport, Thorlabs Elliptec ...): lines_table.h.
#ifndef GONIO_DRIVERS_STAGE_LINES_H
#define GONIO_DRIVERS_STAGE_LINES_H

#include "gonio/rig.h"
#include "host/drivers/lines_table.h"
#include "host/transport/line.h"

typedef struct gonio_lines_axis {
    char name[32];          // what the controller calls it; "": there is none, and it stands at fixed_deg
    double units_per_deg;   // of the controller's positions
    double speed_deg_per_s; // for the time that a move takes
    double min_deg, max_deg;
    double backlash_deg; // every position is approached from the same side; > 0 moving up
    double zero_deg, fixed_deg;
    bool invert; // user = dial - zero_deg, negated
} gonio_lines_axis;

typedef struct gonio_stage_lines_config {
    gonio_line_config line;
    char record[256], replay[256];
    char table[256]; // as gonio_lines_table_read takes it
    int retries;     // of a question
    bool absolute;   // positions survive power: no homing is needed in a run
    gonio_lines_axis axes[GONIO_AXES];
    // Asked all the while the axes move: the interlock. May be NULL.
    const gonio_interlock_ops *interlock;
    void *interlock_device;
    bool (*cancelled)(void *context); // asked all the while, too; true stops the axes. NULL: never
    void *cancelled_context;
} gonio_stage_lines_config;

void gonio_stage_lines_defaults(gonio_stage_lines_config *config);

extern const gonio_stage_ops gonio_stage_lines;
// Nothing moves on opening.
gonio_status gonio_stage_lines_open(const gonio_stage_lines_config *config, void **device, gonio_error *error);

#endif
