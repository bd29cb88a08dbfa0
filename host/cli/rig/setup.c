// SPDX-License-Identifier: BSD-3-Clause
// gonio rig setup: from a controller that nobody has set up to a homed rig and its rig file, by questions.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/text.h"
#include "gonio/output.h"
#include "host/cli/rig/setup_ask.h"

enum { HOME_TIMEOUT_S = 600, ALL_INPUTS = (1 << 14) - 1 };
#define JOG_DEG 2.0
#define BACKOFF_DEG 2.0

typedef struct setup {
    gonio_controller *c;
    gonio_controller_config config;
    gonio_stage_modbus_config stage;
    int64_t enable, invert, direction; // the registers input_enable, input_invert, direction_invert
    unsigned present, homed;           // axes
    bool trying_inputs;                // alarms of contacts say nothing new then
    char devices[1600];                // their sections of the rig file
} setup;

static const controller_register_info *parameter(const char *name) { return gonio_parameter_find(name); }

// ---- the controller ----

static void tell(void *context, const char *kind, const char *text) {
    const setup *s = context;
    if (strcmp(kind, "parameters") != 0 && !s->trying_inputs) { // every parameter was just answered
        fprintf(stderr, "    %s: %s\n", cli_text(kind), cli_text(text));
    }
}

static bool cancelled(void *context) {
    (void)context;
    return cli_interrupted();
}

