// SPDX-License-Identifier: BSD-3-Clause
// Positions are absolute steps in the controller; degrees are turned into steps here and nowhere else.
#include "host/drivers/stage_modbus.h"

#include <math.h>
#include <stdlib.h>

#include "host/drivers/controller_map.h"
#include "host/drivers/driver.h"
#include "host/drivers/stage_parameters.h"

enum { ALL_AXES = 15, JOG_S = 10 }; // JOG_S: of home_slow, the longest that the controller jogs

// As the rig file wants it.
typedef struct axis {
    double steps_per_deg, speed, acceleration, jerk; // steps, seconds
    int64_t minimum, maximum, backlash;              // steps
    double zero_deg;
    int sign;
} axis;

typedef struct stage {
    gonio_stage_modbus_config config;
    gonio_controller *controller;
    gonio_stage_parameters held, wanted;
    bool applied;                  // the controller has what is wanted, in its
    uint32_t generation, checksum; // ... parameters of this generation
    axis axes[GONIO_AXES];
    int64_t lost_steps;
} stage;

static const char *const *const axis_names = gonio_stage_axis_names;

void gonio_stage_modbus_defaults(gonio_stage_modbus_config *config) {
    *config = (gonio_stage_modbus_config){.audit_deg = 0.01, .home_pressed = -1};
    for (int k = 0; k < GONIO_AXES; k++) {
        config->axes[k] =
            (gonio_axis_config){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, -1, -1, 0, false};
    }
}

// ---- parameters: read when it is opened, written before something moves ----

static void take_axes(stage *s) {
    for (int k = 0; k < GONIO_AXES; k++) {
        const int64_t *values = s->wanted.axis[k];
        s->axes[k] = (axis){.steps_per_deg = (double)values[GONIO_PARAMETER_STEPS_PER_DEG] / 1000,
                            .speed = (double)values[GONIO_PARAMETER_SPEED],
                            .acceleration = (double)values[GONIO_PARAMETER_ACCELERATION],
                            .jerk = (double)values[GONIO_PARAMETER_JERK],
                            .minimum = values[GONIO_PARAMETER_MIN],
                            .maximum = values[GONIO_PARAMETER_MAX],
                            .backlash = values[GONIO_PARAMETER_BACKLASH],
                            .zero_deg = s->config.axes[k].zero_deg,
                            .sign = s->config.axes[k].invert ? -1 : 1};
    }
}

static gonio_status compare(stage *s, gonio_error *error) {
    gonio_status status = gonio_stage_parameters_read(s->controller, &s->held, error);
    status = status == GONIO_OK ? gonio_stage_parameters_want(&s->config, &s->held, &s->wanted, error) : status;
    if (status == GONIO_OK) {
        take_axes(s);
    }
    return status;
}

