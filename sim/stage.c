// SPDX-License-Identifier: BSD-3-Clause
// The four axes in simulated time: the controller's firmware (firmware/core) drives the motors of a simulated machine,
// with its own ramps, soft limits, homing, take-up of backlash and emergency stop.
//
// Where an arm stands is a function of what its motor did and of the stamp: the angle asked for + steps that it is off
// + play it did not take up + zero error (per seed) + repeatability (per pose). What rounding to whole steps takes away
// is given back, since the stated pointing covers it: so the samples depend neither on this machine's scale nor on
// which stage backend moved. Backlash adds nothing, because every approach ends in the positive direction, as homing
// does; with backlash_takeup = 0 an approach from above stands high by the backlash.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/internal.h"
#include "sim/random.h"

enum { ALL_AXES = (1 << FW_AXES) - 1 };
_Static_assert((int)FW_AXES == (int)GONIO_AXES, "the controller has as many axes as the rig");

#define STEPS_PER_DEG 100.0      // the controller's own initial scale; less for axes that are quicker,
#define SPEED_LEAST 100.0        // ... more for slow ones: its speeds are whole steps/s
#define SPEED_MOST 40000.0       // ... which four axes reach together
#define HOME_DEG 0.1             // the switch closes this far below 0 and stays closed below
#define MARGIN_DEG 5.0           // from the softer limits to the limit switches
#define BOUNDLESS_DEG 1e4        // no axis has limits beyond
#define STANDSTILL_US 1000000000 // longest deceleration waited for
#define LOST_DEG 0.5             // by a fault lost_steps
#define AUDIT_DEG 0.01           // drift that an audit takes for lost steps

static const char *const axis_names[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};

// ---- the machine ----

static double scale_of(const sim_axis_settings *axis) {
    const double finest = SPEED_MOST / axis->speed_deg_per_s, coarsest = SPEED_LEAST / axis->speed_deg_per_s;
    return fmin(fmax(STEPS_PER_DEG, coarsest), finest);
}

// A whole number of steps within what the register holds.
static uint32_t bounded(double steps, uint32_t least, uint32_t most) {
    return steps < least ? least : steps > most ? most : (uint32_t)lround(steps);
}

static void set_axis(gonio_sim *sim, int k) {
    enum { SPEED_MAX = 62500, SLOW_MAX = 4000, ACCELERATION_MAX = 4000000, WAY_MAX = 1000000 };
    const sim_axis_settings *axis = &sim->settings.axis[k];
    const double scale = sim->steps_per_deg[k] = scale_of(axis), speed = axis->speed_deg_per_s * scale;
    struct fw_registers *r = &sim->machine.core.registers;
    struct machine_axis *motor = &sim->machine.axis[k];
    r->steps_per_deg[k] = bounded(1000 * scale, 1, UINT32_MAX);
    r->speed_max[k] = bounded(speed, 1, SPEED_MAX);
    r->acceleration[k] = bounded(axis->acceleration_deg_per_s2 * scale, 1, ACCELERATION_MAX);
    r->jerk[k] = axis->jerk_deg_per_s3 > 0 ? bounded(axis->jerk_deg_per_s3 * scale, 1, 4000000000u) : 0;
    motor->play = llround(axis->backlash_deg * scale);
    r->backlash[k] = sim->settings.rig.backlash_takeup ? (int32_t)(2 * motor->play) : 0;
    // The take-up passes a target by the backlash, and the controller holds that against its limits too.
    r->soft_min[k] = (int64_t)floor(axis->min_deg * scale) - r->backlash[k];
    r->soft_max[k] = (int64_t)ceil(axis->max_deg * scale);
    r->home_backoff[k] = bounded(HOME_DEG * scale + 2 * (double)motor->play, 1, WAY_MAX);
    r->home_position[k] = motor->home_at = -(int64_t)r->home_backoff[k]; // so that homing ends at 0
    r->home_fast[k] = r->speed_max[k];
    r->home_slow[k] = bounded(speed / 4, 1, SLOW_MAX);
    const double jerk_s = r->jerk[k] > 0 ? 2 * sqrt(speed / r->jerk[k]) : 0;
    const int64_t stopping = (int64_t)ceil(speed * (speed / r->acceleration[k] + jerk_s) + MARGIN_DEG * scale);
    const int64_t lower = r->soft_min[k] < motor->home_at ? r->soft_min[k] : motor->home_at;
    motor->limit_min_at = lower - stopping;
    motor->limit_max_at = r->soft_max[k] + stopping;
    r->home_travel[k] = (uint32_t)(motor->limit_max_at - motor->limit_min_at);
    motor->steps = motor->arm = 0;
}

