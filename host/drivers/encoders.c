// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/encoders.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/transport/clock.h"

enum { SWING_MS = 500, LOOK_MS = 20, BITS_16 = 0 };
// An axis without an encoder excuses no more than this at a homing that found lost steps elsewhere.
#define BLIND_DEG 0.01

static const char *const axis_names[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};

typedef struct encoders {
    gonio_encoders config;
    gonio_encoder_lines lines;
    gonio_modbus_bus *own[GONIO_AXES]; // the line of an axis; shared with an earlier axis of the same port
    bool known[GONIO_AXES];
    double zero[GONIO_AXES];                       // counts
    bool seen[GONIO_AXES];                         // of the two below: at the last comparison that was good
    double last[GONIO_AXES], last_rad[GONIO_AXES]; // counts, and where the stage was
    const gonio_stage_ops *stage;
    void *device;
    gonio_stage_ops ops; // with those optional ones that the stage has
} encoders;

void gonio_encoders_defaults(gonio_encoders *e) {
    for (int k = 0; k < GONIO_AXES; k++) {
        e->axes[k] = (gonio_encoder){.baud = 115200,
                                     .parity = "N",
                                     .timeout_ms = 200,
                                     .function = 3,
                                     .counts_per_deg = 1,
                                     .zero_counts = (double)NAN};
    }
}

bool gonio_encoders_any(const gonio_encoders *e) {
    bool any = false;
    for (int k = 0; k < GONIO_AXES; k++) {
        any = any || e->axes[k].encoder_deg > 0;
    }
    return any;
}

// ---- one encoder ----

static bool there(const encoders *e, int k) { return e->config.axes[k].encoder_deg > 0; }
static bool own(const encoders *e, int k) { return e->config.axes[k].slave == 0; } // the stage's
static double scale(const encoders *e, int k) { return own(e, k) ? 1 : e->config.axes[k].counts_per_deg; }

static gonio_status read_counts(encoders *e, int k, double *counts, gonio_error *error) {
    const gonio_encoder *c = &e->config.axes[k];
    uint16_t words[2] = {0};
    gonio_error why = {.line = -1, .byte = -1};
    gonio_status status;
    if (own(e, k)) {
        double rad[GONIO_AXES];
        status = e->stage->encoders(e->device, rad, &why);
        *counts = gonio_degrees(rad[k]);
    } else {
        const int n = c->bits == BITS_16 ? 1 : 2;
        gonio_modbus_bus *bus = e->own[k] != NULL ? e->own[k] : e->lines.bus;
        status = bus != NULL ? gonio_modbus_bus_read(bus, c->slave, c->function, c->address, n, words, &why)
                             : gonio_controller_read_other(e->lines.controller, c->slave, c->function, c->address, n,
                                                           words, &why);
        *counts = n == 1 ? words[0] : (double)((uint32_t)words[c->low_first] << 16 | words[1 - c->low_first]);
    }
    return status == GONIO_OK ? GONIO_OK
                              : gonio_fail(error, status, "encoder of %s: %.400s", axis_names[k], why.message);
}

// What the encoder says less what the stage says, in degrees: of all readings that the counter's length allows, the
// nearest to the stage's.
static double difference_deg(const encoders *e, int k, double counts, double position_deg) {
    const gonio_encoder *c = &e->config.axes[k];
    const double difference = (counts - e->zero[k]) / scale(e, k) - position_deg;
    const double wrap = c->wrap_counts > 0 ? c->wrap_counts : c->bits == BITS_16 ? 65536 : 4294967296;
    return own(e, k) ? difference : remainder(difference, wrap / fabs(scale(e, k)));
}

static gonio_status read_all(encoders *e, gonio_encoder_reading r[GONIO_AXES], gonio_error *error) {
    double at[GONIO_AXES];
    gonio_status status = e->stage->position(e->device, at, error);
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        r[k] = (gonio_encoder_reading){.there = there(e, k), .difference_rad = (double)NAN};
        status = r[k].there ? read_counts(e, k, &r[k].counts, error) : GONIO_OK;
        r[k].known = r[k].there && e->known[k] && isfinite(r[k].counts);
        if (status == GONIO_OK && r[k].known) {
            r[k].difference_rad = gonio_radians(difference_deg(e, k, r[k].counts, gonio_degrees(at[k])));
        }
        r[k].position_rad = at[k] + (r[k].known ? r[k].difference_rad : 0);
    }
    return status;
}

