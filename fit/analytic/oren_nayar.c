// SPDX-License-Identifier: BSD-3-Clause
// Oren & Nayar 1994, brdf/analytic/oren_nayar.c.
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_oren_nayar;

static const gonio_analytic_variable isotropic[] = {{"sigma", GONIO_VARY_LINEAR, 0, 1.5, 1, 1, 0}, {0}};

static const gonio_analytic_plan plan = {
    .formula = &gonio_formula_oren_nayar, .isotropic = isotropic, .diffuse = -1, .lobes = 1, .lobes_max = 1};

GONIO_ANALYTIC_METHOD(oren_nayar, "oren-nayar", "rough diffuse facets", gonio_analytic_options);
