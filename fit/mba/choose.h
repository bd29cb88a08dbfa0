// SPDX-License-Identifier: BSD-3-Clause
// Which level a multilevel fit should use, from the training samples alone, and in which coordinates and domain it is.
#ifndef GONIO_FIT_MBA_CHOOSE_H
#define GONIO_FIT_MBA_CHOOSE_H

#include "fit/prepare/scatter.h"

typedef struct gonio_mba_choice {
    gonio_scatter_options scatter;
    int level;
    char note[256];
} gonio_mba_choice;

// Fill *choice from the options; a level that they leave open is chosen by the error on inner folds of the samples.
// Coordinates are Nusselt's and the domain is linear unless the options say otherwise.
gonio_status gonio_mba_choose(const gonio_samples *samples, const gonio_fit_options *options, gonio_mba_choice *choice,
                              gonio_error *error);

#endif