gonio_status gonio_stage_modbus_apply(void *device, gonio_error *error) {
    stage *s = device;
    gonio_controller_status now;
    gonio_status status = gonio_controller_claim(s->controller, error);
    status = status == GONIO_OK ? gonio_controller_read_status(s->controller, &now, error) : status;
    if (status != GONIO_OK || (s->applied && now.generation == s->generation && now.checksum == s->checksum)) {
        return status;
    }
    if (s->applied) {
        gonio_controller_tell(s->controller, "parameters", "%s",
                              "somebody else has changed the controller's parameters");
    }
    s->applied = false;
    status = compare(s, error);
    status = status == GONIO_OK ? gonio_stage_parameters_write(s->controller, &s->held, &s->wanted, error) : status;
    status = status == GONIO_OK ? gonio_controller_read_status(s->controller, &now, error) : status;
    if (status == GONIO_OK) {
        s->held = s->wanted;
        s->generation = now.generation;
        s->checksum = now.checksum;
        s->applied = true;
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

// Where an axis stands: the controller's steps are of the scale that it holds, whatever the rig file wants.
static double standing_rad(const stage *s, int k, int64_t steps) {
    axis a = s->axes[k];
    a.steps_per_deg = (double)s->held.axis[k][GONIO_PARAMETER_STEPS_PER_DEG] / 1000;
    return to_rad(&a, steps);
}

static gonio_status watch(void *context, gonio_error *error) {
    const stage *s = context;
    return s->config.interlock != NULL ? s->config.interlock->check(s->config.interlock_device, error) : GONIO_OK;
}

// Homing is asked for, so a standing alarm is cleared first, if its cause is gone.
gonio_status gonio_stage_modbus_home(void *device, unsigned axes, double timeout_s, gonio_error *error) {
    stage *s = device;
    gonio_status status = watch(s, error);
    status = status == GONIO_OK ? gonio_controller_clear(s->controller, error) : status;
    status = status == GONIO_OK ? gonio_stage_modbus_apply(s, error) : status;
    uint32_t id = 0;
    if (status == GONIO_OK) {
        status = gonio_controller_command(s->controller, CONTROLLER_COMMAND_HOME, axes, NULL, &id, error);
    }
    gonio_controller_status now;
    return status == GONIO_OK ? gonio_controller_wait(s->controller, id, timeout_s, watch, s, &now, error) : status;
}

static gonio_status stage_home(void *device, double timeout_s, gonio_error *error) {
    return gonio_stage_modbus_home(device, ALL_AXES, timeout_s, error);
}

gonio_status gonio_stage_modbus_jog(void *device, int k, double user_deg, gonio_error *error) {
    stage *s = device;
    gonio_status status = watch(s, error);
    status = status == GONIO_OK ? gonio_stage_modbus_apply(s, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    const axis *a = &s->axes[k];
    const double way = a->sign * user_deg * a->steps_per_deg;
    const double slow = (double)s->held.axis[k][GONIO_PARAMETER_HOME_SLOW];
    if (!(fabs(way) <= JOG_S * slow)) {
        return gonio_fail(error, GONIO_E_RANGE, "%s can be jogged slowly by up to %.4g deg at a time", axis_names[k],
                          JOG_S * slow / a->steps_per_deg);
    }
    int64_t targets[GONIO_AXES] = {0};
    targets[k] = llround(way);
    uint32_t id = 0;
    gonio_controller_status now;
    status = gonio_controller_command(s->controller, CONTROLLER_COMMAND_JOG, 1u << k, targets, &id, error);
    return status == GONIO_OK ? gonio_controller_wait(s->controller, id, 2 * JOG_S + 60, watch, s, &now, error)
                              : status;
}

gonio_status gonio_stage_modbus_release(void *device, unsigned axes, gonio_error *error) {
    const stage *s = device;
    return gonio_controller_command(s->controller, CONTROLLER_COMMAND_RELEASE, axes, NULL, NULL, error);
}

// The end of the way before the final approach; the target itself where there is no backlash to take up.
static int64_t turning_point(const axis *a, int64_t from, int64_t to) {
    return (a->backlash > 0 && to < from) || (a->backlash < 0 && to > from) ? to - a->backlash : to;
}

static gonio_status beyond(const stage *s, int k, double user_deg, const char *how, gonio_error *error) {
    double low, high;
    gonio_stage_modbus_limits(s, k, &low, &high);
    return gonio_fail(error, GONIO_E_RANGE, "%s cannot go to %.6g deg%s; its limits are %g and %g deg", axis_names[k],
                      user_deg, how, low, high);
}

// Limits hold for every place that an axis passes, its take-up of backlash among them, and for what is asked for, not
// for the step next to it.
static gonio_status check_way(const stage *s, const int64_t from[GONIO_AXES], const double target_rad[GONIO_AXES],
                              unsigned axes, gonio_error *error) {
    const double slack = 1e-6; // of a step: degrees and radians and back
    for (int k = 0; k < GONIO_AXES; k++) {
        const axis *a = &s->axes[k];
        const gonio_axis_config *c = &s->config.axes[k];
        if ((axes >> k & 1) == 0) {
            continue;
        }
        const double user_deg = gonio_degrees(target_rad[k]);
        const double at = (a->sign * user_deg + a->zero_deg) * a->steps_per_deg;
        const double low = isfinite(c->min_deg) ? c->min_deg * a->steps_per_deg : (double)a->minimum,
                     high = isfinite(c->max_deg) ? c->max_deg * a->steps_per_deg : (double)a->maximum;
        if (!(at >= low - slack && at <= high + slack)) {
            return beyond(s, k, user_deg, "", error);
        }
        const int64_t turn = turning_point(a, from[k], llround(at));
        if (turn < a->minimum || turn > a->maximum) {
            return beyond(s, k, user_deg, " from this side: taking up its backlash would pass a limit", error);
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
                              gonio_degrees(standing_rad(s, k, now->position[k])),
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
    gonio_controller_status now;
    gonio_status status = watch(s, error);
    status = status == GONIO_OK ? gonio_stage_modbus_apply(s, error) : status;
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        targets[k] = to_steps(&s->axes[k], target_rad[k]);
    }
    status = status == GONIO_OK ? gonio_controller_read_status(s->controller, &now, error) : status;
    unsigned axes = status == GONIO_OK ? changed_axes(targets, &now) : 0;
    status = status == GONIO_OK ? check_way(s, now.position, target_rad, axes, error) : status;
    // A move of no length settles, and triggers, as any other, with whatever axes the controller would move at all.
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK && axes == 0; k++) {
        axes = check_way(s, now.position, target_rad, 1u << k, NULL) == GONIO_OK ? 1u << k : 0;
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
    const stage *s = device;
    int64_t from[GONIO_AXES];
    unsigned axes = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        from[k] = to_steps(&s->axes[k], from_rad[k]);
        axes |= (unsigned)(from[k] != to_steps(&s->axes[k], to_rad_[k])) << k;
    }
    // An axis stays where it stands, be it half a step beyond; where none moves, the place itself is asked about.
    return check_way(s, from, to_rad_, axes != 0 ? axes : ALL_AXES, error);
}

static bool stage_turns(void *device, const double from_rad[GONIO_AXES], const double to_rad_[GONIO_AXES],
                        double turn_rad[GONIO_AXES]) {
    const stage *s = device;
    bool turns = false;
    for (int k = 0; k < GONIO_AXES; k++) {
        const axis *a = &s->axes[k];
        const int64_t to = to_steps(a, to_rad_[k]), turn = turning_point(a, to_steps(a, from_rad[k]), to);
        turns = turns || turn != to;
        turn_rad[k] = turn == to ? to_rad_[k] : to_rad(a, turn);
    }
    return turns;
}

void gonio_stage_modbus_position(const void *device, const gonio_controller_status *now,
                                 double position_rad[GONIO_AXES]) {
    for (int k = 0; k < GONIO_AXES; k++) {
        position_rad[k] = standing_rad(device, k, now->position[k]);
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

static double stage_step_rad(void *device) {
    const stage *s = device;
    double step = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        step = fmax(step, gonio_radians(1 / s->axes[k].steps_per_deg));
    }
    return step;
}

const gonio_stage_ops gonio_stage_modbus = {.name = "modbus",
                                            .home = stage_home,
                                            .move = stage_move,
                                            .position = stage_position,
                                            .stop = stage_stop,
                                            .duration_s = stage_duration_s,
                                            .step_rad = stage_step_rad,
                                            .close = stage_close,
                                            .check = stage_check,
                                            .audit = stage_audit,
                                            .turns = stage_turns,
                                            .real = true};

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
    const gonio_status status = compare(s, error);
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

bool gonio_stage_modbus_gives(const void *device, int k, int address) {
    return gonio_stage_parameter_given(&((const stage *)device)->config, k, address);
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
        {AXIS_KEY(axis, "home_backoff_deg", REAL, axes[k].home_backoff_deg), 1e-4, 90},                                \
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
