// SPDX-License-Identifier: BSD-3-Clause
// Cook & Torrance 1982, brdf/analytic/cook_torrance.c, with Schlick's Fresnel term. Ngan's form (spec:ngan) differs
// by a factor of the strength alone, 4 / pi.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_cook_torrance;

static const gonio_analytic_variable isotropic[] = {
    {"m", GONIO_VARY_LOG, 1e-3, 2, 2, 2, 0}, {"f0", GONIO_VARY_LINEAR, 0, 1, 3, 3, 0}, {0}};

static const gonio_analytic_plan plan = {
    .formula = &gonio_formula_cook_torrance, .isotropic = isotropic, .diffuse = 0, .lobes = 2, .lobes_max = 3};

GONIO_ANALYTIC_METHOD(cook_torrance, "cook-torrance", "microfacets with Beckmann's slopes, and a diffuse term",
                      gonio_analytic_lobe_options);
