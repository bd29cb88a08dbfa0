// One candidate of a large set: a form and a base, solved and scored with what was held out.
#ifndef GONIO_FIT_LSQ_SEARCH_H
#define GONIO_FIT_LSQ_SEARCH_H

#include "fit/lsq_cg.h"
#include "fit/lsq_inner.h"
#include "fit/lsq_large.h"

typedef struct gonio_lsq_search {
    const gonio_lsq_inner *in;
    const gonio_fit_options *options;
    gonio_lsq_watch *watch;
    const gonio_lsq_data *all;
    const gonio_lobe_base *lobes;
    int finest; // level that any form will have
    double ns;  // of an evaluation at this level; 0: not asked for
    gonio_lsq_base train, held;
    gonio_lsq_form form; // of the solver
    gonio_lsq_cg *cg;
    double *points;                 // channels x count, where the last solve ended
    gonio_lsq_large_choice *choice; // the best of all; NULL: nothing is compared
    gonio_lsq_form best;            // of this candidate, with lambda and score
    double lambda, score;
    double last; // score of the last attempt
} gonio_lsq_search;

gonio_status gonio_lsq_search_init(gonio_lsq_search *s, const gonio_lsq_data *all, const gonio_lsq_inner *in,
                                   gonio_lsq_watch *watch, const gonio_lobe_base *lobes, int finest,
                                   gonio_error *error);
void gonio_lsq_search_release(gonio_lsq_search *s);
// Make the solver of a form.
gonio_status gonio_lsq_search_set(gonio_lsq_search *s, const gonio_lsq_form *form, gonio_error *error);
// Solve with lambda; `warm` from where the points are. Leaves the residuals of the held-out in s->in.
gonio_status gonio_lsq_search_solve(gonio_lsq_search *s, double lambda, bool warm, gonio_lsq_score *score,
                                    gonio_error *error);
// The multilevel start alone.
gonio_status gonio_lsq_search_start(gonio_lsq_search *s, gonio_lsq_score *score, gonio_error *error);
// Like gonio_lsq_search_solve, on other targets of the training part, [train n]; out[held n].
gonio_status gonio_lsq_search_replicate(gonio_lsq_search *s, const double *targets,
                                        const gonio_lsq_large_choice *choice, double *out, gonio_error *error);

// Lambda and stiffness at the form's level, from `lambda` on where it is known (> 0). Sets s->best, lambda, score. No
// stiffness is tried where lambda alone leaves the score worse than the best of all by `hopeless`.
gonio_status gonio_lsq_search_first(gonio_lsq_search *s, const gonio_lsq_form *form, double lambda, double hopeless,
                                    gonio_error *error);
// Other levels up to s->finest, and stiffness and lambda there, from s->best on; brief: one solve at the next finer
// level.
gonio_status gonio_lsq_search_levels(gonio_lsq_search *s, bool brief, gonio_error *error);
// Is there time for one more solve? The first must be made in any case.
bool gonio_lsq_search_may_try(const gonio_lsq_search *s);

#endif
