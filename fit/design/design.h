// SPDX-License-Identifier: BSD-3-Clause
// Where to measure next: the poses that take most of a model's uncertainty away for a second of the rig's time.
//
// The model of the samples so far tells a relative sigma s(x) everywhere; where samples lie tells what they leave
// unknown of a smooth deviation, and how alike that is at two places. Together they are a Gaussian process C(x, y),
// conditioned on the samples (fit/design/posterior.c) and scaled to the geometric mean of both spreads. A sample at x
// takes C(x, y)^2 / (C(x, x) + noise) of the variance at y away. Summed over all directions, with their need, that is
// the gain of a pose (Cohn, "Neural network exploration using optimal experiment design", 1994); the greedy choice
// takes the largest gain a second, conditions C on it and goes on. Travel counts beyond what a tour of the batch takes
// anyway.
#ifndef GONIO_FIT_DESIGN_DESIGN_H
#define GONIO_FIT_DESIGN_DESIGN_H

#include "gonio/fit.h"
#include "gonio/sample.h"

// A place where a prediction was further from what was measured than its sigma said.
typedef struct gonio_design_surprise {
    gonio_pair pair;
    double variance; // of the relative error, beyond what sigma explains
} gonio_design_surprise;

typedef struct gonio_design {
    bool isotropic;
    double theta_max; // rad; of both directions
    uint64_t seed;    // of the candidates
    int threads;      // 0: all; changes nothing
    void *context;
    // Required: seconds of a move, and of settling and exposures at a pose where f_r is about `value`.
    double (*travel_s)(void *context, const gonio_pair *from, const gonio_pair *to);
    double (*dwell_s)(void *context, const gonio_pair *pose, double value);
    bool (*allowed)(void *context, const gonio_pair *pose); // optional: can the rig go there
    // What is asked for, each with what it is worth; 0: all directions alike.
    const gonio_pair *asked;
    const double *asked_worth;
    size_t asked_n;
    const gonio_design_surprise *surprises;
    size_t surprises_n;
    const gonio_pair *barred; // about these nothing more is asked for
    size_t barred_n;
} gonio_design;

typedef struct gonio_design_pose {
    gonio_pair pose;
    double sigma; // relative, at the pose before it was chosen
    double gain;  // the part of what is unknown everywhere that it takes away
    double seconds;
} gonio_design_pose;

// n poses of model and samples (those that it was fitted to); `taken` (taken_n of them) will be measured in any case.
// here: where the rig stands. Fewer come back where no candidate is left: *count. chosen[n].
gonio_status gonio_design_choose(const gonio_design *design, const gonio_model *model, const gonio_samples *samples,
                                 const gonio_pair *taken, size_t taken_n, const gonio_pair *here, size_t n,
                                 gonio_design_pose *chosen, size_t *count, gonio_error *error);
// The i-th pose about the mirror direction, no theta above theta_max: evenly over the tilt as half-vector coordinates
// stretch it, so that a narrow peak is found.
gonio_pair gonio_design_mirror_place(uint64_t i, bool isotropic, double theta_max);
// Relative standard uncertainty of a model at a pair, as the figures have it, over (f + 1e-3); *value: f, mean over the
// channels. 1 where the model tells none.
double gonio_design_spread(const gonio_model *model, const gonio_pair *pair, double *value);

#endif
