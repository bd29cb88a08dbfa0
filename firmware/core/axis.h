// SPDX-License-Identifier: BSD-3-Clause
// Axes: coordinated moves of all axes with limits, backlash take-up, stop and halt.
#ifndef FW_AXIS_H
#define FW_AXIS_H

#include <stdbool.h>
#include <stdint.h>

#include "firmware/core/enums.h"
#include "firmware/core/ramp.h"
#include "firmware/core/stepgen.h"

struct fw_core;

enum { FW_JOG_SECONDS = 10 }; // of home_slow: the longest way of a JOG

struct fw_axis {
    struct fw_ramp ramp[2];     // the one followed, and the one that cuts it short
    uint8_t current;            // of ramp
    uint8_t energised;          // axis bits
    uint8_t opened;             // brakes
    uint8_t gripping;           // motors that hold until their brakes do
    bool gripping_timed;        // since when is known: the main loop asks the clock, which costs an interrupt too much
    uint32_t gripping_since;    // tick
    uint32_t distance[FW_AXES]; // steps, of the move that was begun last
    volatile bool starting;     // it waits for motors and brakes
    uint16_t starting_ms[2];    // for these, one after the other
    uint32_t starting_since;    // tick
    bool under_way;             // between gonio_fw_axis_begin and the end seen by gonio_fw_axis_poll
    volatile uint8_t up, down;  // axes that move, by direction; for the input interrupt
    volatile bool halted;       // by gonio_fw_axis_halt, not yet accounted for
    volatile bool lost;         // that halt leaves positions unknown
    int64_t target[FW_AXES];    // of the standing MOVE, as it was when accepted
    uint16_t axes, permille;    // of it
    bool final_leg;             // of a move with backlash take-up
    bool settling;
    uint32_t at_rest_since; // ms
};

// Begin a straight move by `way` steps at the given speeds (steps/s); at rest only. Ways must be below 2^31.
// False: it would take more than 38 hours; nothing happens.
bool gonio_fw_axis_begin(struct fw_core *core, const int64_t way[FW_AXES], const uint32_t speed[FW_AXES]);
// The MOVE command, checked; begins it.
enum fw_refusal gonio_fw_axis_move(struct fw_core *core);
// The JOG command, checked; begins it. So slow and so short that it can do no harm where nobody knows where the axis
// is.
enum fw_refusal gonio_fw_axis_jog(struct fw_core *core);
// Decelerate to rest; nothing when at rest.
void gonio_fw_axis_stop(struct fw_core *core);
// Stop at once. lost: the motors may have slipped, so that the positions of the moving axes become unknown. Callable
// in interrupts.
void gonio_fw_axis_halt(struct fw_core *core, bool lost);
// Bookkeeping after moves and halts; main loop. Returns true when a movement just came to rest.
bool gonio_fw_axis_poll(struct fw_core *core);
// Go on with a MOVE that came to rest: second leg, settling, done. Main loop, in state MOVING.
void gonio_fw_axis_continue(struct fw_core *core, bool came_to_rest);
// Current positions, booked up to the last segment left. Main loop.
void gonio_fw_axis_positions(struct fw_core *core, int64_t position[FW_AXES]);
// Seconds that a MOVE of all axes at full speed takes from rest at `from`, by the limits alone: what rounding to
// segments and waiting add is left out. For simulators; ways below 2^31.
double gonio_fw_axis_seconds(const struct fw_core *core, const int64_t from[FW_AXES], const int64_t target[FW_AXES]);
// Motor enables and brakes to what they should be, at the levels that motors_invert and brakes_invert ask for. Any.
void gonio_fw_axis_enable(struct fw_core *core);
// Close brakes and switch motors off, brake_delay later where they have one; their positions become unknown. Callable
// in interrupts.
void gonio_fw_axis_release(struct fw_core *core, uint8_t axes);

#endif
