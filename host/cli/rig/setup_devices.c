// SPDX-License-Identifier: BSD-3-Clause
// Lamp, camera and meter in gonio rig setup: what is attached, which of it is meant, and whether it works: the lamp low
// for a moment, one frame, one reading. What does not work can be asked for again, or left out.
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/text.h"
#include "host/cli/rig/setup_ask.h"
#include "host/drivers/camera_aravis.h"
#include "host/drivers/lamp_modbus.h"
#include "host/drivers/meter_modbus.h"
#include "host/drivers/null.h"
#include "host/transport/clock.h"

enum { LAMP_MS = 1000, VIDEO_DEVICES = 32, CAMERAS_MAX = 16, PAIRS_MAX = 6 };
#define LAMP_LEVEL 0.05
#define EXPOSURE_MOST_S 0.05
#define READ_OUT_S 10.0

// A device's section of the rig file to be.
typedef struct section {
    const char *name; // "camera"
    int n;
    char keys[PAIRS_MAX][16], values[PAIRS_MAX][128];
} section;

static void add(section *s, const char *key, const char *value) {
    if (s->n < PAIRS_MAX) {
        snprintf(s->keys[s->n], sizeof s->keys[0], "%s", key);
        snprintf(s->values[s->n++], sizeof s->values[0], "%s", value);
    }
}

static void put(const section *s, char *ini, size_t size) {
    gonio_text_append(ini, size, "[%s]\n", s->name);
    for (int i = 0; i < s->n; i++) {
        gonio_text_append(ini, size, "%s = %s\n", s->keys[i], s->values[i]);
    }
}

static void tell(void *context, const char *kind, const char *text) {
    (void)context;
    fprintf(stderr, "    %s: %s\n", cli_text(kind), cli_text(text));
}

static bool cancelled(void *context) {
    (void)context;
    return cli_interrupted();
}

// Open the one device that the section describes, and try it.
static gonio_status try_section(const section *s, gonio_status (*act)(gonio_rig *rig, gonio_error *error),
                                gonio_error *error) {
    const gonio_hardware_hooks hooks = {.event = tell, .cancelled = cancelled};
    gonio_hardware *hardware = NULL;
    gonio_rig rig = {0};
    gonio_status status = gonio_null_rig_open(&rig, error);
    status = status == GONIO_OK ? gonio_hardware_new(&hooks, &hardware, error) : status;
    for (int i = 0; i < s->n && status == GONIO_OK; i++) {
        bool taken, shared;
        status = gonio_hardware_set(hardware, s->name, s->keys[i], s->values[i], &taken, &shared, error);
    }
    status = status == GONIO_OK ? gonio_hardware_open(hardware, &rig, false, error) : status;
    status = status == GONIO_OK ? act(&rig, error) : status;
    gonio_rig_close(&rig);
    gonio_hardware_free(hardware);
    return status;
}

// What failed, and whether it is to be asked for again: *again.
static gonio_status failed(const gonio_error *why, bool *again, gonio_error *error) {
    static const char *const words[] = {"again", "skip", NULL};
    int which = 0;
    if (why->status == GONIO_E_INTERRUPTED) {
        *error = *why;
        return why->status;
    }
    fprintf(stderr, "    %s\n", cli_text(why->message));
    const gonio_status status = setup_ask_word(NULL, "    ask for it again, or skip it", words, 0, &which, error);
    *again = which == 0;
    return status;
}

// ---- lamp ----

static gonio_status burn(gonio_rig *rig, gonio_error *error) {
    const gonio_lamp_ops *lamp = rig->lamp;
    gonio_status status = lamp->set_level(rig->lamp_device, LAMP_LEVEL, error);
    status = status == GONIO_OK ? lamp->set_shutter(rig->lamp_device, true, error) : status;
    gonio_clock_sleep_ms(status == GONIO_OK ? LAMP_MS : 0);
    const gonio_status closed = lamp->set_shutter(rig->lamp_device, false, status == GONIO_OK ? error : NULL);
    const gonio_status off = lamp->set_level(rig->lamp_device, 0, status == GONIO_OK ? error : NULL);
    return status != GONIO_OK ? status : closed != GONIO_OK ? closed : off;
}

