// SPDX-License-Identifier: BSD-3-Clause
#include "host/drivers/stage_parameters.h"

#include <math.h>
#include <string.h>

#include "host/drivers/controller_map.h"

const char *const gonio_stage_axis_names[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};

typedef enum rounding { NEAREST, DOWN, UP } rounding;
typedef enum unit { NUMBER, THOUSANDTHS, STEPS } unit; // STEPS: the rig file's value times steps a degree

typedef struct row {
    const char *key, *shown;
    size_t offset; // in gonio_axis_config: a double, or an int that is -1 where it is not given
    bool integer;
    unit unit;
    rounding rounding;
    int address;
    bool unhomes;
} row;

#define ROW(key, integer, unit, rounding, name, unhomes)                                                               \
    { #key, "[axis ...] " #key, offsetof(gonio_axis_config, key), integer, unit, rounding, CONTROLLER_##name, unhomes }
static const row rows[GONIO_AXIS_PARAMETERS] = {
    [GONIO_PARAMETER_STEPS_PER_DEG] = ROW(steps_per_deg, false, THOUSANDTHS, NEAREST, steps_per_deg, true),
    [GONIO_PARAMETER_SPEED] = ROW(speed_deg_per_s, false, STEPS, NEAREST, speed_max, false),
    [GONIO_PARAMETER_ACCELERATION] = ROW(acceleration_deg_per_s2, false, STEPS, NEAREST, acceleration, false),
    [GONIO_PARAMETER_JERK] = ROW(jerk_deg_per_s3, false, STEPS, NEAREST, jerk, false),
    [GONIO_PARAMETER_MIN] = ROW(min_deg, false, STEPS, DOWN, soft_min, false),
    [GONIO_PARAMETER_MAX] = ROW(max_deg, false, STEPS, UP, soft_max, false),
    [GONIO_PARAMETER_BACKLASH] = ROW(backlash_deg, false, STEPS, NEAREST, backlash, false),
    [GONIO_PARAMETER_HOME] = ROW(home_deg, false, STEPS, NEAREST, home_position, true),
    [GONIO_PARAMETER_HOME_FAST] = ROW(home_fast_deg_per_s, false, STEPS, NEAREST, home_fast, false),
    [GONIO_PARAMETER_HOME_SLOW] = ROW(home_slow_deg_per_s, false, STEPS, NEAREST, home_slow, false),
    [GONIO_PARAMETER_HOME_TRAVEL] = ROW(home_travel_deg, false, STEPS, NEAREST, home_travel, false),
    [GONIO_PARAMETER_HOME_BACKOFF] = ROW(home_backoff_deg, false, STEPS, NEAREST, home_backoff, false),
    [GONIO_PARAMETER_HOME_ORDER] = ROW(home_order, true, NUMBER, NEAREST, home_order, false),
    [GONIO_PARAMETER_HOME_UP] = ROW(home_up, true, NUMBER, NEAREST, home_up, true)};

// ---- what the controller holds ----

enum { FIRST = CONTROLLER_steps_per_deg, MIDDLE = CONTROLLER_backlash, END = CONTROLLER_home_pressed + 1 };
_Static_assert((int)MIDDLE - (int)FIRST <= 125 && (int)END - (int)MIDDLE <= 125, "two reads tell all");

gonio_status gonio_stage_parameters_read(gonio_controller *c, gonio_stage_parameters *held, gonio_error *error) {
    uint16_t words[END - FIRST];
    gonio_status status = gonio_controller_read(c, FIRST, MIDDLE - FIRST, words, error);
    if (status == GONIO_OK) {
        status = gonio_controller_read(c, MIDDLE, END - MIDDLE, words + (MIDDLE - FIRST), error);
    }
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        for (int i = 0; i < GONIO_AXIS_PARAMETERS; i++) {
            const controller_register_info *info = gonio_controller_register(rows[i].address);
            const uint16_t *at = words + (info->address - FIRST) + k * info->words;
            const int64_t value = gonio_controller_unpack(at, info->words);
            held->axis[k][i] = info->is_signed || info->words > 2 ? value : value & UINT32_MAX;
        }
    }
    held->home_pressed = words[CONTROLLER_home_pressed - FIRST];
    if (status == GONIO_OK && held->axis[0][GONIO_PARAMETER_STEPS_PER_DEG] < 1) {
        return gonio_fail(error, GONIO_E_DEVICE, "axis %s: the controller says no steps a degree",
                          gonio_stage_axis_names[0]);
    }
    return status;
}

// ---- what the rig file wants ----

static double given(const row *r, const gonio_axis_config *config) {
    const char *at = (const char *)config + r->offset;
    if (!r->integer) {
        double real;
        memcpy(&real, at, sizeof real);
        return real;
    }
    const int value = *(const int *)at;
    return value >= 0 ? value : (double)NAN;
}

static double factor(const row *r, double steps_per_deg) {
    return r->unit == STEPS ? steps_per_deg : r->unit == THOUSANDTHS ? 1000 : 1;
}

static int64_t rounded(const row *r, double value) {
    return r->rounding == DOWN ? (int64_t)floor(value) : r->rounding == UP ? (int64_t)ceil(value) : llround(value);
}

