// SPDX-License-Identifier: BSD-3-Clause
// gonio rig: ask the devices of a rig.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/acquire/identity.h"
#include "host/cli/apart.h"
#include "host/cli/rig/actions.h"
#include "host/cli/steering.h"
#include "host/drivers/controller_map.h"
#include "host/drivers/encoders.h"

static int run(int argc, char **argv);
const cli_verb cmd_rig = {"rig", "ACTION [AXIS=DEG ...] --rig RIG.ini|sim",
                          "identify, status, home, release, move, jog, stop, clear, lamp, shutter, capture, burst, "
                          "selftest, parameters, set, save; camera [/dev/videoN], usb, setup NEW.ini",
                          run};

#define STOP_TIMEOUT_S 30

static json_t *describe_controller(const gonio_controller_status *now) {
    char alarm[96], checksum[16];
    snprintf(checksum, sizeof checksum, "%08x", now->checksum);
    snprintf(alarm, sizeof alarm, "%d %s", now->alarm, gonio_controller_alarm_name(now->alarm));
    return json_pack("{s:s,s:s,s:i,s:i,s:s,s:f,s:s,s:s,s:I,s:s}", "state", gonio_controller_state_text(now->state),
                     "alarm", alarm, "homed", (int)now->homed, "inputs", (int)now->inputs, "lamp",
                     gonio_controller_lamp_name(now->lamp_state), "temperature_c", now->temperature_c, "started_by",
                     gonio_controller_cause_text(now->reset_cause), "held",
                     now->owner != 0 ? "by a program" : "by nobody", "parameter_changes", (json_int_t)now->generation,
                     "parameter_checksum", checksum);
}

static json_t *describe_encoders(void *encoders) {
    gonio_encoder_reading r[GONIO_AXES];
    gonio_error why = {.line = -1, .byte = -1};
    if (gonio_encoders_read(encoders, r, &why) != GONIO_OK) {
        return json_string(why.message);
    }
    json_t *object = json_object();
    for (int k = 0; k < GONIO_AXES; k++) {
        if (r[k].there) {
            json_object_set_new(object, rig_axes[k],
                                json_pack("{s:f,s:o}", "counts", r[k].counts, "deg",
                                          r[k].known ? json_real(gonio_degrees(r[k].position_rad)) : json_null()));
        }
    }
    return object;
}

static gonio_status read_status(const cli_rig *rig, json_t **out, gonio_error *error) {
    const gonio_rig *r = &rig->rig;
    double position[GONIO_AXES];
    gonio_status status = r->stage->position(r->stage_device, position, error);
    if (status != GONIO_OK) {
        return status;
    }
    json_t *positions = json_object();
    for (int k = 0; k < GONIO_AXES; k++) {
        json_object_set_new(positions, rig_axes[k], json_real(gonio_degrees(position[k])));
    }
    *out = json_pack("{s:s,s:o}", "driver", rig->driver, "position_deg", positions);
    gonio_error why = {.line = -1, .byte = -1};
    gonio_controller_status now;
    gonio_controller *controller = gonio_hardware_controller(rig->hardware);
    if (controller != NULL) {
        status = gonio_controller_read_status(controller, &now, error);
        if (status != GONIO_OK) {
            return status;
        }
        json_object_set_new(*out, "controller", describe_controller(&now));
    }
    if (gonio_hardware_encoders(rig->hardware) != NULL) {
        json_object_set_new(*out, "encoders", describe_encoders(gonio_hardware_encoders(rig->hardware)));
    }
    if (r->interlock != NULL) {
        status = r->interlock->check(r->interlock_device, &why);
        json_object_set_new(*out, "interlock", json_string(status == GONIO_OK ? "closed" : why.message));
    }
    if (r->meter != NULL) {
        const gonio_stamp stamp = {0, 0, 0};
        double value = NAN, sigma = NAN;
        status = r->meter->read(r->meter_device, &stamp, 0.1, &value, &sigma, &why);
        json_object_set_new(*out, "monitor",
                            status == GONIO_OK ? json_pack("[f,f]", value, sigma) : json_string(why.message));
    }
    return GONIO_OK;
}

// One item a line, as JSON without its braces.
static void print_list(const char *name, json_t *list) {
    size_t i;
    json_t *item;
    if (json_array_size(list) == 0) {
        printf("%-16s none\n", name);
    }
    json_array_foreach(list, i, item) {
        char *text = json_dumps(item, JSON_COMPACT | JSON_PRESERVE_ORDER | JSON_ENCODE_ANY);
        printf("%-16s %s\n", name, text != NULL ? cli_text(text) : "");
        free(text);
    }
}

