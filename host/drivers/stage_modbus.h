// SPDX-License-Identifier: BSD-3-Clause
// The four axes behind the controller.
#ifndef GONIO_DRIVERS_STAGE_MODBUS_H
#define GONIO_DRIVERS_STAGE_MODBUS_H

#include "gonio/rig.h"
#include "host/drivers/controller.h"

// One axis. NaN (or -1 for home_order and home_up): the controller keeps what it has.
typedef struct gonio_axis_config {
    double steps_per_deg, speed_deg_per_s, acceleration_deg_per_s2, jerk_deg_per_s3;
    double min_deg, max_deg; // soft limits, dial coordinates
    double backlash_deg;     // overshoot of the final approach
    double home_deg;         // dial position of the home switch
    double home_fast_deg_per_s, home_slow_deg_per_s;
    double home_travel_deg;  // no switch within this: alarm HOME_MISSING
    double home_backoff_deg; // how far off the switch homing goes, before the second approach and at its end
    int home_order, home_up;
    double zero_deg; // user = sign * (dial - zero); 0
    bool invert;     // the sign is -1, else +1; user coordinates are what poses are given in
} gonio_axis_config;

typedef struct gonio_stage_modbus_config {
    gonio_axis_config axes[GONIO_AXES];
    double audit_deg; // a larger difference to the last homing is a lost-step event; 0.01
    int home_pressed; // an axis that stands on its switch: 1 backs off first, 0 raises HOME_PRESSED; -1: as it is
    // Asked all the while the axes move: the interlock. May be NULL.
    const gonio_interlock_ops *interlock;
    void *interlock_device;
} gonio_stage_modbus_config;

void gonio_stage_modbus_defaults(gonio_stage_modbus_config *config);

extern const gonio_stage_ops gonio_stage_modbus;
// Read the axes' parameters; nothing is written before the first move or homing. Shares the controller. GONIO_E_INPUT
// where the controller cannot have what is configured.
gonio_status gonio_stage_modbus_open(const gonio_stage_modbus_config *config, gonio_controller *controller,
                                     void **device, gonio_error *error);
// Write what differs from the configuration, telling each as an event "parameters"; a move and a homing begin so. What
// makes positions mean something else makes them unknown.
gonio_status gonio_stage_modbus_apply(void *device, gonio_error *error);
// Home some axes (bits) alone, in home_order among them; the others stay.
gonio_status gonio_stage_modbus_home(void *device, unsigned axes, double timeout_s, gonio_error *error);
// Move an axis, homed or not, by so much in user coordinates: at home_slow, for ten seconds at most, which is what the
// controller allows where nobody knows its position. It is not homed by that.
gonio_status gonio_stage_modbus_jog(void *device, int axis, double user_deg, gonio_error *error);
// Switch motors off, so that the axes can be turned by hand; they are not homed then.
gonio_status gonio_stage_modbus_release(void *device, unsigned axes, gonio_error *error);
// Whether the configuration says what this register of an axis is.
bool gonio_stage_modbus_gives(const void *device, int axis, int address);
// What the last homing found: degrees by which each axis had drifted. GONIO_E_MISMATCH where one exceeds audit_deg.
gonio_status gonio_stage_modbus_audit(void *device, double difference_deg[GONIO_AXES], gonio_error *error);
// The limits of an axis in user coordinates, as the controller holds them.
void gonio_stage_modbus_limits(const void *device, int axis, double *min_deg, double *max_deg);
// An axis's user position of a dial position, both in degrees.
double gonio_stage_modbus_user_deg(const void *device, int axis, double dial_deg);
// Where the axes stand by a status of the controller, in user coordinates.
void gonio_stage_modbus_position(const void *device, const gonio_controller_status *now,
                                 double position_rad[GONIO_AXES]);
int64_t gonio_stage_modbus_lost_steps(const void *device); // events since it was opened

#endif
