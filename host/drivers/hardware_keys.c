#include "host/drivers/hardware_keys.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef enum kind { TEXT, WHOLE, REAL, MILLI, MICRO, PERCENT, YES, NO, HEX, PARITY, BIAS, SIGN, DRIVER } kind;

typedef struct entry {
    const char *section, *key;
    kind kind;
    size_t offset, size;
    double low, high;
    const char *with; // the driver of this section that the key belongs to; "" any; choices of a DRIVER
    bool shared;      // with the simulator
} entry;

#define AT(member) offsetof(hardware_settings, member), sizeof(((hardware_settings *)0)->member)
#define AXIS(name, k)                                                                                                   \
    {"axis " name, "steps_per_deg", REAL, AT(stage.axes[k].steps_per_deg), 0.001, 4e6, "modbus", false},                \
        {"axis " name, "speed_deg_per_s", REAL, AT(stage.axes[k].speed_deg_per_s), 1e-3, 1e4, "modbus", true},          \
        {"axis " name, "acceleration_deg_per_s2", REAL, AT(stage.axes[k].acceleration_deg_per_s2), 1e-3, 1e6, "modbus", \
         true},                                                                                                         \
        {"axis " name, "jerk_deg_per_s3", REAL, AT(stage.axes[k].jerk_deg_per_s3), 0, 1e9, "modbus", true},             \
        {"axis " name, "min_deg", REAL, AT(stage.axes[k].min_deg), -720, 720, "modbus", true},                          \
        {"axis " name, "max_deg", REAL, AT(stage.axes[k].max_deg), -720, 720, "modbus", true},                          \
        {"axis " name, "backlash_deg", REAL, AT(stage.axes[k].backlash_deg), -10, 10, "modbus", true},                  \
        {"axis " name, "home_deg", REAL, AT(stage.axes[k].home_deg), -720, 720, "modbus", false},                       \
        {"axis " name, "home_fast_deg_per_s", REAL, AT(stage.axes[k].home_fast_deg_per_s), 1e-3, 1e4, "modbus", false}, \
        {"axis " name, "home_slow_deg_per_s", REAL, AT(stage.axes[k].home_slow_deg_per_s), 1e-4, 1e3, "modbus", false}, \
        {"axis " name, "home_travel_deg", REAL, AT(stage.axes[k].home_travel_deg), 1e-3, 1440, "modbus", false},        \
        {"axis " name, "home_order", WHOLE, AT(stage.axes[k].home_order), 0, 4, "modbus", false},                       \
        {"axis " name, "home_up", WHOLE, AT(stage.axes[k].home_up), 0, 1, "modbus", false},                             \
        {"axis " name, "zero_deg", REAL, AT(stage.axes[k].zero_deg), -720, 720, "modbus", false}, {                     \
        "axis " name, "invert", SIGN, AT(stage.axes[k].sign), 0, 0, "modbus", false                                     \
    }

