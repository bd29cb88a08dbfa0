// SPDX-License-Identifier: BSD-3-Clause
// Schlick 1994, brdf/analytic/schlick.c; his isotropy factor for anisotropic samples.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_schlick;

static const gonio_analytic_variable isotropic[] = {
    {"r", GONIO_VARY_LOG, 1e-6, 1, 2, 2, 0}, {"f0", GONIO_VARY_LINEAR, 0, 1, 4, 4, 0}, {0}};
// The axes are those of the data.
static const gonio_analytic_variable anisotropic[] = {{"r", GONIO_VARY_LOG, 1e-6, 1, 2, 2, 0},
                                                      {"p", GONIO_VARY_LOG, 0.01, 100, 3, 3, 0},
                                                      {"f0", GONIO_VARY_LINEAR, 0, 1, 4, 4, 0},
                                                      {0}};

static const gonio_analytic_plan plan = {.formula = &gonio_formula_schlick,
                                         .isotropic = isotropic,
                                         .anisotropic = anisotropic,
                                         .diffuse = 0,
                                         .lobes = 1,
                                         .lobes_max = 3};

GONIO_ANALYTIC_METHOD(schlick, "schlick", "rational approximations of microfacets, and a diffuse term",
                      gonio_analytic_lobe_options);
