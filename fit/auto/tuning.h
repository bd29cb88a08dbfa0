// SPDX-License-Identifier: BSD-3-Clause
// What of the choice was tuned, and by which benchmark (docs/fitting.md, "Tuned constants"). Scores are sums of
// logarithms of errors: 0.015 is 1 % of all of them.
#ifndef GONIO_FIT_AUTO_TUNING_H
#define GONIO_FIT_AUTO_TUNING_H

#include <stddef.h>

typedef struct gonio_auto_tuning {
    double close; // what comes so close to the best goes on; twice as far where it has not been improved yet
    // Small sets.
    size_t part;     // number of geometries on which forms are compared
    int channels;    // number of channels on which they are
    double gain;     // what a step must gain
    double profile;  // price of a profile: a second lattice
    double width;    // price of other widths of the half vector than the usual one: more to choose from
    double no_lobes; // price of doing without lobes, which go on where nothing was measured
    // Large sets.
    size_t compared;  // number of geometries on which candidates are compared
    double hopeless;  // what is worse by so much is not made good by stiffness
    double worse;     // a lambda that is worse by so much ends a search in its direction; less may be a bump
    double rms_floor; // of transformed values: an error of 1 % of all values is below any instrument's
    double peak;      // weight of ln rmse beside ln rms + ln median/2
} gonio_auto_tuning;

static const gonio_auto_tuning gonio_auto_tuned = {
    .close = 0.5,
    .part = 500,
    .channels = 5,
    .gain = 0.02,
    .profile = 0.03,
    .width = 0.15,
    .no_lobes = 0.03,
    .compared = 20000,
    .hopeless = 2,
    .worse = 0.3,
    .rms_floor = 1e-2,
    .peak = 0.75,
};

#endif
