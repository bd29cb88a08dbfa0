// SPDX-License-Identifier: BSD-3-Clause
// What of the uncertainty was tuned, and by which benchmark (docs/fitting.md, "Tuned constants").
#ifndef GONIO_FIT_SIGMA_TUNING_H
#define GONIO_FIT_SIGMA_TUNING_H

#include <stddef.h>

typedef struct gonio_sigma_tuning {
    // The law (fit/sigma/law.c).
    double freedom;          // of Student's t that residuals have
    double roughness;        // standard deviation of u: roughness varies by factors of e over a domain
    size_t neighbours;       // the nearest samples that reach to one standard deviation of the window: so many,
    size_t neighbours_part;  // or one of so many of the samples,
    size_t neighbours_most;  // at most so many
    double window;           // closer samples lie in the same few cells
    double tilt;             // a lobe of alpha 0.15 is as wide as half of the range of theta_d then
    double correction_floor; // of the residuals' median square: a tenth of the typical residual
    double slopes_floor;     // parameters known to 0.3 %
    double selection; // of the variance: coordinates, base, level and lambda were chosen on the same samples, which
                      // makes left-out residuals too good by 10 %
    double block;     // weight of a block beside a sample left out alone: blocks overlap
    double power[3], spread; // expected of the exponents of U, S and G, and the standard deviation about that: fits of
                             // ln error^2 at new directions gave 0.4 to 0.7 for U and S and 0.3 to 0.4 for G
    double gap_power;        // of U where it is a squared distance, with a standard deviation of 1
    // The step from the law to what physics leaves open (fit/sigma/beyond.c).
    double law_from, law_to; // support: below, the materials' spread alone; above, the law alone,
    double law_samples;      // where there are as many samples to learn it from
    double law_most;         // ln sigma: a factor of e^2 says no more than "unknown"
    // The field (fit/sigma/field.c).
    double lambda;    // smooths what one probe says against its neighbours
    double held_back; // of the square of the lobes' step beyond the samples' angles
} gonio_sigma_tuning;

static const gonio_sigma_tuning gonio_sigma_tuned = {
    .freedom = 5,
    .roughness = 1.5,
    .neighbours = 8,
    .neighbours_part = 25,
    .neighbours_most = 24,
    .window = 0.03,
    .tilt = 6,
    .correction_floor = 0.01,
    .slopes_floor = 1e-5,
    .selection = 1.21,
    .block = 0.5,
    .power = {0.6, 0.6, 0.3},
    .spread = 0.25,
    .gap_power = 1.5,
    .law_from = 0.85,
    .law_to = 0.985,
    .law_samples = 60,
    .law_most = 2,
    .lambda = 1e-4,
    .held_back = 1.75,
};

#endif
