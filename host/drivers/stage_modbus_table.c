// SPDX-License-Identifier: BSD-3-Clause
// A drive is asked what it does in every turn of waiting: an alarm ends a move with its number and name, at whatever
// moment it comes. Commands may be written twice where an answer is lost: targets are absolute.
#include "host/drivers/stage_modbus_table.h"

#include <math.h>
#include <stdlib.h>

#include "host/drivers/driver.h"

#define axis_names gonio_free_axis_names

typedef struct stage {
    gonio_free_stage free;
    gonio_stage_modbus_table_config config;
    gonio_modbus_table table;
    gonio_modbus_bus *bus;
    bool going; // a move was begun, which must arrive
} stage;

static stage *stage_of(gonio_free_stage *free) { return (stage *)free; }

void gonio_stage_modbus_table_defaults(gonio_stage_modbus_table_config *config) {
    *config = (gonio_stage_modbus_table_config){.table = ""};
    gonio_modbus_bus_defaults(&config->line);
    for (int k = 0; k < GONIO_AXES; k++) {
        config->axes[k].free = gonio_free_axis_default();
    }
}

// ---- registers ----

static gonio_status name_axis(int k, gonio_status status, const gonio_error *why, gonio_error *error) {
    return gonio_fail(error, status, "%s: %.400s", axis_names[k], why->message);
}

static int address_of(const stage *s, int k, const gonio_modbus_register *r) {
    return r->address + (r->shared ? 0 : s->config.axes[k].offset);
}

static gonio_status read_register(stage *s, int k, const gonio_modbus_register *r, int64_t *value, gonio_error *error) {
    uint16_t words[2] = {0};
    gonio_error why = {.line = -1, .byte = -1};
    const gonio_status status = gonio_modbus_bus_read(s->bus, s->config.axes[k].slave, s->table.read,
                                                      address_of(s, k, r), r->words, words, &why);
    *value = gonio_modbus_unpack(&s->table, r, words);
    return status == GONIO_OK ? GONIO_OK : name_axis(k, status, &why, error);
}

static gonio_status write_register(stage *s, int k, const gonio_modbus_register *r, int64_t value, gonio_error *error) {
    uint16_t words[2];
    gonio_error why = {.line = -1, .byte = -1};
    gonio_modbus_pack(&s->table, r, value, words);
    const gonio_status status = gonio_modbus_bus_write(s->bus, s->config.axes[k].slave, s->table.write,
                                                       address_of(s, k, r), r->words, words, &why);
    return status == GONIO_OK ? GONIO_OK : name_axis(k, status, &why, error);
}

static gonio_status holds(stage *s, int k, const gonio_modbus_condition *condition, bool *yes, gonio_error *error) {
    gonio_status status = GONIO_OK;
    int64_t value = 0;
    *yes = false;
    for (int i = 0; status == GONIO_OK && i < condition->n && !*yes; i++) {
        const struct gonio_modbus_term *t = &condition->terms[i];
        const bool again = i > 0 && t->at.address == t[-1].at.address && t->at.words == t[-1].at.words;
        status = again ? GONIO_OK : read_register(s, k, &t->at, &value, error);
        const uint32_t bits = (uint32_t)value & t->mask;
        *yes = status == GONIO_OK && (t->equals ? bits == t->value : bits != 0);
    }
    return status;
}

static gonio_status command(stage *s, int k, const gonio_modbus_command *c, double units, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; status == GONIO_OK && i < c->n; i++) {
        const struct gonio_modbus_item *w = &c->writes[i];
        const int speed = s->config.axes[k].speed;
        if (w->what == GONIO_MODBUS_TARGET) {
            status = write_register(s, k, &s->table.target, llround(units), error);
        } else if (w->what == GONIO_MODBUS_NUMBER) {
            status = write_register(s, k, &w->at, w->value, error);
        } else if (speed > 0) {
            status = write_register(s, k, &s->table.speed, speed, error);
        }
    }
    return status;
}

static gonio_status command_all(stage *s, const gonio_modbus_command *c, const double units[GONIO_AXES],
                                gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; status == GONIO_OK && k < GONIO_AXES; k++) {
        status = s->free.axes[k].there ? command(s, k, c, units != NULL ? units[k] : 0, error) : GONIO_OK;
    }
    return status;
}

// ---- faults ----

