// SPDX-License-Identifier: BSD-3-Clause
// How long a pose takes: travel, settling, the exposures of its bracket and their read-out.
//
// The exposures of a flat sample go with 1 / (f_r cos(theta_i)), between the camera's limits; what is left is one
// number of the rig, lamp and camera, which done poses tell. Before there are any it is a guess.
#ifndef GONIO_HOST_ACQUIRE_POSE_TIME_H
#define GONIO_HOST_ACQUIRE_POSE_TIME_H

#include "host/acquire/acquire.h"

// Typical frames a pose; what bracketing really needs depends on the sample.
#define GONIO_FRAMES_A_POSE 2.5

typedef struct gonio_pose_time {
    const gonio_rig *rig; // borrowed
    double settle_s, read_out_s, exposure_min_s, exposure_max_s;
    double frames; // a pose
    double light;  // seconds of exposure x f_r cos(theta_i)
} gonio_pose_time;

// The guess, from rig and setup. Both are borrowed.
gonio_pose_time gonio_pose_time_of(const gonio_rig *rig, const gonio_setup *setup);
// Learn from done steps: frames, and, where values (f_r of each step, mean over channels; NaN: no sample) is given, the
// light. What was learnt does not depend on the wall clock.
void gonio_pose_time_learn(gonio_pose_time *time, const gonio_step *steps, const double *values, size_t n);
double gonio_pose_time_travel_s(const gonio_pose_time *time, const gonio_pair *from, const gonio_pair *to);
// Settling, exposures and read-out where f_r is about `value` (NaN: not known).
double gonio_pose_time_dwell_s(const gonio_pose_time *time, const gonio_pair *pose, double value);
// Both (gonio_pose_seconds, whose context is a gonio_pose_time); from NULL: no way.
double gonio_pose_time_s(void *time, const gonio_pair *from, const gonio_pair *to, double value);

#endif