gonio_status gonio_sim_stage_start(gonio_sim *sim, gonio_error *error) {
    struct machine *m = &sim->machine;
    gonio_machine_new(m);
    gonio_machine_start(m, FW_CAUSE_POWER);
    for (int k = 0; k < GONIO_AXES; k++) {
        set_axis(sim, k);
        sim->target_steps[k] = 0;
        sim->target_rad[k] = sim->actual_rad[k] = 0;
    }
    m->core.registers.home_pressed[0] = 1; // the switches tell the side of 0
    m->core.registers.settle[0] = 0;       // the scan settles on the nominal clock
    gonio_fw_core_parameters_changed(&m->core);
    if (!gonio_fw_registers_valid(&m->core)) {
        return gonio_fail(error, GONIO_E_INPUT, "stage: the controller cannot drive axes of such speeds and limits");
    }
    gonio_machine_run(m, 1000);
    return GONIO_OK;
}

// ---- steps and angles ----

static int64_t to_steps(const gonio_sim *sim, int k, double rad) {
    const double deg = gonio_degrees(rad);
    return fabs(deg) <= BOUNDLESS_DEG ? llround(deg * sim->steps_per_deg[k]) : INT32_MAX; // NaN as well
}

static double to_rad(const gonio_sim *sim, int k, int64_t steps) {
    return sim->target_rad[k] + gonio_radians((double)(steps - sim->target_steps[k]) / sim->steps_per_deg[k]);
}

static void place_arms(gonio_sim *sim, const gonio_stamp *stamp) {
    for (int k = 0; k < GONIO_AXES; k++) {
        const sim_axis_settings *axis = &sim->settings.axis[k];
        const struct machine_axis *motor = &sim->machine.axis[k];
        double off_deg = 0;
        if (stamp != NULL) {
            off_deg = axis->pointing_deg / sqrt(2) *
                      gonio_sim_normal(sim->seed, SIM_REPEATABILITY, stamp->pose, 0, (uint32_t)k);
        }
        if (motor->play > 0) {
            off_deg += axis->backlash_deg * (double)(motor->arm - motor->steps) / (double)motor->play;
        }
        sim->actual_rad[k] = to_rad(sim, k, motor->steps) + sim->truth.zero_error_rad[k] + gonio_radians(off_deg);
    }
}

// ---- operations ----

static const char *alarm_text(const struct fw_core *core) {
    switch (core->registers.alarm[0]) {
#define ALARM(value, name, text)                                                                                       \
    case value:                                                                                                        \
        return text;
#include "firmware/regmap.def"
    default:
        return "an unknown alarm";
    }
}

static const char *refusal_text(enum fw_refusal refusal) {
    switch (refusal) {
#define REFUSAL(value, name, text)                                                                                     \
    case FW_REFUSAL_##name:                                                                                            \
        return text;
#include "firmware/regmap.def"
    default:
        return "an unknown reason";
    }
}

// Simulated time for `s` seconds at most; whether the axes came to rest.
static bool settle(struct machine *m, double s) {
    const double longest_s = 1e12;
    return gonio_machine_settle(m, (uint64_t)(1e6 * fmax(0, fmin(s, longest_s))));
}

