// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/camera_aravis.h"
#include "host/drivers/camera_keys.h"
#include "host/drivers/driver.h"

typedef gonio_camera_aravis_config settings;
#define KEY(text, kind, member) GONIO_CAMERA_KEY(settings, text, kind, member)
static const gonio_key keys[] = {{KEY("device", LINE, id)},
                                 {KEY("format", LINE, format)},
                                 {KEY("bits", INTEGER, bits), 8, 16},
                                 {KEY("shift_bits", INTEGER, shift), 0, 15},
                                 {KEY("settle_frames", INTEGER, settle_frames), 0, 100},
                                 {KEY("exposure_tolerance_percent", REAL, exposure_tolerance), 0, 1000, .times = 100},
                                 {KEY("replug_s", REAL, replug_s), 0, 3600},
                                 GONIO_CAMERA_INFO_KEYS(settings, info),
                                 {0}};

static void defaults(void *config) { gonio_camera_aravis_defaults(config); }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    (void)context;
    return gonio_camera_aravis_open(config, device, error);
}

const gonio_driver gonio_driver_camera_aravis = {.name = "aravis",
                                                 .device = GONIO_DEVICE_CAMERA,
                                                 .summary = "a GenICam camera (GigE Vision, USB3 Vision)",
                                                 .keys = keys,
                                                 .settings = sizeof(settings),
                                                 .defaults = defaults,
                                                 .ops = &gonio_camera_aravis,
                                                 .open = make};