static gonio_status alarm_of(stage *s, int k, gonio_error *error) {
    int64_t number = 0;
    if (s->table.fault.there) {
        const gonio_status status = read_register(s, k, &s->table.fault, &number, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    char text[200];
    gonio_modbus_fault_text(&s->table, (uint32_t)number, text, sizeof text);
    return gonio_fail(error, GONIO_E_DEVICE, "%s: alarm 0x%llx%s%s of its drive; home it when its cause is gone",
                      axis_names[k], (long long)number, text[0] != 0 ? ", " : "", text);
}

static gonio_status check_alarm(stage *s, int k, gonio_error *error) {
    bool alarm = false, limit = false;
    gonio_status status = holds(s, k, &s->table.alarm, &alarm, error);
    if (status == GONIO_OK && alarm) {
        return alarm_of(s, k, error);
    }
    status = status == GONIO_OK && s->going ? holds(s, k, &s->table.limit, &limit, error) : status;
    return limit ? gonio_fail(error, GONIO_E_DEVICE, "%s: its drive is on a limit switch", axis_names[k]) : status;
}

// ---- what the axes do with it ----

static gonio_status state_of(stage *s, int k, gonio_free_state *now, gonio_error *error) {
    bool moving = false, yes = true;
    *now = GONIO_FREE_IDLE;
    gonio_status status = check_alarm(s, k, error);
    status = status == GONIO_OK ? holds(s, k, &s->table.moving, &moving, error) : status;
    if (status == GONIO_OK && !moving && s->going && s->table.arrived.n > 0) {
        status = holds(s, k, &s->table.arrived, &yes, error);
        moving = !yes;
    }
    if (status == GONIO_OK && !moving && s->table.homed.n > 0 && !s->config.absolute) {
        status = holds(s, k, &s->table.homed, &yes, error);
        *now = yes ? GONIO_FREE_IDLE : GONIO_FREE_UNHOMED;
    }
    *now = moving ? GONIO_FREE_BUSY : *now;
    return status;
}

static gonio_status drive_state(gonio_free_stage *free, gonio_free_state *all, gonio_error *error) {
    stage *s = stage_of(free);
    gonio_status status = GONIO_OK;
    *all = GONIO_FREE_IDLE;
    for (int k = 0; status == GONIO_OK && k < GONIO_AXES; k++) {
        gonio_free_state one = GONIO_FREE_IDLE;
        status = free->axes[k].there ? state_of(s, k, &one, error) : GONIO_OK;
        *all = one == GONIO_FREE_BUSY || (one == GONIO_FREE_UNHOMED && *all != GONIO_FREE_BUSY) ? one : *all;
    }
    return status;
}

static gonio_status drive_position(gonio_free_stage *free, int axis, double *units, gonio_error *error) {
    stage *s = stage_of(free);
    int64_t value = 0;
    const gonio_status status = read_register(s, axis, &s->table.position, &value, error);
    *units = (double)value;
    return status;
}

// Homing is asked for, so a standing alarm is cleared first, if its cause is gone.
static gonio_status drive_home(gonio_free_stage *free, double timeout_s, gonio_error *error) {
    (void)timeout_s;
    stage *s = stage_of(free);
    gonio_status status = GONIO_OK;
    s->going = false;
    for (int k = 0; status == GONIO_OK && k < GONIO_AXES; k++) {
        bool alarm = false;
        status = free->axes[k].there ? holds(s, k, &s->table.alarm, &alarm, error) : GONIO_OK;
        status = status == GONIO_OK && alarm ? command(s, k, &s->table.reset, 0, error) : status;
        status = status == GONIO_OK && free->axes[k].there ? check_alarm(s, k, error) : status;
    }
    return status == GONIO_OK ? command_all(s, &s->table.home, NULL, error) : status;
}

static gonio_status drive_go(gonio_free_stage *free, const double units[GONIO_AXES], gonio_error *error) {
    stage *s = stage_of(free);
    for (int k = 0; k < GONIO_AXES; k++) {
        const double most = s->table.target.words == 2 ? 2147483647.0 : 32767.0;
        if (free->axes[k].there && !(fabs(units[k]) <= most)) {
            return gonio_fail(error, GONIO_E_RANGE, "%s: %.0f units are more than its register `target` holds",
                              axis_names[k], units[k]);
        }
    }
    s->going = true;
    return command_all(s, &s->table.move, units, error);
}

// All of them are told, whatever one answers.
static gonio_status drive_stop(gonio_free_stage *free, gonio_error *error) {
    stage *s = stage_of(free);
    gonio_status status = GONIO_OK;
    s->going = false;
    if (s->table.stop.n == 0) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "stage: the table of these drives has no stop; they end their move");
    }
    for (int k = 0; k < GONIO_AXES; k++) {
        gonio_error why = {.line = -1, .byte = -1};
        const gonio_status one = free->axes[k].there ? command(s, k, &s->table.stop, 0, &why) : GONIO_OK;
        if (one != GONIO_OK && status == GONIO_OK) {
            status = gonio_fail(error, one, "%s", why.message);
        }
    }
    gonio_free_state now;
    return status == GONIO_OK ? gonio_free_come_to_rest(free, &now, error) : status;
}

static void drive_close(gonio_free_stage *free_stage) {
    stage *s = stage_of(free_stage);
    gonio_modbus_bus_close(s->bus);
    free(s);
}