static void stop(struct machine *m, enum fw_command command) {
    gonio_machine_command(m, command, 0);
    gonio_machine_settle(m, STANDSTILL_US);
}

static gonio_status alarmed(const gonio_sim *sim, gonio_error *error) {
    const struct fw_core *core = &sim->machine.core;
    const unsigned axis = core->registers.alarm_axis[0];
    return gonio_fail(error, GONIO_E_DEVICE, "stage: %s%s%s; home it", alarm_text(core), axis < GONIO_AXES ? ": " : "",
                      axis < GONIO_AXES ? axis_names[axis] : "");
}

// Homing is asked for, so an alarm is cleared first, if its cause is gone.
static gonio_status stage_home(void *device, double timeout_s, gonio_error *error) {
    gonio_sim *sim = device;
    struct machine *m = &sim->machine;
    gonio_machine_run(m, 2000); // it looks at its contacts
    enum fw_refusal refusal = gonio_machine_command(m, FW_COMMAND_CLEAR, 0);
    if (refusal == FW_REFUSAL_NONE) {
        refusal = gonio_machine_command(m, FW_COMMAND_HOME, ALL_AXES);
    }
    if (refusal != FW_REFUSAL_NONE) {
        return gonio_fail(error, GONIO_E_DEVICE, "stage: no homing: %s", refusal_text(refusal));
    }
    const bool in_time = settle(m, timeout_s);
    if (!in_time) {
        stop(m, FW_COMMAND_STOP);
    }
    for (int k = 0; k < GONIO_AXES; k++) {
        sim->target_steps[k] = 0;
        sim->target_rad[k] = 0;
    }
    place_arms(sim, NULL);
    if (!in_time) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "stage: homing did not end within %.3g s", timeout_s);
    }
    return m->core.state == FW_STATE_IDLE ? GONIO_OK : alarmed(sim, error);
}

static gonio_status check_limits(const gonio_sim *sim, const int64_t steps[GONIO_AXES],
                                 const double target_rad[GONIO_AXES], gonio_error *error) {
    const struct fw_registers *r = &sim->machine.core.registers;
    for (int k = 0; k < GONIO_AXES; k++) {
        if (steps[k] < r->soft_min[k] + r->backlash[k] || steps[k] > r->soft_max[k]) {
            const sim_axis_settings *axis = &sim->settings.axis[k];
            return gonio_fail(error, GONIO_E_RANGE, "stage: %s cannot go to %.6g deg; its limits are %g and %g deg",
                              axis_names[k], gonio_degrees(target_rad[k]), axis->min_deg, axis->max_deg);
        }
    }
    return GONIO_OK;
}

static gonio_status refused(enum fw_refusal refusal, gonio_error *error) {
    if (refusal == FW_REFUSAL_NOT_HOMED) {
        return gonio_fail(error, GONIO_E_DEVICE, "stage: not homed");
    }
    return gonio_fail(error, GONIO_E_DEVICE, "stage: the move is refused: %s", refusal_text(refusal));
}

static int longest_way(const gonio_sim *sim, const int64_t steps[GONIO_AXES]) {
    int longest = 0;
    double most = -1;
    for (int k = 0; k < GONIO_AXES; k++) {
        const double way = fabs((double)(steps[k] - sim->machine.axis[k].steps)) / sim->steps_per_deg[k];
        if (way > most) {
            most = way;
            longest = k;
        }
    }
    return longest;
}

static void run_half_way(struct machine *m, int axis, int64_t target) {
    const int64_t from = m->axis[axis].steps, way = llabs(target - from);
    while (m->core.axis.under_way && 2 * llabs(m->axis[axis].steps - from) < way) {
        gonio_machine_run(m, 1000);
    }
}

