// SPDX-License-Identifier: BSD-3-Clause
// Least squares on large sets: level, lambda and form chosen on inner held-out geometries, solved by iteration.
#ifndef GONIO_FIT_AUTO_ITERATIVE_H
#define GONIO_FIT_AUTO_ITERATIVE_H

#include "brdf/kind/lobe_spline.h"
#include "fit/deadline.h"
#include "fit/smooth/loo.h"

// A form and a base to try.
typedef struct gonio_smooth_candidate {
    gonio_smooth_form form;       // its level is where the search begins
    const gonio_lobe_base *lobes; // NULL: none; borrowed
    double lambda;                // with the form where it begins; 0: not known
} gonio_smooth_candidate;

#define GONIO_SMOOTH_GRAZING 2 // grazing factors that are tried beside none
#define GONIO_SMOOTH_CANDIDATES (GONIO_COORDINATES * (2 + GONIO_SMOOTH_GRAZING))
// Bases of a grazing factor alone, exponents 1/2 and 1 (brdf/kind/lobe_spline.h). Candidates without lobes stand in the
// order of the exponent.
void gonio_smooth_grazing_bases(const gonio_dataset *data, gonio_lobe_base bases[GONIO_SMOOTH_GRAZING]);

// The best that was scored of a base in some coordinates at a level.
typedef struct gonio_iterative_trial {
    gonio_smooth_form form;
    double lambda;
    const gonio_lobe_base *lobes; // borrowed
    gonio_smooth_score score;
} gonio_iterative_trial;

#define GONIO_ITERATIVE_TRIALS ((GONIO_LEVEL_MAX + 1) * GONIO_SMOOTH_CANDIDATES) // each at all levels

typedef struct gonio_iterative_choice {
    gonio_iterative_trial trials[GONIO_ITERATIVE_TRIALS];
    int trials_n;
    gonio_smooth_form form;
    const gonio_lobe_base *lobes;
    double lambda;
    gonio_smooth_score score, start_score; // on the held-out geometries: of the solution, of its multilevel start
    double ns;                             // of an evaluation; 0: not asked for
    bool start_only;                       // the start was better: it is the answer
    int iterations;                        // of the final solve, the most of any channel
    double gradient;                       // how far its gradient fell, the worst of any channel
} gonio_iterative_choice;

// Choose among the candidates; every fifth geometry is held out. compare_only: the level is searched
// roughly, for a choice that goes on with more samples.
gonio_status gonio_iterative_choose(const gonio_dataset *data, gonio_deadline *watch,
                                    const gonio_smooth_candidate *candidates, int n, bool compare_only,
                                    gonio_iterative_choice *choice, gonio_error *error);
// Fit the choice to all geometries.
gonio_status gonio_iterative_parts(const gonio_dataset *data, gonio_deadline *watch, gonio_iterative_choice *choice,
                                   gonio_lobe_spline_parts *parts, gonio_error *error);

// A choice fitted without some geometries, and what it makes of them. Some channels: all, or three spread over them.
typedef struct gonio_left_out {
    gonio_dataset kept, held;
    double *residuals; // [held n x held channels], of transformed values
    double *replicate; // [held n]: what one draw of noise in the kept samples leaves there, in the noise's own units at
                       // full weight
} gonio_left_out;

gonio_status gonio_iterative_leave_out(const gonio_dataset *data, gonio_deadline *watch,
                                       const gonio_iterative_choice *choice, const bool *keep, gonio_left_out *out,
                                       gonio_error *error);
void gonio_left_out_release(gonio_left_out *out);

#endif
