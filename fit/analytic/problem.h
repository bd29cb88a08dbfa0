// SPDX-License-Identifier: BSD-3-Clause
// Levenberg-Marquardt for a sum of lobes: shapes that all channels share, strengths that each has of its own.
//
// With f = offset + sum_k p_ck u_k(shapes), a residual of sample i and channel c depends on the shapes and on the
// channel's own strengths alone. The normal matrix is an arrow: a block of the shapes, one block a channel, and what
// joins them, so a step costs no more than the channels times one small solution, and the Schur complement of the
// shapes is the matrix of Kaufman's variable projection ("A variable projection method for solving separable nonlinear
// least squares problems", 1975). Where the residuals are linear in the strengths (any loss but the logarithm), these
// are solved for at every trial; starts then consist of shapes alone.
#ifndef GONIO_FIT_ANALYTIC_PROBLEM_H
#define GONIO_FIT_ANALYTIC_PROBLEM_H

#include "fit/analytic/plan.h"

enum {
    GONIO_ANALYTIC_LOBES_MAX = 5,
    GONIO_ANALYTIC_OWN_MAX = 4, // shapes of one lobe
};

// Which shapes and strengths there are, and where they go.
typedef struct gonio_analytic_layout {
    const gonio_analytic_plan *plan;
    int lobes, shapes, strengths, own; // own: shapes a lobe
    const gonio_analytic_variable *variables;
    struct {
        int lobe, parameter;
    } strength[GONIO_ANALYTIC_STRENGTHS_MAX];
    double low[GONIO_ANALYTIC_SHAPES_MAX], high[GONIO_ANALYTIC_SHAPES_MAX]; // as they are varied
    double limit;                                                           // of strengths
} gonio_analytic_layout;

void gonio_analytic_layout_init(gonio_analytic_layout *layout, const gonio_analytic_plan *plan, bool isotropic,
                                int lobes);
// The formula's parameters of one lobe for these shapes, its linear ones 0.
void gonio_analytic_parameters_of(const gonio_analytic_layout *layout, const double *shapes, int lobe, double *p);
// The value of a shape, and its derivative by what is varied.
double gonio_analytic_value_of(const gonio_analytic_variable *variable, double varied, double *slope);

// What a residual measures.
typedef struct gonio_analytic_loss {
    gonio_loss loss;
    bool is_signed; // of the logarithm: asinh in its place
} gonio_analytic_loss;

typedef struct gonio_analytic_data {
    size_t n;
    int channels;
    gonio_analytic_loss loss;
    const gonio_lobe_geometry *geometry; // [n]
    const double *y;                     // [channels][n], in units of order 1
    const double *weight;                // [n]
    const double *eps, *highest;         // [channels]; the highest sample
} gonio_analytic_data;

// The residual of a value f, and its derivative by f.
double gonio_analytic_residual(const gonio_analytic_data *data, int channel, size_t i, double f, double *slope);

// A point of the search, with the lobes' values and derivatives at it.
typedef struct gonio_analytic_point {
    double shapes[GONIO_ANALYTIC_SHAPES_MAX];
    double *strengths; // [channels][layout->strengths]
    double *units;     // [n + 1][strengths][1 + OWN]: u_k and its derivatives by its lobe's shapes; last at the normal
    double *offsets;   // [n + 1][1 + OWN] of an absolute formula, else NULL
    double cost;       // half the sum of the squared residuals
} gonio_analytic_point;

typedef struct gonio_analytic_problem {
    const gonio_analytic_layout *layout;
    const gonio_analytic_data *data;
} gonio_analytic_problem;

gonio_status gonio_analytic_point_init(gonio_analytic_point *point, const gonio_analytic_problem *problem,
                                       gonio_error *error);
void gonio_analytic_point_release(gonio_analytic_point *point);
// The units of point->shapes.
void gonio_analytic_units(const gonio_analytic_problem *problem, gonio_analytic_point *point);
// The best strengths between 0 and the limit for them.
void gonio_analytic_solve_strengths(const gonio_analytic_problem *problem, gonio_analytic_point *point);
void gonio_analytic_cost(const gonio_analytic_problem *problem, gonio_analytic_point *point);
// f of a channel at a sample, and its derivative by every shape (NULL: not wanted).
double gonio_analytic_value_at(const gonio_analytic_problem *problem, const gonio_analytic_point *point, int channel,
                               size_t i, double *by_shape);

// What is paid for a peak above all samples, a residual too: its slope is GONIO_ANALYTIC_PRICE by the logarithm of the
// peak, whose unit and derivatives go to *unit. 0: nothing is.
#define GONIO_ANALYTIC_PRICE 0.1
double gonio_analytic_price(const gonio_analytic_problem *problem, const gonio_analytic_point *point, int channel,
                            int strength, const double **unit);

// The arrow; see arrow.c.
typedef struct gonio_arrow {
    int shapes, strengths, channels;
    double *core;  // [shapes][shapes]
    double *side;  // [channels][strengths][shapes]
    double *block; // [channels][strengths][strengths]
    double *right; // the negative gradient: shapes, then the channels' strengths
    double *step;  // as right
    bool *held;    // as right: at a bound that the step would cross
    double *scratch;
} gonio_arrow;

gonio_status gonio_arrow_init(gonio_arrow *arrow, const gonio_analytic_problem *problem, gonio_error *error);
void gonio_arrow_release(gonio_arrow *arrow);
void gonio_arrow_fill(gonio_arrow *arrow, const gonio_analytic_problem *problem, const gonio_analytic_point *point);
// step = (A + lambda diag A)^-1 right over what is not held; false: not positive definite.
bool gonio_arrow_solve(gonio_arrow *arrow, double lambda);
// Variances of every unknown, in units of the residuals' variance, as right; infinite where the data do not decide.
// Returns the condition number of the Jacobian with columns of unit length (INFINITY: singular).
double gonio_arrow_variances(gonio_arrow *arrow, double *variances);

// How a search ended.
typedef struct gonio_analytic_end {
    bool converged;
    int iterations;
    // Of a multi-start: how many starts went down, and the rms residuals at which the best and the worst of them ended.
    int starts;
    double best, worst;
} gonio_analytic_end;

// From point->shapes and strengths downhill. *end may be NULL.
gonio_status gonio_analytic_minimise(const gonio_analytic_problem *problem, gonio_analytic_point *point, int iterations,
                                     gonio_analytic_end *end, gonio_error *error);
// Multi-start: the best shapes for the data, into point (of `problem`, whose data are all samples).
gonio_status gonio_analytic_search(const gonio_analytic_problem *problem, gonio_analytic_point *point,
                                   gonio_analytic_end *end, int threads, gonio_error *error);

#endif