gonio_status gonio_encoders_read(void *device, gonio_encoder_reading readings[GONIO_AXES], gonio_error *error) {
    return read_all(device, readings, error);
}

// ---- comparing ----

static void tell(const encoders *e, const char *kind, const char *text) {
    if (e->lines.event != NULL) {
        e->lines.event(e->lines.event_context, kind, text);
    }
}

static gonio_status judge(const encoders *e, int k, const gonio_encoder_reading *r, gonio_error *error) {
    const double off = gonio_degrees(r->difference_rad), stage_rad = r->position_rad - r->difference_rad;
    const double moved = gonio_degrees(fabs(stage_rad - e->last_rad[k])), allowed = e->config.axes[k].encoder_deg;
    if (!r->known || fabs(off) <= allowed) {
        return GONIO_OK;
    }
    return e->seen[k] && r->counts == e->last[k] && moved > allowed
               ? gonio_fail(
                     error, GONIO_E_DEVICE,
                     "encoder of %s is frozen, or its axis is blocked: it reads %.10g as before a move of %.4g deg",
                     axis_names[k], r->counts, moved)
               : gonio_fail(
                     error, GONIO_E_MISMATCH,
                     "lost steps: %s stands at %.6g deg by its encoder, and should at %.6g deg; allowed are %g deg",
                     axis_names[k], gonio_degrees(r->position_rad), gonio_degrees(stage_rad), allowed);
}

static gonio_status look(encoders *e, gonio_encoder_reading r[GONIO_AXES], gonio_error *error) {
    gonio_status status = read_all(e, r, error);
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        status = judge(e, k, &r[k], error);
    }
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        e->seen[k] = r[k].known;
        e->last[k] = r[k].counts;
        e->last_rad[k] = r[k].position_rad - r[k].difference_rad;
    }
    return status;
}

// Arms may still swing.
static gonio_status compare(encoders *e, double difference_rad[GONIO_AXES], gonio_error *error) {
    const gonio_deadline deadline = gonio_deadline_in_ms(SWING_MS);
    gonio_encoder_reading r[GONIO_AXES];
    gonio_status status = look(e, r, error);
    while ((status == GONIO_E_MISMATCH || status == GONIO_E_DEVICE) && gonio_deadline_left_ms(deadline) > 0) {
        gonio_clock_sleep_ms(LOOK_MS);
        status = look(e, r, error);
    }
    for (int k = 0; k < GONIO_AXES && difference_rad != NULL; k++) {
        difference_rad[k] = r[k].difference_rad;
    }
    return status;
}

static gonio_status guard_verify(void *device, double difference_rad[GONIO_AXES], gonio_error *error) {
    return compare(device, difference_rad, error);
}

// ---- the zero ----

static gonio_status take_zero(encoders *e, bool all, gonio_error *error) {
    double at[GONIO_AXES];
    gonio_status status = e->stage->position(e->device, at, error);
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        double counts = 0;
        const gonio_encoder *c = &e->config.axes[k];
        if (!there(e, k) || own(e, k) || isfinite(c->zero_counts) || (e->known[k] && !all)) {
            continue;
        }
        status = read_counts(e, k, &counts, error);
        e->zero[k] = counts - c->counts_per_deg * gonio_degrees(at[k]);
        e->known[k] = status == GONIO_OK;
    }
    return status;
}

static gonio_status homed(encoders *e, gonio_error *error) {
    gonio_encoder_reading r[GONIO_AXES];
    const gonio_status status = take_zero(e, true, error);
    memset(e->seen, 0, sizeof e->seen);
    const gonio_status good = status == GONIO_OK ? look(e, r, error) : status;
    return good == GONIO_E_MISMATCH // by zero_counts: all others have just been made to agree
               ? gonio_fail(error, GONIO_E_DEVICE, "%s",
                            "after homing an encoder with zero_counts says another position: the home switch or the "
                            "encoder has moved")
               : good;
}

static gonio_status guard_home(void *device, double timeout_s, gonio_error *error) {
    encoders *e = device;
    const gonio_status status = e->stage->home(e->device, timeout_s, error);
    return status == GONIO_OK ? homed(e, error) : status;
}

// ---- lost steps ----

