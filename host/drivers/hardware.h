// SPDX-License-Identifier: BSD-3-Clause
// The real devices of a rig file: their settings by section and key, and opening them over a rig that is there.
#ifndef GONIO_DRIVERS_HARDWARE_H
#define GONIO_DRIVERS_HARDWARE_H

#include "gonio/rig.h"
#include "host/drivers/camera_v4l2.h"
#include "host/drivers/controller.h"
#include "host/drivers/driver.h"
#include "host/drivers/interlock_gpio.h"
#include "host/drivers/lamp_gpio.h"
#include "host/drivers/meter_usbtmc.h"
#include "host/drivers/stage_modbus.h"

typedef struct gonio_hardware gonio_hardware;

typedef struct gonio_hardware_hooks {
    void (*event)(void *context, const char *kind, const char *text); // may be NULL
    void *context;
    bool (*cancelled)(void *context); // asked while axes move; may be NULL
} gonio_hardware_hooks;

gonio_status gonio_hardware_new(const gonio_hardware_hooks *hooks, gonio_hardware **out, gonio_error *error);
// After the rig that it opened is closed. NULL is allowed.
void gonio_hardware_free(gonio_hardware *hardware);
// One key of the rig file. Give every `driver` key first: they decide which other keys are known. *taken: it is known
// here; *shared: the simulator has a key of the same name, which means the same. GONIO_E_INPUT for a bad value.
gonio_status gonio_hardware_set(gonio_hardware *hardware, const char *section, const char *key, const char *value,
                                bool *taken, bool *shared, gonio_error *error);
// " key" of every key of the section that is known with the drivers chosen so far, for messages. False where there is
// none but `driver`.
bool gonio_hardware_list(gonio_hardware *hardware, const char *section, char *text, size_t size);
// Whether drivers that were not chosen have such a key; the error then names them.
bool gonio_hardware_elsewhere(const gonio_hardware *hardware, const char *section, const char *key, gonio_error *error);
// "stage modbus, controller.port = tcp:HOST:PORT": the devices that gonio_hardware_open would open and every name that
// their settings give it, of ports and of files, fit for a terminal. False where there is none, or null ones alone.
bool gonio_hardware_reach(gonio_hardware *hardware, char *text, size_t size);
// Open every device that has a driver in place of the rig's own. simulated: the rig's stage and lamp are simulated and
// follow the real ones. On failure the rig keeps what it has; close it as a whole either way.
gonio_status gonio_hardware_open(gonio_hardware *hardware, gonio_rig *rig, bool simulated, gonio_error *error);

// The line to the controller that the keys name; NULL: no device is behind one, or a record answers in its place.
const char *gonio_hardware_line(const gonio_hardware *hardware);
// What was opened, for `gonio rig`; NULL where there is none.
gonio_controller *gonio_hardware_controller(const gonio_hardware *hardware);
void *gonio_hardware_stage(const gonio_hardware *hardware);       // of stage_modbus.h
void *gonio_hardware_encoders(const gonio_hardware *hardware);    // of encoders.h
const char *gonio_hardware_meter(const gonio_hardware *hardware); // *IDN?, or NULL

#endif
