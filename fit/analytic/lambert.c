// SPDX-License-Identifier: BSD-3-Clause
// Lambert 1760: one albedo, brdf/analytic/lambert.c.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_lambert;

static const gonio_analytic_variable isotropic[] = {{0}};

static const gonio_analytic_plan plan = {
    .formula = &gonio_formula_lambert, .isotropic = isotropic, .diffuse = -1, .lobes = 1, .lobes_max = 1};

GONIO_ANALYTIC_METHOD(lambert, "lambert", "a constant: perfectly diffuse", gonio_analytic_options);