static bool drive_tells_homed(const gonio_free_stage *free) { return ((const stage *)free)->table.homed.n > 0; }

static const gonio_free_drive drive = {drive_home,     drive_go,    drive_stop,       drive_state,
                                       drive_position, drive_close, drive_tells_homed};

const gonio_stage_ops gonio_stage_modbus_table = {.name = "modbus-table", GONIO_FREE_STAGE_OPS};

// ---- opening ----

gonio_modbus_bus *gonio_stage_modbus_table_bus(const void *device) { return ((const stage *)device)->bus; }

gonio_status gonio_stage_modbus_table_open(const gonio_stage_modbus_table_config *config,
                                           const gonio_driver_context *context, void **device, gonio_error *error) {
    stage *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a stage");
    }
    s->config = *config;
    s->free.drive = &drive;
    s->free.absolute = config->absolute;
    gonio_free_watch(&s->free, context);
    for (int k = 0; k < GONIO_AXES; k++) {
        s->free.axes[k] = config->axes[k].free;
        s->free.axes[k].there = config->axes[k].slave > 0;
    }
    gonio_status status = gonio_free_check_config(s->free.axes, "slave: no axis has a drive's Modbus address", error);
    status = status == GONIO_OK ? gonio_modbus_table_read(config->table, &config->texts, &s->table, error) : status;
    status = status == GONIO_OK ? gonio_modbus_bus_open(&config->line, &s->bus, error) : status;
    status = status == GONIO_OK ? command_all(s, &s->table.open, NULL, error) : status;
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) { // does everyone answer?
        int64_t value;
        status = s->free.axes[k].there ? read_register(s, k, &s->table.position, &value, error) : GONIO_OK;
    }
    if (status != GONIO_OK) {
        drive_close(&s->free);
        return status;
    }
    *device = s;
    return GONIO_OK;
}

typedef gonio_stage_modbus_table_config settings;

GONIO_KEY_NAMES(parities, "N", "E", "O")
#define KEY(text, kind, member) .section = "stage", GONIO_KEY_NAMED(settings, member, text, kind)
#define TEXT(name)                                                                                                     \
    { .section = "drive", GONIO_KEY_NAMED(settings, texts.name, #name, LINE) }
#define AXIS(title, number)                                                                                            \
    {GONIO_FREE_KEY(settings, title, "slave", INTEGER, axes[number].slave), 0, 247},                                   \
        {GONIO_FREE_KEY(settings, title, "offset", INTEGER, axes[number].offset), 0, 65535},                           \
        {GONIO_FREE_KEY(settings, title, "drive_speed", INTEGER, axes[number].speed), 0, 2147483647},                  \
        GONIO_FREE_KEYS(settings, title, axes[number].free)
static const gonio_key keys[] = {{KEY("port", LINE, line.modbus.port)},
                                 {KEY("baud", INTEGER, line.modbus.baud), 1200, 1e6},
                                 {KEY("parity", NAME, line.modbus.parity), .names = parities},
                                 {KEY("timeout_ms", INTEGER, line.modbus.timeout_ms), 5, 10000},
                                 {KEY("retries", INTEGER, line.retries), 0, 100},
                                 {KEY("replug_s", REAL, line.replug_s), 0, 3600},
                                 {KEY("table", LINE, table)},
                                 {KEY("absolute", BOOLEAN, absolute)},
                                 {KEY("record", LINE, line.record)},
                                 {KEY("replay", LINE, line.replay)},
                                 TEXT(read),
                                 TEXT(write),
                                 TEXT(words),
                                 TEXT(target),
                                 TEXT(speed),
                                 TEXT(position),
                                 TEXT(fault),
                                 TEXT(open),
                                 TEXT(move),
                                 TEXT(home),
                                 TEXT(stop),
                                 TEXT(reset),
                                 TEXT(moving),
                                 TEXT(homed),
                                 TEXT(alarm),
                                 TEXT(arrived),
                                 TEXT(limit),
                                 TEXT(faults),
                                 AXIS("axis light_theta", GONIO_LIGHT_THETA),
                                 AXIS("axis light_phi", GONIO_LIGHT_PHI),
                                 AXIS("axis camera_theta", GONIO_CAMERA_THETA),
                                 AXIS("axis camera_phi", GONIO_CAMERA_PHI),
                                 {0}};

static void defaults(void *config) { gonio_stage_modbus_table_defaults(config); }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    return gonio_stage_modbus_table_open(config, context, device, error);
}

const gonio_driver gonio_driver_stage_modbus_table = {.name = "modbus-table",
                                                      .device = GONIO_DEVICE_STAGE,
                                                      .summary = "axes of stepper drives with Modbus registers",
                                                      .keys = keys,
                                                      .settings = sizeof(settings),
                                                      .defaults = defaults,
                                                      .ops = &gonio_stage_modbus_table,
                                                      .open = make};
