// SPDX-License-Identifier: BSD-3-Clause
// An adaptive plan without a session: samples come from the truth itself, with the default rig's noise, and the stage's
// moves take the time that its limits allow. What tests and benches of the choice need.
#ifndef TESTS_ADAPTIVE_RUN_H
#define TESTS_ADAPTIVE_RUN_H

#include <math.h>
#include <string.h>

#include "base/random.h"
#include "host/acquire/adaptive.h"
#include "tests/simulate.h"

#define RUN_NOISE 0.003 // relative, of a sample

// Axes at 30 deg/s with 0.5 s to start and stop.
static inline double run_duration_s(void *device, const double from[GONIO_AXES], const double to[GONIO_AXES]) {
    (void)device;
    double longest = 0;
    for (int k = 0; k < GONIO_AXES; k++) {
        longest = fmax(longest, fabs(to[k] - from[k]));
    }
    return 0.5 + longest / gonio_radians(30);
}

static const gonio_stage_ops run_stage = {.name = "run", .duration_s = run_duration_s};

typedef struct adaptive_run {
    gonio_adaptive a;
    const gonio_model *truth;
    gonio_rig rig;
    gonio_pose_time time;
    gonio_pair here;
    uint64_t noise;
    double rig_s; // so far, of travel, settling and exposures
    int threads;
    int channels; // of the samples: all of the truth's, or 1: their mean, as a camera without colours has it
    // Does a pose give a sample? NULL: every one does.
    bool (*gives)(const gonio_pair *pose);
} adaptive_run;

static inline void run_begin(adaptive_run *run, const gonio_model *truth, const char *plan, uint64_t seed) {
    gonio_error error = {0};
    *run = (adaptive_run){.truth = truth, .noise = gonio_random(seed), .threads = 1, .channels = truth->channels};
    run->a.seed = seed;
    run->rig.stage = &run_stage;
    run->time = (gonio_pose_time){.settle_s = 0.2,
                                  .read_out_s = 0.045,
                                  .exposure_min_s = 1e-5,
                                  .exposure_max_s = 20,
                                  .frames = 1.5,
                                  .light = 0.003};
    if (gonio_adaptive_parse(plan, &run->a.plan, &error) != GONIO_OK) {
        simulate_die(&error);
    }
}

// The truth as the camera sees it.
static inline void run_values(const adaptive_run *run, const gonio_pair *pose, double *values) {
    gonio_model_eval_pair(run->truth, pose, values);
    if (run->channels < run->truth->channels) {
        for (int c = 1; c < run->truth->channels; c++) {
            values[0] += values[c];
        }
        values[0] /= run->truth->channels;
    }
}

// One sample of the truth, with noise.
static inline void run_sample(adaptive_run *run, const gonio_pair *pose, gonio_samples *samples) {
    double values[GONIO_CHANNELS_MAX], random[GONIO_CHANNELS_MAX], systematic[GONIO_CHANNELS_MAX];
    gonio_error error = {0};
    run_values(run, pose, values);
    for (int c = 0; c < run->channels; c++) {
        double sum = -6; // of twelve uniforms: nearly normal
        for (int k = 0; k < 12; k++) {
            sum += gonio_random_next(&run->noise);
        }
        random[c] = RUN_NOISE * values[c] + 1e-5;
        systematic[c] = 0.002 * values[c];
        values[c] += sum * random[c];
    }
    if (gonio_samples_add(samples, pose, values, random, systematic, &error) != GONIO_OK) {
        simulate_die(&error);
    }
}

// Measure the poses from `first` on, in an order of short moves.
static inline void run_measure(adaptive_run *run, size_t first) {
    gonio_adaptive *a = &run->a;
    gonio_error error = {0};
    if (a->samples == NULL) {
        if (gonio_samples_new(run->channels, true, &a->samples, &error) != GONIO_OK) {
            simulate_die(&error);
        }
        a->samples->isotropic = !a->plan.anisotropic;
        for (int c = 0; c < run->channels; c++) {
            snprintf(a->samples->channel_names[c], sizeof a->samples->channel_names[c], "c%d", c);
        }
    }
    gonio_plan plan = {a->n - first, malloc((a->n - first + 1) * sizeof(gonio_pair))};
    gonio_step *steps = calloc(plan.n + 1, sizeof *steps);
    size_t *which = calloc(plan.n + 1, sizeof *which);
    for (size_t i = 0; i < plan.n; i++) {
        plan.poses[i] = a->poses[first + i].pose;
    }
    if (gonio_scan_tour(&run->rig, &run->here, &plan, steps, which, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    for (size_t i = 0; i < plan.n; i++) {
        gonio_adaptive_pose *p = &a->poses[first + which[i]];
        run->rig_s += gonio_pose_time_travel_s(&run->time, &run->here, &steps[i].pose);
        run->here = steps[i].pose;
        double values[GONIO_CHANNELS_MAX];
        run_values(run, &p->pose, values);
        run->rig_s += gonio_pose_time_dwell_s(&run->time, &p->pose, values[0]);
        if (run->gives != NULL && !run->gives(&p->pose)) {
            continue;
        }
        run_sample(run, &p->pose, a->samples);
        p->sample = (ptrdiff_t)a->samples->n - 1;
        for (int c = 0; c < run->channels && c < GONIO_ADAPTIVE_CHANNELS; c++) {
            p->uncertainty[c] = hypot(p->uncertainty[c], gonio_samples_sigma(a->samples, a->samples->n - 1, c));
        }
    }
    free(plan.poses);
    free(steps);
    free(which);
}

static inline void run_end(adaptive_run *run) { gonio_adaptive_release(&run->a); }

// Choose and measure one more batch; how many poses it has.
static inline size_t run_batch(adaptive_run *run) {
    gonio_error error = {0};
    size_t count;
    run->time.rig = &run->rig;
    const gonio_adaptive_how how = {.time = &run->time, .here = run->here, .threads = run->threads};
    const size_t first = run->a.n;
    if (gonio_adaptive_choose(&run->a, &how, &count, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    run_measure(run, first);
    return count;
}

#endif