// The lamp behind the controller that is open already.
static gonio_status burn_controllers(gonio_controller *c, gonio_error *error) {
    gonio_rig rig = {.lamp = &gonio_lamp_modbus};
    gonio_status status = gonio_controller_clear(c, error);
    status = status == GONIO_OK ? gonio_lamp_modbus_open(c, 0.1, &rig.lamp_device, error) : status;
    if (status == GONIO_OK) {
        status = burn(&rig, error);
        rig.lamp->close(rig.lamp_device);
    }
    return status;
}

static gonio_status turn_lamp_over(gonio_controller *c, gonio_error *error) {
    const controller_register_info *p = gonio_parameter_find("output_invert");
    int64_t inverted;
    const gonio_status status = gonio_parameter_read(c, p, &inverted, error);
    return status == GONIO_OK ? gonio_parameter_write(c, p, 0, inverted ^ 1 << CONTROLLER_OUTPUT_lamp, error) : status;
}

static gonio_status ask_lamp_lines(section *s, gonio_error *error) {
    char answer[64];
    gonio_status status =
        setup_ask(NULL, "    line that switches it on, a name or gpiochipN:M", "none", answer, sizeof answer, error);
    if (status == GONIO_OK && strcmp(answer, "none") != 0) {
        add(s, "enable_line", answer);
    }
    status = status == GONIO_OK
                 ? setup_ask(NULL, "    line that opens its shutter", "none", answer, sizeof answer, error)
                 : status;
    if (status == GONIO_OK && strcmp(answer, "none") != 0) {
        add(s, "shutter_line", answer);
    }
    return status;
}

// *again: it is on where it should be off, and its output was turned over, or it failed.
static gonio_status try_lamp(gonio_controller *c, const section *s, bool controllers, bool *again, bool *works,
                             gonio_error *error) {
    static const char *const seen[] = {"yes", "no", "turn", NULL};
    gonio_error why = {.line = -1, .byte = -1};
    bool go;
    int which = 0;
    gonio_status status = setup_ask_yes("    look away from it: light it at 5 % for a second", &go, error);
    if (status != GONIO_OK || !go) {
        return status;
    }
    if ((controllers ? burn_controllers(c, &why) : try_section(s, burn, &why)) != GONIO_OK) {
        *works = false;
        return failed(&why, again, error);
    }
    status = setup_ask_word(NULL, "    it burned and went out: yes; no; or the other way round: turn", seen, 0, &which,
                            error);
    *again = which == 2 && controllers;
    *works = which == 0;
    return status == GONIO_OK && *again ? turn_lamp_over(c, error) : status;
}

static gonio_status ask_lamp(gonio_controller *c, char *ini, size_t size, gonio_error *error) {
    static const char *const words[] = {"none", "modbus", "gpio", NULL};
    int which = 0;
    gonio_status status = setup_ask_word(NULL, "lamp: none; modbus, at the controller; gpio, on lines of this computer",
                                         words, 0, &which, error);
    section s = {.name = "lamp"};
    add(&s, "driver", words[which]);
    status = status == GONIO_OK && which == 2 ? ask_lamp_lines(&s, error) : status;
    bool again = which != 0, works = which != 0;
    while (status == GONIO_OK && again) {
        again = false;
        works = true;
        status = try_lamp(c, &s, which == 1, &again, &works, error);
    }
    if (works) {
        put(&s, ini, size);
    }
    return status;
}

// ---- camera ----

