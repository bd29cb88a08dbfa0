// The four axes in simulated time: a move takes none, but its duration on the nominal clock follows from the limits.
//
// Where an arm stands after a move is a function of the target and the stamp: target + zero error (per seed) +
// repeatability (per pose). Backlash adds nothing, because every approach ends in the positive direction, as homing
// does; with backlash_takeup = 0 an approach from above stands high by the backlash.
#include <math.h>
#include <string.h>

#include "sim/internal.h"
#include "sim/random.h"

// A fault lost_steps, and the drift that an audit takes for lost steps.
#define LOST_DEG 0.5
#define AUDIT_DEG 0.01

static const char *const axis_names[GONIO_AXES] = {"light_theta", "light_phi", "camera_theta", "camera_phi"};

// The trapezoidal profile, triangular where the distance is too short to reach full speed.
static double profile_s(const sim_axis_settings *axis, double distance_deg) {
    const double v = axis->speed_deg_per_s, a = axis->acceleration_deg_per_s2;
    return distance_deg < v * v / a ? 2 * sqrt(distance_deg / a) : distance_deg / v + v / a;
}

// The axis passes a target that lies below by twice its backlash and comes back.
static double axis_duration_s(const gonio_sim *sim, int k, double from_rad, double to_rad) {
    const sim_axis_settings *axis = &sim->settings.axis[k];
    const double down = gonio_degrees(from_rad - to_rad), past = 2 * axis->backlash_deg;
    if (down <= 0 || past == 0 || !sim->settings.rig.backlash_takeup) {
        return profile_s(axis, fabs(down));
    }
    return profile_s(axis, down + past) + profile_s(axis, past);
}

static double stage_duration_s(void *device, const double from_rad[GONIO_AXES], const double to_rad[GONIO_AXES]) {
    double longest = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        longest = fmax(longest, axis_duration_s(device, k, from_rad[k], to_rad[k]));
    }
    return longest;
}

static gonio_status stage_home(void *device, double timeout_s, gonio_error *error) {
    gonio_sim *sim = device;
    const double zero[GONIO_AXES] = {0};
    const double takes_s = stage_duration_s(sim, sim->position_rad, zero);
    if (takes_s > timeout_s) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "stage: homing takes %.3g s, allowed were %.3g s", takes_s,
                          timeout_s);
    }
    for (int k = 0; k < GONIO_AXES; k++) {
        sim->position_rad[k] = 0;
        sim->lost_rad[k] = 0;
        sim->actual_rad[k] = sim->truth.zero_error_rad[k];
    }
    sim->homed = true;
    return GONIO_OK;
}

static gonio_status check_target(const gonio_sim *sim, const double target_rad[GONIO_AXES], gonio_error *error) {
    if (!sim->homed) {
        return gonio_fail(error, GONIO_E_DEVICE, "stage: not homed");
    }
    for (int k = 0; k < GONIO_AXES; k++) {
        const sim_axis_settings *axis = &sim->settings.axis[k];
        const double deg = gonio_degrees(target_rad[k]);
        if (!(deg >= axis->min_deg && deg <= axis->max_deg)) {
            return gonio_fail(error, GONIO_E_RANGE, "stage: %s cannot go to %.6g deg; its limits are %g and %g deg",
                              axis_names[k], deg, axis->min_deg, axis->max_deg);
        }
    }
    return GONIO_OK;
}

static int longest_way(const gonio_sim *sim, const double target_rad[GONIO_AXES]) {
    int worst = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        if (fabs(target_rad[k] - sim->position_rad[k]) > fabs(target_rad[worst] - sim->position_rad[worst])) {
            worst = k;
        }
    }
    return worst;
}

// The axis with the longest way sticks half-way; where it then stands is unknown until it is homed.
static gonio_status stall(gonio_sim *sim, const double target_rad[GONIO_AXES], gonio_error *error) {
    const int worst = longest_way(sim, target_rad);
    for (int k = 0; k < GONIO_AXES; k++) {
        sim->actual_rad[k] = sim->position_rad[k] = (sim->position_rad[k] + target_rad[k]) / 2;
    }
    sim->homed = false;
    return gonio_fail(error, GONIO_E_DEVICE, "stage: %s stalled at about %.3g deg on its way to %.6g deg; home it",
                      axis_names[worst], gonio_degrees(sim->position_rad[worst]), gonio_degrees(target_rad[worst]));
}

