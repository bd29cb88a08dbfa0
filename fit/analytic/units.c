// SPDX-License-Identifier: BSD-3-Clause
// Lobes of unit strength at the samples, the residuals and their sum.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/analytic/problem.h"

#define STRIDE (1 + GONIO_ANALYTIC_OWN_MAX)

double gonio_analytic_value_of(const gonio_analytic_variable *variable, double varied, double *slope) {
    switch (variable->vary) {
    case GONIO_VARY_LOG:
        *slope = exp(varied);
        // exp(log(x)) may miss a bound by its rounding.
        return fmin(fmax(*slope, variable->low), variable->high);
    case GONIO_VARY_SIGN:
        *slope = 0;
        return varied < 0 ? -1 : 1;
    case GONIO_VARY_FACTOR:
        return *slope = exp(varied);
    case GONIO_VARY_LINEAR:
        break;
    }
    *slope = 1;
    return varied;
}

void gonio_analytic_layout_init(gonio_analytic_layout *layout, const gonio_analytic_plan *plan, bool isotropic,
                                int lobes) {
    *layout = (gonio_analytic_layout){.plan = plan,
                                      .lobes = lobes,
                                      .variables = isotropic ? plan->isotropic : plan->anisotropic,
                                      .limit = plan->formula->absolute ? 1 : GONIO_STRENGTH_MAX};
    while (layout->variables[layout->own].name != NULL) {
        layout->own++;
    }
    layout->shapes = lobes * layout->own;
    for (int s = 0; s < layout->shapes; s++) {
        const gonio_analytic_variable *v = &layout->variables[s % layout->own];
        layout->low[s] = v->vary == GONIO_VARY_LOG ? log(v->low) : v->low;
        layout->high[s] = v->vary == GONIO_VARY_LOG ? log(v->high) : v->high;
    }
    for (int lobe = 0; lobe < lobes; lobe++) {
        for (int k = 0; k < plan->formula->n; k++) {
            if ((plan->formula->linear & GONIO_LINEAR(k)) != 0 && (lobe == 0 || k != plan->diffuse)) {
                layout->strength[layout->strengths].lobe = lobe;
                layout->strength[layout->strengths++].parameter = k;
            }
        }
    }
}

// The derivatives of a lobe's parameters by its shapes.
typedef struct chain {
    double slopes[GONIO_ANALYTIC_OWN_MAX][GONIO_FORMULA_PARAMETERS_MAX]; // first..last of each variable
} chain;

// A variable sets its parameters.
static void follow(const gonio_analytic_variable *v, double varied, double *p, double *slopes) {
    double slope;
    const double value = gonio_analytic_value_of(v, varied, &slope);
    for (int k = v->first; k <= v->last; k++) {
        const double before = v->vary == GONIO_VARY_FACTOR ? p[k] : 1;
        p[k] = before * value;
        slopes[k - v->first] = before * slope;
    }
}

static void parameters_of(const gonio_analytic_layout *layout, const double *shapes, int lobe, double *p, chain *c) {
    const gonio_formula *formula = layout->plan->formula;
    for (int k = 0; k < formula->n; k++) {
        const bool linear = (formula->linear & GONIO_LINEAR(k)) != 0;
        p[k] = linear || isnan(formula->parameters[k].initial) ? 0 : formula->parameters[k].initial;
    }
    for (int j = 0; j < layout->own; j++) {
        follow(&layout->variables[j], shapes[lobe * layout->own + j], p, c->slopes[j]);
    }
}

void gonio_analytic_parameters_of(const gonio_analytic_layout *layout, const double *shapes, int lobe, double *p) {
    chain unused;
    parameters_of(layout, shapes, lobe, p, &unused);
}

// The derivatives by the lobe's shapes, from those by the formula's parameters.
static void by_shapes(const gonio_analytic_layout *layout, const chain *c, const double *d, double *out) {
    for (int j = 0; j < layout->own; j++) {
        const gonio_analytic_variable *v = &layout->variables[j];
        out[j] = 0;
        for (int k = v->first; k <= v->last; k++) {
            out[j] += d[k] * c->slopes[j][k - v->first];
        }
    }
}

void gonio_analytic_units(const gonio_analytic_problem *problem, gonio_analytic_point *point) {
    const gonio_analytic_layout *layout = problem->layout;
    const gonio_formula *formula = layout->plan->formula;
    double p[GONIO_ANALYTIC_LOBES_MAX][GONIO_FORMULA_PARAMETERS_MAX], d[GONIO_FORMULA_PARAMETERS_MAX];
    chain c[GONIO_ANALYTIC_LOBES_MAX];
    for (int lobe = 0; lobe < layout->lobes; lobe++) {
        parameters_of(layout, point->shapes, lobe, p[lobe], &c[lobe]);
    }
    const gonio_lobe_geometry normal = gonio_lobe_geometry_of((gonio_vec3){0, 0, 1}, (gonio_vec3){0, 0, 1});
    for (size_t i = 0; i <= problem->data->n; i++) {
        const gonio_lobe_geometry *g = i < problem->data->n ? &problem->data->geometry[i] : &normal;
        double *offset = point->offsets != NULL ? point->offsets + i * STRIDE : NULL;
        if (offset != NULL) {
            offset[0] = formula->slope(g, p[0], d);
            by_shapes(layout, &c[0], d, offset + 1);
        }
        for (int k = 0; k < layout->strengths; k++) {
            double *unit = point->units + (i * (size_t)layout->strengths + (size_t)k) * STRIDE;
            const int lobe = layout->strength[k].lobe, at = layout->strength[k].parameter;
            p[lobe][at] = 1;
            formula->slope(g, p[lobe], d);
            p[lobe][at] = 0;
            unit[0] = d[at];
            by_shapes(layout, &c[lobe], d, unit + 1);
            for (int j = 0; offset != NULL && j < layout->own; j++) {
                unit[1 + j] -= offset[1 + j];
            }
        }
    }
}

