#include "host/drivers/hardware.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/drivers/hardware_keys.h"
#include "host/drivers/lamp_modbus.h"
#include "host/drivers/shadow.h"

struct gonio_hardware {
    hardware_settings settings;
    gonio_controller *controller; // one user of it is this
    gonio_tape *controller_tape, *camera_tape;
    gonio_v4l2_recorder *recorder;
    gonio_trigger_gpio trigger;
    void *stage, *camera, *meter, *interlock; // borrowed from the rig
};

gonio_status gonio_hardware_new(const gonio_hardware_hooks *hooks, gonio_hardware **out, gonio_error *error) {
    gonio_hardware *h = calloc(1, sizeof *h);
    if (h == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for the rig's devices");
    }
    hardware_settings_default(&h->settings);
    h->settings.controller.event = hooks->event;
    h->settings.controller.event_context = hooks->context;
    h->settings.controller.cancelled = hooks->cancelled;
    *out = h;
    return GONIO_OK;
}

void gonio_hardware_free(gonio_hardware *h) {
    if (h == NULL) {
        return;
    }
    gonio_controller_release(h->controller);
    if (h->trigger.handle != NULL) {
        gonio_trigger_gpio_close(&h->trigger);
    }
    gonio_v4l2_recorder_free(h->recorder);
    gonio_tape_close(h->controller_tape);
    gonio_tape_close(h->camera_tape);
    free(h);
}

gonio_status gonio_hardware_set(gonio_hardware *h, const char *section, const char *key, const char *value, bool *taken,
                                bool *shared, gonio_error *error) {
    return hardware_settings_set(&h->settings, section, key, value, taken, shared, error);
}

void gonio_hardware_list(const gonio_hardware *h, char *text, size_t size) {
    hardware_settings_list(&h->settings, text, size);
}

static bool is(const char *driver, const char *name) { return strcmp(driver, name) == 0; }

static gonio_status open_tape(const char *record, const char *replay, gonio_tape **tape, gonio_error *error) {
    return replay[0] != 0   ? gonio_tape_open(replay, tape, error)
           : record[0] != 0 ? gonio_tape_create(record, tape, error)
                            : GONIO_OK;
}

static gonio_status open_controller(gonio_hardware *h, gonio_error *error) {
    hardware_settings *s = &h->settings;
    if (!is(s->stage_driver, "modbus") && !is(s->lamp_driver, "modbus") && !is(s->meter_driver, "modbus")) {
        return GONIO_OK;
    }
    const gonio_status status = open_tape(s->controller_record, s->controller_replay, &h->controller_tape, error);
    if (status != GONIO_OK) {
        return status;
    }
    s->controller.tape = h->controller_tape;
    s->controller.mode = s->controller_replay[0] != 0   ? GONIO_TAPE_REPLAY
                         : s->controller_record[0] != 0 ? GONIO_TAPE_RECORD
                                                        : GONIO_TAPE_OFF;
    return gonio_controller_open(&s->controller, &h->controller, error);
}

static gonio_status open_interlock(gonio_hardware *h, gonio_rig *rig, gonio_error *error) {
    if (!is(h->settings.interlock_driver, "gpio")) {
        return GONIO_OK;
    }
    const gonio_status status =
        gonio_interlock_gpio_open(&h->settings.interlock, &gonio_gpio_system, NULL, &h->interlock, error);
    if (status == GONIO_OK) {
        if (rig->interlock != NULL) {
            rig->interlock->close(rig->interlock_device);
        }
        rig->interlock = &gonio_interlock_gpio;
        rig->interlock_device = h->interlock;
    }
    return status;
}