static double settle(const gonio_sim *sim, int k, double target_rad, const gonio_stamp *stamp) {
    const sim_axis_settings *axis = &sim->settings.axis[k];
    const double repeatability =
        axis->pointing_deg / sqrt(2) * sim_normal(sim->seed, SIM_REPEATABILITY, stamp->pose, 0, (uint32_t)k);
    const bool from_above = !sim->settings.rig.backlash_takeup && target_rad < sim->position_rad[k];
    return target_rad + sim->truth.zero_error_rad[k] + sim->lost_rad[k] +
           gonio_radians(repeatability + (from_above ? axis->backlash_deg : 0));
}

static gonio_status stage_move(void *device, const double target_rad[GONIO_AXES], uint32_t id, const gonio_stamp *stamp,
                               double timeout_s, gonio_error *error) {
    (void)id; // a repeated move ends where the first one did
    gonio_sim *sim = device;
    gonio_status status = check_target(sim, target_rad, error);
    if (status != GONIO_OK) {
        return status;
    }
    sim->moved = *stamp;
    if (sim_fault_strikes(sim, SIM_FAULT_STAGE_STALL, stamp)) {
        return stall(sim, target_rad, error);
    }
    const double takes_s = stage_duration_s(sim, sim->position_rad, target_rad);
    if (takes_s > timeout_s || sim_fault_strikes(sim, SIM_FAULT_STAGE_TIMEOUT, stamp)) {
        return gonio_fail(error, GONIO_E_TIMEOUT, "stage: the move to pose %lld did not end within %.3g s",
                          (long long)stamp->pose, timeout_s);
    }
    if (sim_fault_strikes(sim, SIM_FAULT_LOST_STEPS, stamp)) {
        sim->lost_rad[longest_way(sim, target_rad)] += gonio_radians(LOST_DEG);
    }
    for (int k = 0; k < GONIO_AXES; k++) {
        sim->actual_rad[k] = settle(sim, k, target_rad[k], stamp);
    }
    memcpy(sim->position_rad, target_rad, sizeof sim->position_rad);
    return GONIO_OK;
}

static gonio_status stage_position(void *device, double position_rad[GONIO_AXES], gonio_error *error) {
    (void)error;
    memcpy(position_rad, ((gonio_sim *)device)->position_rad, sizeof(double[GONIO_AXES]));
    return GONIO_OK;
}

// A move is over when its call returns, so there is nothing left to stop.
static gonio_status stage_stop(void *device, gonio_error *error) {
    (void)device;
    (void)error;
    return GONIO_OK;
}

static gonio_status stage_audit(void *device, double timeout_s, double difference_rad[GONIO_AXES], gonio_error *error) {
    gonio_sim *sim = device;
    const bool known = sim->homed || !sim->loses_steps;
    for (int k = 0; k < GONIO_AXES; k++) {
        difference_rad[k] = known ? 0 - sim->lost_rad[k] : (double)NAN;
    }
    const gonio_status status = stage_home(sim, timeout_s, error);
    for (int k = 0; k < GONIO_AXES && status == GONIO_OK; k++) {
        if (fabs(gonio_degrees(difference_rad[k])) > AUDIT_DEG) {
            return gonio_fail(error, GONIO_E_MISMATCH, "stage: %s had drifted by %.4g deg since the last homing",
                              axis_names[k], gonio_degrees(difference_rad[k]));
        }
    }
    return status;
}

static void stage_close(void *device) { (void)device; }

const gonio_stage_ops sim_stage_ops = {.api_version = GONIO_RIG_API_VERSION,
                                       .name = "simulated stage",
                                       .home = stage_home,
                                       .move = stage_move,
                                       .position = stage_position,
                                       .stop = stage_stop,
                                       .duration_s = stage_duration_s,
                                       .close = stage_close,
                                       .audit = stage_audit};