static const entry entries[] = {
    {"stage", "driver", DRIVER, AT(stage_driver), 0, 0, "modbus none ", false},
    {"stage", "audit_deg", REAL, AT(stage.audit_deg), 0, 10, "modbus", false},
    {"stage", "home_pressed", WHOLE, AT(stage.home_pressed), 0, 1, "modbus", false},
    AXIS("light_theta", GONIO_LIGHT_THETA),
    AXIS("light_phi", GONIO_LIGHT_PHI),
    AXIS("camera_theta", GONIO_CAMERA_THETA),
    AXIS("camera_phi", GONIO_CAMERA_PHI),
    {"controller", "port", TEXT, AT(controller.modbus.port), 0, 0, "", false},
    {"controller", "baud", WHOLE, AT(controller.modbus.baud), 1200, 1e6, "", false},
    {"controller", "parity", PARITY, AT(controller.modbus.parity), 0, 0, "", false},
    {"controller", "slave", WHOLE, AT(controller.modbus.slave), 1, 247, "", false},
    {"controller", "timeout_ms", WHOLE, AT(controller.modbus.timeout_ms), 5, 10000, "", false},
    {"controller", "retries", WHOLE, AT(controller.retries), 0, 100, "", false},
    {"controller", "deadman_s", REAL, AT(controller.deadman_s), 0, 3600, "", false},
    {"controller", "feed_s", REAL, AT(controller.feed_s), 0, 86400, "", false},
    {"controller", "replug_s", REAL, AT(controller.replug_s), 0, 3600, "", false},
    {"controller", "record", TEXT, AT(controller_record), 0, 0, "", false},
    {"controller", "replay", TEXT, AT(controller_replay), 0, 0, "", false},
    {"lamp", "driver", DRIVER, AT(lamp_driver), 0, 0, "modbus gpio none ", false},
    {"lamp", "shutter_settle_s", REAL, AT(shutter_settle_s), 0, 60, "", false},
    {"lamp", "enable_line", TEXT, AT(lamp.enable_line), 0, 0, "gpio", false},
    {"lamp", "enable_low", YES, AT(lamp.enable_low), 0, 0, "gpio", false},
    {"lamp", "shutter_line", TEXT, AT(lamp.shutter_line), 0, 0, "gpio", false},
    {"lamp", "shutter_low", YES, AT(lamp.shutter_low), 0, 0, "gpio", false},
    {"lamp", "warm_up_s", REAL, AT(lamp.warm_up_s), 0, 1e5, "gpio", true},
    {"meter", "driver", DRIVER, AT(meter_driver), 0, 0, "usbtmc modbus none ", false},
    {"meter", "vendor", HEX, AT(meter.match.vendor), 0, 0, "usbtmc", false},
    {"meter", "product", HEX, AT(meter.match.product), 0, 0, "usbtmc", false},
    {"meter", "serial", TEXT, AT(meter.match.serial), 0, 0, "usbtmc", false},
    {"meter", "setup", TEXT, AT(meter.setup), 0, 0, "usbtmc", false},
    {"meter", "query", TEXT, AT(meter.query), 0, 0, "usbtmc", false},
    {"meter", "scale", REAL, AT(meter.scale), -1e30, 1e30, "", false},
    {"meter", "sigma_percent", PERCENT, AT(meter.relative_sigma), 0, 100, "", false},
    {"meter", "retries", WHOLE, AT(meter.retries), 0, 100, "usbtmc", false},
    {"meter", "timeout_ms", WHOLE, AT(meter.timeout_ms), 10, 100000, "usbtmc", false},
    {"meter", "replug_s", REAL, AT(meter.replug_s), 0, 3600, "usbtmc", false},
    {"camera", "driver", DRIVER, AT(camera_driver), 0, 0, "v4l2 none ", false},
    {"camera", "device", TEXT, AT(camera.path), 0, 0, "v4l2", false},
    {"camera", "format", TEXT, AT(camera.format), 0, 0, "v4l2", false},
    {"camera", "width", WHOLE, AT(camera.width), 8, 65536, "v4l2", false},
    {"camera", "height", WHOLE, AT(camera.height), 8, 65536, "v4l2", false},
    {"camera", "bits", WHOLE, AT(camera.bits), 8, 16, "v4l2", false},
    {"camera", "shift_bits", WHOLE, AT(camera.shift), 0, 15, "v4l2", false},
    {"camera", "settle_frames", WHOLE, AT(camera.settle_frames), 0, 100, "v4l2", false},
    {"camera", "buffers", WHOLE, AT(camera.buffers), 2, 16, "v4l2", false},
    {"camera", "exposure_unit_us", MICRO, AT(camera.exposure_unit_s), 1e-3, 1e6, "v4l2", false},
    {"camera", "fixed_exposure_ms", MILLI, AT(camera.fixed_exposure_s), 1e-3, 1e6, "v4l2", false},
    {"camera", "exposure_tolerance_percent", PERCENT, AT(camera.exposure_tolerance), 0, 1000, "v4l2", false},
    {"camera", "gain_db_per_step", REAL, AT(camera.gain_unit_db), 0, 20, "v4l2", false},
    {"camera", "replug_s", REAL, AT(camera.replug_s), 0, 3600, "v4l2", false},
    {"camera", "serial", TEXT, AT(camera.info.serial), 0, 0, "v4l2", false},
    {"camera", "fx_px", REAL, AT(camera.info.fx), 1, 1e7, "v4l2", false},
    {"camera", "fy_px", REAL, AT(camera.info.fy), 1, 1e7, "v4l2", false},
    {"camera", "cx_px", REAL, AT(camera.info.cx), -1e5, 1e5, "v4l2", false},
    {"camera", "cy_px", REAL, AT(camera.info.cy), -1e5, 1e5, "v4l2", false},
    {"camera", "k1", REAL, AT(camera.info.k1), -1e3, 1e3, "v4l2", false},
    {"camera", "k2", REAL, AT(camera.info.k2), -1e6, 1e6, "v4l2", false},
    {"camera", "p1", REAL, AT(camera.info.p1), -10, 10, "v4l2", false},
    {"camera", "p2", REAL, AT(camera.info.p2), -10, 10, "v4l2", false},
    {"camera", "k3", REAL, AT(camera.info.k3), -1e9, 1e9, "v4l2", false},
    {"camera", "read_out_s", REAL, AT(camera.info.read_out_s), 0, 100, "v4l2", false},
    {"camera", "record", TEXT, AT(camera_record), 0, 0, "v4l2", false},
    {"camera", "replay", TEXT, AT(camera_replay), 0, 0, "v4l2", false},
    {"camera", "trigger_line", TEXT, AT(trigger_line), 0, 0, "v4l2", false},
    {"camera", "trigger_low", YES, AT(trigger_low), 0, 0, "v4l2", false},
    {"camera", "trigger_settle_ms", MILLI, AT(trigger_settle_s), 0, 1e5, "v4l2", false},
    {"camera", "trigger_pulse_ms", MILLI, AT(trigger_pulse_s), 0, 1e3, "v4l2", false},
    {"keep-out", "retro_deg", REAL, AT(keep_out.retro_deg), 0, 90, "", false},
    {"interlock", "driver", DRIVER, AT(interlock_driver), 0, 0, "gpio none ", false},
    {"interlock", "estop_line", TEXT, AT(interlock.contacts[0].line), 0, 0, "gpio", false},
    {"interlock", "estop_normally_open", NO, AT(interlock.contacts[0].normally_closed), 0, 0, "gpio", false},
    {"interlock", "estop_bias", BIAS, AT(interlock.contacts[0].bias), 0, 0, "gpio", false},
    {"interlock", "door_line", TEXT, AT(interlock.contacts[1].line), 0, 0, "gpio", false},
    {"interlock", "door_normally_open", NO, AT(interlock.contacts[1].normally_closed), 0, 0, "gpio", false},
    {"interlock", "door_bias", BIAS, AT(interlock.contacts[1].bias), 0, 0, "gpio", false},
    {"interlock", "debounce_ms", MILLI, AT(interlock.debounce_s), 0, 1000, "gpio", false},
};
#define COUNT (sizeof entries / sizeof *entries)

