// SPDX-License-Identifier: BSD-3-Clause
// The iterative solver of large sets: preconditioned conjugate gradients on the lattice, no matrix stored.
#ifndef GONIO_FIT_SMOOTH_CG_H
#define GONIO_FIT_SMOOTH_CG_H

#include "brdf/spline/lattice.h"
#include "fit/deadline.h"
#include "fit/smooth/form.h"

typedef struct gonio_smooth_cg gonio_smooth_cg;

// How a solve went: how far the gradient's norm (preconditioned) fell against that of the starting point, and the
// objective against its value there.
typedef struct gonio_smooth_cg_report {
    int iterations;
    double gradient, objective;
} gonio_smooth_cg_report;

// Prepare geometries for levels up to form->level. data is borrowed until the solver is freed; the form's reciprocity
// is not used. threads 0: all; they change no bit.
gonio_status gonio_smooth_cg_new(const gonio_dataset *data, const gonio_smooth_form *form, int threads,
                                 gonio_smooth_cg **out, gonio_error *error);
// Another form in the same coordinates, of a level up to that of gonio_smooth_cg_new.
void gonio_smooth_cg_reform(gonio_smooth_cg *cg, const gonio_smooth_form *form);
void gonio_smooth_cg_free(gonio_smooth_cg *cg); // NULL is allowed
// Solves ask it at every iteration: past its time they end where they are, as a smaller number of iterations would;
// interrupted ones return GONIO_E_INTERRUPTED. Borrowed; NULL: nobody watches.
void gonio_smooth_cg_watch(gonio_smooth_cg *cg, gonio_deadline *watch);

// Control points a channel at a level: the length of `points` below.
size_t gonio_smooth_cg_count(const gonio_smooth_cg *cg, int level);
// Fit one channel of targets[i * stride] by multilevel B-spline approximation, levels 0 to `level`; points is filled.
void gonio_smooth_cg_start(gonio_smooth_cg *cg, const double *targets, size_t stride, int level, double *points);
// Go from points (any start) toward the least-squares solution; stops after `iterations`, or when the gradient has
// fallen to `tolerance` of the start's. GONIO_E_MEMORY leaves points alone.
gonio_status gonio_smooth_cg_solve(gonio_smooth_cg *cg, const double *targets, size_t stride, int level, double lambda,
                                   int iterations, double tolerance, double *points, gonio_smooth_cg_report *report,
                                   gonio_error *error);
// The start and the solve from two levels below on, the iterations shared between the levels.
gonio_status gonio_smooth_cg_cascade(gonio_smooth_cg *cg, const double *targets, size_t stride, double lambda,
                                     int iterations, double tolerance, double *points, gonio_smooth_cg_report *report,
                                     gonio_error *error);
// The spline at any geometries (not only the solver's), out[i * stride].
gonio_status gonio_smooth_cg_eval(const gonio_smooth_cg *cg, const gonio_dataset *at, int level, const double *points,
                                  double *out, size_t stride, gonio_error *error);

#endif
