// Least squares on large sets: level, lambda and form chosen on inner held-out geometries, solved by iteration.
#ifndef GONIO_FIT_LSQ_LARGE_H
#define GONIO_FIT_LSQ_LARGE_H

#include "fit/lobe_model.h"
#include "fit/lsq_select.h"
#include "fit/lsq_watch.h"

// A form and a base to try.
typedef struct gonio_lsq_candidate {
    gonio_lsq_form form;          // its level is where the search begins
    const gonio_lobe_base *lobes; // NULL: none; borrowed
    double lambda;                // with the form where it begins; 0: not known
} gonio_lsq_candidate;

#define GONIO_LSQ_GRAZING 2 // grazing factors that are tried beside none
#define GONIO_LSQ_CANDIDATES (GONIO_COORDINATES * (2 + GONIO_LSQ_GRAZING))
// Bases of a grazing factor alone, exponents 1/2 and 1 (fit/lobe_model.h). Candidates without lobes stand in the order
// of the exponent.
void gonio_lsq_grazing_bases(const gonio_lsq_data *data, gonio_lobe_base bases[GONIO_LSQ_GRAZING]);

// The best that was scored of a base in some coordinates at a level.
typedef struct gonio_lsq_large_trial {
    gonio_lsq_form form;
    double lambda;
    const gonio_lobe_base *lobes; // borrowed
    gonio_lsq_score score;
} gonio_lsq_large_trial;

#define GONIO_LSQ_LARGE_TRIALS (10 * GONIO_LSQ_CANDIDATES) // each at all levels

typedef struct gonio_lsq_large_choice {
    gonio_lsq_large_trial trials[GONIO_LSQ_LARGE_TRIALS];
    int trials_n;
    gonio_lsq_form form;
    const gonio_lobe_base *lobes;
    double lambda;
    gonio_lsq_score score, start_score; // on the held-out geometries: of the solution, of its multilevel start
    double ns;                          // of an evaluation; 0: not asked for
    bool start_only;                    // the start was better: it is the answer
    int iterations;                     // of the final solve, the most of any channel
    double gradient;                    // how far its gradient fell, the worst of any channel
} gonio_lsq_large_choice;

// Choose among the candidates; every fifth geometry is held out. compare_only: the level is searched
// roughly, for a choice that goes on with more samples.
gonio_status gonio_lsq_large_choose(const gonio_lsq_data *data, gonio_lsq_watch *watch,
                                    const gonio_lsq_candidate *candidates, int n, bool compare_only,
                                    gonio_lsq_large_choice *choice, gonio_error *error);
// Fit the choice to all geometries.
gonio_status gonio_lsq_large_parts(const gonio_lsq_data *data, gonio_lsq_watch *watch, gonio_lsq_large_choice *choice,
                                   gonio_lobe_model_parts *parts, gonio_error *error);

// A choice fitted without some geometries, and what it makes of them. Some channels: all, or three spread over them.
typedef struct gonio_lsq_left_out {
    gonio_lsq_data kept, held;
    double *residuals; // [held n x held channels], of link values
    double *replicate; // [held n]: what one draw of noise in the kept samples leaves there, in the noise's own units at
                       // full weight
} gonio_lsq_left_out;

gonio_status gonio_lsq_large_leave_out(const gonio_lsq_data *data, gonio_lsq_watch *watch,
                                       const gonio_lsq_large_choice *choice, const bool *keep, gonio_lsq_left_out *out,
                                       gonio_error *error);
void gonio_lsq_left_out_release(gonio_lsq_left_out *out);

#endif
