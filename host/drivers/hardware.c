// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/hardware.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/text.h"
#include "host/drivers/encoders.h"
#include "host/drivers/keep_out.h"
#include "host/drivers/shadow.h"
#include "host/drivers/stage_modbus_table.h"

// What the drivers behind the controller share.
typedef struct controller_settings {
    gonio_controller_config config;
    char record[256], replay[256];
} controller_settings;

GONIO_KEY_NAMES(parities, "N", "E", "O")
#define CONTROLLER(text, kind, member) .section = "controller", GONIO_KEY_NAMED(controller_settings, member, text, kind)
const gonio_key gonio_controller_keys[] = {{CONTROLLER("port", LINE, config.modbus.port)},
                                           {CONTROLLER("baud", INTEGER, config.modbus.baud), 2400, 1e6},
                                           {CONTROLLER("parity", NAME, config.modbus.parity), .names = parities},
                                           {CONTROLLER("slave", INTEGER, config.modbus.slave), 1, 247},
                                           {CONTROLLER("timeout_ms", INTEGER, config.modbus.timeout_ms), 5, 10000},
                                           {CONTROLLER("retries", INTEGER, config.retries), 0, 100},
                                           {CONTROLLER("deadman_s", REAL, config.deadman_s), 0, 3600},
                                           {CONTROLLER("feed_s", REAL, config.feed_s), 0, 86400},
                                           {CONTROLLER("replug_s", REAL, config.replug_s), 0, 3600},
                                           {CONTROLLER("record", LINE, record)},
                                           {CONTROLLER("replay", LINE, replay)},
#define NAMES_input_enable gonio_parameter_contacts
#define NAMES_input_invert gonio_parameter_contacts
#define NAMES_direction_invert gonio_parameter_axes
#define NAMES_motors_invert gonio_parameter_axes
#define NAMES_output_invert gonio_parameter_outputs
#define NAMES_brakes gonio_parameter_axes
#define NAMES_brakes_invert gonio_parameter_axes
#define NAMES_safe_motors gonio_parameter_axes
#define ROW_FLAGS(key, lowest, highest) {CONTROLLER(#key, FLAGS, config.parameters.key), .names = NAMES_##key},
#define ROW_INTEGER(key, lowest, highest) {CONTROLLER(#key, INTEGER, config.parameters.key), lowest, highest},
#define ROW_REAL(key, lowest, highest) {CONTROLLER(#key, REAL, config.parameters.key), lowest, highest},
#define PARAMETER(key, kind, type, register, low, high, times) ROW_##kind(key, low, high)
#include "host/drivers/controller_parameters.def"
                                           {0}};

static const gonio_key keep_out_keys[] = {{.section = "keep-out", GONIO_KEY(gonio_keep_out, retro_deg, REAL), 0, 90},
                                          {0}};

// One device: its driver (NULL: the rig's own device stays), the driver's settings, what it opened.
typedef struct slot {
    const gonio_driver *driver;
    void *settings, *device; // the device is borrowed from the rig
} slot;

struct gonio_hardware {
    slot slots[GONIO_DEVICES];
    controller_settings line;
    gonio_controller *controller; // one user of it is this
    gonio_tape *tape;             // of the controller
    gonio_keep_out keep_out;
    gonio_encoders encoders;
    void *compared; // what compares them, borrowed from the rig
};

gonio_status gonio_hardware_new(const gonio_hardware_hooks *hooks, gonio_hardware **out, gonio_error *error) {
    gonio_hardware *h = calloc(1, sizeof *h);
    if (h == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for the rig's devices");
    }
    gonio_controller_defaults(&h->line.config);
    gonio_encoders_defaults(&h->encoders);
    h->line.config.event = hooks->event;
    h->line.config.event_context = hooks->context;
    h->line.config.cancelled = hooks->cancelled;
    *out = h;
    return GONIO_OK;
}

static void empty(slot *s) {
    if (s->driver != NULL && s->driver->release != NULL) {
        s->driver->release(s->settings);
    }
    free(s->settings);
    *s = (slot){0};
}