// The axis with the longest way sticks half-way; where it then stands is unknown until it is homed.
static gonio_status stall(gonio_sim *sim, gonio_error *error) {
    struct machine *m = &sim->machine;
    const int worst = longest_way(sim, sim->target_steps);
    run_half_way(m, worst, sim->target_steps[worst]);
    stop(m, FW_COMMAND_HALT);
    gonio_machine_command(m, FW_COMMAND_RELEASE, (uint16_t)(1 << worst));
    return gonio_fail(error, GONIO_E_DEVICE, "stage: %s stalled at about %.3g deg on its way to %.6g deg; home it",
                      axis_names[worst], gonio_degrees(to_rad(sim, worst, m->axis[worst].steps)),
                      gonio_degrees(sim->target_rad[worst]));
}

// Pressed half-way, and let go when everything stands.
static gonio_status press_estop(gonio_sim *sim, gonio_error *error) {
    struct machine *m = &sim->machine;
    const int worst = longest_way(sim, sim->target_steps);
    run_half_way(m, worst, sim->target_steps[worst]);
    gonio_machine_hold(m, FW_CONTACT_estop, true);
    gonio_machine_run(m, 2000);
    gonio_machine_release(m, FW_CONTACT_estop);
    gonio_machine_run(m, 2000);
    return alarmed(sim, error);
}

// The move was accepted and is under way.
static gonio_status follow(gonio_sim *sim, const gonio_stamp *stamp, double takes_s, double timeout_s,
                           gonio_error *error) {
    struct machine *m = &sim->machine;
    if (gonio_sim_fault_strikes(sim, SIM_FAULT_STAGE_STALL, stamp)) {
        return stall(sim, error);
    }
    if (gonio_sim_fault_strikes(sim, SIM_FAULT_STAGE_ESTOP, stamp)) {
        return press_estop(sim, error);
    }
    const bool hangs = gonio_sim_fault_strikes(sim, SIM_FAULT_STAGE_TIMEOUT, stamp);
    if (!settle(m, hangs ? takes_s / 2 : timeout_s)) {
        stop(m, FW_COMMAND_STOP);
        return gonio_fail(error, GONIO_E_TIMEOUT, "stage: the move to pose %lld did not end within %.3g s",
                          (long long)stamp->pose, timeout_s);
    }
    return m->core.state == FW_STATE_IDLE ? GONIO_OK : alarmed(sim, error);
}

static gonio_status stage_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                               double timeout_s, gonio_error *error) {
    (void)id; // a repeated move ends where the first one did
    gonio_sim *sim = device;
    struct machine *m = &sim->machine;
    int64_t steps[GONIO_AXES], from[GONIO_AXES];
    for (int k = 0; k < GONIO_AXES; k++) {
        steps[k] = to_steps(sim, k, target_rad[k]);
        from[k] = m->core.step.position[k];
    }
    gonio_status status = check_limits(sim, steps, target_rad, error);
    if (status != GONIO_OK) {
        return status;
    }
    const enum fw_refusal refusal = gonio_machine_move(m, ALL_AXES, steps);
    if (refusal != FW_REFUSAL_NONE) {
        return refused(refusal, error);
    }
    memcpy(sim->target_steps, steps, sizeof steps);
    memcpy(sim->target_rad, target_rad, sizeof sim->target_rad);
    sim->moved = *stamp;
    const int longest = longest_way(sim, steps);
    status = follow(sim, stamp, gonio_fw_axis_seconds(&m->core, from, steps), timeout_s, error);
    if (status == GONIO_OK && gonio_sim_fault_strikes(sim, SIM_FAULT_LOST_STEPS, stamp)) {
        const int64_t lost = llround(LOST_DEG * sim->steps_per_deg[longest]);
        m->axis[longest].steps += lost;
        m->axis[longest].arm += lost;
    }
    place_arms(sim, stamp);
    return status;
}

static gonio_status stage_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    (void)error;
    const gonio_sim *sim = device;
    for (int k = 0; k < GONIO_AXES; k++) {
        position_rad[k] = to_rad(sim, k, sim->machine.core.step.position[k]);
    }
    return GONIO_OK;
}

