// SPDX-License-Identifier: BSD-3-Clause
// The axes' parameters: what a rig file says of them in degrees, what the controller holds in steps, and the
// difference.
#ifndef GONIO_DRIVERS_STAGE_PARAMETERS_H
#define GONIO_DRIVERS_STAGE_PARAMETERS_H

#include "host/drivers/stage_modbus.h"

typedef enum gonio_parameter {
    GONIO_PARAMETER_STEPS_PER_DEG, // in thousandths; the others need it
    GONIO_PARAMETER_SPEED,
    GONIO_PARAMETER_ACCELERATION,
    GONIO_PARAMETER_JERK,
    GONIO_PARAMETER_MIN,
    GONIO_PARAMETER_MAX,
    GONIO_PARAMETER_BACKLASH,
    GONIO_PARAMETER_HOME,
    GONIO_PARAMETER_HOME_FAST,
    GONIO_PARAMETER_HOME_SLOW,
    GONIO_PARAMETER_HOME_TRAVEL,
    GONIO_PARAMETER_HOME_BACKOFF,
    GONIO_PARAMETER_HOME_ORDER,
    GONIO_PARAMETER_HOME_UP,
    GONIO_AXIS_PARAMETERS
} gonio_parameter;

// In steps, as the registers have them.
typedef struct gonio_stage_parameters {
    int64_t axis[GONIO_AXES][GONIO_AXIS_PARAMETERS];
    int64_t home_pressed;
} gonio_stage_parameters;

extern const char *const gonio_stage_axis_names[GONIO_AXES];

// "[axis ...] min_deg" of an axis' register; NULL: it has no key there.
const char *gonio_stage_parameter_key(int address);
// Whether the rig file says what this register of an axis is, or home_pressed.
bool gonio_stage_parameter_given(const gonio_stage_modbus_config *config, int axis, int address);

gonio_status gonio_stage_parameters_read(gonio_controller *controller, gonio_stage_parameters *held,
                                         gonio_error *error);
// What the rig file wants of a controller that holds this. GONIO_E_INPUT naming the key, its value and the controller's
// bound where it cannot be, or where the limits are the wrong way round.
gonio_status gonio_stage_parameters_want(const gonio_stage_modbus_config *config, const gonio_stage_parameters *held,
                                         gonio_stage_parameters *wanted, gonio_error *error);
// Write what differs, and tell each difference as an event "parameters".
gonio_status gonio_stage_parameters_write(gonio_controller *controller, const gonio_stage_parameters *held,
                                          const gonio_stage_parameters *wanted, gonio_error *error);

#endif
