// SPDX-License-Identifier: BSD-3-Clause
// The driver's keys: a record or a replay of the line, and a trigger, around the camera of camera_v4l2.h.
#include <stdio.h>

#include "host/drivers/camera_keys.h"
#include "host/drivers/camera_v4l2.h"
#include "host/drivers/driver.h"
#include "host/drivers/lamp_gpio.h"

typedef struct settings {
    gonio_camera_v4l2_config config;
    char record[256], replay[256];
    gonio_trigger_gpio trigger; // its line empty: none
    gonio_tape *tape;
    gonio_v4l2_recorder *recorder;
} settings;

#define KEY(text, kind, member) GONIO_CAMERA_KEY(settings, text, kind, member)
static const gonio_key keys[] = {
    {KEY("device", LINE, config.path)},
    {KEY("format", LINE, config.format)},
    {KEY("width", INTEGER, config.width), 8, 65536},
    {KEY("height", INTEGER, config.height), 8, 65536},
    {KEY("bits", INTEGER, config.bits), 8, 16},
    {KEY("shift_bits", INTEGER, config.shift), 0, 15},
    {KEY("settle_frames", INTEGER, config.settle_frames), 0, 100},
    {KEY("buffers", INTEGER, config.buffers), 2, 16},
    {KEY("exposure_unit_us", REAL, config.exposure_unit_s), 1e-3, 1e6, .times = 1e6},
    {KEY("fixed_exposure_ms", REAL, config.fixed_exposure_s), 1e-3, 1e6, .times = 1000},
    {KEY("exposure_tolerance_percent", REAL, config.exposure_tolerance), 0, 1000, .times = 100},
    {KEY("gain_db_per_step", REAL, config.gain_unit_db), 0, 20},
    {KEY("replug_s", REAL, config.replug_s), 0, 3600},
    GONIO_CAMERA_INFO_KEYS(settings, config.info),
    {KEY("record", LINE, record)},
    {KEY("replay", LINE, replay)},
    {KEY("trigger_line", LINE, trigger.line)},
    {KEY("trigger_low", BOOLEAN, trigger.low)},
    {KEY("trigger_settle_ms", REAL, trigger.settle_s), 0, 1e5, .times = 1000},
    {KEY("trigger_pulse_ms", REAL, trigger.pulse_s), 0, 1e3, .times = 1000},
    {0}};

static void defaults(void *of) {
    settings *s = of;
    gonio_camera_v4l2_defaults(&s->config);
    s->trigger = (gonio_trigger_gpio){.io = &gonio_gpio_system, .pulse_s = 0.001};
}

static gonio_status make(void *of, const gonio_driver_context *context, void **device, gonio_error *error) {
    settings *s = of;
    gonio_status status = GONIO_OK;
    if (s->trigger.line[0] != 0) {
        s->config.trigger = gonio_trigger_gpio_fire;
        s->config.trigger_context = &s->trigger;
        status = gonio_trigger_gpio_open(&s->trigger, error);
    }
    status = status == GONIO_OK ? gonio_tape_choose(s->record, s->replay, &s->tape, error) : status;
    if (status == GONIO_OK && s->tape != NULL) {
        status = gonio_v4l2_recorder_new(s->tape, &gonio_v4l2_system, NULL, &s->recorder, error);
    }
    const gonio_v4l2_io *io = s->replay[0] != 0   ? &gonio_v4l2_replaying
                              : s->record[0] != 0 ? &gonio_v4l2_recording
                                                  : &gonio_v4l2_system;
    status = status == GONIO_OK ? gonio_camera_v4l2_open(&s->config, io, s->recorder, device, error) : status;
    if (status == GONIO_OK && gonio_camera_v4l2_warning(*device)[0] != 0 && context->event != NULL) {
        context->event(context->event_context, "camera", gonio_camera_v4l2_warning(*device));
    }
    const gonio_pixel_format *format = status == GONIO_OK ? gonio_camera_v4l2_format(*device) : NULL;
    if (format != NULL && format->fitness == GONIO_FIT_WITH_WARNING && context->event != NULL) {
        char text[160];
        snprintf(text, sizeof text, "%s is %s", format->name, format->why);
        context->event(context->event_context, "camera", text);
    }
    return status;
}

static void let_go(void *of) {
    settings *s = of;
    if (s->trigger.handle != NULL) {
        gonio_trigger_gpio_close(&s->trigger);
    }
    gonio_v4l2_recorder_free(s->recorder);
    gonio_tape_close(s->tape);
}

const gonio_driver gonio_driver_camera_v4l2 = {.name = "v4l2",
                                               .device = GONIO_DEVICE_CAMERA,
                                               .summary = "any V4L2 camera with a linear, uncompressed format",
                                               .keys = keys,
                                               .settings = sizeof(settings),
                                               .defaults = defaults,
                                               .ops = &gonio_camera_v4l2,
                                               .open = make,
                                               .release = let_go};
