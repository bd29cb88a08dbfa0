// SPDX-License-Identifier: BSD-3-Clause
// Axes behind motion controllers of other makers, which move each at its own pace: limits, take-up of backlash,
// waiting, stopping, arriving. How they are talked to is their driver's matter.
//
// A move has absolute targets, so that a repeated one harms nothing. It may pass any place of the box between its ends;
// where it takes up backlash, of the two boxes before and behind the turning point.
#ifndef GONIO_DRIVERS_FREE_AXES_H
#define GONIO_DRIVERS_FREE_AXES_H

#include "base/keys.h"
#include "gonio/rig.h"
#include "host/drivers/driver.h"

typedef struct gonio_free_axis {
    bool there;             // else it stands at fixed_deg
    double units_per_deg;   // of the controller's positions
    double speed_deg_per_s; // for the time that a move takes
    double min_deg, max_deg;
    double backlash_deg; // every position is approached from the same side; > 0 moving up
    double zero_deg, fixed_deg;
    bool invert; // user = dial - zero_deg, negated
} gonio_free_axis;

typedef enum gonio_free_state {
    GONIO_FREE_IDLE,
    GONIO_FREE_BUSY,
    GONIO_FREE_UNHOMED,
    GONIO_FREE_STOPPED
} gonio_free_state;

typedef struct gonio_free_stage gonio_free_stage;

// What a driver does with them.
typedef struct gonio_free_drive {
    gonio_status (*home)(gonio_free_stage *stage, double timeout_s, gonio_error *error); // begin, or carry out
    // Begin to move all axes that are there to these positions, in the controller's units.
    gonio_status (*go)(gonio_free_stage *stage, const double units[GONIO_AXES], gonio_error *error);
    gonio_status (*stop)(gonio_free_stage *stage, gonio_error *error); // and wait until they stand
    gonio_status (*state)(gonio_free_stage *stage, gonio_free_state *state, gonio_error *error);
    gonio_status (*position)(gonio_free_stage *stage, int axis, double *units, gonio_error *error);
    void (*close)(gonio_free_stage *stage);             // and free it
    bool (*tells_homed)(const gonio_free_stage *stage); // state says UNHOMED where it is so
} gonio_free_drive;

// The first member of a driver's device.
struct gonio_free_stage {
    const gonio_free_drive *drive;
    gonio_free_axis axes[GONIO_AXES];
    bool absolute; // positions survive power: no homing is needed in a run
    bool homed;    // in this run
    // Asked all the while the axes move: the interlock. May be NULL.
    const gonio_interlock_ops *interlock;
    void *interlock_device;
    bool (*cancelled)(void *context); // asked all the while, too; true stops the axes. NULL: never
    void *cancelled_context;
};

extern const char *const gonio_free_axis_names[GONIO_AXES];
gonio_free_axis gonio_free_axis_default(void);
// GONIO_E_INPUT where limits contradict each other or no axis is there; named: what makes one be there.
gonio_status gonio_free_check_config(const gonio_free_axis axes[GONIO_AXES], const char *named, gonio_error *error);
// Wait until nothing is busy, for a driver's `stop`.
gonio_status gonio_free_come_to_rest(gonio_free_stage *stage, gonio_free_state *state, gonio_error *error);
// The operations of the stage, but for its name.
#define GONIO_FREE_STAGE_OPS                                                                                           \
    .home = gonio_free_home, .move = gonio_free_move, .position = gonio_free_position, .stop = gonio_free_stop,        \
    .duration_s = gonio_free_duration_s, .close = gonio_free_close, .check = gonio_free_check,                         \
    .turns = gonio_free_turns, .independent = true, .real = true
gonio_status gonio_free_home(void *device, double timeout_s, gonio_error *error);
gonio_status gonio_free_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                             double timeout_s, gonio_error *error);
gonio_status gonio_free_position(void *device, double position_rad[GONIO_AXES], gonio_error *error);
gonio_status gonio_free_stop(void *device, gonio_error *error);
double gonio_free_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]);
void gonio_free_close(void *device);
gonio_status gonio_free_check(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                              gonio_error *error);
bool gonio_free_turns(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                      double turn_rad[GONIO_AXES]);

// The keys of an axis for a driver whose settings have a gonio_free_axis at `at`.
#define GONIO_FREE_KEY(settings, title, text, kind, member)                                                            \
    .section = title, GONIO_KEY_NAMED(settings, member, text, kind)
#define GONIO_FREE_KEYS(settings, title, at)                                                                           \
    {GONIO_FREE_KEY(settings, title, "units_per_deg", REAL, at.units_per_deg), -1e9, 1e9},                             \
        {GONIO_FREE_KEY(settings, title, "speed_deg_per_s", REAL, at.speed_deg_per_s), 1e-3, 1e4, .shared = true},     \
        {GONIO_FREE_KEY(settings, title, "min_deg", REAL, at.min_deg), -3600, 3600, .shared = true},                   \
        {GONIO_FREE_KEY(settings, title, "max_deg", REAL, at.max_deg), -3600, 3600, .shared = true},                   \
        {GONIO_FREE_KEY(settings, title, "backlash_deg", REAL, at.backlash_deg), -45, 45, .shared = true},             \
        {GONIO_FREE_KEY(settings, title, "zero_deg", REAL, at.zero_deg), -3600, 3600},                                 \
        {GONIO_FREE_KEY(settings, title, "fixed_deg", REAL, at.fixed_deg), -360, 360}, {                               \
        GONIO_FREE_KEY(settings, title, "invert", BOOLEAN, at.invert)                                                  \
    }
// What a driver's `open` is given, into the stage.
void gonio_free_watch(gonio_free_stage *stage, const gonio_driver_context *context);

#endif