// A homing found by how much each axis had drifted; the encoders had said by how much. What both say, the encoder found
// when it happened, and nothing before it is in doubt; what they do not agree about is a drift that nobody can date.
static gonio_status explain(encoders *e, const gonio_encoder_reading before[GONIO_AXES], gonio_status status,
                            double difference_rad[GONIO_AXES], gonio_error *error) {
    bool explained = true;
    for (int k = 0; k < GONIO_AXES; k++) {
        const double found = gonio_degrees(difference_rad[k]), said = gonio_degrees(before[k].difference_rad);
        if (!isfinite(found) || !before[k].known) {
            explained = explained && fabs(found) <= BLIND_DEG;
            continue;
        }
        difference_rad[k] = gonio_radians(found + said);
        if (fabs(found + said) > e->config.axes[k].encoder_deg) {
            return gonio_fail(error, GONIO_E_MISMATCH,
                              "%s had drifted by %.4g deg since the last homing, and its encoder says %.4g deg",
                              axis_names[k], found, -said);
        }
    }
    if (status == GONIO_E_MISMATCH && explained) {
        tell(e, "lost-steps", "the homing found what the encoders had said; the poses before it stand");
    }
    return explained ? GONIO_OK : status;
}

static gonio_status guard_audit(void *device, double timeout_s, double difference_rad[GONIO_AXES], gonio_error *error) {
    encoders *e = device;
    gonio_encoder_reading before[GONIO_AXES];
    gonio_status status = read_all(e, before, error);
    status = status == GONIO_OK ? e->stage->audit(e->device, timeout_s, difference_rad, error) : status;
    if (status != GONIO_OK && status != GONIO_E_MISMATCH) {
        return status;
    }
    status = explain(e, before, status, difference_rad, error);
    const gonio_status zero = homed(e, error);
    return zero == GONIO_OK ? status : zero;
}

// Where nothing has told the zero, where the axis stands before the move does: the move itself is then compared.
static gonio_status guard_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                               double timeout_s, gonio_error *error) {
    encoders *e = device;
    gonio_status status = take_zero(e, false, error);
    status = status == GONIO_OK ? e->stage->move(e->device, target_rad, id, stamp, timeout_s, error) : status;
    return status == GONIO_OK ? compare(e, NULL, error) : status;
}

// ---- what is the stage's own ----

static gonio_status guard_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    const encoders *e = device;
    return e->stage->position(e->device, position_rad, error);
}

static gonio_status guard_stop(void *device, gonio_error *error) {
    const encoders *e = device;
    return e->stage->stop(e->device, error);
}

static double guard_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]) {
    const encoders *e = device;
    return e->stage->duration_s(e->device, from_rad, to_rad);
}

static gonio_status guard_check(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                                gonio_error *error) {
    const encoders *e = device;
    return e->stage->check(e->device, from_rad, to_rad, error);
}

static bool guard_turns(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES],
                        double turn_rad[GONIO_AXES]) {
    const encoders *e = device;
    return e->stage->turns(e->device, from_rad, to_rad, turn_rad);
}

static void close_lines(encoders *e) {
    for (int k = GONIO_AXES - 1; k >= 0; k--) {
        bool shared = false;
        for (int j = 0; j < k; j++) {
            shared = shared || e->own[j] == e->own[k];
        }
        if (!shared) {
            gonio_modbus_bus_close(e->own[k]);
        }
    }
}

static void guard_close(void *device) {
    encoders *e = device;
    e->stage->close(e->device);
    close_lines(e);
    free(e);
}

static const gonio_stage_ops guard_ops = {.home = guard_home,
                                          .move = guard_move,
                                          .position = guard_position,
                                          .stop = guard_stop,
                                          .duration_s = guard_duration_s,
                                          .close = guard_close,
                                          .verify = guard_verify};

// ---- opening ----

static gonio_status open_line(encoders *e, int k, gonio_error *error) {
    const gonio_encoder *c = &e->config.axes[k];
    if (!there(e, k)) {
        return GONIO_OK;
    }
    e->known[k] = own(e, k) || isfinite(c->zero_counts);
    e->zero[k] = own(e, k) ? 0 : c->zero_counts;
    if (own(e, k)) {
        return e->stage->encoders != NULL
                   ? GONIO_OK
                   : gonio_fail(error, GONIO_E_INPUT,
                                "[encoder %s] slave: this stage has no encoder of its own; expected the encoder's "
                                "Modbus address",
                                axis_names[k]);
    }
    if (c->counts_per_deg == 0) {
        return gonio_fail(error, GONIO_E_INPUT, "[encoder %s] counts_per_deg: expected a number that is not 0",
                          axis_names[k]);
    }
    if (c->port[0] == 0) {
        return e->lines.controller != NULL || e->lines.bus != NULL
                   ? GONIO_OK
                   : gonio_fail(error, GONIO_E_INPUT, "[encoder %s] port: the stage here has no Modbus line",
                                axis_names[k]);
    }
    for (int j = 0; j < k; j++) {
        if (there(e, j) && strcmp(e->config.axes[j].port, c->port) == 0) {
            e->own[k] = e->own[j];
            return GONIO_OK;
        }
    }
    gonio_modbus_bus_config line;
    gonio_modbus_bus_defaults(&line);
    snprintf(line.modbus.port, sizeof line.modbus.port, "%s", c->port);
    line.modbus.baud = c->baud;
    line.modbus.parity = c->parity;
    line.modbus.timeout_ms = c->timeout_ms;
    return gonio_modbus_bus_open(&line, &e->own[k], error);
}