void hardware_settings_default(hardware_settings *s) {
    *s = (hardware_settings){.shutter_settle_s = 0.1, .trigger_pulse_s = 0.001};
    gonio_controller_defaults(&s->controller);
    gonio_stage_modbus_defaults(&s->stage);
    gonio_meter_usbtmc_defaults(&s->meter);
    gonio_camera_v4l2_defaults(&s->camera);
    gonio_interlock_gpio_defaults(&s->interlock);
}

static gonio_status bad(const entry *e, const char *value, const char *expected, gonio_error *error) {
    return gonio_fail(error, GONIO_E_INPUT, "[%s] %s: found '%.80s', expected %s", e->section, e->key, value, expected);
}

static gonio_status set_number(const entry *e, void *at, const char *value, gonio_error *error) {
    static const double scales[] = {[MILLI] = 1e-3, [MICRO] = 1e-6, [PERCENT] = 1e-2};
    char *end;
    const double number = strtod(value, &end);
    if (end == value || *end != 0 || !(number >= e->low && number <= e->high) ||
        (e->kind == WHOLE && number != floor(number))) {
        char expected[80];
        snprintf(expected, sizeof expected, "%s from %g to %g", e->kind == WHOLE ? "a whole number" : "a number",
                 e->low, e->high);
        return bad(e, value, expected, error);
    }
    if (e->kind == WHOLE) {
        *(int *)at = (int)number;
    } else {
        *(double *)at = e->kind == REAL ? number : number * scales[e->kind];
    }
    return GONIO_OK;
}

static gonio_status set_text(const entry *e, char *at, const char *value, gonio_error *error) {
    if (value[0] == 0 || strlen(value) >= e->size) {
        char expected[48];
        snprintf(expected, sizeof expected, "1 to %zu characters", e->size - 1);
        return bad(e, value, expected, error);
    }
    strcpy(at, value);
    return GONIO_OK;
}

// The index of the value among the choices, each followed by a blank; -1: none.
static int choice(const char *choices, const char *value) {
    int index = 0;
    for (const char *c = choices; *c != 0; c += strcspn(c, " ") + 1, index++) {
        if (strlen(value) == strcspn(c, " ") && strncmp(c, value, strlen(value)) == 0) {
            return index;
        }
    }
    return -1;
}

