// SPDX-License-Identifier: BSD-3-Clause
// The drivers of a rig's devices. A driver is one file, its registration the last thing there, and one line in
// drivers.def; `driver = NAME` in the device's section of a rig file chooses it, and its keys are then the section's.
#ifndef GONIO_DRIVERS_DRIVER_H
#define GONIO_DRIVERS_DRIVER_H

#include <stddef.h>

#include "base/keys.h"
#include "gonio/rig.h"
#include "host/drivers/controller.h"

// In the order in which they are opened: the interlock watches the stage, the stage stands before anything looks.
typedef enum gonio_device {
    GONIO_DEVICE_INTERLOCK,
    GONIO_DEVICE_STAGE,
    GONIO_DEVICE_LAMP,
    GONIO_DEVICE_METER,
    GONIO_DEVICE_CAMERA,
    GONIO_DEVICE_MOUNT,
    GONIO_DEVICES
} gonio_device;

const char *gonio_device_name(gonio_device device); // "stage", which is its section of a rig file

#define GONIO_SHUTTER_SETTLE_S 0.1 // waited after each switching of a shutter, where its key says nothing else

// What a driver may use while it opens.
typedef struct gonio_driver_context {
    gonio_controller *controller;         // where the driver asks for it; a device that keeps it shares it
    const gonio_interlock_ops *interlock; // a real one, opened before; NULL: none
    void *interlock_device;
    void (*event)(void *context, const char *kind, const char *text); // what a session should note; NULL: nobody
    bool (*cancelled)(void *context); // asked in long waits; true ends them. NULL: never
    void *event_context;              // of both
} gonio_driver_context;

typedef struct gonio_driver {
    const char *name; // "v4l2"
    gonio_device device;
    const char *summary;
    const gonio_key *keys;            // of a rig file's sections, most in the device's own; NULL: none
    size_t settings;                  // bytes of the struct that the keys fill; 0: none
    void (*defaults)(void *settings); // NULL: zeros
    bool controller;                  // behind the controller: the keys of [controller] belong to it as well
    const void *ops;                  // gonio_stage_ops, gonio_lamp_ops ... by the device
    // Make the device, which ops->close frees. The settings outlive it.
    gonio_status (*open)(void *settings, const gonio_driver_context *context, void **device, gonio_error *error);
    // Optional: release what open has put into the settings, after the device is closed, or could not be opened.
    void (*release)(void *settings);
} gonio_driver;

// For drivers without a device of their own: open and close.
gonio_status gonio_driver_no_device(void *settings, const gonio_driver_context *context, void **device,
                                    gonio_error *error);
void gonio_driver_nothing_to_close(void *device);

// By number, from 0 on; NULL past the last.
const gonio_driver *gonio_driver_at(int number);
const gonio_driver *gonio_driver_find(gonio_device device, const char *name); // NULL: none
// " a b" of the drivers of a device, for messages.
void gonio_driver_names(gonio_device device, char *text, size_t size);
// The keys of [controller].
extern const gonio_key gonio_controller_keys[];
// Put the device into the rig in place of the one that is there, which is closed.
void gonio_driver_install(const gonio_driver *driver, void *device, gonio_rig *rig);

#endif
