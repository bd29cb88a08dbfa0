// SPDX-License-Identifier: BSD-3-Clause
// One candidate of a large set: a form and a base, solved and scored with what was held out.
#ifndef GONIO_FIT_AUTO_DESCENT_H
#define GONIO_FIT_AUTO_DESCENT_H

#include "fit/auto/iterative.h"
#include "fit/prepare/holdout.h"
#include "fit/smooth/cg.h"

typedef struct gonio_descent {
    const gonio_holdout *in;
    const gonio_fit_options *options;
    gonio_deadline *watch;
    const gonio_dataset *all;
    const gonio_lobe_base *lobes;
    int finest; // level that any form will have
    double ns;  // of an evaluation at this level; 0: not asked for
    gonio_smooth_base train, held;
    gonio_smooth_form form; // of the solver
    gonio_smooth_cg *cg;
    double *points;                 // channels x count, where the last solve ended
    gonio_iterative_choice *choice; // the best of all; NULL: nothing is compared
    gonio_smooth_form best;         // of this candidate, with lambda and score
    double lambda, score;
    double last; // score of the last attempt
} gonio_descent;

gonio_status gonio_descent_init(gonio_descent *s, const gonio_dataset *all, const gonio_holdout *in,
                                gonio_deadline *watch, const gonio_lobe_base *lobes, int finest, gonio_error *error);
void gonio_descent_release(gonio_descent *s);
// Make the solver of a form.
gonio_status gonio_descent_set(gonio_descent *s, const gonio_smooth_form *form, gonio_error *error);
// Solve with lambda; `warm` from where the points are. Leaves the residuals of the held-out in s->in.
gonio_status gonio_descent_solve(gonio_descent *s, double lambda, bool warm, gonio_smooth_score *score,
                                 gonio_error *error);
// The multilevel start alone.
gonio_status gonio_descent_start(gonio_descent *s, gonio_smooth_score *score, gonio_error *error);
// Like gonio_descent_solve, on other targets of the training part, [train n]; out[held n].
gonio_status gonio_descent_replicate(gonio_descent *s, const double *targets, const gonio_iterative_choice *choice,
                                     double *out, gonio_error *error);

// Lambda and stiffness at the form's level, from `lambda` on where it is known (> 0). Sets s->best, lambda, score. No
// stiffness is tried where lambda alone leaves the score worse than the best of all by `hopeless`.
gonio_status gonio_descent_first(gonio_descent *s, const gonio_smooth_form *form, double lambda, double hopeless,
                                 gonio_error *error);
// Other levels up to s->finest, and stiffness and lambda there, from s->best on; brief: one solve at the next finer
// level.
gonio_status gonio_descent_levels(gonio_descent *s, bool brief, gonio_error *error);
// Is there time for one more solve? The first must be made in any case.
bool gonio_descent_may_try(const gonio_descent *s);

#endif