static gonio_status set_choice(const entry *e, void *at, const char *value, gonio_error *error) {
    static const char *const choices[] = {
        [YES] = "0 1 ", [NO] = "0 1 ", [SIGN] = "0 1 ", [PARITY] = "N E O ", [BIAS] = "as-is pull-up pull-down "};
    const char *which = e->kind == DRIVER ? e->with : choices[e->kind];
    const int index = choice(which, value);
    if (index < 0) {
        char expected[80];
        snprintf(expected, sizeof expected, "one of: %s", which);
        return bad(e, value, expected, error);
    }
    if (e->kind == DRIVER) {
        strcpy(at, strcmp(value, "none") == 0 ? "" : value); // the rig's own
    } else if (e->kind == PARITY) {
        *(char *)at = value[0];
    } else if (e->kind == BIAS) {
        *(gonio_gpio_bias *)at = (gonio_gpio_bias)index;
    } else if (e->kind == SIGN) {
        *(int *)at = index == 1 ? -1 : 1;
    } else {
        *(bool *)at = (index == 1) == (e->kind == YES);
    }
    return GONIO_OK;
}

static gonio_status set_hex(const entry *e, int *at, const char *value, gonio_error *error) {
    char *end;
    const unsigned long number = strtoul(value, &end, 16);
    if (end == value || *end != 0 || number > 0xffff) {
        return bad(e, value, "four hexadecimal digits, as lsusb prints them", error);
    }
    *at = (int)number;
    return GONIO_OK;
}

static const char *driver_of(const hardware_settings *s, const char *section) {
    return strcmp(section, "stage") == 0 || strncmp(section, "axis ", 5) == 0 ? s->stage_driver
           : strcmp(section, "lamp") == 0                                     ? s->lamp_driver
           : strcmp(section, "meter") == 0                                    ? s->meter_driver
           : strcmp(section, "camera") == 0                                   ? s->camera_driver
           : strcmp(section, "interlock") == 0                                ? s->interlock_driver
                                                                              : "";
}

static bool applies(const hardware_settings *s, const entry *e) {
    if (e->kind == DRIVER || strcmp(e->section, "keep-out") == 0) {
        return true;
    }
    if (strcmp(e->section, "controller") == 0) {
        return strcmp(s->stage_driver, "modbus") == 0 || strcmp(s->lamp_driver, "modbus") == 0 ||
               strcmp(s->meter_driver, "modbus") == 0;
    }
    const char *driver = driver_of(s, e->section);
    return driver[0] != 0 && (e->with[0] == 0 || strcmp(e->with, driver) == 0);
}

// [keep-out NAME]: an axis's interval in degrees, "AXIS = LOW HIGH".
static gonio_status set_zone(hardware_settings *s, const char *section, const char *key, const char *value, bool *taken,
                             gonio_error *error) {
    static const char *const axes[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};
    for (int k = 0; k < GONIO_AXES; k++) {
        if (strcmp(axes[k], key) != 0) {
            continue;
        }
        *taken = true;
        const entry e = {.section = section, .key = key};
        char *end, *last;
        const double low = strtod(value, &end);
        const double high = strtod(end, &last);
        if (end == value || last == end || *last != 0 || !(low <= high)) {
            return bad(&e, value, "two angles in degrees, the lower first", error);
        }
        const int zone = gonio_keep_out_zone(&s->keep_out, section + strlen("keep-out "));
        if (zone < 0) {
            return bad(&e, section, "at most 16 zones with names of at most 31 characters", error);
        }
        s->keep_out.zones[zone].minimum_deg[k] = low;
        s->keep_out.zones[zone].maximum_deg[k] = high;
    }
    return GONIO_OK;
}

gonio_status hardware_settings_set(hardware_settings *s, const char *section, const char *key, const char *value,
                                   bool *taken, bool *shared, gonio_error *error) {
    *taken = *shared = false;
    if (strncmp(section, "keep-out ", 9) == 0) {
        return set_zone(s, section, key, value, taken, error);
    }
    for (size_t i = 0; i < COUNT; i++) {
        const entry *e = &entries[i];
        if (strcmp(e->section, section) != 0 || strcmp(e->key, key) != 0 || !applies(s, e)) {
            continue;
        }
        *taken = true;
        *shared = e->shared;
        void *at = (char *)s + e->offset;
        switch (e->kind) {
        case TEXT:
            return set_text(e, at, value, error);
        case HEX:
            return set_hex(e, at, value, error);
        case WHOLE:
        case REAL:
        case MILLI:
        case MICRO:
        case PERCENT:
            return set_number(e, at, value, error);
        default:
            return set_choice(e, at, value, error);
        }
    }
    return GONIO_OK;
}

void hardware_settings_list(const hardware_settings *s, char *text, size_t size) {
    size_t used = 0;
    text[0] = 0;
    for (size_t i = 0; i < COUNT && used < size; i++) {
        if (applies(s, &entries[i])) {
            used += (size_t)snprintf(text + used, size - used, " %s.%s", entries[i].section, entries[i].key);
        }
    }
}
