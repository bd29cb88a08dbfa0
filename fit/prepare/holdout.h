// SPDX-License-Identifier: BSD-3-Clause
// A part of a set held out inside the training samples, by which large fits are chosen.
#ifndef GONIO_FIT_PREPARE_HOLDOUT_H
#define GONIO_FIT_PREPARE_HOLDOUT_H

#include "brdf/kind/lobe_spline.h"
#include "fit/prepare/dataset.h"

#define GONIO_SMOOTH_CHANNELS_TRIED 3

typedef struct gonio_holdout {
    gonio_dataset train, held;
    int which[GONIO_SMOOTH_CHANNELS_TRIED], channels; // those of the set; more say little more
    double *residuals, *work;                         // held n x channels, held n
} gonio_holdout;

// keep[n]: what is not held out; NULL: a fifth is. Release with gonio_holdout_release.
gonio_status gonio_holdout_init(gonio_holdout *in, const gonio_dataset *data, const bool *keep, gonio_error *error);
void gonio_holdout_release(gonio_holdout *in);
// The base for the channels tried: out->strength is the caller's to free.
gonio_status gonio_holdout_lobes(const gonio_holdout *in, const gonio_lobe_base *lobes, gonio_lobe_base *out,
                                 gonio_error *error);
// Standard normal enough (12 uniforms less 6), the same for the same i.
double gonio_holdout_noise(uint64_t i);

#endif
