// SPDX-License-Identifier: BSD-3-Clause
// gonio rig parameters, set and save: the controller's parameters by name.
#include "host/drivers/parameters.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "host/cli/rig/actions.h"

enum { ONE_FOR_ALL = -1 };

static gonio_status controller_of(const cli_rig *rig, gonio_controller **controller, gonio_error *error) {
    *controller = gonio_hardware_controller(rig->hardware);
    return *controller != NULL ? GONIO_OK
                               : gonio_fail(error, GONIO_E_UNSUPPORTED,
                                            "this rig has no controller with parameters ([stage] driver = modbus)");
}

// ---- parameters ----

static bool asked_for(const rig_request *request, const char *name) {
    for (int i = 0; i < request->n; i++) {
        if (strcmp(request->arguments[i], name) == 0) {
            return true;
        }
    }
    return request->n == 0;
}

static json_t *values_of(const controller_register_info *p, const int64_t *values) {
    char text[300];
    if (p->count == 1) {
        gonio_parameter_print(p, values[0], text, sizeof text);
        return json_string(text);
    }
    json_t *all = json_object();
    for (int k = 0; k < p->count; k++) {
        gonio_parameter_print(p, values[k], text, sizeof text);
        json_object_set_new(all, gonio_parameter_axes()[k], json_string(text));
    }
    return all;
}

static json_t *describe(const controller_register_info *p, const int64_t *values) {
    char bounds[400];
    const char *why, *key = gonio_parameter_key(p, &why);
    gonio_parameter_bounds(p, bounds, sizeof bounds);
    json_t *one = json_pack("{s:o,s:s,s:s,s:s}", "value", values_of(p, values), "unit", gonio_parameter_unit(p),
                            "bounds", bounds, "meaning", p->text);
    json_object_set_new(one, "key", cli_json_text(key != NULL ? key : ""));
    return one;
}

gonio_status rig_parameters(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    gonio_controller *c;
    gonio_status status = controller_of(rig, &c, error);
    for (int i = 0; i < request->n && status == GONIO_OK; i++) {
        if (gonio_parameter_find(request->arguments[i]) == NULL) {
            status = gonio_fail(error, GONIO_E_USAGE, "parameters: there is no '%s'; without a name all are listed",
                                request->arguments[i]);
        }
    }
    json_t *all = json_object();
    const controller_register_info *p;
    for (int i = 0; status == GONIO_OK && (p = gonio_controller_register_at(i)) != NULL; i++) {
        if (p->parameter && asked_for(request, p->name)) {
            int64_t values[GONIO_CONTROLLER_AXES];
            status = gonio_parameter_read(c, p, values, error);
            if (status == GONIO_OK) {
                json_object_set_new(all, p->name, describe(p, values));
            }
        }
    }
    if (status == GONIO_OK) {
        *out = json_pack("{s:o}", "parameters", all);
    } else {
        json_decref(all);
    }
    return status;
}

static void print_value(const char *axis, const char *name, const char *value, json_t *one) {
    char assignment[400];
    const char *unit = json_string_value(json_object_get(one, "unit"));
    snprintf(assignment, sizeof assignment, "%s%s%s=%s%s%s", axis, axis[0] != 0 ? "." : "", name, value,
             unit[0] != 0 ? " " : "", unit);
    printf("%s\n", cli_text(assignment));
}

void rig_print_parameters(json_t *out) {
    const char *name, *axis;
    json_t *one, *value;
    json_object_foreach(json_object_get(out, "parameters"), name, one) {
        const char *key = json_string_value(json_object_get(one, "key"));
        printf("; %s; %s%s%s\n", json_string_value(json_object_get(one, "meaning")),
               json_string_value(json_object_get(one, "bounds")), key != NULL ? "; key " : "", key != NULL ? key : "");
        json_t *values = json_object_get(one, "value");
        if (json_is_string(values)) {
            print_value("", name, json_string_value(values), one);
        }
        json_object_foreach(values, axis, value) { print_value(axis, name, json_string_value(value), one); }
    }
}

// ---- set ----

typedef struct assignment {
    const controller_register_info *parameter;
    int axis; // ONE_FOR_ALL: of every axis, or the only value
    int64_t value;
} assignment;

static int axis_named(const char *name, size_t length) {
    for (int k = 0; k < GONIO_AXES; k++) {
        if (strlen(gonio_parameter_axes()[k]) == length && strncmp(gonio_parameter_axes()[k], name, length) == 0) {
            return k;
        }
    }
    return ONE_FOR_ALL;
}