gonio_status gonio_encoders_guard(const gonio_encoders *config, const gonio_encoder_lines *lines, gonio_rig *rig,
                                  void **device, gonio_error *error) {
    encoders *e = calloc(1, sizeof *e);
    if (e == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for encoders");
    }
    const gonio_stage_ops *stage = rig->stage;
    e->config = *config;
    e->lines = *lines;
    e->stage = stage;
    e->device = rig->stage_device;
    gonio_encoder_reading first[GONIO_AXES];
    gonio_status status = GONIO_OK;
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        status = open_line(e, k, error);
    }
    status = status == GONIO_OK ? read_all(e, first, error) : status; // does everyone answer?
    if (status != GONIO_OK) {
        close_lines(e);
        free(e);
        return status;
    }
    e->ops = guard_ops;
    e->ops.name = stage->name;
    e->ops.independent = stage->independent;
    e->ops.real = stage->real;
    e->ops.check = stage->check != NULL ? guard_check : NULL;
    e->ops.turns = stage->turns != NULL ? guard_turns : NULL;
    e->ops.audit = stage->audit != NULL ? guard_audit : NULL;
    rig->stage = &e->ops;
    rig->stage_device = *device = e;
    return GONIO_OK;
}

// ---- keys ----

static bool parse_address(const char *text, void *value) {
    char *end;
    const long address = strtol(text, &end, 0);
    if (end == text || *end != 0 || address < 0 || address > 65535) {
        return false;
    }
    *(int *)value = (int)address;
    return true;
}

static const gonio_key_form addresses = {"a register's address, 0 to 65535 or 0x0000 to 0xffff", parse_address, NULL};

GONIO_KEY_NAMES(parities, "N", "E", "O")
GONIO_KEY_NAMES(widths, "16", "32")
GONIO_KEY_NAMES(orders, "high-first", "low-first")
#define ONE(title, number, text, kind, member)                                                                         \
    .section = "encoder " title, GONIO_KEY_NAMED(gonio_encoders, axes[number].member, text, kind)
#define ENCODER(title, number)                                                                                         \
    {ONE(title, number, "encoder_deg", REAL, encoder_deg), 0, 45}, {ONE(title, number, "port", LINE, port)},           \
        {ONE(title, number, "baud", INTEGER, baud), 1200, 1e6},                                                        \
        {ONE(title, number, "parity", NAME, parity), .names = parities},                                               \
        {ONE(title, number, "timeout_ms", INTEGER, timeout_ms), 5, 10000},                                             \
        {ONE(title, number, "slave", INTEGER, slave), 0, 247},                                                         \
        {ONE(title, number, "register", OWN, address), .form = &addresses},                                            \
        {ONE(title, number, "function", INTEGER, function), 3, 4},                                                     \
        {ONE(title, number, "bits", CHOICE, bits), .names = widths},                                                   \
        {ONE(title, number, "words", CHOICE, low_first), .names = orders},                                             \
        {ONE(title, number, "counts_per_deg", REAL, counts_per_deg), -1e9, 1e9},                                       \
        {ONE(title, number, "wrap_counts", REAL, wrap_counts), 0, 4294967296}, {                                       \
        ONE(title, number, "zero_counts", REAL, zero_counts), -4294967296, 4294967296                                  \
    }
const gonio_key gonio_encoder_keys[] = {ENCODER("light_theta", GONIO_LIGHT_THETA),
                                        ENCODER("light_phi", GONIO_LIGHT_PHI),
                                        ENCODER("camera_theta", GONIO_CAMERA_THETA),
                                        ENCODER("camera_phi", GONIO_CAMERA_PHI),
                                        {0}};