static gonio_status expose(gonio_rig *rig, gonio_error *error) {
    gonio_camera_info info;
    gonio_status status = rig->camera->info(rig->camera_device, &info, error);
    if (status != GONIO_OK) {
        return status;
    }
    const size_t n = (size_t)info.width * (size_t)info.height;
    const gonio_window all = {0, 0, info.width, info.height};
    const double exposure_s = fmin(EXPOSURE_MOST_S, sqrt(info.exposure_min_s * info.exposure_max_s));
    gonio_frame frame = {.pixels = calloc(n, sizeof(uint16_t))};
    if (frame.pixels == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a frame of %d x %d", info.width, info.height);
    }
    status =
        rig->camera->capture(rig->camera_device, &all, exposure_s, 0, &(gonio_stamp){0}, READ_OUT_S, &frame, error);
    if (status == GONIO_OK) {
        double sum = 0;
        int most = 0;
        for (size_t i = 0; i < n; i++) {
            sum += frame.pixels[i];
            most = frame.pixels[i] > most ? frame.pixels[i] : most;
        }
        fprintf(stderr, "    a frame of %d x %d, %d bits, exposed for %.3g ms: mean %.4g, brightest pixel %d\n",
                info.width, info.height, info.bits, 1e3 * frame.exposure_s, sum / (double)n, most);
    }
    free(frame.pixels);
    return status;
}

typedef struct found {
    int n;
    bool v4l2[CAMERAS_MAX];
    char device[CAMERAS_MAX][128];
} found;

static void list_cameras(found *f) {
    for (int i = 0; i < VIDEO_DEVICES && f->n < CAMERAS_MAX; i++) {
        json_t *said = NULL;
        snprintf(f->device[f->n], sizeof f->device[0], "/dev/video%d", i);
        if (access(f->device[f->n], F_OK) == 0 && rig_camera_report(f->device[f->n], &said, NULL) == GONIO_OK) {
            f->v4l2[f->n] = true;
            fprintf(stderr, "    %d: %s, %s; fit for radiometry: %s\n", f->n + 1, f->device[f->n],
                    cli_text(json_string_value(json_object_get(said, "card"))),
                    json_string_value(json_object_get(said, "fit_for_radiometry")));
            f->n++;
        }
        json_decref(said);
    }
    for (int i = 0; f->n < CAMERAS_MAX && gonio_camera_aravis_listed(i, f->device[f->n]); i++) {
        f->v4l2[f->n] = false;
        fprintf(stderr, "    %d: %s, a GenICam camera\n", f->n + 1, cli_text(f->device[f->n]));
        f->n++;
    }
}

static gonio_status ask_camera(char *ini, size_t size, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (bool again = true; status == GONIO_OK && again;) {
        found f = {0};
        char answer[128];
        fprintf(stderr, "Cameras that are attached:\n");
        list_cameras(&f);
        fprintf(stderr, "%s", f.n == 0 ? "    none\n" : "");
        status = setup_ask(NULL, "camera: a number, or a name (/dev/..., or GenICam's), or none",
                           f.n > 0 ? "1" : "none", answer, sizeof answer, error);
        again = false;
        if (status != GONIO_OK || strcmp(answer, "none") == 0) {
            return status;
        }
        char *end;
        const long number = strtol(answer, &end, 10);
        const bool listed = *end == 0 && number >= 1 && number <= f.n;
        const bool v4l2 = listed ? f.v4l2[number - 1] : answer[0] == '/';
        section s = {.name = "camera"};
        add(&s, "driver", v4l2 ? "v4l2" : "aravis");
        add(&s, "device", listed ? f.device[number - 1] : answer);
        gonio_error why = {.line = -1, .byte = -1};
        if (try_section(&s, expose, &why) == GONIO_OK) {
            put(&s, ini, size);
        } else {
            status = failed(&why, &again, error);
        }
    }
    return status;
}

// ---- meter ----

static gonio_status read_once(gonio_rig *rig, gonio_error *error) {
    double value = 0, sigma = 0;
    const gonio_status status = rig->meter->read(rig->meter_device, &(gonio_stamp){0}, 0.2, &value, &sigma, error);
    if (status == GONIO_OK) {
        fprintf(stderr, "    it reads %.6g +- %.2g\n", value, sigma);
    }
    return status;
}

