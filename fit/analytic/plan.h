// SPDX-License-Identifier: BSD-3-Clause
// What a fit of an analytic formula varies. A method is one file with its plan and its registration
// (GONIO_ANALYTIC_METHOD).
//
// The parameters that the formula is linear in are found by linear least squares; the plan names the others, the
// shapes, each with the range that is searched and the scale on which it is varied.
#ifndef GONIO_FIT_ANALYTIC_PLAN_H
#define GONIO_FIT_ANALYTIC_PLAN_H

#include "brdf/analytic/formula.h"
#include "fit/method.h"

typedef enum gonio_vary {
    GONIO_VARY_LOG,    // by its logarithm
    GONIO_VARY_LINEAR, // by itself
    GONIO_VARY_SIGN,   // -1 or 1, chosen with the start
    GONIO_VARY_FACTOR, // by its logarithm, whose range low and high are; what the variable before it set is multiplied
} gonio_vary;

typedef struct gonio_analytic_variable {
    const char *name; // in reports; NULL ends a list
    gonio_vary vary;
    double low, high; // of the value
    int first, last;  // parameters of the formula that have it
    int over;         // starts are spread and divided by the value of the variable of this number, from 1 on; 0: not
} gonio_analytic_variable;

typedef struct gonio_analytic_plan {
    const gonio_formula *formula;
    const gonio_analytic_variable *isotropic;
    const gonio_analytic_variable *anisotropic; // of materials that are not; NULL: the formula knows none
    int diffuse;                                // the parameter that further lobes go without; -1: one lobe only
    int lobes, lobes_max;                       // of the method, and at most
} gonio_analytic_plan;

#define GONIO_ANALYTIC_SHAPES_MAX 20   // five lobes of four
#define GONIO_ANALYTIC_STRENGTHS_MAX 6 // five lobes and the diffuse albedo

// The fit of a method with this plan; every such method has the options of gonio_analytic_options, those of several
// lobes gonio_analytic_lobe_options.
gonio_status gonio_analytic_fit(const gonio_analytic_plan *plan, const gonio_samples *samples,
                                const gonio_fit_options *options, gonio_model **out, gonio_fit_report *report,
                                gonio_error *error);
gonio_method_memory gonio_analytic_memory;
extern const gonio_method_option gonio_analytic_options[], gonio_analytic_lobe_options[];
extern const gonio_method_form gonio_analytic_form;

#define GONIO_ANALYTIC_METHOD(id, title, says, has)                                                                    \
    static gonio_status fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,         \
                            gonio_fit_report *report, gonio_error *error) {                                            \
        return gonio_analytic_fit(&plan, samples, options, out, report, error);                                        \
    }                                                                                                                  \
    const gonio_method gonio_method_##id = {.name = title,                                                             \
                                            .summary = says,                                                           \
                                            .kind = "analytic",                                                        \
                                            .options = has,                                                            \
                                            .fit = fit,                                                                \
                                            .memory = gonio_analytic_memory,                                           \
                                            .forms = &gonio_analytic_form,                                             \
                                            .forms_n = 1}

#endif
