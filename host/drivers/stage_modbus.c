// SPDX-License-Identifier: BSD-3-Clause
// Positions are absolute steps in the controller; degrees are turned into steps here and nowhere else.
#include "host/drivers/stage_modbus.h"

#include <math.h>
#include <stdlib.h>

#include "host/drivers/controller_map.h"
#include "host/drivers/driver.h"

enum { ALL_AXES = 15 };

typedef struct axis {
    double steps_per_deg, speed, acceleration, jerk; // steps, seconds
    int64_t minimum, maximum, backlash;              // steps
    double zero_deg;
    int sign;
} axis;

typedef struct stage {
    gonio_stage_modbus_config config;
    gonio_controller *controller;
    axis axes[GONIO_AXES];
    int64_t lost_steps;
} stage;

static const char *const axis_names[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};

void gonio_stage_modbus_defaults(gonio_stage_modbus_config *config) {
    *config = (gonio_stage_modbus_config){.audit_deg = 0.01, .home_pressed = -1};
    for (int k = 0; k < GONIO_AXES; k++) {
        config->axes[k] = (gonio_axis_config){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, -1, -1, 0, false};
    }
}

// ---- parameters ----

// One axis's value of a parameter: written where `wanted` is a number, then read.
static gonio_status parameter(const stage *s, int base, int words, int k, double wanted, double *value,
                              gonio_error *error) {
    uint16_t held[4];
    const int address = base + k * words;
    if (isfinite(wanted)) {
        gonio_controller_pack(held, words, (int64_t)llround(wanted));
        const gonio_status status = gonio_controller_write(s->controller, address, words, held, error);
        if (status != GONIO_OK) {
            return status;
        }
        *value = (double)llround(wanted);
        return GONIO_OK;
    }
    const gonio_status status = gonio_controller_read(s->controller, address, words, held, error);
    if (status == GONIO_OK) {
        // Only the 64-bit and the signed values of the table can be negative; speeds and scales are below 2^31.
        *value = (double)gonio_controller_unpack(held, words);
    }
    return status;
}

#define PARAMETER(name, wanted, value) parameter(s, CONTROLLER_##name, CONTROLLER_EACH_##name, k, wanted, value, error)

static gonio_status set_up_motion(stage *s, int k, gonio_error *error) {
    const gonio_axis_config *c = &s->config.axes[k];
    axis *a = &s->axes[k];
    double scale = 0;
    gonio_status status = PARAMETER(steps_per_deg, c->steps_per_deg * 1000, &scale);
    a->steps_per_deg = scale / 1000;
    if (status == GONIO_OK && !(a->steps_per_deg > 0)) {
        return gonio_fail(error, GONIO_E_DEVICE, "axis %s: the controller says %g steps a degree", axis_names[k],
                          a->steps_per_deg);
    }
    status = status == GONIO_OK ? PARAMETER(speed_max, c->speed_deg_per_s * a->steps_per_deg, &a->speed) : status;
    if (status == GONIO_OK) {
        status = PARAMETER(acceleration, c->acceleration_deg_per_s2 * a->steps_per_deg, &a->acceleration);
    }
    return status == GONIO_OK ? PARAMETER(jerk, c->jerk_deg_per_s3 * a->steps_per_deg, &a->jerk) : status;
}

static gonio_status set_up_limits(stage *s, int k, gonio_error *error) {
    const gonio_axis_config *c = &s->config.axes[k];
    axis *a = &s->axes[k];
    double value = 0;
    gonio_status status = PARAMETER(backlash, c->backlash_deg * a->steps_per_deg, &value);
    a->backlash = (int64_t)value;
    if (status == GONIO_OK) {
        // The take-up overshoots a target by the backlash, and the controller holds that against its limits too.
        const double room = fabs(value);
        status = PARAMETER(soft_min, floor(c->min_deg * a->steps_per_deg) - room, &value);
        a->minimum = (int64_t)value + (int64_t)room;
        if (status == GONIO_OK) {
            status = PARAMETER(soft_max, ceil(c->max_deg * a->steps_per_deg) + room, &value);
            a->maximum = (int64_t)value - (int64_t)room;
        }
    }
    return status;
}