// "[AXIS.]NAME=VALUE"
static gonio_status read_assignment(const char *text, assignment *a, gonio_error *error) {
    const char *equals = strchr(text, '='), *dot = strchr(text, '.');
    char name[40] = "";
    if (equals != NULL) {
        const bool of_axis = dot != NULL && dot < equals;
        const char *begin = of_axis ? dot + 1 : text;
        snprintf(name, sizeof name, "%.*s", (int)(equals - begin), begin);
        a->parameter = gonio_parameter_find(name);
        a->axis = of_axis ? axis_named(text, (size_t)(dot - text)) : ONE_FOR_ALL;
        if (a->parameter != NULL && (!of_axis || (a->axis != ONE_FOR_ALL && a->parameter->count > 1))) {
            return gonio_parameter_parse(a->parameter, equals + 1, &a->value, error);
        }
    }
    return gonio_fail(error, GONIO_E_USAGE,
                      "set: found '%.80s', expected NAME=VALUE, or AXIS.NAME=VALUE of an axis' parameter; `gonio rig "
                      "parameters` lists the names",
                      text);
}

// What the rig file says would be written again before the next move.
static gonio_status check_rig_file(const cli_rig *rig, const assignment *a, gonio_error *error) {
    const void *stage = gonio_hardware_stage(rig->hardware);
    const int address = a->parameter->address;
    bool given = gonio_controller_gives(gonio_hardware_controller(rig->hardware), address);
    for (int k = 0; k < GONIO_AXES && stage != NULL; k++) {
        given = given || ((a->axis == k || a->axis == ONE_FOR_ALL) && gonio_stage_modbus_gives(stage, k, address));
    }
    return !given ? GONIO_OK
                  : gonio_fail(error, GONIO_E_USAGE, "set: the rig file says what %s is: change it there, %s",
                               a->parameter->name, gonio_parameter_key(a->parameter, NULL));
}

static gonio_status check_at_rest(gonio_controller *c, gonio_controller_status *now, gonio_error *error) {
    const gonio_status status = gonio_controller_read_status(c, now, error);
    const bool moves = status == GONIO_OK && (now->moving != 0 || now->state == CONTROLLER_STATE_MOVING ||
                                              now->state == CONTROLLER_STATE_HOMING);
    return moves ? gonio_fail(error, GONIO_E_DEVICE, "set: not while an axis moves") : status;
}

static gonio_status write_assignment(gonio_controller *c, const assignment *a, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; k < a->parameter->count && status == GONIO_OK; k++) {
        if (a->axis == k || a->axis == ONE_FOR_ALL) {
            status = gonio_parameter_write(c, a->parameter, k, a->value, error);
        }
    }
    return status;
}

// The parameters that were set, as they are held now, and the axes whose positions that has made unknown.
static gonio_status report(gonio_controller *c, const assignment *all, int n, unsigned homed, json_t **out,
                           gonio_error *error) {
    json_t *set = json_object(), *lost = json_array();
    gonio_controller_status now;
    gonio_status status = gonio_controller_read_status(c, &now, error);
    for (int i = 0; i < n && status == GONIO_OK; i++) {
        int64_t values[GONIO_CONTROLLER_AXES];
        status = gonio_parameter_read(c, all[i].parameter, values, error);
        if (status == GONIO_OK) {
            json_object_set_new(set, all[i].parameter->name, describe(all[i].parameter, values));
        }
    }
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        if ((homed & ~now.homed) >> k & 1) {
            json_array_append_new(lost, json_string(gonio_parameter_axes()[k]));
            gonio_controller_tell(c, "parameters", "%s: a step means something else now; home it again",
                                  gonio_parameter_axes()[k]);
        }
    }
    if (status == GONIO_OK) {
        *out = json_pack("{s:o,s:o}", "parameters", set, "not_homed_any_more", lost);
    } else {
        json_decref(set);
        json_decref(lost);
    }
    return status;
}

gonio_status rig_set(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    assignment all[RIG_ARGUMENTS];
    gonio_controller *c;
    gonio_controller_status before;
    gonio_status status = controller_of(rig, &c, error);
    for (int i = 0; i < request->n && status == GONIO_OK; i++) {
        status = read_assignment(request->arguments[i], &all[i], error);
        status = status == GONIO_OK ? check_rig_file(rig, &all[i], error) : status;
    }
    status = status == GONIO_OK ? check_at_rest(c, &before, error) : status;
    status = status == GONIO_OK ? gonio_controller_claim(c, error) : status;
    for (int i = 0; i < request->n && status == GONIO_OK; i++) {
        status = write_assignment(c, &all[i], error);
    }
    return status == GONIO_OK ? report(c, all, request->n, before.homed, out, error) : status;
}

// ---- save ----

gonio_status rig_save(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    (void)request;
    void *stage = gonio_hardware_stage(rig->hardware);
    gonio_controller *c;
    gonio_status status = controller_of(rig, &c, error);
    // What the rig file says belongs to it, as for a move.
    status = status == GONIO_OK && stage != NULL ? gonio_stage_modbus_apply(stage, error) : status;
    if (status == GONIO_OK) {
        status = gonio_controller_command(c, CONTROLLER_COMMAND_SAVE, 0, NULL, NULL, error);
    }
    gonio_controller_status now;
    status = status == GONIO_OK ? gonio_controller_read_status(c, &now, error) : status;
    if (status == GONIO_OK) {
        char checksum[16];
        snprintf(checksum, sizeof checksum, "%08x", now.checksum);
        *out = json_pack("{s:s}", "saved_parameters_checksum", checksum);
    }
    return status;
}