static gonio_status open_controller(setup *s, gonio_error *error) {
    char port[sizeof s->config.modbus.port];
    gonio_controller_defaults(&s->config);
    gonio_status status = setup_ask(NULL, "port of the controller, a serial device or tcp:HOST:PORT",
                                    "/dev/gonio-controller", port, sizeof port, error);
    if (status == GONIO_OK) {
        status = setup_ask_number("seconds without this program after which the controller makes itself safe",
                                  s->config.deadman_s, 1, 3600, &s->config.deadman_s, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    snprintf(s->config.modbus.port, sizeof s->config.modbus.port, "%s", port);
    s->config.event = tell;
    s->config.event_context = s;
    s->config.cancelled = cancelled;
    s->config.feed_s = 86400; // somebody reads, thinks and wires
    status = gonio_controller_open(&s->config, &s->c, error);
    if (status == GONIO_OK) {
        const gonio_controller_identity *id = gonio_controller_identify(s->c);
        fprintf(stderr, "    a controller with firmware %u.%u.%u and %d axes\n", id->version >> 16 & 255,
                id->version >> 8 & 255, id->version & 255, id->axes);
        status = gonio_controller_claim(s->c, error);
    }
    return status;
}

static gonio_status write_bits(setup *s, const char *name, int64_t bits, gonio_error *error) {
    return gonio_parameter_write(s->c, parameter(name), 0, bits, error);
}

// ---- inputs ----

static gonio_status ask_contact(setup *s, int contact, const char *what, gonio_error *error) {
    static const char *const words[] = {"unwired", "seen", "low", "high", NULL};
    gonio_controller_status now;
    gonio_status status = gonio_controller_read_status(s->c, &now, error);
    const bool first = status == GONIO_OK && (now.inputs >> contact & 1) != 0;
    setup_watched w = {s->c, contact, first, false}; // over all of the questions: it may have come back between two
    for (int which = -1; status == GONIO_OK && which < 0;) {
        char question[200];
        snprintf(question, sizeof question, "%s (%s) reads %s", gonio_parameter_contacts()[contact], what,
                 w.level ? "high" : "low");
        status = setup_ask_word(&w, question, words, 0, &which, error);
        if (status == GONIO_OK && which == 1 && (!w.moved || w.level != first)) {
            fprintf(stderr, "    %s\n", w.moved ? "it is not back at rest" : "it has not changed: is it wired?");
            which = -1;
        }
        if (which > 0) {
            s->enable |= 1 << contact;
            s->invert |= (which == 3 || (which == 1 && first)) << contact;
        }
    }
    return status;
}

static gonio_status ask_inputs(setup *s, gonio_error *error) {
    static const char *const kinds[] = {"home switch", "lower limit switch", "upper limit switch"};
    static const char *const others[] = {"emergency stop", "door contact"}, *const no_yes[] = {"no", "yes", NULL};
    int limits = 0;
    fprintf(stderr,
            "Inputs, as their wires are now; nothing moves. Operate each one and let it go: its changes are shown.\n"
            "Then answer `seen`; or `unwired`; or the level that it has at rest, `low` or `high`.\n");
    s->trying_inputs = true;
    gonio_status status = write_bits(s, "input_invert", 0, error);
    status = status == GONIO_OK ? write_bits(s, "input_enable", ALL_INPUTS, error) : status;
    for (int i = 0; i < 2 && status == GONIO_OK; i++) {
        status = ask_contact(s, CONTROLLER_CONTACT_estop + i, others[i], error);
    }
    for (int i = 0; i < 3 * GONIO_AXES && status == GONIO_OK; i++) {
        if (i == GONIO_AXES) {
            status = setup_ask_word(NULL, "are there limit switches as well", no_yes, 0, &limits, error);
        }
        if (status == GONIO_OK && (i < GONIO_AXES || limits != 0)) {
            status = ask_contact(s, i, kinds[i / GONIO_AXES], error);
        }
    }
    status = status == GONIO_OK ? write_bits(s, "input_invert", s->invert, error) : status;
    status = status == GONIO_OK ? write_bits(s, "input_enable", s->enable, error) : status;
    s->trying_inputs = false;
    if (status == GONIO_OK && (s->enable >> CONTROLLER_CONTACT_estop & 1) == 0) {
        fprintf(stderr, "    No emergency stop: let nothing move unless somebody can cut the motors' power.\n");
    }
    return status;
}

// ---- axes ----

static gonio_status ask_axis(setup *s, int k, gonio_error *error) {
    gonio_axis_config *a = &s->stage.axes[k];
    char question[120];
    snprintf(question, sizeof question, "%s: motor steps (with microsteps and gear) a degree; 0: no such axis",
             rig_axes[k]);
    gonio_status status = setup_ask_number(question, 100, 0, 4e6, &a->steps_per_deg, error);
    if (status != GONIO_OK || a->steps_per_deg == 0) {
        *a = (gonio_axis_config){NAN, NAN, NAN, NAN, 0, 0, NAN, 0, NAN, NAN, NAN, NAN, 0, -1, 0, false};
        return status;
    }
    s->present |= 1u << k;
    status = setup_ask_number("    its speed in deg/s", fmin(10, 4000 / a->steps_per_deg), 1e-3,
                              62500 / a->steps_per_deg, &a->speed_deg_per_s, error);
    status = status == GONIO_OK ? setup_ask_number("    its lowest angle in deg", -90, -720, 720, &a->min_deg, error)
                                : status;
    if (status == GONIO_OK) {
        status =
            setup_ask_number("    its highest angle in deg", fmax(90, a->min_deg), a->min_deg, 720, &a->max_deg, error);
    }
    a->acceleration_deg_per_s2 = 2 * a->speed_deg_per_s;
    a->jerk_deg_per_s3 = 20 * a->speed_deg_per_s;
    a->home_fast_deg_per_s = a->speed_deg_per_s / 2;
    a->home_slow_deg_per_s = fmin(1, a->speed_deg_per_s / 4);
    a->home_backoff_deg = BACKOFF_DEG;
    a->home_travel_deg = fmin(1440, a->max_deg - a->min_deg + 20);
    return status;
}

static gonio_status ask_switch(setup *s, int k, gonio_error *error) {
    static const char *const ends[] = {"lower", "upper", NULL};
    gonio_axis_config *a = &s->stage.axes[k];
    if ((s->enable >> k & 1) == 0) {
        a->home_order = 0;
        return setup_ask_number("    it has no home switch: at what angle does it stand when `home` is asked for", 0,
                                a->min_deg, a->max_deg, &a->home_deg, error);
    }
    a->home_order = k + 1;
    const gonio_status status =
        setup_ask_word(NULL, "    its home switch is at the lower or the upper end", ends, 0, &a->home_up, error);
    return status != GONIO_OK ? status
                              : setup_ask_number("    angle of the switch in deg",
                                                 a->home_up == 1 ? a->max_deg + BACKOFF_DEG : a->min_deg - BACKOFF_DEG,
                                                 -720, 720, &a->home_deg, error);
}

static gonio_status open_stage(setup *s, void **stage, gonio_error *error) {
    gonio_status status = gonio_controller_clear(s->c, error);
    status = status == GONIO_OK ? gonio_stage_modbus_open(&s->stage, s->c, stage, error) : status;
    return status;
}

static gonio_status jog(setup *s, int k, gonio_error *error) {
    void *stage;
    gonio_status status = open_stage(s, &stage, error);
    if (status == GONIO_OK) {
        status = gonio_stage_modbus_jog(stage, k, fmin(JOG_DEG, 8 * s->stage.axes[k].home_slow_deg_per_s), error);
        gonio_stage_modbus.close(stage);
    }
    return status;
}

static gonio_status home(setup *s, int k, gonio_error *error) {
    void *stage;
    gonio_status status = open_stage(s, &stage, error);
    if (status == GONIO_OK) {
        double at[GONIO_AXES];
        status = gonio_stage_modbus_home(stage, 1u << k, HOME_TIMEOUT_S, error);
        status = status == GONIO_OK ? gonio_stage_modbus.position(stage, at, error) : status;
        gonio_stage_modbus.close(stage);
        if (status == GONIO_OK && (s->present >> k & 1) != 0) {
            s->homed |= 1u << k;
            fprintf(stderr, "    %s is homed and stands at %.6g deg\n", rig_axes[k], gonio_degrees(at[k]));
        }
    }
    return status;
}

static gonio_status turn_over(setup *s, int k, gonio_error *error) {
    s->direction ^= 1 << k;
    return write_bits(s, "direction_invert", s->direction, error);
}

// Do it; where it fails, say why, and ask what now. *done: it went well.
static gonio_status attempt(setup *s, int k, gonio_status (*act)(setup *s, int k, gonio_error *error), bool *done,
                            gonio_error *error) {
    static const char *const words[] = {"again", "turn", "skip", NULL};
    int next = 0;
    *done = false;
    while (next < 2) {
        gonio_error why = {.line = -1, .byte = -1};
        gonio_status status = act(s, k, &why);
        *done = status == GONIO_OK;
        if (*done) {
            return GONIO_OK;
        }
        if (status == GONIO_E_INTERRUPTED) {
            *error = why;
            return status;
        }
        fprintf(stderr, "    %s\n", cli_text(why.message));
        status = setup_ask_word(NULL, "    try again, turn its direction over and try again, or skip it", words, 0,
                                &next, error);
        status = status == GONIO_OK && next == 1 ? turn_over(s, k, error) : status;
        if (status != GONIO_OK) {
            return status;
        }
    }
    return GONIO_OK;
}

static gonio_status find_direction(setup *s, int k, gonio_error *error) {
    static const char *const words[] = {"larger", "smaller", "again", "not", NULL};
    char question[160];
    snprintf(question, sizeof question, "    clear its way: move %s a little and slowly, to see its direction",
             rig_axes[k]);
    bool go;
    gonio_status status = setup_ask_yes(question, &go, error);
    while (status == GONIO_OK && go) {
        int which = 0;
        status = attempt(s, k, jog, &go, error);
        if (status == GONIO_OK && go) {
            status =
                setup_ask_word(NULL, "    it moved towards larger or smaller angles; or again; or it did not move: not",
                               words, 0, &which, error);
        }
        go = go && which >= 2;
        if (status == GONIO_OK && which == 1) {
            status = turn_over(s, k, error);
        } else if (status == GONIO_OK && which == 3) {
            fprintf(stderr,
                    "    is its power on, and its enable output the right way round? `motors_invert` (A4988, TMC: "
                    "active low) is turned over now\n");
            int64_t inverted;
            status = gonio_parameter_read(s->c, parameter("motors_invert"), &inverted, error);
            status = status == GONIO_OK ? write_bits(s, "motors_invert", inverted ^ 1 << k, error) : status;
        }
    }
    return status;
}

static gonio_status set_up_axis(setup *s, int k, gonio_error *error) {
    gonio_status status = ask_axis(s, k, error);
    if (status != GONIO_OK || (s->present >> k & 1) == 0) {
        return status == GONIO_OK ? home(s, k, error) : status; // nothing moves, and the others may then
    }
    status = ask_switch(s, k, error);
    status = status == GONIO_OK ? find_direction(s, k, error) : status;
    bool yes = false, done;
    status = status == GONIO_OK ? setup_ask_yes("    home it now, with a hand on the stop", &yes, error) : status;
    return status == GONIO_OK && yes ? attempt(s, k, home, &done, error) : status;
}

// ---- the rig file ----

static gonio_status put_bits(setup *s, FILE *out, const char *name, gonio_error *error) {
    int64_t bits;
    char text[400];
    const gonio_status status = gonio_parameter_read(s->c, parameter(name), &bits, error);
    if (status == GONIO_OK) {
        gonio_parameter_print(parameter(name), bits, text, sizeof text);
        fprintf(out, "%s = %s\n", name, text);
    }
    return status;
}

static void put_number(FILE *out, const char *key, double value) {
    char text[32];
    if (isfinite(value)) {
        gonio_text_shortest(value, text);
        fprintf(out, "%s = %s\n", key, text);
    }
}

static void put_axis(FILE *out, const char *name, const gonio_axis_config *a) {
    fprintf(out, "[axis %s]\n", name);
    put_number(out, "steps_per_deg", a->steps_per_deg);
    put_number(out, "speed_deg_per_s", a->speed_deg_per_s);
    put_number(out, "acceleration_deg_per_s2", a->acceleration_deg_per_s2);
    put_number(out, "jerk_deg_per_s3", a->jerk_deg_per_s3);
    put_number(out, "min_deg", a->min_deg);
    put_number(out, "max_deg", a->max_deg);
    put_number(out, "home_deg", a->home_deg);
    put_number(out, "home_fast_deg_per_s", a->home_fast_deg_per_s);
    put_number(out, "home_slow_deg_per_s", a->home_slow_deg_per_s);
    put_number(out, "home_travel_deg", a->home_travel_deg);
    put_number(out, "home_backoff_deg", a->home_backoff_deg);
    put_number(out, "home_order", a->home_order);
    put_number(out, "home_up", a->home_up >= 0 ? a->home_up : (double)NAN);
}

static gonio_status write_file(setup *s, const char *path, gonio_error *error) {
    static const char *const bits[] = {"input_enable", "input_invert", "direction_invert", "motors_invert",
                                       "output_invert"};
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *out = gonio_output_stream(output);
    fprintf(out, "; made by gonio rig setup; docs/hardware.md tells the keys\n");
    fprintf(out, "[rig]\ndriver = null\n[controller]\nport = %s\n", s->config.modbus.port);
    put_number(out, "deadman_s", s->config.deadman_s);
    for (size_t i = 0; i < sizeof bits / sizeof *bits && status == GONIO_OK; i++) {
        status = put_bits(s, out, bits[i], error);
    }
    fprintf(out, "[stage]\ndriver = modbus\nhome_pressed = 1\n");
    for (int k = 0; k < GONIO_AXES; k++) {
        put_axis(out, rig_axes[k], &s->stage.axes[k]);
    }
    fputs(s->devices, out);
    if (status != GONIO_OK) {
        gonio_output_abandon(output);
        return status;
    }
    return gonio_output_commit(output, error);
}

// ---- all of it ----

static gonio_status set_up(setup *s, const char *path, gonio_error *error) {
    gonio_status status = open_controller(s, error);
    status =
        status == GONIO_OK ? gonio_parameter_read(s->c, parameter("direction_invert"), &s->direction, error) : status;
    status = status == GONIO_OK ? ask_inputs(s, error) : status;
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        status = set_up_axis(s, k, error);
    }
    bool save = false;
    status = status == GONIO_OK ? setup_devices(s->c, s->devices, sizeof s->devices, error) : status;
    status = status == GONIO_OK ? write_file(s, path, error) : status;
    status = status == GONIO_OK ? setup_ask_yes("keep the parameters in the controller as well", &save, error) : status;
    return status == GONIO_OK && save ? gonio_controller_command(s->c, CONTROLLER_COMMAND_SAVE, 0, NULL, NULL, error)
                                      : status;
}

gonio_status rig_setup(const char *path, json_t **out, gonio_error *error) {
    setup s = {0};
    if (access(path, F_OK) == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "setup: %s exists; expected the name of a new rig file", path);
    }
    gonio_stage_modbus_defaults(&s.stage);
    s.stage.home_pressed = 1;
    const gonio_status status = set_up(&s, path, error);
    gonio_controller_release(s.c);
    if (status != GONIO_OK) {
        return status;
    }
    json_t *homed = json_array();
    for (int k = 0; k < GONIO_AXES; k++) {
        if ((s.homed >> k & 1) != 0) {
            json_array_append_new(homed, json_string(rig_axes[k]));
        }
    }
    *out = json_pack("{s:s,s:o}", "rig_file", path, "homed", homed);
    fprintf(stderr, "Next: gonio rig status --rig %s\n", cli_text(path));
    return GONIO_OK;
}