static void print(const char *prefix, json_t *object) {
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value) {
        char name[64];
        snprintf(name, sizeof name, "%s%s", prefix, key);
        if (json_is_object(value)) {
            const bool named = prefix[0] != 0 || json_is_object(json_object_iter_value(json_object_iter(value)));
            if (named) { // its members' names alone would say nothing
                printf("%s\n", name);
            }
            print(prefix[0] == 0 ? "  " : "    ", value);
        } else if (json_is_array(value) && !json_is_number(json_array_get(value, 0))) {
            print_list(name, value);
        } else if (json_is_array(value)) {
            printf("%-16s %.6g +- %.2g\n", name, json_number_value(json_array_get(value, 0)),
                   json_number_value(json_array_get(value, 1)));
        } else if (json_is_number(value)) {
            printf("%-16s %.9g\n", name, json_number_value(value));
        } else if (json_is_boolean(value)) {
            printf("%-16s %s\n", name, json_is_true(value) ? "yes" : "no");
        } else if (json_is_string(value)) {
            printf("%-16s %s\n", name, cli_text(json_string_value(value)));
        }
    }
}

static const rig_action *find_action(const char *name) {
    for (const rig_action *a = rig_actions; a->name != NULL; a++) {
        if (strcmp(a->name, name) == 0) {
            return a;
        }
    }
    return NULL;
}

// The program that drives the rig, asked in the rig's place: nothing goes over its line.
static gonio_status ask_driver(const char *name, const char *identity, json_t **out, gonio_error *error) {
    static const char *const own[] = {"stopping", "paused", "fraction", "done_before"};
    const bool stop = strcmp(name, "stop") == 0;
    const gonio_status status = cli_ask(GONIO_CONTROL_RIG, identity, stop ? "stop" : "status", out, error);
    if (status != GONIO_OK) {
        return status;
    }
    for (size_t i = 0; i < sizeof own / sizeof *own; i++) {
        json_object_del(*out, own[i]);
    }
    if (stop && !gonio_control_wait_gone(GONIO_CONTROL_RIG, identity, STOP_TIMEOUT_S)) {
        return gonio_fail(error, GONIO_E_TIMEOUT,
                          "the program that drives the rig was told and is still at work after %d s: press the "
                          "emergency stop",
                          STOP_TIMEOUT_S);
    }
    if (stop) { // where it stood when it was told is of no interest
        json_object_del(*out, "position_deg");
        json_object_del(*out, "controller");
        json_object_set_new(*out, "state", json_string("stopped"));
    }
    return GONIO_OK;
}

