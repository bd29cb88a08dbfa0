// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/rig/actions.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "gonio/output.h"
#include "host/drivers/controller_map.h"

#define HOME_TIMEOUT_S 600.0
#define MOVE_TIMEOUT_S 600.0

const char *const rig_axes[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};

static json_t *positions(const double rad[GONIO_AXES]) {
    json_t *object = json_object();
    for (int k = 0; k < GONIO_AXES; k++) {
        json_object_set_new(object, rig_axes[k], json_real(gonio_degrees(rad[k])));
    }
    return object;
}

static gonio_status tell_position(const cli_rig *rig, json_t **out, gonio_error *error) {
    double now[GONIO_AXES];
    const gonio_status status = rig->rig.stage->position(rig->rig.stage_device, now, error);
    if (status == GONIO_OK) {
        *out = json_pack("{s:o}", "position_deg", positions(now));
    }
    return status;
}

static int axis_named(const char *name, size_t length) {
    for (int k = 0; k < GONIO_AXES; k++) {
        if (strlen(rig_axes[k]) == length && strncmp(name, rig_axes[k], length) == 0) {
            return k;
        }
    }
    return -1;
}

// The stage behind the controller and the axes (bits) that the arguments name.
static gonio_status read_axes(const rig_request *request, const cli_rig *rig, void **stage, unsigned *axes,
                              gonio_error *error) {
    *stage = gonio_hardware_stage(rig->hardware);
    *axes = 0;
    for (int i = 0; i < request->n; i++) {
        const int k = axis_named(request->arguments[i], strlen(request->arguments[i]));
        if (k < 0) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "found '%s', expected light_theta, light_phi, camera_theta or camera_phi",
                              request->arguments[i]);
        }
        *axes |= 1u << k;
    }
    return *stage != NULL ? GONIO_OK
                          : gonio_fail(error, GONIO_E_UNSUPPORTED,
                                       "single axes are homed and released by [stage] driver = modbus alone");
}

static gonio_status home_axes(const rig_request *request, const cli_rig *rig, gonio_error *error) {
    void *stage;
    unsigned axes;
    if (request->n == 0) {
        return rig->rig.stage->home(rig->rig.stage_device, HOME_TIMEOUT_S, error);
    }
    const gonio_status status = read_axes(request, rig, &stage, &axes, error);
    return status == GONIO_OK ? gonio_stage_modbus_home(stage, axes, HOME_TIMEOUT_S, error) : status;
}

static gonio_status release(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    void *stage;
    unsigned axes;
    gonio_status status = read_axes(request, rig, &stage, &axes, error);
    axes = request->n == 0 ? (1u << GONIO_AXES) - 1 : axes;
    status = status == GONIO_OK ? gonio_stage_modbus_release(stage, axes, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    json_t *released = json_array();
    for (int k = 0; k < GONIO_AXES; k++) {
        if ((axes >> k & 1) != 0) {
            json_array_append_new(released, json_string(rig_axes[k]));
        }
    }
    *out = json_pack("{s:o}", "released", released);
    return GONIO_OK;
}

static gonio_status home(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    gonio_status status = home_axes(request, rig, error);
    status = status == GONIO_OK ? tell_position(rig, out, error) : status;
    void *stage = gonio_hardware_stage(rig->hardware);
    if (status == GONIO_OK && stage != NULL) {
        double drift_deg[GONIO_AXES] = {0}, drift_rad[GONIO_AXES];
        status = gonio_stage_modbus_audit(stage, drift_deg, error);
        for (int k = 0; k < GONIO_AXES; k++) {
            drift_rad[k] = gonio_radians(drift_deg[k]);
        }
        json_object_set_new(*out, "home_difference_deg", positions(drift_rad));
    }
    return status;
}

// "AXIS=DEGREES" into target (radians), by or to.
static gonio_status read_target(const rig_request *request, const cli_rig *rig, bool relative,
                                double target[GONIO_AXES], gonio_error *error) {
    const void *stage = gonio_hardware_stage(rig->hardware);
    if (request->dial && stage == NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "--dial: only a real stage has positions of its own");
    }
    for (int i = 0; i < request->n; i++) {
        const char *text = request->arguments[i], *equals = strchr(text, '=');
        const int axis = equals != NULL ? axis_named(text, (size_t)(equals - text)) : -1;
        char *end = NULL;
        const double deg = equals != NULL ? gonio_number_parse(equals + 1, &end) : 0;
        if (axis < 0 || end == equals + 1 || *end != 0 || !isfinite(deg)) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "found '%s', expected AXIS=DEGREES; axes are light_theta, light_phi, camera_theta and "
                              "camera_phi",
                              text);
        }
        if (relative) {
            target[axis] += gonio_radians(deg);
        } else {
            target[axis] = gonio_radians(request->dial ? gonio_stage_modbus_user_deg(stage, axis, deg) : deg);
        }
    }
    return GONIO_OK;
}

