// SPDX-License-Identifier: BSD-3-Clause
#include "host/acquire/rig_control.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/control/control.h"
#include "host/drivers/controller_map.h"

gonio_status gonio_rig_identity(const gonio_rig_file *rig, char **identity, gonio_error *error) {
    const char *line = gonio_hardware_line(rig->hardware);
    *identity = NULL;
    if (line == NULL && rig->path == NULL) {
        return GONIO_OK;
    }
    // A device has many names: /dev/serial/by-id/... and /dev/ttyUSB0 are one.
    char *real = line != NULL && line[0] == '/' ? realpath(line, NULL) : NULL;
    const char *name = real != NULL ? real : line != NULL ? line : rig->path;
    const int length = asprintf(identity, "%s %s", line != NULL ? "line" : "file", name);
    free(real);
    if (length < 0) {
        *identity = NULL;
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the rig's name");
    }
    return GONIO_OK;
}

static gonio_status fail_driven(const char *identity, gonio_error *error) {
    char answer[GONIO_CONTROL_ANSWER], pid[32] = "";
    if (gonio_control_request(GONIO_CONTROL_RIG, identity, "status", answer, NULL) == GONIO_OK) {
        json_t *said = json_loads(answer, 0, NULL);
        snprintf(pid, sizeof pid, ", process %lld,", (long long)json_integer_value(json_object_get(said, "pid")));
        json_decref(said);
    }
    return gonio_fail(error, GONIO_E_DEVICE,
                      "another program of yours%s drives this rig; `gonio rig status` shows it and `gonio rig stop` "
                      "stops it",
                      pid);
}

// Somebody who only asks the rig for its status has it for a moment, and that is no reason to be refused.
#define MOMENT_S 2

static gonio_status take_name(gonio_rig_file *rig, const char *identity, gonio_error *error) {
    gonio_error why = {.line = -1, .byte = -1};
    gonio_status status = gonio_control_listen(rig->control, GONIO_CONTROL_RIG, identity, &why);
    if (status == GONIO_E_FAILED && gonio_control_wait_gone(GONIO_CONTROL_RIG, identity, MOMENT_S)) {
        status = gonio_control_listen(rig->control, GONIO_CONTROL_RIG, identity, &why);
    }
    if (status == GONIO_OK) {
        return GONIO_OK;
    }
    if (status == GONIO_E_FAILED) {
        // Two programs may use one file of a simulated rig; they have nothing in common but the file.
        return strncmp(identity, "line ", 5) == 0 ? fail_driven(identity, error) : GONIO_OK;
    }
    if (rig->event != NULL) {
        rig->event(rig->context, "cannot be steered from another terminal", why.message);
    }
    return GONIO_OK;
}

gonio_status gonio_rig_control_begin(gonio_rig_file *rig, gonio_error *error) {
    if (!rig->steered) {
        return GONIO_OK;
    }
    char *identity;
    gonio_status status = gonio_control_new(&rig->control, error);
    status = status == GONIO_OK ? gonio_rig_identity(rig, &identity, error) : status;
    if (status == GONIO_OK && identity != NULL) {
        status = take_name(rig, identity, error);
        free(identity);
    }
    return status;
}

// ---- what the devices last said ----

static json_t *positions(const gonio_rig_file *rig, const gonio_controller_status *now) {
    static const char *const axes[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};
    const void *stage = gonio_hardware_stage(rig->hardware);
    double rad[GONIO_AXES];
    if (stage == NULL) {
        return json_null();
    }
    gonio_stage_modbus_position(stage, now, rad);
    json_t *object = json_object();
    for (int k = 0; k < GONIO_AXES; k++) {
        json_object_set_new(object, axes[k], json_real(gonio_degrees(rad[k])));
    }
    return object;
}

// Called by the thread that answers: nothing here goes to a device.
static void members(void *context, char *text, size_t size) {
    const gonio_rig_file *rig = context;
    gonio_controller *controller = gonio_hardware_controller(rig->hardware);
    json_t *object = json_pack("{s:s}", "driver", rig->driver);
    gonio_controller_status now;
    double age_s;
    if (controller != NULL && gonio_controller_last(controller, &now, &age_s)) {
        char alarm[96];
        snprintf(alarm, sizeof alarm, "%d %s", now.alarm, gonio_controller_alarm_name(now.alarm));
        json_object_set_new(object, "position_deg", positions(rig, &now));
        json_object_set_new(object, "controller",
                            json_pack("{s:s,s:s,s:i,s:i,s:s,s:f,s:f}", "state", gonio_controller_state_text(now.state),
                                      "alarm", alarm, "homed", (int)now.homed, "inputs", (int)now.inputs, "lamp",
                                      gonio_controller_lamp_name(now.lamp_state), "temperature_c", now.temperature_c,
                                      "age_s", age_s));
    }
    const size_t used = json_dumpb(object, text, size, JSON_COMPACT | JSON_PRESERVE_ORDER | JSON_EMBED);
    text[used < size ? used : 0] = 0;
    json_decref(object);
}

void gonio_rig_control_opened(gonio_rig_file *rig) { gonio_control_ask(rig->control, members, rig); }
