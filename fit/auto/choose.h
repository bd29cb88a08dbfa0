// SPDX-License-Identifier: BSD-3-Clause
// What `--method auto` and an open `--method lsq` choose for small sets, by closed-form leave-one-out.
#ifndef GONIO_FIT_AUTO_CHOOSE_H
#define GONIO_FIT_AUTO_CHOOSE_H

#include "fit/deadline.h"
#include "fit/smooth/loo.h"

#define GONIO_AUTO_BASES (1 + GONIO_LOBE_FAMILIES) // none, and each family's lobes

// One combination that was scored.
typedef struct gonio_auto_trial {
    gonio_smooth_form form;
    int base;
    gonio_smooth_score score;
    size_t bytes; // of the model
    double ns;    // of one evaluation; 0: not asked for
    double entry; // what the score must gain for the way to this form
} gonio_auto_trial;

typedef struct gonio_auto_choice {
    gonio_smooth_base bases[GONIO_AUTO_BASES];
    int bases_n;
    gonio_auto_trial *trials;
    int trials_n, trials_room;
    int chosen;                // index of the trial
    gonio_smooth_dense *dense; // of the chosen form
    double *lambdas;           // [channels]
    double longest;            // s, that forms compared side by side took
} gonio_auto_choice;

// lobes: may the base be lobes? data is borrowed. Release with gonio_auto_choice_release.
// lobes: they may be chosen; terms: a profile and shares too, which only the direct solver knows.
gonio_status gonio_auto_choose(const gonio_dataset *data, gonio_deadline *watch, bool lobes, bool terms,
                               gonio_auto_choice *choice, gonio_error *error);
void gonio_auto_choice_release(gonio_auto_choice *choice);
// Text about the choice and its neighbours for the report.
void gonio_auto_describe(const gonio_auto_choice *choice, const gonio_fit_options *options, gonio_fit_report *report);

#endif
