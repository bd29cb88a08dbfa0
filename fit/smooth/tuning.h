// SPDX-License-Identifier: BSD-3-Clause
// What of the score was tuned, and by which benchmark (docs/fitting.md, "Tuned constants").
#ifndef GONIO_FIT_SMOOTH_TUNING_H
#define GONIO_FIT_SMOOTH_TUNING_H

typedef struct gonio_smooth_tuning {
    double median;       // weight of ln median beside ln rms
    double median_floor; // of transformed values: a typical error of 0.2 % is below any instrument's; once there, only
                         // the worst still counts
} gonio_smooth_tuning;

static const gonio_smooth_tuning gonio_smooth_tuned = {
    .median = 0.5,
    .median_floor = 2e-3,
};

#endif