static gonio_status open_stage(gonio_hardware *h, gonio_rig *rig, bool simulated, gonio_error *error) {
    if (!is(h->settings.stage_driver, "modbus")) {
        return GONIO_OK;
    }
    // Only a real interlock is watched in mid-move; a simulated one strikes by pose.
    h->settings.stage.interlock = h->interlock != NULL ? &gonio_interlock_gpio : NULL;
    h->settings.stage.interlock_device = h->interlock;
    gonio_status status = gonio_stage_modbus_open(&h->settings.stage, h->controller, &h->stage, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (simulated) {
        status = gonio_shadow_stage(rig, &gonio_stage_modbus, h->stage, error);
        if (status != GONIO_OK) {
            gonio_stage_modbus.close(h->stage);
        }
        return status;
    }
    rig->stage->close(rig->stage_device);
    rig->stage = &gonio_stage_modbus;
    rig->stage_device = h->stage;
    return GONIO_OK;
}

static gonio_status open_lamp(gonio_hardware *h, gonio_rig *rig, bool simulated, gonio_error *error) {
    const bool modbus = is(h->settings.lamp_driver, "modbus");
    if (h->settings.lamp_driver[0] == 0) {
        return GONIO_OK;
    }
    void *device = NULL;
    const gonio_lamp_ops *ops = modbus ? &gonio_lamp_modbus : &gonio_lamp_gpio;
    h->settings.lamp.shutter_settle_s = h->settings.shutter_settle_s;
    gonio_status status = modbus ? gonio_lamp_modbus_open(h->controller, h->settings.shutter_settle_s, &device, error)
                                 : gonio_lamp_gpio_open(&h->settings.lamp, &gonio_gpio_system, NULL, &device, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (simulated) {
        status = gonio_shadow_lamp(rig, ops, device, error);
        if (status != GONIO_OK) {
            ops->close(device);
        }
        return status;
    }
    rig->lamp->close(rig->lamp_device);
    rig->lamp = ops;
    rig->lamp_device = device;
    return GONIO_OK;
}

static gonio_status open_meter(gonio_hardware *h, gonio_rig *rig, gonio_error *error) {
    const gonio_meter_usbtmc_config *c = &h->settings.meter;
    if (h->settings.meter_driver[0] == 0) {
        return GONIO_OK;
    }
    void *device = NULL;
    const bool usb = is(h->settings.meter_driver, "usbtmc");
    const gonio_status status =
        usb ? gonio_meter_usbtmc_open(c, &device, error)
            : gonio_meter_modbus_open(h->controller, c->scale, c->relative_sigma, &device, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (rig->meter != NULL) {
        rig->meter->close(rig->meter_device);
    }
    rig->meter = usb ? &gonio_meter_usbtmc : &gonio_meter_modbus;
    rig->meter_device = device;
    h->meter = usb ? device : NULL;
    return GONIO_OK;
}

static gonio_status open_trigger(gonio_hardware *h, gonio_error *error) {
    const hardware_settings *s = &h->settings;
    if (s->trigger_line[0] == 0) {
        return GONIO_OK;
    }
    h->trigger = (gonio_trigger_gpio){.io = &gonio_gpio_system,
                                      .low = s->trigger_low,
                                      .settle_s = s->trigger_settle_s,
                                      .pulse_s = s->trigger_pulse_s};
    memcpy(h->trigger.line, s->trigger_line, sizeof h->trigger.line);
    h->settings.camera.trigger = gonio_trigger_gpio_fire;
    h->settings.camera.trigger_context = &h->trigger;
    return gonio_trigger_gpio_open(&h->trigger, error);
}

static gonio_status open_camera(gonio_hardware *h, gonio_rig *rig, gonio_error *error) {
    hardware_settings *s = &h->settings;
    if (!is(s->camera_driver, "v4l2")) {
        return GONIO_OK;
    }
    gonio_status status = open_trigger(h, error);
    if (status == GONIO_OK) {
        status = open_tape(s->camera_record, s->camera_replay, &h->camera_tape, error);
    }
    if (status == GONIO_OK && h->camera_tape != NULL) {
        status = gonio_v4l2_recorder_new(h->camera_tape, &gonio_v4l2_system, NULL, &h->recorder, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_v4l2_io *io = s->camera_replay[0] != 0   ? &gonio_v4l2_replaying
                              : s->camera_record[0] != 0 ? &gonio_v4l2_recording
                                                         : &gonio_v4l2_system;
    status = gonio_camera_v4l2_open(&s->camera, io, h->recorder, &h->camera, error);
    if (status == GONIO_OK) {
        rig->camera->close(rig->camera_device);
        rig->camera = &gonio_camera_v4l2;
        rig->camera_device = h->camera;
        const gonio_pixel_format *format = gonio_camera_v4l2_format(h->camera);
        if (format->fitness == GONIO_FIT_WITH_WARNING && s->controller.event != NULL) {
            char text[160];
            snprintf(text, sizeof text, "%s is %s", format->name, format->why);
            s->controller.event(s->controller.event_context, "camera", text);
        }
    }
    return status;
}

gonio_status gonio_hardware_open(gonio_hardware *h, gonio_rig *rig, bool simulated, gonio_error *error) {
    gonio_status status = open_controller(h, error);
    if (status == GONIO_OK) {
        status = open_interlock(h, rig, error);
    }
    if (status == GONIO_OK) {
        status = open_stage(h, rig, simulated, error);
    }
    if (status == GONIO_OK) {
        status = open_lamp(h, rig, simulated, error);
    }
    if (status == GONIO_OK) {
        status = open_meter(h, rig, error);
    }
    if (status == GONIO_OK) {
        status = open_camera(h, rig, error);
    }
    const gonio_keep_out *keep_out = &h->settings.keep_out;
    const bool guarded = keep_out->n > 0 || keep_out->retro_deg > 0;
    return status == GONIO_OK && guarded ? gonio_keep_out_guard(keep_out, rig, error) : status;
}

gonio_controller *gonio_hardware_controller(const gonio_hardware *h) { return h->controller; }
void *gonio_hardware_stage(const gonio_hardware *h) { return h->stage; }
void *gonio_hardware_camera(const gonio_hardware *h) { return h->camera; }
void *gonio_hardware_interlock(const gonio_hardware *h) { return h->interlock; }
const char *gonio_hardware_meter(const gonio_hardware *h) {
    return h->meter != NULL ? gonio_meter_usbtmc_identity(h->meter) : NULL;
}
