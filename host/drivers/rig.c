// SPDX-License-Identifier: BSD-3-Clause
// A rig as a whole.
#include <stddef.h>

#include "host/drivers/driver.h"
#include "host/drivers/null.h"

void gonio_rig_close(gonio_rig *rig) {
    // The lamp last: nothing moves in the dark, and a shutter is closed by its own device.
    if (rig->mount != NULL && rig->mount->close != NULL) {
        rig->mount->close(rig->mount_device);
    }
    if (rig->camera != NULL && rig->camera->close != NULL) {
        rig->camera->close(rig->camera_device);
    }
    if (rig->meter != NULL && rig->meter->close != NULL) {
        rig->meter->close(rig->meter_device);
    }
    if (rig->stage != NULL && rig->stage->close != NULL) {
        rig->stage->close(rig->stage_device);
    }
    if (rig->interlock != NULL && rig->interlock->close != NULL) {
        rig->interlock->close(rig->interlock_device);
    }
    if (rig->lamp != NULL && rig->lamp->close != NULL) {
        rig->lamp->close(rig->lamp_device);
    }
    *rig = (gonio_rig){0};
}

gonio_status gonio_null_rig_open(gonio_rig *rig, gonio_error *error) {
    *rig = (gonio_rig){0};
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < GONIO_DEVICES; k++) {
        const gonio_driver *driver = gonio_driver_find((gonio_device)k, "null");
        void *device;
        status = driver->open(NULL, NULL, &device, error);
        if (status == GONIO_OK) {
            gonio_driver_install(driver, device, rig);
        }
    }
    if (status != GONIO_OK) {
        gonio_rig_close(rig);
    }
    return status;
}
