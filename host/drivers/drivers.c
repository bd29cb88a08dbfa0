// SPDX-License-Identifier: BSD-3-Clause
// The list of drivers: by number, by device and name; putting a device into a rig.
#include <stdio.h>
#include <string.h>

#include "base/text.h"
#include "host/drivers/driver.h"

#define GONIO_DRIVER(name) extern const gonio_driver gonio_driver_##name;
#include "host/drivers/drivers.def"
#undef GONIO_DRIVER

static const gonio_driver *const drivers[] = {
#define GONIO_DRIVER(name) &gonio_driver_##name,
#include "host/drivers/drivers.def"
#undef GONIO_DRIVER
};
#define COUNT ((int)(sizeof drivers / sizeof *drivers))

const char *gonio_device_name(gonio_device device) {
    static const char *const names[GONIO_DEVICES] = {
        [GONIO_DEVICE_INTERLOCK] = "interlock", [GONIO_DEVICE_STAGE] = "stage",   [GONIO_DEVICE_LAMP] = "lamp",
        [GONIO_DEVICE_METER] = "meter",         [GONIO_DEVICE_CAMERA] = "camera", [GONIO_DEVICE_MOUNT] = "mount"};
    return names[device];
}

const gonio_driver *gonio_driver_at(int number) { return number >= 0 && number < COUNT ? drivers[number] : NULL; }

const gonio_driver *gonio_driver_find(gonio_device device, const char *name) {
    for (int i = 0; i < COUNT; i++) {
        if (drivers[i]->device == device && strcmp(drivers[i]->name, name) == 0) {
            return drivers[i];
        }
    }
    return NULL;
}

void gonio_driver_names(gonio_device device, char *text, size_t size) {
    text[0] = 0;
    for (int i = 0; i < COUNT; i++) {
        if (drivers[i]->device == device) {
            gonio_text_append(text, size, " %s", drivers[i]->name);
        }
    }
}

// Close what stands in the place, if anything does, and put the new device there.
#define INSTALL(place, type)                                                                                           \
    do {                                                                                                               \
        if (rig->place != NULL && rig->place->close != NULL) {                                                         \
            rig->place->close(rig->place##_device);                                                                    \
        }                                                                                                              \
        rig->place = (const type *)driver->ops;                                                                        \
        rig->place##_device = device;                                                                                  \
    } while (0)

void gonio_driver_install(const gonio_driver *driver, void *device, gonio_rig *rig) {
    switch (driver->device) {
    case GONIO_DEVICE_INTERLOCK:
        INSTALL(interlock, gonio_interlock_ops);
        return;
    case GONIO_DEVICE_STAGE:
        INSTALL(stage, gonio_stage_ops);
        return;
    case GONIO_DEVICE_LAMP:
        INSTALL(lamp, gonio_lamp_ops);
        return;
    case GONIO_DEVICE_METER:
        INSTALL(meter, gonio_meter_ops);
        return;
    case GONIO_DEVICE_CAMERA:
        INSTALL(camera, gonio_camera_ops);
        return;
    case GONIO_DEVICE_MOUNT:
        INSTALL(mount, gonio_mount_ops);
        return;
    case GONIO_DEVICES:
        return;
    }
}