// An azimuth by whole turns: the first way to write it that the stage can reach; as it was asked for where none is.
static void choose_turns(const gonio_rig *rig, const double from[GONIO_AXES], double target[GONIO_AXES]) {
    static const double turns[] = {0, -1, 1, -2, 2};
    enum { WAYS = sizeof turns / sizeof *turns };
    const bool light = target[GONIO_LIGHT_PHI] != from[GONIO_LIGHT_PHI];
    const bool camera = target[GONIO_CAMERA_PHI] != from[GONIO_CAMERA_PHI];
    for (int s = 0; rig->stage->check != NULL && s < WAYS * WAYS; s++) {
        double way[GONIO_AXES];
        gonio_error why;
        memcpy(way, target, sizeof way);
        way[GONIO_LIGHT_PHI] += light ? 2 * GONIO_PI * turns[s % WAYS] : 0;
        way[GONIO_CAMERA_PHI] += camera ? 2 * GONIO_PI * turns[s / WAYS] : 0;
        if (rig->stage->check(rig->stage_device, from, way, &why) == GONIO_OK) {
            memcpy(target, way, sizeof way);
            return;
        }
    }
}

static gonio_status go(const rig_request *request, cli_rig *rig, bool relative, json_t **out, gonio_error *error) {
    const gonio_rig *r = &rig->rig;
    double from[GONIO_AXES], target[GONIO_AXES];
    gonio_status status = r->stage->position(r->stage_device, from, error);
    memcpy(target, from, sizeof target);
    status = status == GONIO_OK ? read_target(request, rig, relative, target, error) : status;
    if (status == GONIO_OK && !relative && !request->dial) {
        choose_turns(r, from, target);
    }
    status = status == GONIO_OK && r->interlock != NULL ? r->interlock->check(r->interlock_device, error) : status;
    if (status == GONIO_OK) {
        const gonio_stamp stamp = {0};
        status = r->stage->move(r->stage_device, target, 1, &stamp, MOVE_TIMEOUT_S, error);
    }
    return status == GONIO_OK ? tell_position(rig, out, error) : status;
}

// Of an axis whose position nobody knows, so that its switch or its mechanics can be seen to.
static gonio_status jog_slowly(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    void *stage = gonio_hardware_stage(rig->hardware);
    double way[GONIO_AXES] = {0};
    int axis = 0;
    if (stage == NULL || request->n != 1) {
        return gonio_fail(error, stage == NULL ? GONIO_E_UNSUPPORTED : GONIO_E_USAGE,
                          "jog --slow: expected one axis of a stage with driver = modbus");
    }
    const gonio_status status = read_target(request, rig, true, way, error);
    for (int k = 0; k < GONIO_AXES; k++) {
        axis = way[k] != 0 ? k : axis;
    }
    if (status != GONIO_OK || way[axis] == 0) {
        return status == GONIO_OK ? tell_position(rig, out, error) : status;
    }
    const gonio_status moved = gonio_stage_modbus_jog(stage, axis, gonio_degrees(way[axis]), error);
    return moved == GONIO_OK ? tell_position(rig, out, error) : moved;
}

static gonio_status move(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    return go(request, rig, false, out, error);
}

static gonio_status jog(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    if (request->slow) {
        return jog_slowly(request, rig, out, error);
    }
    return go(request, rig, true, out, error);
}

static gonio_status stop(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    (void)request;
    const gonio_status status = rig->rig.stage->stop(rig->rig.stage_device, error);
    return status == GONIO_OK ? tell_position(rig, out, error) : status;
}

static gonio_status clear(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    (void)request;
    gonio_controller *controller = gonio_hardware_controller(rig->hardware);
    if (controller == NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "clear: this rig has no controller with alarms");
    }
    gonio_controller_status now;
    gonio_status status = gonio_controller_clear(controller, error);
    status = status == GONIO_OK ? gonio_controller_read_status(controller, &now, error) : status;
    if (status == GONIO_OK) {
        *out = json_pack("{s:s}", "state", gonio_controller_state_text(now.state));
    }
    return status;
}

