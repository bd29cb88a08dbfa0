// SPDX-License-Identifier: BSD-3-Clause
// The simulated rig's own state; private to sim/.
#ifndef GONIO_SIM_INTERNAL_H
#define GONIO_SIM_INTERNAL_H

#include "firmware/board/posix/machine.h"
#include "gonio/sim.h"
#include "sim/response.h"
#include "sim/scene.h"
#include "sim/sensor.h"
#include "sim/settings.h"

#define SIM_WANDER_TERMS 4

// What is drawn once from the seed: the truth behind every stated uncertainty.
typedef struct sim_truth {
    double zero_error_rad[GONIO_AXES];
    sim_axis axis[GONIO_AXES];
    gonio_vec3 ball_centre; // where the ball came to lie
    double reflectance[3];  // of the white reference
    double drift_per_s;     // relative
    double ambient, glare;  // stray light, relative to white and to the scene's mean
    double wander_amplitude, wander_rad_per_s[SIM_WANDER_TERMS], wander_rad[SIM_WANDER_TERMS];
} sim_truth;

struct gonio_sim {
    uint64_t seed;
    int threads;
    sim_settings settings;
    gonio_model *sample;        // what the spec says
    gonio_model *ball, *mirror; // after open: of the targets that show the light
    gonio_model *seen;          // the same in the camera's channels, after open; may be `sample` itself
    sim_truth truth;
    sim_sensor *sensor; // after open
    sim_response *response;
    int fault_hits[SIM_FAULTS];
    bool loses_steps; // was ever told to, perhaps in the process before this one

    struct machine machine; // the controller with its motors and switches
    double steps_per_deg[GONIO_AXES];
    int64_t target_steps[GONIO_AXES]; // of the last move
    double target_rad[GONIO_AXES];
    double actual_rad[GONIO_AXES];  // where the arms really stand
    gonio_stamp moved;              // the stamp of the last move
    double encoder_rad[GONIO_AXES]; // as last read
    double lamp_level;
    bool shutter_open;
    struct {
        double exposure_s, gain_db;
        int32_t next; // frame
    } stream;
    gonio_target target;
    sim_texture texture; // of the fiducial; its pixels are owned
};

// Power the stage up: nothing is homed, the arms stand at 0.
gonio_status gonio_sim_stage_start(gonio_sim *sim, gonio_error *error);
extern const gonio_stage_ops gonio_sim_stage_ops;
extern const gonio_lamp_ops gonio_sim_lamp_ops;
extern const gonio_meter_ops gonio_sim_meter_ops;
extern const gonio_camera_ops gonio_sim_camera_ops;
extern const gonio_mount_ops gonio_sim_mount_ops;
extern const gonio_interlock_ops gonio_sim_interlock_ops;

// Does the fault strike now? Counts the hit.
bool gonio_sim_fault_strikes(gonio_sim *sim, sim_fault_kind kind, const gonio_stamp *stamp);
// The lamp's output relative to its nominal one at a time; and with the fault that puts it out.
double gonio_sim_lamp_curve(const gonio_sim *sim, double clock_s);
double gonio_sim_lamp_output(gonio_sim *sim, const gonio_stamp *stamp, double after_s);
gonio_pattern gonio_sim_camera_pattern(const gonio_sim *sim);
void gonio_sim_camera_describe(const gonio_sim *sim, gonio_camera_info *info);

#endif