static gonio_status read_controllers(gonio_controller *c, gonio_error *error) {
    gonio_rig rig = {.meter = &gonio_meter_modbus};
    gonio_status status = gonio_meter_modbus_open(c, 1, 0.005, &rig.meter_device, error);
    if (status == GONIO_OK) {
        status = read_once(&rig, error);
        rig.meter->close(rig.meter_device);
    }
    return status;
}

// USB instruments, numbered; their section where one is chosen.
static gonio_status choose_instrument(section *s, gonio_error *error) {
    json_t *said = NULL, *item;
    size_t i;
    gonio_status status = rig_usb_report(&said, error);
    const json_t *list = json_object_get(said, "instruments");
    json_array_foreach(list, i, item) {
        fprintf(stderr, "    %zu: %s %s, %s\n", i + 1, json_string_value(json_object_get(item, "id")),
                cli_text(json_string_value(json_object_get(item, "manufacturer"))),
                cli_text(json_string_value(json_object_get(item, "model"))));
    }
    double number = 0;
    const double n = (double)json_array_size(list);
    if (status == GONIO_OK && n == 0) {
        status = gonio_fail(error, GONIO_E_DEVICE, "no USBTMC instrument is attached (rights: docs/hardware.md)");
    }
    status = status == GONIO_OK ? setup_ask_number("    which of these instruments", 1, 1, n, &number, error) : status;
    if (status == GONIO_OK) {
        item = json_array_get(list, (size_t)number - 1);
        const char *id = json_string_value(json_object_get(item, "id")); // "1313:8078"
        char vendor[8];
        snprintf(vendor, sizeof vendor, "%.4s", id);
        add(s, "vendor", vendor);
        add(s, "product", id + 5);
        const char *serial = json_string_value(json_object_get(item, "serial"));
        if (serial != NULL && serial[0] != 0) {
            add(s, "serial", serial);
        }
    }
    json_decref(said);
    return status;
}

static gonio_status ask_line(section *s, gonio_error *error) {
    char answer[128];
    const gonio_status status = setup_ask(NULL, "    port of the meter, a serial device or tcp:HOST:5025",
                                          "/dev/ttyUSB1", answer, sizeof answer, error);
    add(s, "port", answer);
    return status;
}

static gonio_status ask_meter(gonio_controller *c, char *ini, size_t size, gonio_error *error) {
    static const char *const words[] = {"none", "modbus", "usbtmc", "scpi", NULL};
    gonio_status status = GONIO_OK;
    for (bool again = true; status == GONIO_OK && again;) {
        int which = 0;
        status = setup_ask_word(
            NULL, "meter: none; modbus, the controller's photodiode; usbtmc, on USB; scpi, on a line or TCP", words, 0,
            &which, error);
        again = false;
        if (status != GONIO_OK || which == 0) {
            return status;
        }
        section s = {.name = "meter"};
        gonio_error why = {.line = -1, .byte = -1};
        add(&s, "driver", words[which]);
        gonio_status one = which == 2 ? choose_instrument(&s, &why) : which == 3 ? ask_line(&s, &why) : GONIO_OK;
        if (one == GONIO_E_USAGE) { // the answers ended
            *error = why;
            return one;
        }
        if (one == GONIO_OK) {
            one = which == 1 ? read_controllers(c, &why) : try_section(&s, read_once, &why);
        }
        if (one == GONIO_OK) {
            put(&s, ini, size);
        } else {
            status = failed(&why, &again, error);
        }
    }
    return status;
}

gonio_status setup_devices(gonio_controller *c, char *ini, size_t size, gonio_error *error) {
    ini[0] = 0;
    gonio_status status = ask_lamp(c, ini, size, error);
    status = status == GONIO_OK ? ask_camera(ini, size, error) : status;
    return status == GONIO_OK ? ask_meter(c, ini, size, error) : status;
}