// stop and status go to the program that drives the rig, where there is one; *done: it has answered.
static gonio_status through_driver(const char *name, const cli_rig_options *options, json_t **out, bool *done,
                                   gonio_error *error) {
    char *identity;
    *done = false;
    gonio_status status = cli_rig_identity(options, &identity, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (identity == NULL) {
        return strcmp(name, "stop") != 0
                   ? GONIO_OK
                   : gonio_fail(error, GONIO_E_USAGE,
                                "stop: every program has a simulated rig of its own; `gonio stop SESSION` ends the one "
                                "that measures a session");
    }
    gonio_error why = {.line = -1, .byte = -1};
    status = ask_driver(name, identity, out, &why);
    free(identity);
    *done = status != GONIO_E_FAILED; // else nobody drives it
    if (*done && status != GONIO_OK) {
        *error = why;
    }
    return *done ? status : GONIO_OK;
}

static gonio_status with_rig(const char *name, const rig_request *request, const cli_rig_options *options, json_t **out,
                             gonio_error *error) {
    cli_rig rig = {0};
    bool done = false;
    gonio_status status = GONIO_OK;
    if (strcmp(name, "stop") == 0 || strcmp(name, "status") == 0) {
        status = through_driver(name, options, out, &done, error);
    }
    if (done || status != GONIO_OK) {
        return status;
    }
    status = cli_rig_open(options, &rig, error);
    if (status == GONIO_OK && strcmp(name, "identify") == 0) {
        status = gonio_rig_describe(&rig, out, error);
    } else if (status == GONIO_OK && strcmp(name, "status") == 0) {
        status = read_status(&rig, out, error);
    } else if (status == GONIO_OK) {
        status = find_action(name)->run(request, &rig, out, error);
    }
    cli_rig_close(&rig);
    return status;
}

static bool needs_no_rig(const char *name) {
    return strcmp(name, "usb") == 0 || strcmp(name, "camera") == 0 || strcmp(name, "setup") == 0;
}

// A rig is not to be taken for the simulator, nor the simulator for a rig, because somebody forgot to say which.
static bool check_named(const cli_common *common, const char *name, const cli_rig_options *options) {
    if (cli_rig_named(options) != NULL || needs_no_rig(name)) {
        return true;
    }
    cli_usage(common, "rig %s: which rig? --rig RIG.ini, or GONIO_RIG in the environment; --rig sim is the simulator",
              name);
    return false;
}

// Whether the action is known and has the right number of arguments.
static bool check_request(const cli_common *common, const char *name, int n) {
    const rig_action *action = find_action(name);
    const bool reads = strcmp(name, "identify") == 0 || strcmp(name, "status") == 0, setup = strcmp(name, "setup") == 0;
    const int minimum = action != NULL ? action->minimum : setup;
    const int maximum = action != NULL ? action->maximum : setup || strcmp(name, "camera") == 0;
    if (action == NULL && !reads && !needs_no_rig(name)) {
        cli_usage(common,
                  "rig: found '%s', expected identify, status, home, release, move, jog, stop, clear, lamp, shutter, "
                  "capture, burst, selftest, parameters, set, save, camera, usb or setup",
                  name);
        return false;
    }
    if (n < minimum || n > maximum) {
        cli_usage(common, "rig: usage: gonio rig %s %s", name,
                  action != NULL ? action->arguments
                  : setup        ? "NEW.ini"
                                 : "");
        return false;
    }
    return true;
}

static int answer_or_fail(const cli_common *common, const char *name, json_t *answer, gonio_status status,
                          const gonio_error *error) {
    const rig_action *action = find_action(name);
    if (status != GONIO_OK) {
        if (!common->json && answer != NULL) {
            print("", answer); // what was found all the same
        }
        json_decref(answer);
        return cli_fail(common, error);
    }
    if (common->json) {
        return cli_json(answer);
    }
    if (action != NULL && action->print != NULL) {
        action->print(answer);
    } else {
        print("", answer);
    }
    json_decref(answer);
    return 0;
}

static int run(int argc, char **argv) {
    cli_common common;
    cli_rig_options rig_options = {0};
    rig_request request = {0};
    const cli_option options[] = {
        CLI_RIG_OPTIONS(rig_options),
        {"dial", 0, CLI_FLAG, &request.dial, NULL, NULL, "move: positions as the controller counts them"},
        {"home", 0, CLI_FLAG, &request.home, NULL, NULL, "selftest: also home all axes, twice"},
        {"slow", 0, CLI_FLAG, &request.slow, NULL, NULL, "jog: one axis, homed or not, for up to 10 s at home_slow"},
        {"exposure", 0, CLI_DOUBLE, &request.exposure_s, NULL, "S",
         "capture, burst: exposure in seconds (the shortest)"},
        {"output", 'o', CLI_OUTPUT, &request.output, NULL, "PGM", "capture: the frame's file"},
        {0}};
    const char *words[1 + RIG_ARGUMENTS];
    int count;
    if (!cli_parse(&cmd_rig, options, argc, argv, words, 1, 1 + RIG_ARGUMENTS, &count, &common)) {
        return 2;
    }
    request.n = count - 1;
    memcpy(request.arguments, words + 1, (size_t)request.n * sizeof *words);
    if (!check_request(&common, words[0], request.n) || !check_named(&common, words[0], &rig_options) ||
        (strcmp(words[0], "burst") == 0 && !cli_apart_session(&common, words[2]))) {
        return 2;
    }
    cli_rig_any_sample(&rig_options, &common);
    cli_catch_interrupts(); // the first Ctrl-C stops the axes
    gonio_error error = {.line = -1, .byte = -1};
    json_t *answer = NULL;
    const gonio_status status =
        strcmp(words[0], "camera") == 0  ? rig_camera_report(count > 1 ? words[1] : "/dev/video0", &answer, &error)
        : strcmp(words[0], "usb") == 0   ? rig_usb_report(&answer, &error)
        : strcmp(words[0], "setup") == 0 ? rig_setup(words[1], &answer, &error)
                                         : with_rig(words[0], &request, &rig_options, &answer, &error);
    return answer_or_fail(&common, words[0], answer, status, &error);
}