void gonio_hardware_free(gonio_hardware *h) {
    if (h == NULL) {
        return;
    }
    gonio_controller_release(h->controller);
    for (int k = 0; k < GONIO_DEVICES; k++) {
        empty(&h->slots[k]);
    }
    gonio_tape_close(h->tape);
    free(h);
}

// ---- keys ----

static bool behind_controller(const gonio_hardware *h) {
    for (int k = 0; k < GONIO_DEVICES; k++) {
        if (h->slots[k].driver != NULL && h->slots[k].driver->controller) {
            return true;
        }
    }
    return false;
}

// A table of keys and the settings that it fills.
typedef struct table {
    const gonio_key *keys;
    void *settings;
} table;

// The tables that are known with the drivers chosen so far; an empty one at the end.
static void tables_of(gonio_hardware *h, table tables[GONIO_DEVICES + 4]) {
    int n = 0;
    for (int k = 0; k < GONIO_DEVICES; k++) {
        const slot *s = &h->slots[k];
        if (s->driver != NULL && s->driver->keys != NULL) {
            tables[n++] = (table){s->driver->keys, s->settings};
        }
    }
    if (behind_controller(h)) {
        tables[n++] = (table){gonio_controller_keys, &h->line};
    }
    tables[n++] = (table){keep_out_keys, &h->keep_out};
    tables[n++] = (table){gonio_encoder_keys, &h->encoders};
    tables[n] = (table){0};
}

// [keep-out NAME]: an axis's interval in degrees, "AXIS = LOW HIGH".
static gonio_status set_zone(gonio_keep_out *keep_out, const char *section, const char *key, const char *value,
                             bool *taken, gonio_error *error) {
    static const char *const axes[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};
    for (int k = 0; k < GONIO_AXES; k++) {
        if (strcmp(axes[k], key) != 0) {
            continue;
        }
        *taken = true;
        char *end, *last;
        const double low = gonio_number_parse(value, &end);
        const double high = gonio_number_parse(end, &last);
        if (end == value || last == end || *last != 0 || !(low <= high)) {
            return gonio_fail(error, GONIO_E_INPUT,
                              "[%s] %s: found '%.80s', expected two angles in degrees, the lower first", section, key,
                              value);
        }
        const int zone = gonio_keep_out_zone(keep_out, section + strlen("keep-out "));
        if (zone < 0) {
            return gonio_fail(error, GONIO_E_INPUT,
                              "[%s]: expected at most 16 zones with names of at most 31 characters", section);
        }
        keep_out->zones[zone].minimum_deg[k] = low;
        keep_out->zones[zone].maximum_deg[k] = high;
    }
    return GONIO_OK;
}

// Another driver for a device. Keys of the same name and kind keep what the earlier driver was given.
static gonio_status choose(slot *s, const gonio_driver *driver, gonio_error *error) {
    slot next = {.driver = driver};
    if (driver != NULL && driver->settings > 0) {
        next.settings = calloc(1, driver->settings);
        if (next.settings == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for the settings of a driver");
        }
        if (driver->defaults != NULL) {
            driver->defaults(next.settings);
        }
    }
    for (const gonio_key *to = s->driver != NULL && driver != NULL ? driver->keys : NULL;
         to != NULL && to->name != NULL; to++) {
        const gonio_key *from = gonio_key_find(s->driver->keys, to->section, to->name);
        if (from != NULL && from->kind == to->kind && from->size == to->size) {
            memcpy((char *)next.settings + to->offset, (const char *)s->settings + from->offset, to->size);
        }
    }
    empty(s);
    *s = next;
    return GONIO_OK;
}

static gonio_status set_driver(gonio_hardware *h, const char *section, const char *value, bool *taken,
                               gonio_error *error) {
    for (int k = 0; k < GONIO_DEVICES; k++) {
        const gonio_device device = (gonio_device)k;
        if (strcmp(gonio_device_name(device), section) != 0) {
            continue;
        }
        *taken = true;
        const gonio_driver *driver = gonio_driver_find(device, value);
        if (driver == NULL && strcmp(value, "none") != 0) { // none: the rig's own
            char names[100];
            gonio_driver_names(device, names, sizeof names);
            return gonio_fail(error, GONIO_E_INPUT, "[%s] driver: found '%.80s', expected one of:%s none", section,
                              value, names);
        }
        if (driver != h->slots[k].driver) {
            return choose(&h->slots[k], driver, error);
        }
    }
    return GONIO_OK;
}

