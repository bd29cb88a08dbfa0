// SPDX-License-Identifier: BSD-3-Clause
// The controller's parameters, every one by its name in firmware/regmap.def: values as people write them, in the unit
// of the table without its factor (temperature_max in degC, not in 0.001 degC), bits by the names of axes and contacts.
#ifndef GONIO_DRIVERS_PARAMETERS_H
#define GONIO_DRIVERS_PARAMETERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/status.h"
#include "host/drivers/controller_map.h"

typedef struct gonio_controller gonio_controller;

// What a rig file says in [controller]; NaN, or -1 of an int: nothing, the controller keeps what it has.
typedef struct gonio_controller_parameters {
#define PARAMETER(key, kind, type, register, low, high, times) type key;
#include "host/drivers/controller_parameters.def"
} gonio_controller_parameters;

void gonio_controller_parameters_defaults(gonio_controller_parameters *parameters);
bool gonio_controller_parameters_give(const gonio_controller_parameters *parameters, int address);
// Write those that are given and differ, and tell each as an event "parameters". The controller is held.
gonio_status gonio_controller_parameters_write(gonio_controller *controller,
                                               const gonio_controller_parameters *parameters, gonio_error *error);

// Names of bits, NULL-terminated: "light_theta"; "home_light_theta", "estop".
const char *const *gonio_parameter_axes(void);
const char *const *gonio_parameter_contacts(void);
const char *const *gonio_parameter_outputs(void);

// By name; NULL: there is no such parameter.
const controller_register_info *gonio_parameter_find(const char *name);
const char *gonio_parameter_unit(const controller_register_info *parameter); // "steps/deg"; "" of bits
// How many of the register's counts are one of the unit: 1000 of "0.001 degC".
double gonio_parameter_counts(const controller_register_info *parameter);
void gonio_parameter_print(const controller_register_info *parameter, int64_t value, char *text, size_t size);
// "1 to 7", or the names of the bits.
void gonio_parameter_bounds(const controller_register_info *parameter, char *text, size_t size);
// GONIO_E_USAGE naming the parameter, what was found and what is expected.
gonio_status gonio_parameter_parse(const controller_register_info *parameter, const char *text, int64_t *value,
                                   gonio_error *error);
// The rig file's key, "[controller] settle_ms" or "[axis ...] min_deg". Where there is none: NULL, and *why (may be
// NULL) says why, or is NULL.
const char *gonio_parameter_key(const controller_register_info *parameter, const char **why);

// `count` values, one an axis where there are several.
gonio_status gonio_parameter_read(gonio_controller *controller, const controller_register_info *parameter,
                                  int64_t *values, gonio_error *error);
gonio_status gonio_parameter_write(gonio_controller *controller, const controller_register_info *parameter, int index,
                                   int64_t value, gonio_error *error);

#endif