static gonio_status set_up_homing(stage *s, int k, gonio_error *error) {
    const gonio_axis_config *c = &s->config.axes[k];
    const double scale = s->axes[k].steps_per_deg;
    double unused;
    gonio_status status = PARAMETER(home_position, c->home_deg * scale, &unused);
    status = status == GONIO_OK ? PARAMETER(home_fast, c->home_fast_deg_per_s * scale, &unused) : status;
    status = status == GONIO_OK ? PARAMETER(home_slow, c->home_slow_deg_per_s * scale, &unused) : status;
    if (status == GONIO_OK && isfinite(c->home_travel_deg)) { // of no use to the host: not read
        status = PARAMETER(home_travel, c->home_travel_deg * scale, &unused);
    }
    if (status == GONIO_OK) {
        status = PARAMETER(home_order, c->home_order < 0 ? (double)NAN : c->home_order, &unused);
    }
    return status == GONIO_OK ? PARAMETER(home_up, c->home_up < 0 ? (double)NAN : c->home_up, &unused) : status;
}

static gonio_status set_up(stage *s, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        s->axes[k].zero_deg = s->config.axes[k].zero_deg;
        s->axes[k].sign = s->config.axes[k].invert ? -1 : 1;
        status = set_up_motion(s, k, error);
        status = status == GONIO_OK ? set_up_limits(s, k, error) : status;
        status = status == GONIO_OK ? set_up_homing(s, k, error) : status;
    }
    if (status == GONIO_OK && s->config.home_pressed >= 0) {
        const int k = 0; // the axes share it
        double unused;
        status = PARAMETER(home_pressed, s->config.home_pressed, &unused);
    }
    return status;
}

// ---- operations ----

static int64_t to_steps(const axis *a, double rad) {
    return llround((a->sign * gonio_degrees(rad) + a->zero_deg) * a->steps_per_deg);
}

static double to_rad(const axis *a, int64_t steps) {
    return gonio_radians(a->sign * ((double)steps / a->steps_per_deg - a->zero_deg));
}

static gonio_status watch(void *context, gonio_error *error) {
    const stage *s = context;
    return s->config.interlock != NULL ? s->config.interlock->check(s->config.interlock_device, error) : GONIO_OK;
}

// Homing is asked for, so a standing alarm is cleared first, if its cause is gone.
static gonio_status stage_home(void *device, double timeout_s, gonio_error *error) {
    stage *s = device;
    gonio_status status = watch(s, error);
    status = status == GONIO_OK ? gonio_controller_clear(s->controller, error) : status;
    uint32_t id = 0;
    if (status == GONIO_OK) {
        status = gonio_controller_command(s->controller, CONTROLLER_COMMAND_HOME, ALL_AXES, NULL, &id, error);
    }
    gonio_controller_status now;
    return status == GONIO_OK ? gonio_controller_wait(s->controller, id, timeout_s, watch, s, &now, error) : status;
}

static gonio_status check_targets(const stage *s, const int64_t targets[GONIO_AXES], unsigned axes,
                                  gonio_error *error) {
    for (int k = 0; k < GONIO_AXES; k++) {
        const axis *a = &s->axes[k];
        if ((axes >> k & 1) == 0) {
            continue;
        }
        if (targets[k] < a->minimum || targets[k] > a->maximum) {
            double low, high;
            gonio_stage_modbus_limits(s, k, &low, &high);
            return gonio_fail(error, GONIO_E_RANGE, "%s cannot go to %.6g deg; its limits are %g and %g deg",
                              axis_names[k], gonio_degrees(to_rad(a, targets[k])), low, high);
        }
    }
    return GONIO_OK;
}

static gonio_status check_arrival(stage *s, const int64_t targets[GONIO_AXES], const gonio_controller_status *now,
                                  gonio_error *error) {
    for (int k = 0; k < GONIO_AXES; k++) {
        if (now->position[k] != targets[k]) {
            s->lost_steps++;
            gonio_controller_tell(s->controller, "lost-steps", "%s stands at %lld steps, asked for %lld", axis_names[k],
                                  (long long)now->position[k], (long long)targets[k]);
            return gonio_fail(error, GONIO_E_DEVICE, "%s stands at %.6g deg, asked for %.6g deg", axis_names[k],
                              gonio_degrees(to_rad(&s->axes[k], now->position[k])),
                              gonio_degrees(to_rad(&s->axes[k], targets[k])));
        }
    }
    return GONIO_OK;
}