gonio_status gonio_hardware_set(gonio_hardware *h, const char *section, const char *name, const char *value,
                                bool *taken, bool *shared, gonio_error *error) {
    *taken = *shared = false;
    if (strcmp(name, "driver") == 0) {
        return set_driver(h, section, value, taken, error);
    }
    if (strncmp(section, "keep-out ", 9) == 0) {
        return set_zone(&h->keep_out, section, name, value, taken, error);
    }
    table tables[GONIO_DEVICES + 4];
    tables_of(h, tables);
    for (const table *t = tables; t->keys != NULL; t++) {
        const gonio_key *key = gonio_key_find(t->keys, section, name);
        if (key != NULL) {
            *taken = true;
            *shared = key->shared;
            return gonio_key_parse(key, t->settings, value, error);
        }
    }
    return GONIO_OK;
}

bool gonio_hardware_list(gonio_hardware *h, const char *section, char *text, size_t size) {
    table tables[GONIO_DEVICES + 4];
    tables_of(h, tables);
    text[0] = 0;
    for (int k = 0; k < GONIO_DEVICES; k++) {
        if (strcmp(gonio_device_name((gonio_device)k), section) == 0) {
            gonio_text_append(text, size, " driver");
        }
    }
    const size_t used = strlen(text);
    for (const table *t = tables; t->keys != NULL; t++) {
        gonio_key_list(t->keys, section, text, size);
    }
    return strlen(text) > used;
}

bool gonio_hardware_elsewhere(const gonio_hardware *h, const char *section, const char *name, gonio_error *error) {
    char owners[120] = "";
    const gonio_driver *present = NULL;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        const bool behind = d->controller && gonio_key_find(gonio_controller_keys, section, name) != NULL;
        if (behind || gonio_key_find(d->keys, section, name) != NULL) {
            gonio_text_append(owners, sizeof owners, "%s[%s] driver = %s", owners[0] != 0 ? ", " : "",
                              gonio_device_name(d->device), d->name);
            present = h->slots[d->device].driver;
        }
    }
    if (owners[0] != 0) {
        gonio_fail(error, GONIO_E_INPUT, "%s.%s is a key of %s; the driver here is %s", section, name, owners,
                   present != NULL ? present->name : "the rig's own");
    }
    return owners[0] != 0;
}

// ---- opening ----

bool gonio_hardware_reach(gonio_hardware *h, char *text, size_t size) {
    text[0] = 0;
    for (int k = 0; k < GONIO_DEVICES; k++) {
        const gonio_driver *driver = h->slots[k].driver;
        if (driver != NULL && strcmp(driver->name, "null") != 0) {
            gonio_text_append(text, size, "%s%s %s", text[0] != 0 ? ", " : "", gonio_device_name(driver->device),
                              driver->name);
        }
    }
    table tables[GONIO_DEVICES + 4];
    tables_of(h, tables);
    for (const table *t = tables; t->keys != NULL && text[0] != 0; t++) {
        for (const gonio_key *key = t->keys; key->name != NULL; key++) {
            const bool text_key = key->kind == GONIO_KEY_LINE || key->kind == GONIO_KEY_TEXT;
            const bool names = text_key && strcmp(key->section, "drive") != 0; // those are registers
            const char *value = names ? (const char *)t->settings + key->offset : "";
            if (value[0] != 0) {
                char shown[128];
                gonio_text_printable(value, shown, sizeof shown);
                gonio_text_append(text, size, ", %s.%s = %s", key->section, key->name, shown);
            }
        }
    }
    return text[0] != 0;
}

static gonio_status open_controller(gonio_hardware *h, gonio_error *error) {
    if (!behind_controller(h)) {
        return GONIO_OK;
    }
    controller_settings *s = &h->line;
    const gonio_status status = gonio_tape_choose(s->record, s->replay, &h->tape, error);
    if (status != GONIO_OK) {
        return status;
    }
    s->config.tape = h->tape;
    s->config.mode = s->replay[0] != 0 ? GONIO_TAPE_REPLAY : s->record[0] != 0 ? GONIO_TAPE_RECORD : GONIO_TAPE_OFF;
    return gonio_controller_open(&s->config, &h->controller, error);
}