static gonio_status lamp(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    char *end;
    const double level = gonio_number_parse(request->arguments[0], &end);
    if (end == request->arguments[0] || *end != 0 || !(level >= 0 && level <= 1)) {
        return gonio_fail(error, GONIO_E_USAGE, "lamp: found '%s', expected a level from 0 to 1",
                          request->arguments[0]);
    }
    const gonio_status status = rig->rig.lamp->set_level(rig->rig.lamp_device, level, error);
    *out = status == GONIO_OK ? json_pack("{s:f}", "lamp_level", level) : NULL;
    return status;
}

static gonio_status shutter(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    const bool open = strcmp(request->arguments[0], "open") == 0;
    if (!open && strcmp(request->arguments[0], "close") != 0) {
        return gonio_fail(error, GONIO_E_USAGE, "shutter: found '%s', expected open or close", request->arguments[0]);
    }
    const gonio_status status = rig->rig.lamp->set_shutter(rig->rig.lamp_device, open, error);
    *out = status == GONIO_OK ? json_pack("{s:s}", "shutter", open ? "open" : "closed") : NULL;
    return status;
}

// ---- capture ----

// 16-bit PGM: big-endian words, maximum value first.
static gonio_status write_pgm(const gonio_frame *frame, int bits, const char *path, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    fprintf(stream, "P5\n%d %d\n%d\n", frame->window.width, frame->window.height, bits > 8 ? (1 << bits) - 1 : 256);
    const size_t n = (size_t)frame->window.width * (size_t)frame->window.height;
    for (size_t i = 0; i < n; i++) {
        putc(frame->pixels[i] >> 8, stream);
        putc(frame->pixels[i] & 255, stream);
    }
    return gonio_output_commit(output, error);
}

static void statistics(const gonio_frame *frame, int bits, json_t *out) {
    const size_t n = (size_t)frame->window.width * (size_t)frame->window.height;
    double sum = 0, squares = 0;
    int low = 65535, high = 0;
    size_t saturated = 0;
    for (size_t i = 0; i < n; i++) {
        const int v = frame->pixels[i];
        sum += v;
        squares += (double)v * v;
        low = v < low ? v : low;
        high = v > high ? v : high;
        saturated += v >= (1 << bits) - 1;
    }
    const double mean = sum / (double)n;
    json_object_set_new(out, "mean", json_real(mean));
    json_object_set_new(out, "deviation", json_real(sqrt(fmax(0, squares / (double)n - mean * mean))));
    json_object_set_new(out, "minimum", json_integer(low));
    json_object_set_new(out, "maximum", json_integer(high));
    json_object_set_new(out, "saturated", json_integer((json_int_t)saturated));
}

static gonio_status capture(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    const gonio_rig *r = &rig->rig;
    gonio_camera_info info;
    gonio_status status = r->camera->info(r->camera_device, &info, error);
    if (status != GONIO_OK) {
        return status;
    }
    const gonio_window all = {0, 0, info.width, info.height};
    const gonio_stamp stamp = {0};
    const double exposure_s = request->exposure_s > 0 ? request->exposure_s : info.exposure_min_s;
    gonio_frame frame = {.pixels = calloc((size_t)info.width * (size_t)info.height, sizeof(uint16_t))};
    if (frame.pixels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a frame of %d x %d", info.width, info.height);
    }
    status = r->camera->capture(r->camera_device, &all, exposure_s, 0, &stamp, 10 + 8 * exposure_s, &frame, error);
    if (status == GONIO_OK) {
        *out = json_pack("{s:i,s:i,s:i,s:f}", "width", info.width, "height", info.height, "bits", info.bits,
                         "exposure_s", frame.exposure_s);
        statistics(&frame, info.bits, *out);
        status = request->output != NULL ? write_pgm(&frame, info.bits, request->output, error) : GONIO_OK;
    }
    free(frame.pixels);
    return status;
}

// ---- selftest ----

typedef struct test_list {
    json_t *object;
    gonio_status worst;
    gonio_error *error;
} test_list;

static void note(test_list *list, const char *name, gonio_status status, const gonio_error *why) {
    json_object_set_new(list->object, name, json_string(status == GONIO_OK ? "passed" : why->message));
    if (status != GONIO_OK && list->worst == GONIO_OK) {
        list->worst = status;
        *list->error = *why;
    }
}

