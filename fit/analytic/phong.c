// SPDX-License-Identifier: BSD-3-Clause
// Phong 1975 (Kameya 2002, eq. 2.8), brdf/analytic/phong.c. Published exponents go to 68,000 (Ngan et al. 2005).
#include "fit/analytic/plan.h"

extern const gonio_formula gonio_formula_phong;

static const gonio_analytic_variable isotropic[] = {{"n", GONIO_VARY_LOG, 0.2, 2e5, 2, 2, 0}, {0}};

static const gonio_analytic_plan plan = {
    .formula = &gonio_formula_phong, .isotropic = isotropic, .diffuse = 0, .lobes = 1, .lobes_max = 3};

GONIO_ANALYTIC_METHOD(phong, "phong", "powers of the cosine about the mirror direction, and a diffuse term",
                      gonio_analytic_lobe_options);