// Where simulated devices follow the real stage and lamp, those stand in front of them.
static gonio_status place(const slot *s, gonio_rig *rig, bool simulated, gonio_error *error) {
    gonio_status status = GONIO_OK;
    if (simulated && s->driver->device == GONIO_DEVICE_STAGE) {
        const gonio_stage_ops *stage = s->driver->ops;
        status = gonio_shadow_stage(rig, stage, s->device, error);
        if (status != GONIO_OK) {
            stage->close(s->device);
        }
    } else if (simulated && s->driver->device == GONIO_DEVICE_LAMP) {
        const gonio_lamp_ops *lamp = s->driver->ops;
        status = gonio_shadow_lamp(rig, lamp, s->device, error);
        if (status != GONIO_OK) {
            lamp->close(s->device);
        }
    } else {
        gonio_driver_install(s->driver, s->device, rig);
    }
    return status;
}

static gonio_status open_slot(gonio_hardware *h, slot *s, gonio_rig *rig, bool simulated, gonio_error *error) {
    // Only a real interlock is watched in mid-move; a simulated one strikes by pose.
    const slot *interlock = &h->slots[GONIO_DEVICE_INTERLOCK];
    const gonio_driver_context context = {.controller = h->controller,
                                          .interlock = interlock->driver != NULL ? interlock->driver->ops : NULL,
                                          .interlock_device = interlock->device,
                                          .event = h->line.config.event,
                                          .cancelled = h->line.config.cancelled,
                                          .event_context = h->line.config.event_context};
    void *device = NULL;
    gonio_status status = s->driver->open(s->settings, &context, &device, error);
    if (status == GONIO_OK) {
        s->device = device;
        status = place(s, rig, simulated, error);
    }
    if (status != GONIO_OK) {
        s->device = NULL;
    }
    return status;
}

static void *opened(const gonio_hardware *h, gonio_device device, const void *ops) {
    const slot *s = &h->slots[device];
    return s->driver != NULL && s->driver->ops == ops ? s->device : NULL;
}

gonio_status gonio_hardware_open(gonio_hardware *h, gonio_rig *rig, bool simulated, gonio_error *error) {
    gonio_status status = open_controller(h, error);
    for (int k = 0; k < GONIO_DEVICES && status == GONIO_OK; k++) {
        if (h->slots[k].driver != NULL) {
            status = open_slot(h, &h->slots[k], rig, simulated, error);
        }
    }
    if (status == GONIO_OK && gonio_encoders_any(&h->encoders)) {
        const void *drives = opened(h, GONIO_DEVICE_STAGE, &gonio_stage_modbus_table);
        const gonio_encoder_lines lines = {h->controller, drives != NULL ? gonio_stage_modbus_table_bus(drives) : NULL,
                                           h->line.config.event, h->line.config.event_context};
        status = gonio_encoders_guard(&h->encoders, &lines, rig, &h->compared, error);
    }
    const bool guarded = h->keep_out.n > 0 || h->keep_out.retro_deg > 0;
    return status == GONIO_OK && guarded ? gonio_keep_out_guard(&h->keep_out, rig, error) : status;
}

const char *gonio_hardware_line(const gonio_hardware *h) {
    return behind_controller(h) && h->line.replay[0] == 0 ? h->line.config.modbus.port : NULL;
}
gonio_controller *gonio_hardware_controller(const gonio_hardware *h) { return h->controller; }
void *gonio_hardware_encoders(const gonio_hardware *h) { return h->compared; }
void *gonio_hardware_stage(const gonio_hardware *h) { return opened(h, GONIO_DEVICE_STAGE, &gonio_stage_modbus); }
const char *gonio_hardware_meter(const gonio_hardware *h) {
    const void *meter = opened(h, GONIO_DEVICE_METER, &gonio_meter_usbtmc);
    return meter != NULL ? gonio_meter_usbtmc_identity(meter) : NULL;
}
