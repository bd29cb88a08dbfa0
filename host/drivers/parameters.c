// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/parameters.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "base/keys.h"
#include "base/number.h"
#include "base/text.h"
#include "host/drivers/controller.h"
#include "host/drivers/stage_parameters.h"

GONIO_KEY_NAMES(axes, "light_theta", "light_phi", "camera_theta", "camera_phi")
#define OF_AXES(what) what "_light_theta", what "_light_phi", what "_camera_theta", what "_camera_phi"
GONIO_KEY_NAMES(outputs, "shutter", "lamp", "trigger")
GONIO_KEY_NAMES(contacts, OF_AXES("home"), OF_AXES("limit_min"), OF_AXES("limit_max"), "estop", "door")

const char *const *gonio_parameter_axes(void) { return axes(); }
const char *const *gonio_parameter_contacts(void) { return contacts(); }
const char *const *gonio_parameter_outputs(void) { return outputs(); }

// ---- one value ----

const controller_register_info *gonio_parameter_find(const char *name) {
    const controller_register_info *r;
    for (int i = 0; (r = gonio_controller_register_at(i)) != NULL; i++) {
        if (r->parameter && strcmp(r->name, name) == 0) {
            return r;
        }
    }
    return NULL;
}

double gonio_parameter_counts(const controller_register_info *p) {
    char *end;
    const double unit = gonio_number_parse(p->unit, &end);
    return end != p->unit && *end == ' ' ? round(1 / unit) : 1;
}

static bool of_bits(const controller_register_info *p) {
    const char *last = strrchr(p->unit, ' ');
    return last != NULL && strcmp(last, " bits") == 0;
}

const char *gonio_parameter_unit(const controller_register_info *p) {
    return of_bits(p) ? "" : gonio_parameter_counts(p) > 1 ? strchr(p->unit, ' ') + 1 : p->unit;
}

typedef union number {
    int bits;
    double real;
} number;

static gonio_key key_of(const controller_register_info *p) {
    const double counts = gonio_parameter_counts(p);
    gonio_key key = {.name = p->name,
                     .argument = p->name,
                     .kind = GONIO_KEY_REAL,
                     .size = sizeof(double),
                     .low = (double)p->minimum / counts,
                     .high = (double)p->maximum / counts};
    if (of_bits(p)) {
        key.kind = GONIO_KEY_FLAGS;
        key.size = sizeof(int);
        key.names = p->unit[0] == 'a' ? axes : p->unit[0] == 'o' ? outputs : contacts;
    }
    return key;
}

void gonio_parameter_print(const controller_register_info *p, int64_t value, char *text, size_t size) {
    const gonio_key key = key_of(p);
    number n;
    if (key.kind == GONIO_KEY_FLAGS) {
        n.bits = (int)value;
    } else {
        n.real = (double)value / gonio_parameter_counts(p);
    }
    gonio_key_print(&key, &n, text, size);
}

void gonio_parameter_bounds(const controller_register_info *p, char *text, size_t size) {
    const gonio_key key = key_of(p);
    if (key.kind == GONIO_KEY_FLAGS) {
        gonio_key_expected(&key, text, size);
    } else {
        snprintf(text, size, "%.10g to %.10g", key.low, key.high);
    }
}

gonio_status gonio_parameter_parse(const controller_register_info *p, const char *text, int64_t *value,
                                   gonio_error *error) {
    const gonio_key key = key_of(p);
    const double counts = gonio_parameter_counts(p);
    number n;
    char expected[400];
    gonio_key_expected(&key, expected, sizeof expected);
    if (gonio_key_parse(&key, &n, text, NULL) != GONIO_OK) {
        const char *unit = gonio_parameter_unit(p);
        return gonio_fail(error, GONIO_E_USAGE, "%s: found '%.60s', expected %s%s%s", p->name, text, expected,
                          unit[0] != 0 ? " " : "", unit);
    }
    *value = key.kind == GONIO_KEY_FLAGS ? n.bits : llround(n.real * counts);
    if (key.kind == GONIO_KEY_REAL && fabs(n.real * counts - (double)*value) > 1e-6 * fmax(1, fabs(n.real * counts))) {
        return gonio_fail(error, GONIO_E_USAGE, "%s: found '%.60s', expected a multiple of %g %s", p->name, text,
                          1 / counts, gonio_parameter_unit(p));
    }
    return GONIO_OK;
}