static gonio_status out_of_range(const row *r, int k, double value, double steps_per_deg, bool large,
                                 gonio_error *error) {
    const controller_register_info *info = gonio_controller_register(r->address);
    const int64_t bound = large ? info->maximum : info->minimum;
    const char *name = gonio_stage_axis_names[k], *which = large ? "largest" : "smallest";
    if (r->unit != STEPS) {
        return gonio_fail(error, GONIO_E_INPUT, "[axis %s] %s = %.9g: the controller's %s is %.9g", name, r->key, value,
                          which, (double)bound / factor(r, 1));
    }
    return gonio_fail(error, GONIO_E_INPUT,
                      "[axis %s] %s = %.9g: the controller's %s is %.9g, which is %lld steps at %.9g steps a degree",
                      name, r->key, value, which, (double)bound / steps_per_deg, (long long)bound, steps_per_deg);
}

static gonio_status want_axis(const gonio_axis_config *config, int k, int64_t values[GONIO_AXIS_PARAMETERS],
                              gonio_error *error) {
    for (int i = 0; i < GONIO_AXIS_PARAMETERS; i++) {
        const row *r = &rows[i];
        const controller_register_info *info = gonio_controller_register(r->address);
        const double value = given(r, config);
        const double steps_per_deg = (double)values[GONIO_PARAMETER_STEPS_PER_DEG] / 1000;
        if (!isfinite(value)) {
            continue;
        }
        const double in_steps = value * factor(r, steps_per_deg);
        if (fabs(in_steps) < 9e18) {
            values[i] = rounded(r, in_steps);
        }
        if (!(fabs(in_steps) < 9e18) || values[i] < info->minimum || values[i] > info->maximum) {
            return out_of_range(r, k, value, steps_per_deg, in_steps > (double)info->minimum, error);
        }
    }
    if (values[GONIO_PARAMETER_MIN] > values[GONIO_PARAMETER_MAX]) {
        const double scale = (double)values[GONIO_PARAMETER_STEPS_PER_DEG] / 1000;
        return gonio_fail(error, GONIO_E_INPUT, "[axis %s] min_deg = %.9g is above max_deg = %.9g",
                          gonio_stage_axis_names[k], (double)values[GONIO_PARAMETER_MIN] / scale,
                          (double)values[GONIO_PARAMETER_MAX] / scale);
    }
    return GONIO_OK;
}

gonio_status gonio_stage_parameters_want(const gonio_stage_modbus_config *config, const gonio_stage_parameters *held,
                                         gonio_stage_parameters *wanted, gonio_error *error) {
    gonio_status status = GONIO_OK;
    *wanted = *held;
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        status = want_axis(&config->axes[k], k, wanted->axis[k], error);
    }
    if (config->home_pressed >= 0) {
        wanted->home_pressed = config->home_pressed;
    }
    return status;
}

static const row *row_of(int address) {
    for (int i = 0; i < GONIO_AXIS_PARAMETERS; i++) {
        if (rows[i].address == address) {
            return &rows[i];
        }
    }
    return NULL;
}

const char *gonio_stage_parameter_key(int address) {
    const row *r = row_of(address);
    return r != NULL ? r->shown : NULL;
}

bool gonio_stage_parameter_given(const gonio_stage_modbus_config *config, int k, int address) {
    const row *r = row_of(address);
    return r != NULL ? isfinite(given(r, &config->axes[k]))
                     : address == CONTROLLER_home_pressed && config->home_pressed >= 0;
}

// ---- the difference ----

static double in_file(const row *r, const int64_t values[GONIO_AXIS_PARAMETERS], int64_t value) {
    return (double)value / factor(r, (double)values[GONIO_PARAMETER_STEPS_PER_DEG] / 1000);
}

static gonio_status write_one(gonio_controller *c, int address, int words, int64_t value, gonio_error *error) {
    uint16_t packed[4];
    gonio_controller_pack(packed, words, value);
    return gonio_controller_write(c, address, words, packed, error);
}

gonio_status gonio_stage_parameters_write(gonio_controller *c, const gonio_stage_parameters *held,
                                          const gonio_stage_parameters *wanted, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; k < GONIO_AXES; k++) {
        for (int i = 0; i < GONIO_AXIS_PARAMETERS && status == GONIO_OK; i++) {
            const row *r = &rows[i];
            const int64_t was = held->axis[k][i], is = wanted->axis[k][i];
            if (was == is) {
                continue;
            }
            gonio_controller_tell(c, "parameters", "%s %s: the controller had %.9g, the rig file has %.9g%s",
                                  gonio_stage_axis_names[k], r->key, in_file(r, held->axis[k], was),
                                  in_file(r, wanted->axis[k], is), r->unhomes ? "; home it again" : "");
            const controller_register_info *info = gonio_controller_register(r->address);
            status = write_one(c, r->address + k * info->words, info->words, is, error);
        }
    }
    if (status == GONIO_OK && held->home_pressed != wanted->home_pressed) {
        gonio_controller_tell(c, "parameters", "home_pressed: the controller had %d, the rig file has %d",
                              (int)held->home_pressed, (int)wanted->home_pressed);
        status = write_one(c, CONTROLLER_home_pressed, 1, wanted->home_pressed, error);
    }
    return status;
}
