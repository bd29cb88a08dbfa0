// SPDX-License-Identifier: BSD-3-Clause
// Counter-based random numbers: every draw is a pure function of (seed, effect, pose, frame, index), so that order,
// threads, windows and restarts cannot change it.
#ifndef GONIO_SIM_RANDOM_H
#define GONIO_SIM_RANDOM_H

#include <stdint.h>

// What a draw is for; each effect has a stream of its own. The numbers are part of what a session reproduces: append,
// never renumber.
typedef enum sim_effect {
    SIM_ZERO_ERROR = 1,    // of an axis
    SIM_REPEATABILITY = 2, // of an axis at a pose
    SIM_REFERENCE = 3,     // white reference scale
    SIM_DRIFT = 4,         // lamp drift rate
    SIM_WANDER = 5,        // lamp wander's phases
    SIM_METER = 6,         // a monitor reading
    SIM_PRNU = 7,
    SIM_DARK = 8,
    SIM_OFFSET = 9,
    SIM_HOT = 10,
    SIM_SHOT = 11,
    SIM_READ = 12,
    SIM_STRAY = 13,      // room's scatter, lens' glare
    SIM_STRAY_POSE = 14, // the room's scatter at a pose
    SIM_AXES = 20,       // where an axis stands in space
} sim_effect;

typedef struct sim_draw {
    uint32_t word[4];
} sim_draw;

// Philox4x32-10; pose < 2^56.
sim_draw gonio_sim_random(uint64_t seed, sim_effect effect, int64_t pose, int32_t frame, uint32_t index);

// Uniform in (0, 1), 53 bits, never 0 or 1; k = 0 or 1 takes one half of the draw.
double gonio_sim_uniform(const sim_draw *draw, int k);
// Two independent standard normals of one draw.
void gonio_sim_normals(const sim_draw *draw, double normals[2]);
// The first of them.
double gonio_sim_normal(uint64_t seed, sim_effect effect, int64_t pose, int32_t frame, uint32_t index);

// A Poisson count of the given mean from one uniform u (inversion, exact; meant for means below SIM_POISSON_EXACT) ...
#define SIM_POISSON_EXACT 30.0
double gonio_sim_poisson_small(double mean, double u);
// ... and from one standard normal, for means from SIM_POISSON_EXACT on.
double gonio_sim_poisson_large(double mean, double normal);

#endif