static gonio_status check_homed(unsigned homed, gonio_error *error) {
    for (int k = 0; k < GONIO_AXES; k++) {
        if ((homed & 1u << k) == 0) {
            return gonio_fail(error, GONIO_E_DEVICE, "%s is not homed: `gonio rig home` first", axis_names[k]);
        }
    }
    return GONIO_OK;
}

// An axis that stays where it is need not be within its limits: after homing it stands at its switch, outside them.
static unsigned changed_axes(const int64_t targets[GONIO_AXES], const gonio_controller_status *now) {
    unsigned axes = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        axes |= (unsigned)(targets[k] != now->position[k]) << k;
    }
    return axes;
}

// Every call gets an id of the controller's own sequence: ids of the host begin anew with each process, and the
// controller takes one it has just carried out for a repeat. Targets are absolute, so a repeated call is harmless.
static gonio_status stage_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                               double timeout_s, gonio_error *error) {
    (void)id;
    (void)stamp;
    stage *s = device;
    int64_t targets[GONIO_AXES];
    for (int k = 0; k < GONIO_AXES; k++) {
        targets[k] = to_steps(&s->axes[k], target_rad[k]);
    }
    gonio_controller_status now;
    gonio_status status = watch(s, error);
    status = status == GONIO_OK ? gonio_controller_read_status(s->controller, &now, error) : status;
    unsigned axes = status == GONIO_OK ? changed_axes(targets, &now) : 0;
    status = status == GONIO_OK ? check_targets(s, targets, axes, error) : status;
    // A move of no length settles, and triggers, as any other, with whatever axes the controller would move at all.
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK && axes == 0; k++) {
        axes = check_targets(s, targets, 1u << k, NULL) == GONIO_OK ? 1u << k : 0;
    }
    if (status == GONIO_OK && axes == 0) {
        return GONIO_OK;
    }
    status = status == GONIO_OK ? gonio_controller_alarm(&now, error) : status;
    status = status == GONIO_OK ? check_homed(now.homed, error) : status;
    uint32_t own_id = 0;
    if (status == GONIO_OK) {
        status = gonio_controller_command(s->controller, CONTROLLER_COMMAND_MOVE, axes, targets, &own_id, error);
    }
    if (status == GONIO_OK) {
        status = gonio_controller_wait(s->controller, own_id, timeout_s, watch, s, &now, error);
    }
    status = status == GONIO_OK ? check_arrival(s, targets, &now, error) : status;
    if (status == GONIO_OK) {
        gonio_controller_rest(s->controller, targets);
    }
    return status;
}

static gonio_status stage_check(void *device, const double from_rad[GONIO_AXES], const double to_rad_[GONIO_AXES],
                                gonio_error *error) {
    (void)from_rad;
    const stage *s = device;
    int64_t targets[GONIO_AXES];
    for (int k = 0; k < GONIO_AXES; k++) {
        targets[k] = to_steps(&s->axes[k], to_rad_[k]);
    }
    return check_targets(s, targets, ALL_AXES, error);
}

void gonio_stage_modbus_position(const void *device, const gonio_controller_status *now,
                                 double position_rad[GONIO_AXES]) {
    for (int k = 0; k < GONIO_AXES; k++) {
        position_rad[k] = to_rad(&((const stage *)device)->axes[k], now->position[k]);
    }
}

static gonio_status stage_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    const stage *s = device;
    gonio_controller_status now;
    const gonio_status status = gonio_controller_read_status(s->controller, &now, error);
    if (status == GONIO_OK) {
        gonio_stage_modbus_position(s, &now, position_rad);
    }
    return status;
}

static gonio_status stage_stop(void *device, gonio_error *error) {
    const stage *s = device;
    return gonio_controller_command(s->controller, CONTROLLER_COMMAND_STOP, 0, NULL, NULL, error);
}