// The controller's own contacts and alarm, and the interlock beside it.
static gonio_status check_interlock(const cli_rig *rig, gonio_error *error) {
    const gonio_rig *r = &rig->rig;
    gonio_controller *controller = gonio_hardware_controller(rig->hardware);
    gonio_controller_status now;
    gonio_status status = GONIO_OK;
    if (controller != NULL) {
        status = gonio_controller_read_status(controller, &now, error);
        status = status == GONIO_OK ? gonio_controller_contacts(&now, error) : status;
        status = status == GONIO_OK ? gonio_controller_alarm(&now, error) : status;
    }
    return status == GONIO_OK && r->interlock != NULL ? r->interlock->check(r->interlock_device, error) : status;
}

static gonio_status home_twice(const rig_request *request, cli_rig *rig, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; i < 2 && status == GONIO_OK; i++) {
        json_t *unused = NULL;
        status = home(request, rig, &unused, error);
        json_decref(unused);
    }
    return status;
}

// Moves nothing, but with --home, which homes twice and compares. The camera must deliver.
static gonio_status selftest(const rig_request *request, cli_rig *rig, json_t **out, gonio_error *error) {
    const gonio_rig *r = &rig->rig;
    gonio_error why = {.line = -1, .byte = -1};
    gonio_status status;
    *out = json_object();
    test_list list = {*out, GONIO_OK, error};
    if (r->interlock != NULL || gonio_hardware_controller(rig->hardware) != NULL) {
        note(&list, "interlock", check_interlock(rig, &why), &why);
    }
    if (request->home && list.worst == GONIO_OK) { // nothing moves with an open interlock
        note(&list, "homing", home_twice(request, rig, &why), &why);
    }
    if (r->meter != NULL) {
        const gonio_stamp stamp = {0};
        double value = 0, sigma = 0;
        status = r->meter->read(r->meter_device, &stamp, 0.1, &value, &sigma, &why);
        if (status == GONIO_OK && !(isfinite(value) && sigma >= 0)) {
            status = gonio_fail(&why, GONIO_E_DEVICE, "the meter reads %g +- %g", value, sigma);
        }
        note(&list, "meter", status, &why);
    }
    json_t *picture = NULL;
    note(&list, "camera", capture(request, rig, &picture, &why), &why);
    json_decref(picture);
    gonio_camera_info info;
    if (r->camera->latency != NULL && r->camera->info(r->camera_device, &info, NULL) == GONIO_OK &&
        info.exposure_max_s > 4 * info.exposure_min_s) {
        int frames = 0;
        const double low = sqrt(info.exposure_min_s * info.exposure_max_s) / 2;
        status = r->camera->latency(r->camera_device, low,
                                    4 * low < info.exposure_max_s ? 4 * low : info.exposure_max_s, &frames, &why);
        note(&list, "camera_latency", status, &why);
        json_object_set_new(*out, "settle_frames_needed", json_integer(frames));
    }
    return list.worst;
}

const rig_action rig_actions[] = {
    {"home", "[AXIS ...]", "find the home switches, report what had drifted; clears a standing alarm", 0, GONIO_AXES,
     home, NULL},
    {"release", "[AXIS ...]", "switch motors off; those axes are not homed then", 0, GONIO_AXES, release, NULL},
    {"move", "AXIS=DEG ...", "move to absolute positions, azimuths by whole turns within the limits; other axes stay",
     1, GONIO_AXES, move, NULL},
    {"jog", "AXIS=DEG ...", "move by so much; --slow: one axis, homed or not, at its slow homing speed", 1, GONIO_AXES,
     jog, NULL},
    {"stop", "", "decelerate and hold", 0, 0, stop, NULL},
    {"clear", "", "leave an alarm whose cause is gone; nothing moves", 0, 0, clear, NULL},
    {"lamp", "LEVEL", "0 (off) to 1", 1, 1, lamp, NULL},
    {"shutter", "open|close", "the lamp's shutter", 1, 1, shutter, NULL},
    {"capture", "", "one frame: --exposure, -o PGM", 0, 0, capture, NULL},
    {"burst", "FRAMES SESSION", "frames at the camera's own rate: --exposure", 2, 2, rig_burst, NULL},
    {"selftest", "", "interlock, meter, camera; nothing moves, but --home homes twice", 0, 0, selftest, NULL},
    {"parameters", "[NAME ...]", "what the controller holds, with units and bounds", 0, RIG_ARGUMENTS, rig_parameters,
     rig_print_parameters},
    {"set", "[AXIS.]NAME=VALUE ...", "change parameters, at rest", 1, RIG_ARGUMENTS, rig_set, rig_print_parameters},
    {"save", "", "keep the parameters in the controller, with the lamp off", 0, 0, rig_save, NULL},
    {0}};
