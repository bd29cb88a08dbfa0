// SPDX-License-Identifier: BSD-3-Clause
// Blinn 1977, brdf/analytic/blinn_phong.c. Published exponents lie between 10 and 104,000 (Ngan et al. 2005).
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_blinn_phong;

static const gonio_analytic_variable isotropic[] = {{"n", GONIO_VARY_LOG, 0.2, 5e5, 2, 2, 0}, {0}};

static const gonio_analytic_plan plan = {
    .formula = &gonio_formula_blinn_phong, .isotropic = isotropic, .diffuse = 0, .lobes = 1, .lobes_max = 3};

GONIO_ANALYTIC_METHOD(blinn_phong, "blinn-phong", "powers of the half vector's cosine, and a diffuse term",
                      gonio_analytic_lobe_options);