// Rest to rest over `steps` within speed v, acceleration a and jerk j (0: none): the S-curve of an axis alone.
static double profile_s(const axis *axis, double steps) {
    const double v = axis->speed, a = axis->acceleration, j = axis->jerk;
    if (steps <= 0 || !(v > 0) || !(a > 0)) {
        return 0;
    }
    if (!(j > 0)) {
        return steps < v * v / a ? 2 * sqrt(steps / a) : steps / v + v / a;
    }
    // Peak speed p reached in t(p) = p/a + a/j, or 2 sqrt(p/j) where full acceleration is not reached; the ramps up and
    // down together cover p t(p).
    const double full = a * a / j;
    double p = v;
    const double t = p > full ? p / a + a / j : 2 * sqrt(p / j);
    if (p * t <= steps) {
        return steps / p + t;
    }
    p = cbrt(steps * steps * j / 4);
    return p <= full ? 4 * cbrt(steps / (2 * j)) : a / j + sqrt(a * a / (j * j) + 4 * steps / a);
}

static double stage_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad_[GONIO_AXES]) {
    const stage *s = device;
    double longest = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        const axis *a = &s->axes[k];
        const double way = (double)(to_steps(a, to_rad_[k]) - to_steps(a, from_rad[k]));
        const double past = (double)llabs(a->backlash);
        // Against the side of the final approach the target is passed by the backlash.
        const bool takes_up = past > 0 && way != 0 && (way > 0) != (a->backlash > 0);
        const double time = takes_up ? profile_s(a, fabs(way) + past) + profile_s(a, past) : profile_s(a, fabs(way));
        longest = fmax(longest, time);
    }
    return longest;
}

static gonio_status stage_audit(void *device, double timeout_s, double difference_rad[GONIO_AXES], gonio_error *error) {
    const stage *s = device;
    gonio_controller_status before;
    double difference_deg[GONIO_AXES] = {0};
    gonio_status status = gonio_controller_read_status(s->controller, &before, error);
    status = status == GONIO_OK ? stage_home(device, timeout_s, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    // The controller compares with its last homing; a position that was lost since makes that a meaningless figure.
    const bool known = before.homed == ALL_AXES;
    status = known ? gonio_stage_modbus_audit(device, difference_deg, error) : GONIO_OK;
    for (int k = 0; k < GONIO_AXES; k++) {
        difference_rad[k] = known ? s->axes[k].sign * gonio_radians(difference_deg[k]) : (double)NAN;
    }
    return status;
}

static void stage_close(void *device) {
    stage *s = device;
    gonio_controller_release(s->controller);
    free(s);
}

const gonio_stage_ops gonio_stage_modbus = {.name = "modbus",
                                            .home = stage_home,
                                            .move = stage_move,
                                            .position = stage_position,
                                            .stop = stage_stop,
                                            .duration_s = stage_duration_s,
                                            .close = stage_close,
                                            .check = stage_check,
                                            .audit = stage_audit};

gonio_status gonio_stage_modbus_open(const gonio_stage_modbus_config *config, gonio_controller *controller,
                                     void **device, gonio_error *error) {
    if (gonio_controller_identify(controller)->axes != GONIO_AXES) {
        return gonio_fail(error, GONIO_E_DEVICE, "the controller has %d axes; expected %d",
                          gonio_controller_identify(controller)->axes, (int)GONIO_AXES);
    }
    stage *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "not enough memory for a stage");
    }
    s->config = *config;
    s->controller = controller;
    const gonio_status status = set_up(s, error);
    if (status != GONIO_OK) {
        free(s);
        return status;
    }
    gonio_controller_share(controller);
    *device = s;
    return GONIO_OK;
}

gonio_status gonio_stage_modbus_audit(void *device, double difference_deg[GONIO_AXES], gonio_error *error) {
    stage *s = device;
    gonio_controller_status now;
    gonio_status status = gonio_controller_read_status(s->controller, &now, error);
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        difference_deg[k] = now.home_difference[k] / s->axes[k].steps_per_deg;
    }
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        if (fabs(difference_deg[k]) > s->config.audit_deg) {
            s->lost_steps++;
            gonio_controller_tell(s->controller, "lost-steps", "%s: homing found the switch %.6g deg off",
                                  axis_names[k], difference_deg[k]);
            status = gonio_fail(error, GONIO_E_MISMATCH,
                                "%s had drifted by %.4g deg since the last homing; allowed "
                                "are %g deg",
                                axis_names[k], difference_deg[k], s->config.audit_deg);
        }
    }
    return status;
}