// The nominal clock: what the controller's limits alone ask for.
static double stage_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad_[GONIO_AXES]) {
    const gonio_sim *sim = device;
    int64_t from[GONIO_AXES], to[GONIO_AXES];
    for (int k = 0; k < GONIO_AXES; k++) {
        from[k] = to_steps(sim, k, from_rad[k]);
        to[k] = to_steps(sim, k, to_rad_[k]);
    }
    return gonio_fw_axis_seconds(&sim->machine.core, from, to);
}

static gonio_status stage_check(void *device, const double from_rad[GONIO_AXES], const double to_rad_[GONIO_AXES],
                                gonio_error *error) {
    (void)from_rad;
    const gonio_sim *sim = device;
    int64_t steps[GONIO_AXES];
    for (int k = 0; k < GONIO_AXES; k++) {
        steps[k] = to_steps(sim, k, to_rad_[k]);
    }
    return check_limits(sim, steps, to_rad_, error);
}

static bool stage_turns(void *device, const double from_rad[GONIO_AXES], const double to_rad_[GONIO_AXES],
                        double turn_rad[GONIO_AXES]) {
    const gonio_sim *sim = device;
    bool turns = false;
    for (int k = 0; k < GONIO_AXES; k++) {
        const int64_t past = to_steps(sim, k, to_rad_[k]) < to_steps(sim, k, from_rad[k])
                                 ? sim->machine.core.registers.backlash[k]
                                 : 0; // it is taken up from below
        turn_rad[k] = to_rad_[k] - gonio_radians((double)past / sim->steps_per_deg[k]);
        turns = turns || past != 0;
    }
    return turns;
}

static gonio_status stage_stop(void *device, gonio_error *error) {
    (void)error;
    stop(&((gonio_sim *)device)->machine, FW_COMMAND_STOP);
    return GONIO_OK;
}

static gonio_status stage_audit(void *device, double timeout_s, double difference_rad[GONIO_AXES], gonio_error *error) {
    gonio_sim *sim = device;
    const struct fw_core *core = &sim->machine.core;
    const bool known = core->known == ALL_AXES || !sim->loses_steps;
    const gonio_status status = stage_home(sim, timeout_s, error);
    for (int k = 0; k < GONIO_AXES; k++) {
        const double off_deg = core->registers.home_difference[k] / sim->steps_per_deg[k];
        difference_rad[k] = known && status == GONIO_OK ? gonio_radians(off_deg) : (double)NAN;
    }
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        if (fabs(gonio_degrees(difference_rad[k])) > AUDIT_DEG) {
            return gonio_fail(error, GONIO_E_MISMATCH, "stage: %s had drifted by %.4g deg since the last homing",
                              axis_names[k], gonio_degrees(difference_rad[k]));
        }
    }
    return status;
}

// An encoder an axis, on the motor's side of the play, so that it tells lost steps.
static gonio_status stage_encoders(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    gonio_sim *sim = device;
    if (gonio_sim_fault_strikes(sim, SIM_FAULT_ENCODER_SILENT, &sim->moved)) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "it does not answer");
    }
    const bool frozen = gonio_sim_fault_strikes(sim, SIM_FAULT_ENCODER_FROZEN, &sim->moved);
    for (int k = 0; k < GONIO_AXES && !frozen; k++) {
        sim->encoder_rad[k] = to_rad(sim, k, sim->machine.axis[k].steps);
    }
    memcpy(position_rad, sim->encoder_rad, sizeof sim->encoder_rad);
    return GONIO_OK;
}

static void stage_close(void *device) { (void)device; }

const gonio_stage_ops gonio_sim_stage_ops = {.name = "simulated stage",
                                             .home = stage_home,
                                             .move = stage_move,
                                             .position = stage_position,
                                             .stop = stage_stop,
                                             .duration_s = stage_duration_s,
                                             .close = stage_close,
                                             .check = stage_check,
                                             .audit = stage_audit,
                                             .turns = stage_turns,
                                             .encoders = stage_encoders};