gonio_status gonio_parameter_read(gonio_controller *c, const controller_register_info *p, int64_t *values,
                                  gonio_error *error) {
    uint16_t words[4 * GONIO_CONTROLLER_AXES];
    const gonio_status status = gonio_controller_read(c, p->address, p->words * p->count, words, error);
    for (int k = 0; k < p->count && status == GONIO_OK; k++) {
        const int64_t value = gonio_controller_unpack(words + k * p->words, p->words);
        values[k] = p->is_signed ? value : (int64_t)((uint64_t)value & (p->words == 1 ? UINT16_MAX : UINT32_MAX));
    }
    return status;
}

gonio_status gonio_parameter_write(gonio_controller *c, const controller_register_info *p, int index, int64_t value,
                                   gonio_error *error) {
    uint16_t words[4];
    gonio_controller_pack(words, p->words, value);
    return gonio_controller_write(c, p->address + index * p->words, p->words, words, error);
}

// ---- keys of a rig file ----

typedef struct row {
    const char *key, *shown; // "settle_ms", "[controller] settle_ms"
    size_t offset;
    bool integer;
    int address;
    double times;
} row;

enum { KIND_FLAGS = 1, KIND_INTEGER = 1, KIND_REAL = 0 };
static const row rows[] = {
#define PARAMETER(key, kind, type, register, low, high, times)                                                         \
    {#key, "[controller] " #key, offsetof(gonio_controller_parameters, key), KIND_##kind, CONTROLLER_##register, times},
#include "host/drivers/controller_parameters.def"
};
enum { ROWS = sizeof rows / sizeof *rows };

void gonio_controller_parameters_defaults(gonio_controller_parameters *parameters) {
    for (int i = 0; i < ROWS; i++) {
        char *at = (char *)parameters + rows[i].offset;
        if (rows[i].integer) {
            memcpy(at, &(int){-1}, sizeof(int));
        } else {
            memcpy(at, &(double){(double)NAN}, sizeof(double));
        }
    }
}

static bool given(const row *r, const gonio_controller_parameters *parameters, int64_t *value) {
    const char *at = (const char *)parameters + r->offset;
    if (r->integer) {
        *value = *(const int *)at;
        return *value >= 0;
    }
    double real;
    memcpy(&real, at, sizeof real);
    real *= r->times;
    *value = isfinite(real) ? llround(real) : 0;
    return isfinite(real);
}

bool gonio_controller_parameters_give(const gonio_controller_parameters *parameters, int address) {
    int64_t unused;
    for (int i = 0; i < ROWS; i++) {
        if (rows[i].address == address) {
            return given(&rows[i], parameters, &unused);
        }
    }
    return address == CONTROLLER_deadman; // by deadman_s, always
}

static gonio_status write_row(gonio_controller *c, const row *r, int64_t wanted, gonio_error *error) {
    const controller_register_info *p = gonio_controller_register(r->address);
    int64_t held = 0;
    const gonio_status status = gonio_parameter_read(c, p, &held, error);
    if (status != GONIO_OK || held == wanted) {
        return status;
    }
    char was[300], is[300];
    const char *unit = gonio_parameter_unit(p);
    gonio_parameter_print(p, held, was, sizeof was);
    gonio_parameter_print(p, wanted, is, sizeof is);
    gonio_controller_tell(c, "parameters", "%s: the controller had %s%s%s, the rig file has %s%s%s%s", p->name, was,
                          unit[0] != 0 ? " " : "", unit, is, unit[0] != 0 ? " " : "", unit,
                          r->address == CONTROLLER_direction_invert ? "; home those axes again" : "");
    return gonio_parameter_write(c, p, 0, wanted, error);
}

gonio_status gonio_controller_parameters_write(gonio_controller *c, const gonio_controller_parameters *parameters,
                                               gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int i = 0; i < ROWS && status == GONIO_OK; i++) {
        int64_t wanted;
        if (given(&rows[i], parameters, &wanted)) {
            status = write_row(c, &rows[i], wanted, error);
        }
    }
    return status;
}

const char *gonio_parameter_key(const controller_register_info *p, const char **why) {
    static const struct {
        int address;
        const char *key, *why;
    } others[] = {
        {CONTROLLER_deadman, "[controller] deadman_s", NULL},
        {CONTROLLER_home_pressed, "[stage] home_pressed", NULL},
        {CONTROLLER_slave_address, NULL, "slave of [controller] says how to reach it, and so cannot change it"},
        {CONTROLLER_baud, NULL, "baud of [controller] says how to reach it, and so cannot change it"},
    };
    if (why != NULL) {
        *why = NULL;
    }
    for (int i = 0; i < ROWS; i++) {
        if (rows[i].address == p->address) {
            return rows[i].shown;
        }
    }
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        if (others[i].address == p->address && why != NULL) {
            *why = others[i].why;
        }
        if (others[i].address == p->address) {
            return others[i].key;
        }
    }
    return gonio_stage_parameter_key(p->address);
}