double gonio_analytic_value_at(const gonio_analytic_problem *problem, const gonio_analytic_point *point, int channel,
                               size_t i, double *by_shape) {
    const gonio_analytic_layout *layout = problem->layout;
    const double *strengths = point->strengths + channel * layout->strengths;
    const double *unit = point->units + i * (size_t)layout->strengths * STRIDE;
    double f = point->offsets != NULL ? point->offsets[i * STRIDE] : 0;
    for (int j = 0; by_shape != NULL && j < layout->shapes; j++) {
        by_shape[j] = point->offsets != NULL ? point->offsets[i * STRIDE + 1 + (size_t)j] : 0;
    }
    for (int k = 0; k < layout->strengths; k++, unit += STRIDE) {
        f += strengths[k] * unit[0];
        for (int j = 0; by_shape != NULL && j < layout->own; j++) {
            by_shape[layout->strength[k].lobe * layout->own + j] += strengths[k] * unit[1 + j];
        }
    }
    return f;
}

// A logarithm's residual of 30 % counts in full, larger ones less and less: the soft L1 loss, so that samples which no
// lobe describes do not pull. Noise of 2 % is left as it is, to 5e-4 of it.
#define SOFT 0.3

static double soft(double d, double *slope) {
    const double q = d / SOFT, root = sqrt(1 + q * q);
    // sqrt(2 (root - 1)) without cancellation.
    const double r = copysign(sqrt(2 * q * q / (root + 1)), q);
    *slope *= q != 0 ? q / (root * r) : 1;
    return SOFT * r;
}

double gonio_analytic_residual(const gonio_analytic_data *data, int channel, size_t i, double f, double *slope) {
    const double y = data->y[(size_t)channel * data->n + i], eps = data->eps[channel], w = sqrt(data->weight[i]);
    switch (data->loss.loss) {
    case GONIO_LOSS_RELATIVE:
        *slope = w / (fabs(y) + eps);
        return *slope * (f - y);
    case GONIO_LOSS_LOG:
        if (data->loss.is_signed) {
            *slope = w / hypot(f, eps);
            return w * soft(asinh(f / eps) - asinh(y / eps), slope);
        }
        *slope = w / (f + eps);
        // ln((f + eps) / (y + eps)), with all its digits where f is near y.
        return w * soft(log1p((f - fmax(y, 0)) / (fmax(y, 0) + eps)), slope);
    case GONIO_LOSS_LINEAR:
    case GONIO_LOSS_AUTO:
        break;
    }
    *slope = w;
    return w * (f - y);
}

// A lobe between the samples may be of any height. From FREE times the highest sample on, its peak at normal incidence
// pays: as much as a residual of 30 % at one sample for 20 times more. Peaks that samples hold down pay nothing.
#define FREE 4.0

double gonio_analytic_price(const gonio_analytic_problem *problem, const gonio_analytic_point *point, int channel,
                            int strength, const double **unit) {
    const gonio_analytic_layout *layout = problem->layout;
    *unit = point->units + (problem->data->n * (size_t)layout->strengths + (size_t)strength) * STRIDE;
    if (problem->data->loss.loss != GONIO_LOSS_LOG || layout->strength[strength].parameter == layout->plan->diffuse) {
        return 0;
    }
    const double peak = point->strengths[channel * layout->strengths + strength] * (*unit)[0];
    return fmax(log(fmax(peak, 1e-300) / (FREE * problem->data->highest[channel])), 0) * GONIO_ANALYTIC_PRICE;
}

void gonio_analytic_cost(const gonio_analytic_problem *problem, gonio_analytic_point *point) {
    double sum = 0, slope;
    const double *unit;
    for (int c = 0; c < problem->data->channels; c++) {
        for (size_t i = 0; i < problem->data->n; i++) {
            const double r = gonio_analytic_residual(problem->data, c, i,
                                                     gonio_analytic_value_at(problem, point, c, i, NULL), &slope);
            sum += r * r / 2;
        }
        for (int k = 0; k < problem->layout->strengths; k++) {
            sum += gonio_square(gonio_analytic_price(problem, point, c, k, &unit)) / 2;
        }
    }
    point->cost = isfinite(sum) ? sum : INFINITY;
}

gonio_status gonio_analytic_point_init(gonio_analytic_point *point, const gonio_analytic_problem *problem,
                                       gonio_error *error) {
    const size_t n = problem->data->n + 1, k = (size_t)problem->layout->strengths;
    *point = (gonio_analytic_point){.strengths = calloc((size_t)problem->data->channels * k, sizeof(double)),
                                    .units = malloc(n * k * STRIDE * sizeof(double)),
                                    .cost = INFINITY};
    const bool absolute = problem->layout->plan->formula->absolute;
    point->offsets = absolute ? malloc(n * STRIDE * sizeof(double)) : NULL;
    if (point->strengths == NULL || point->units == NULL || (absolute && point->offsets == NULL)) {
        gonio_analytic_point_release(point);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to fit lobes to %zu samples", n - 1);
    }
    return GONIO_OK;
}

void gonio_analytic_point_release(gonio_analytic_point *point) {
    free(point->strengths);
    free(point->units);
    free(point->offsets);
    *point = (gonio_analytic_point){0};
}