void gonio_stage_modbus_limits(const void *device, int k, double *min_deg, double *max_deg) {
    const axis *a = &((const stage *)device)->axes[k];
    const double one = gonio_degrees(to_rad(a, a->minimum)), other = gonio_degrees(to_rad(a, a->maximum));
    *min_deg = fmin(one, other);
    *max_deg = fmax(one, other);
}

double gonio_stage_modbus_user_deg(const void *device, int k, double dial_deg) {
    const axis *a = &((const stage *)device)->axes[k];
    return a->sign * (dial_deg - a->zero_deg);
}

int64_t gonio_stage_modbus_lost_steps(const void *device) { return ((const stage *)device)->lost_steps; }

#define KEY(text, kind, member) .section = "stage", GONIO_KEY_NAMED(gonio_stage_modbus_config, member, text, kind)
#define AXIS_KEY(axis, text, kind, member)                                                                             \
    .section = "axis " axis, GONIO_KEY_NAMED(gonio_stage_modbus_config, member, text, kind)
#define AXIS(axis, k)                                                                                                  \
    {AXIS_KEY(axis, "steps_per_deg", REAL, axes[k].steps_per_deg), 0.001, 4e6},                                        \
        {AXIS_KEY(axis, "speed_deg_per_s", REAL, axes[k].speed_deg_per_s), 1e-3, 1e4, .shared = true},                 \
        {AXIS_KEY(axis, "acceleration_deg_per_s2", REAL, axes[k].acceleration_deg_per_s2), 1e-3, 1e6, .shared = true}, \
        {AXIS_KEY(axis, "jerk_deg_per_s3", REAL, axes[k].jerk_deg_per_s3), 0, 1e9, .shared = true},                    \
        {AXIS_KEY(axis, "min_deg", REAL, axes[k].min_deg), -720, 720, .shared = true},                                 \
        {AXIS_KEY(axis, "max_deg", REAL, axes[k].max_deg), -720, 720, .shared = true},                                 \
        {AXIS_KEY(axis, "backlash_deg", REAL, axes[k].backlash_deg), -10, 10, .shared = true},                         \
        {AXIS_KEY(axis, "home_deg", REAL, axes[k].home_deg), -720, 720},                                               \
        {AXIS_KEY(axis, "home_fast_deg_per_s", REAL, axes[k].home_fast_deg_per_s), 1e-3, 1e4},                         \
        {AXIS_KEY(axis, "home_slow_deg_per_s", REAL, axes[k].home_slow_deg_per_s), 1e-4, 1e3},                         \
        {AXIS_KEY(axis, "home_travel_deg", REAL, axes[k].home_travel_deg), 1e-3, 1440},                                \
        {AXIS_KEY(axis, "home_order", INTEGER, axes[k].home_order), 0, 4},                                             \
        {AXIS_KEY(axis, "home_up", INTEGER, axes[k].home_up), 0, 1},                                                   \
        {AXIS_KEY(axis, "zero_deg", REAL, axes[k].zero_deg), -720, 720}, {                                             \
        AXIS_KEY(axis, "invert", BOOLEAN, axes[k].invert)                                                              \
    }
static const gonio_key keys[] = {{KEY("audit_deg", REAL, audit_deg), 0, 10},
                                 {KEY("home_pressed", INTEGER, home_pressed), 0, 1},
                                 AXIS("light_theta", GONIO_LIGHT_THETA),
                                 AXIS("light_phi", GONIO_LIGHT_PHI),
                                 AXIS("camera_theta", GONIO_CAMERA_THETA),
                                 AXIS("camera_phi", GONIO_CAMERA_PHI),
                                 {0}};

static void defaults(void *config) { gonio_stage_modbus_defaults(config); }

static gonio_status make(void *config, const gonio_driver_context *context, void **device, gonio_error *error) {
    gonio_stage_modbus_config *c = config;
    c->interlock = context->interlock;
    c->interlock_device = context->interlock_device;
    return gonio_stage_modbus_open(c, context->controller, device, error);
}

const gonio_driver gonio_driver_stage_modbus = {.name = "modbus",
                                                .device = GONIO_DEVICE_STAGE,
                                                .summary = "four axes behind the controller",
                                                .keys = keys,
                                                .settings = sizeof(gonio_stage_modbus_config),
                                                .defaults = defaults,
                                                .controller = true,
                                                .ops = &gonio_stage_modbus,
                                                .open = make};
